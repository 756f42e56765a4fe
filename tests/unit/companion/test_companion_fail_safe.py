"""What a companion says last, and leaves to the autopilot: where it is stopped, or can do nothing more."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import (
    HASTY,
    KINDS,
    LOITER,
    SET_MODE,
    Flight,
    assert_left_alone,
    heard_until,
    new_flight,
    without,
)
from tests.kit.wire import heartbeat, packed, parsed, spoken
from vfguide.companion.supervisor import Mode

DEAF_S = 12.0

RECIPE = {"FS_GCS_ENABL": 1.0, "FS_LONG_ACTN": 1.0, "FS_LONG_TIMEOUT": 5.0, "MAV_GCS_SYSID": 2.0}
"""As docs/on-an-aircraft.md has it, for the vehicle with system id 2."""


def set_up_flight() -> Flight:
    """Fly until something happens, with an autopilot that is set up by the recipe."""
    flown = new_flight()
    for name, value in RECIPE.items():
        setting = mavlink.MAVLink_param_set_message(
            2, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
        )
        flown.autopilot.receive(packed(setting))
    flown.run(DEAF_S)
    assert flown.autopilot_mode == "GUIDED"
    return flown


def texts(flown: Flight, since_s: float) -> list[str]:
    return [text for time_s, text in flown.texts() if time_s >= since_s]


def test_a_deaf_companion_lets_the_autopilots_fail_safe_take_over():
    flown = set_up_flight()
    flown.deaf = True
    # 10 s until it is to be handed back, 5 s for that, 5 s of the autopilot's own patience.
    flown.run(DEAF_S + 22.0)
    assert_left_alone(flown, "RTL", since_s=DEAF_S)
    said = texts(flown, DEAF_S)
    assert "no heartbeat heard, not steering; check the telemetry, or take over" in said[1]
    assert "this companion falls silent" in said[2]
    assert len(said) == 3
    # It speaks again once it hears again, and does not take the aircraft back.
    flown.deaf = False
    flown.run(DEAF_S + 40.0)
    assert flown.later("HEARTBEAT", DEAF_S + 24.0)
    assert_left_alone(flown, "RTL", since_s=DEAF_S)


def test_so_does_one_that_hears_positions_and_no_heartbeats():
    flown = set_up_flight()
    flown.edit = without("HEARTBEAT")
    flown.run(DEAF_S + 22.0)
    assert_left_alone(flown, "RTL", since_s=DEAF_S)


def test_a_pilot_who_has_taken_over_is_not_disturbed_by_a_companion_that_goes_deaf():
    flown = set_up_flight()
    flown.pilot("MANUAL", until_s=DEAF_S + 3.0)
    flown.deaf = True
    flown.run(DEAF_S + 40.0)
    assert flown.autopilot_mode == "MANUAL"


def test_guided_by_hand_without_a_leader_is_told_to_the_pilot():
    flown = new_flight(engage=False, link=heard_until(-1.0), until_s=5.0)
    flown.pilot("GUIDED", until_s=30.0)
    assert [text.split(": ", 1)[1] for text in texts(flown, 0.0)] == [
        "not steering, no position or no leader heard; watch it, or take over"
    ]


def test_refusals_that_nobody_asked_for_do_not_end_the_steering_of_a_px4():
    flown = new_flight(kind="px4", version=(1, 18), until_s=15.0)
    refusal = mavlink.MAVLink_command_ack_message(SET_MODE, mavlink.MAV_RESULT_DENIED)
    flown.forge = lambda now: spoken(refusal) if 15.2 < now < 15.5 else b""
    flown.run(30.0)
    assert flown.mode_at(30.0).steers


@pytest.mark.parametrize("leap_s", [1.1, 1.9])
def test_a_leap_of_the_boot_time_excuses_no_step_of_the_place(leap_s):
    flown = new_flight(until_s=20.0)

    def leaping(message: MAVLink_message, now: float) -> MAVLink_message:
        """Ahead in time and, at 20 m/s to the north, in place."""
        if message.get_type() == "GLOBAL_POSITION_INT" and now > 20.5:
            message.time_boot_ms += int(leap_s * 1e3)
            message.lat += int(leap_s * 20.0 / 111_320.0 * 1e7)
        return message

    flown.edit = leaping
    flown.run(30.0)
    north_m, _ = flown.place()
    # The leader is at 20 m/s times the time, f1's slot 20 m behind; 0.3 s of the leap are an ordinary link's.
    assert abs(20.0 * 30.0 - 20.0 - north_m) < 8.0


def test_guidance_that_fails_hands_the_aircraft_back_and_says_why(monkeypatch):
    flown = new_flight(until_s=DEAF_S)
    assert flown.autopilot_mode == "GUIDED"

    def fails(*_: object) -> None:
        raise ValueError("the path\nhas no course here")

    monkeypatch.setattr(flown.companion._vehicle.role, "step", fails)  # noqa: SLF001
    flown.run(DEAF_S + 14.0)
    assert flown.autopilot_mode == "LOITER"
    said = texts(flown, DEAF_S)
    assert "guidance fails (ValueError in test_companion_fail_safe.py" in said[0]
    assert "the path has no course here): take over; mend the law or the path" in said[0]
    assert sum("guidance fails" in text for text in said) == 1


def test_each_change_of_mode_is_told_to_ground_stations():
    flown = new_flight(link=heard_until(40.0, 50.0), patience=HASTY, until_s=52.0)
    flown.pilot("LOITER", until_s=54.0)
    assert [text for _, text in flown.texts()] == [
        f"vfguide f1: {text}"
        for text in (
            "steering to its place; leave GUIDED to take over",
            "in its place, nothing to do",
            "leader not heard, steering by its path; leave GUIDED to take over",
            "leader lost, flying away from the others; leave GUIDED to take over",
            "leader lost, handing back to the autopilot; select GUIDED once it is heard",
            "LOITER, not steering; select GUIDED to be steered",
        )
    ]
    changes = [time for time, text in flown.events if "->" in text]
    assert [time for time, _ in flown.texts()][:6] == changes


@pytest.mark.parametrize("kind", KINDS)
def test_stopping_hands_back_what_is_steered(kind):
    flown = new_flight(kind=kind, until_s=20.0)
    assert flown.companion.snapshot.mode.steers
    flown.sent.clear()
    out = flown.companion.stop(20.0)
    assert [event.text for event in out.events] == ["stopping: handing back"]
    assert (out.to_link, out.steered) == ([], False)
    assert not flown.companion.released
    flown.run(20.95)
    # The next heartbeat shows which mode would be left.
    assert flown.times(SET_MODE) == []
    flown.run(22.0)
    (data,) = [data for time, data in flown.sent if time == 21.0]
    (message,) = [one for one in parsed(data) if getattr(one, "command", 0) == SET_MODE]
    # MAV_CMD_DO_SET_MODE, custom mode enabled: LOITER, or main mode AUTO and sub mode LOITER.
    wanted = (1.0, 12.0, 0.0) if kind == "ardupilot" else (1.0, 4.0, 3.0)
    assert (message.param1, message.param2, message.param3) == wanted
    assert (message.target_system, message.get_srcSystem()) == (2, 2)
    assert flown.times(SET_MODE) == [21.0]
    assert flown.autopilot_mode == "LOITER"
    assert flown.companion.snapshot.mode is Mode.WAITING
    assert flown.companion.released


def test_stopping_while_breaking_away_hands_back():
    flown = new_flight(link=heard_until(20.0), patience={"prediction_s": 3.0}, until_s=25.0)
    assert flown.mode_at(25.0) is Mode.BREAKAWAY
    flown.companion.stop(25.0)
    flown.run(26.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("begins", ["waiting", "pilot", "lost"])
def test_stopping_says_nothing_where_nothing_is_steered_and_releases_at_once(begins):
    flown = new_flight(
        engage=begins != "waiting", link=heard_until(10.0), patience=HASTY, until_s=8.0
    )
    if begins == "pilot":
        flown.pilot("LOITER")
    flown.run(20.0)
    assert flown.companion.snapshot.mode.value == begins
    out = flown.companion.stop(20.05)
    assert (out.to_autopilot, out.events) == (b"", [])
    assert flown.companion.released


def test_last_words_are_said_three_times_and_no_more():
    flown = new_flight(until_s=20.0)
    flown.lose = frozenset({SET_MODE})
    flown.companion.stop(20.0)
    flown.run(26.0)
    assert flown.later(SET_MODE, 20.0) == [21.0, 22.0, 23.0]
    assert not flown.companion.released


@pytest.mark.parametrize("mode", ["RTL", "MANUAL"])
def test_last_words_are_not_said_into_the_pilots_mode(mode):
    flown = new_flight(until_s=20.4)
    # Its heartbeat is lost, and the companion is stopped: SIGTERM a moment after the pilot's hand.
    flown.pilot(mode)
    flown.waiting = b""
    flown.companion.stop(20.4)
    flown.run(30.0)
    assert_left_alone(flown, mode, since_s=20.0)
    assert flown.companion.released


@pytest.mark.parametrize("mode", ["RTL", "MANUAL"])
@pytest.mark.parametrize("every_steps", [1, 3, 10])
def test_forged_heartbeats_and_a_stop_do_not_undo_the_pilot(mode, every_steps):
    flown = new_flight(until_s=20.0)
    flown.pilot(mode, until_s=22.0)
    flown.forge = lambda now: b"" if round(now * 20) % every_steps else spoken(heartbeat())
    flown.run(25.0)
    flown.companion.stop(25.0)
    flown.run(32.0)
    assert_left_alone(flown, mode, since_s=20.0)


@pytest.mark.parametrize("stops", [False, True])
def test_forged_heartbeats_are_not_believed_by_a_companion_that_hears_nothing_else(stops):
    flown = new_flight(link=heard_until(20.0), patience=HASTY, until_s=20.0)
    flown.deaf = True
    flown.run(20.5)
    flown.pilot("RTL")
    flown.forge = lambda _now: spoken(heartbeat())
    flown.run(28.0)
    if stops:
        flown.companion.stop(28.0)
    flown.run(40.0)
    assert_left_alone(flown, "RTL", since_s=20.0)


@pytest.mark.parametrize("target", [(0, 0), (255, 190), (2, 191)])
def test_an_answer_alone_releases_nothing(target):
    flown = new_flight(until_s=20.0)
    flown.companion.stop(20.0)
    # MAV_CMD_DO_SET_MODE, accepted: of anybody's command, and heartbeats still show GUIDED.
    answer = mavlink.MAVLink_command_ack_message(SET_MODE, 0, 0, 0, *target)
    flown.companion.receive_mavlink(spoken(answer), 20.1)
    assert not flown.companion.released
    out = flown.companion.receive_mavlink(spoken(heartbeat(LOITER)), 20.2)
    assert flown.companion.released
    assert out.to_link == []
