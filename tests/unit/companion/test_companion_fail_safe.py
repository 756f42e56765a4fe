"""What is left to the autopilot and its pilot: where a companion is stopped, hears late, or no leader."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import (
    HASTY,
    HEADING,
    KINDS,
    LOITER,
    MESSAGE_INTERVAL,
    SET_MODE,
    SPEED,
    Flight,
    assert_left_alone,
    heard_from,
    heard_until,
    leader_bytes,
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
    # 10 s until it is to be handed back, 5 s for that, 5 s of the autopilot's own patience.
    flown.run(DEAF_S + 22.0, deaf=True)
    assert_left_alone(flown, "RTL", since_s=DEAF_S)
    assert flown.later(HEADING, DEAF_S + 0.1) == []
    _, unsteered, silent = texts(flown, DEAF_S)
    assert "no heartbeat heard, not steering; check the telemetry, or take over" in unsteered
    assert "this companion falls silent" in silent
    # It speaks again once it hears again, and does not take the aircraft back.
    flown.run(DEAF_S + 40.0, deaf=False)
    assert flown.later("HEARTBEAT", DEAF_S + 24.0)
    assert_left_alone(flown, "RTL", since_s=DEAF_S)


def test_so_does_one_that_hears_positions_and_no_heartbeats():
    flown = set_up_flight()
    flown.run(DEAF_S + 22.0, edit=without("HEARTBEAT"))
    assert_left_alone(flown, "RTL", since_s=DEAF_S)


def test_a_pilot_who_has_taken_over_is_not_disturbed_by_a_companion_that_goes_deaf():
    flown = set_up_flight()
    flown.pilot("MANUAL", until_s=DEAF_S + 3.0)
    flown.run(DEAF_S + 40.0, deaf=True)
    assert flown.autopilot_mode == "MANUAL"


def test_a_pilot_who_takes_over_from_a_deaf_companion_keeps_the_vehicle():
    flown = new_flight(until_s=10.0)
    flown.run(11.0, deaf=True)
    flown.pilot("RTL", until_s=40.0)
    assert_left_alone(flown, "RTL", since_s=10.0)
    assert flown.later(HEADING, 10.1) == []


def test_refusals_that_nobody_asked_for_do_not_end_the_steering_of_a_px4():
    flown = new_flight(kind="px4", version=(1, 18), until_s=15.0)
    refusal = mavlink.MAVLink_command_ack_message(SET_MODE, mavlink.MAV_RESULT_DENIED)
    flown.run(30.0, forge=lambda now: spoken(refusal) if 15.2 < now < 15.5 else b"")
    assert flown.mode.steers


@pytest.mark.parametrize("leap_s", [1.1, 1.9])
def test_a_leap_of_the_boot_time_excuses_no_step_of_the_place(leap_s):
    flown = new_flight(until_s=20.0)

    def leaping(message: MAVLink_message, now: float) -> MAVLink_message:
        """Ahead in time and, at 20 m/s to the north, in place."""
        if message.get_type() == "GLOBAL_POSITION_INT" and now > 20.5:
            message.time_boot_ms += int(leap_s * 1e3)
            message.lat += int(leap_s * 20.0 / 111_320.0 * 1e7)
        return message

    flown.run(30.0, edit=leaping)
    north_m, _ = flown.place()
    # The leader is at 20 m/s times the time, f1's slot 20 m behind; 0.3 s of the leap are an ordinary link's.
    assert abs(20.0 * 30.0 - 20.0 - north_m) < 8.0


def elsewhere(message: MAVLink_message, now: float) -> MAVLink_message:
    """Lie about the place, by 3 km and by more each second."""
    if message.get_type() == "GLOBAL_POSITION_INT" and now > DEAF_S:
        message.lat += int(3e5 + 1e5 * (now - DEAF_S))
    return message


@pytest.mark.parametrize("edit", [None, elsewhere], ids=["alone", "positions not believed"])
def test_guidance_that_fails_hands_the_aircraft_back_and_says_why(monkeypatch, edit):
    flown = new_flight(until_s=DEAF_S)
    assert flown.autopilot_mode == "GUIDED"

    def fails(*_: object) -> None:
        raise ValueError("the path\nhas no course here")

    monkeypatch.setattr(flown.companion._vehicle.role, "step", fails)  # noqa: SLF001
    flown.run(DEAF_S + 14.0, edit=edit)
    assert flown.autopilot_mode == "LOITER"
    (said,) = [text for text in texts(flown, DEAF_S) if "guidance fails" in text]
    assert "guidance fails (ValueError in test_companion_fail_safe.py" in said
    assert "the path has no course here): take over; mend the law or the path" in said


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
    assert flown.mode.steers
    flown.sent.clear()
    out = flown.companion.stop(20.0)
    assert [event.text for event in out.events] == ["stopping: handing back"]
    assert (out.to_link, out.steered, flown.companion.released) == ([], False, False)
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
    assert flown.state == (Mode.WAITING, "LOITER")
    assert flown.companion.released


def test_stopping_while_breaking_away_hands_back():
    flown = new_flight(link=heard_until(20.0), patience={"prediction_s": 3.0}, until_s=25.0)
    assert flown.mode is Mode.BREAKAWAY
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
    flown.companion.stop(20.0)
    flown.run(26.0, lose=frozenset({SET_MODE}))
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
    flown.run(20.5, deaf=True)
    flown.pilot("RTL")
    flown.run(28.0, forge=lambda _now: spoken(heartbeat()))
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


def lost_at_25(**options: object) -> Flight:
    """Make a flight whose leader falls silent at 25 s."""
    return new_flight(link=heard_until(25.0), patience=HASTY, **options)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", ["RTL", "MANUAL"])
@pytest.mark.parametrize("before_s", [0.1, 0.8, 1.8, 2.8])
def test_a_mode_selected_while_telemetry_is_late_is_not_engaged_over(kind, mode, before_s):
    flown = new_flight(kind=kind, link=heard_from(10.0), late_s=3.0, until_s=10.0 - before_s)
    flown.pilot(mode)
    flown.run(20.0)
    assert_left_alone(flown, mode)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("late_s", "before_s"), [(1.5, 0.1), (1.5, 0.9), (2.2, 0.5), (3.0, 0.5)])
def test_a_companion_that_stops_does_not_undo_a_mode_that_it_has_not_heard_of(
    kind, late_s, before_s
):
    flown = new_flight(kind=kind, until_s=20.0)
    flown.run(29.2, late_s=late_s)
    flown.pilot("RTL", until_s=29.2 + before_s)
    flown.companion.stop(flown.now)
    flown.run(40.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.companion.released


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("after_s", [5.2, 5.6, 6.0, 6.4, 6.8])
def test_a_lost_leader_does_not_undo_a_mode_that_was_not_heard_of(kind, after_s):
    flown = lost_at_25(kind=kind, until_s=20.0)
    flown.run(25.0 + after_s, late_s=3.0)
    flown.pilot("RTL", until_s=50.0)
    assert flown.later(SET_MODE, 20.0) == []


def test_the_pilot_hears_that_late_telemetry_keeps_the_companion_from_handing_back():
    flown = lost_at_25(until_s=20.0)
    flown.run(50.0, late_s=3.0)
    assert flown.autopilot_mode == "GUIDED"
    (late,) = [text for text in texts(flown, 0.0) if "telemetry comes late" in text]
    assert late == (
        "vfguide f1: telemetry comes late: the autopilot's mode is not changed by this companion;"
        " check the radio, or select a mode by hand"
    )
    # In time again, it is handed back.
    flown.run(60.0, late_s=0.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize(("late_s", "edit"), [(0.2, None), (0.5, None), (0.0, without("TIMESYNC"))])
def test_an_ordinary_radio_is_quick_enough_and_an_autopilot_without_a_time_flown_too(late_s, edit):
    flown = lost_at_25(late_s=late_s, edit=edit, until_s=20.0)
    assert flown.autopilot_mode == "GUIDED"
    flown.run(40.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("forged", [False, True])
def test_answers_that_stay_away_end_the_right_to_command_modes_and_others_date_nothing(forged):
    flown = lost_at_25(until_s=20.0)
    if forged:
        # Answers to questions that nobody asked.
        flown.forge = lambda now: spoken(
            mavlink.MAVLink_timesync_message(round(now * 1e9), round(now * 1e9) + 1)
        )
    flown.run(40.0, edit=without("TIMESYNC"))
    assert_left_alone(flown, "GUIDED", since_s=20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_what_waited_while_the_companion_stood_still_for_a_moment_shows_no_mode(kind):
    flown = new_flight(kind=kind, until_s=0.6)
    flown.hang(1.05)
    flown.pilot("MANUAL")
    flown.hang(1.7)
    flown.run(10.0)
    assert_left_alone(flown, "MANUAL")


def by_hand(flown: Flight) -> None:
    """Flying by hand for a moment."""
    flown.pilot("MANUAL")
    flown.pilot("LOITER")


def deaf(flown: Flight, until_s: float) -> None:
    """Nothing is heard for a while in which the pilot flies."""
    flown.run((flown.now + until_s) / 2.0, deaf=True)
    by_hand(flown)
    flown.run(until_s)
    flown.deaf = False


def hung(flown: Flight, until_s: float) -> None:
    """The companion stands still for a while in which the pilot flies."""
    flown.hang((flown.now + until_s) / 2.0)
    by_hand(flown)
    flown.hang(until_s)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_request_that_nobody_has_answered_is_forgotten_by_one_that_did_not_watch(kind, away):
    flown = new_flight(kind=kind, lose=frozenset({SET_MODE}), until_s=5.5)
    assert flown.times(SET_MODE)
    away(flown, 20.0)
    flown.run(50.0, lose=frozenset())
    assert_left_alone(flown, "LOITER", since_s=20.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_vehicle_that_waits_for_its_leader_is_not_engaged_after_it_was_not_watched(kind, away):
    flown = new_flight(kind=kind, link=heard_from(20.0), until_s=4.0)
    away(flown, 14.0)
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    (reason,) = [text for text in texts(flown, 0.0) if "heartbeats were not heard" in text]
    assert reason.endswith("to be steered")


def off(message: MAVLink_message, now: float) -> MAVLink_message | None:
    """Positions 5 km off between 4 and 15 s."""
    if message.get_type() == "GLOBAL_POSITION_INT" and 4.0 < now <= 15.0:
        message.lat += 500_000
    return message


def lost(message: MAVLink_message, now: float) -> MAVLink_message | None:
    """No positions between 4 and 15 s."""
    return None if message.get_type() == "GLOBAL_POSITION_INT" and 4.0 < now <= 15.0 else message


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("edit", [off, lost])
def test_flying_by_hand_without_positions_spends_the_right_to_engage(kind, edit):
    flown = new_flight(kind=kind, link=heard_from(18.0), edit=edit, until_s=8.0)
    flown.pilot("MANUAL", until_s=12.0)
    flown.pilot("LOITER", until_s=40.0)
    assert_left_alone(flown, "LOITER")


@pytest.mark.parametrize("kind", KINDS)
def test_one_lost_heartbeat_hides_no_flight(kind):
    flown = new_flight(kind=kind, link=heard_from(10.0), until_s=5.5)
    flown.run(6.5, deaf=True)
    flown.run(20.0, deaf=False)
    assert len(flown.times(SET_MODE)) == 1


PATIENCE = {"prediction_s": 5.0, "breakaway_s": 3.0}
"""The leader is lost 8 s after it was heard last; 5 s where patience is `HASTY`."""


@pytest.mark.parametrize(
    ("patience", "left_s", "lost_s"), [(PATIENCE, 45.0, 48.0), ({}, 70.0, 95.0)]
)
def test_a_silent_leader_is_predicted_in_the_slot_then_left_and_then_lost(patience, left_s, lost_s):
    flown = new_flight(link=heard_until(40.0), patience=patience, until_s=left_s)
    assert [flown.mode_at(time_s) for time_s in (40.55, 40.65)] == [Mode.TRACKING, Mode.PREDICTING]
    # The leader would be 20 m/s times the time north, and the slot 20 m behind and 20 m left of it.
    assert flown.place() == pytest.approx((20.0 * left_s - 20.0, -20.0), abs=1.0)
    assert flown.times(HEADING)[-1] > left_s - 0.5
    flown.run(lost_s + 1.0)
    edges = [flown.mode_at(time_s) for time_s in (left_s, left_s + 0.1, lost_s, lost_s + 0.1)]
    assert edges == [Mode.PREDICTING, Mode.BREAKAWAY, Mode.BREAKAWAY, Mode.LOST]
    changes = flown.told("->", from_s=40.0)
    assert changes == ["tracking -> predicting", "predicting -> breakaway", "breakaway -> lost"]


def test_a_gap_in_telemetry_does_not_bend_the_way_of_a_silent_leader():
    flown = new_flight(link=heard_until(39.95), until_s=39.95)
    # Its last words are of a moment in which it turned.
    flown.companion.receive_link(leader_bytes(40.0, turn_rate=0.2), 40.0)
    flown.run(50.0)
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.run(52.0, lose=frozenset({MESSAGE_INTERVAL}))
    assert flown.mode is Mode.WAITING
    flown.run(65.0, lose=frozenset())
    assert flown.mode is Mode.PREDICTING
    # A leader that went on turning would by now be going round in circles of 100 m.
    assert flown.place() == pytest.approx((1280.0, -20.0), abs=5.0)


def test_breaking_away_it_turns_to_the_side_of_its_slot():
    patience = {"prediction_s": 2.0, "breakaway_s": 20.0}
    flown = new_flight(link=heard_until(30.0), patience=patience, until_s=50.0)
    assert flown.mode is Mode.BREAKAWAY
    truth = flown.autopilot.truth()
    course = math.degrees(math.remainder(truth.course_rad, math.tau))
    assert course == pytest.approx(-60.0, abs=0.6)
    assert truth.airspeed_m_s == pytest.approx(20.0, abs=0.1)
    assert min(flown.times(HEADING)[-1], flown.times(SPEED)[-1]) > 49.5


@pytest.mark.parametrize("kind", KINDS)
def test_a_vehicle_whose_leader_is_lost_goes_back_to_its_autopilot(kind):
    flown = new_flight(kind=kind, link=heard_until(20.0), patience=PATIENCE, until_s=28.95)
    assert flown.autopilot_mode == "GUIDED"
    flown.run(29.0)
    assert flown.autopilot_mode == "LOITER"
    flown.run(60.0)
    assert flown.state == (Mode.LOST, "LOITER")
    for command in (HEADING, SPEED if kind == "ardupilot" else 178):
        assert 27.5 < flown.times(command)[-1] <= 28.0


def test_handing_back_is_commanded_three_times_on_heartbeats_that_show_guided():
    flown = new_flight(link=heard_until(20.0), patience=PATIENCE, until_s=28.0)
    flown.run(40.0, lose=frozenset({SET_MODE}))
    assert flown.mode is Mode.LOST
    assert flown.later(SET_MODE, 20.0) == [29.0, 30.0, 31.0]
    assert flown.told("take it by hand") == [
        "the autopilot stays in GUIDED although it was handed back 3 times: take it by hand"
    ]


def test_a_pilot_who_selects_guided_without_a_leader_keeps_it_unsteered():
    flown = new_flight(link=heard_until(20.0), patience=PATIENCE, until_s=30.0)
    flown.pilot("GUIDED", until_s=34.0)
    assert flown.autopilot_mode == "GUIDED"
    assert any("stays in GUIDED, unsteered" in text for _, text in flown.texts())
    assert 27.5 < flown.times(HEADING)[-1] <= 28.0


@pytest.mark.parametrize(
    ("back_s", "patience", "before", "then"),
    [
        (60.0, {}, Mode.PREDICTING, {Mode.TRACKING}),
        (47.0, PATIENCE, Mode.BREAKAWAY, {Mode.JOINING, Mode.TRACKING}),
    ],
)
def test_a_leader_that_is_back_in_time_or_during_the_breakaway_is_followed_again(
    back_s, patience, before, then
):
    flown = new_flight(link=heard_until(40.0, back_s), patience=patience, until_s=80.0)
    assert flown.mode_at(back_s - 0.05) is before
    assert flown.mode_at(back_s) in then
    assert flown.state == (Mode.TRACKING, "GUIDED")
    assert len(flown.times(SET_MODE)) == 1


@pytest.mark.parametrize(("silent_s", "taken_s"), [(20.0, 22.0), (5.0, 20.0)])
def test_the_pilot_wins_over_a_silent_leader_and_flies_what_was_handed_back(silent_s, taken_s):
    flown = new_flight(link=heard_until(silent_s), patience=PATIENCE, until_s=taken_s)
    assert flown.autopilot_mode == ("GUIDED" if silent_s == 20.0 else "LOITER")
    flown.pilot("MANUAL", until_s=40.0)
    assert flown.mode is Mode.PILOT
    assert_left_alone(flown, "MANUAL", since_s=20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_handed_back_is_the_pilots_to_give_again(kind):
    # Engaging by itself happens once in a flight: nobody tells a hand-back from a pilot's LOITER for sure.
    flown = new_flight(kind=kind, link=heard_until(20.0, 30.5), patience=HASTY, until_s=30.45)
    assert flown.mode is Mode.LOST
    loiter = flown.autopilot_mode
    flown.run(50.0)
    assert flown.mode_at(30.55) is Mode.WAITING
    assert_left_alone(flown, loiter, since_s=26.5)
    assert flown.texts()[-1][1].endswith("steered")
    flown.pilot("GUIDED", until_s=55.0)
    assert flown.mode.steers


@pytest.mark.parametrize(
    ("back_s", "selected", "last"),
    [
        (30.0, {27.0: "MANUAL"}, Mode.PILOT),
        (30.0, {27.0: "RTL"}, Mode.PILOT),
        # And back into the loiter before the leader is heard.
        (30.0, {27.0: "MANUAL", 28.0: "LOITER"}, Mode.PILOT),
        # Just when the leader is back.
        (30.1, {30.3: "MANUAL"}, Mode.PILOT),
        # The pilot may bring GUIDED back.
        (30.0, {27.0: "MANUAL", 40.0: "GUIDED"}, Mode.TRACKING),
    ],
)
def test_a_pilot_who_took_over_meanwhile_is_not_overruled(back_s, selected, last):
    taken_s = min(selected)
    flown = new_flight(link=heard_until(20.0, back_s), patience=HASTY, until_s=taken_s)
    assert flown.state == (Mode.LOST if taken_s < back_s else Mode.WAITING, "LOITER")
    for time_s, mode in selected.items():
        flown.run(time_s)
        flown.pilot(mode)
    flown.run(70.0)
    assert flown.mode is last
    assert_left_alone(flown, [*selected.values()][-1], since_s=26.0)


def test_what_the_operator_did_not_allow_is_not_engaged_again():
    flown = new_flight(engage=False, link=heard_until(20.0, 30.0), patience=HASTY, until_s=2.0)
    flown.pilot("GUIDED", until_s=29.0)
    assert flown.state == (Mode.LOST, "LOITER")
    flown.run(60.0)
    assert flown.mode is Mode.WAITING
    assert_left_alone(flown, "LOITER", since_s=26.0)


def test_words_that_are_old_when_they_arrive_do_not_end_the_loss():
    flown = new_flight(link=heard_until(20.0), patience=HASTY, until_s=29.95)
    flown.run(60.0, link=lambda now: [leader_bytes(now - 6.0)])
    assert flown.state == (Mode.LOST, "LOITER")
