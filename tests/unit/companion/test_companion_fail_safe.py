"""A companion that can do nothing any more leaves the aircraft to its autopilot's fail-safe, and says so."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import SET_MODE, Flight, heard_until, new_flight, without
from tests.kit.wire import packed, spoken

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
    assert flown.autopilot_mode == "RTL"
    assert flown.later(SET_MODE, DEAF_S) == []
    said = texts(flown, DEAF_S)
    assert "no heartbeat heard, not steering; check the telemetry, or take over" in said[1]
    assert "this companion falls silent" in said[2]
    assert len(said) == 3
    # It speaks again once it hears again, and does not take the aircraft back.
    flown.deaf = False
    flown.run(DEAF_S + 40.0)
    assert flown.later("HEARTBEAT", DEAF_S + 24.0)
    assert flown.autopilot_mode == "RTL"
    assert flown.later(SET_MODE, DEAF_S) == []


def test_so_does_one_that_hears_positions_and_no_heartbeats():
    flown = set_up_flight()
    flown.edit = without("HEARTBEAT")
    flown.run(DEAF_S + 22.0)
    assert flown.autopilot_mode == "RTL"
    assert flown.later(SET_MODE, DEAF_S) == []


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
