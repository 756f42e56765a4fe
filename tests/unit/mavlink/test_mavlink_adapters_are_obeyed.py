"""What adapters say, and that autopilots obey it."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from sitl_stub import PlantParameters
from tests.kit.autopilot import GroundStation, address, asked, new_station
from vfguide.mavlink.adapter import DetectedAutopilot, SetpointStream
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.reports import VersionReport


def test_arduplane_flies_the_course_airspeed_and_altitude_in_guided_and_goes_back_to_loiter():
    plane, aircraft = ArduPlane(address(component_id=1)), new_station()
    assert aircraft.truth.mode == "LOITER"
    assert aircraft.obey(plane.engage()) == [(176, "ACCEPTED")]
    answers = aircraft.obey(plane.fly(asked(-1.0, 24.0)))
    assert answers == [(43_002, "ACCEPTED"), (43_000, "ACCEPTED")]
    assert aircraft.obey(plane.hold_altitude(520.0)) == [(43_001, "ACCEPTED")]
    stream(aircraft, lambda: plane.fly(asked(-1.0, 24.0)), 30.0)
    assert_flown(aircraft, "GUIDED")
    assert aircraft.obey(plane.hand_back()) == [(176, "ACCEPTED")]
    assert aircraft.truth.mode == "LOITER"


def stream(aircraft: GroundStation, messages: Callable[[], list[Any]], duration_s: float) -> None:
    """Repeat messages at 10 Hz while the aircraft flies on."""
    for tenth in range(round(duration_s * 10)):
        aircraft.obey(messages())
        aircraft.advance(0.1 * (tenth + 1))


def assert_flown(aircraft: GroundStation, mode: str) -> None:
    """A course of -1 rad at 24 m/s, 520 m above the sea."""
    truth = aircraft.truth
    assert truth.mode == mode
    assert math.remainder(truth.course_rad + 1.0, math.tau) == pytest.approx(0.0, abs=1e-3)
    assert truth.airspeed_m_s == pytest.approx(24.0, abs=1e-3)
    assert truth.altitude_amsl_m == pytest.approx(520.0, abs=0.1)


def test_arduplane_takes_a_ground_speed_where_the_vehicle_holds_one():
    plane = ArduPlane(address("course-hold", component_id=1))
    aircraft = new_station(plant=PlantParameters(kind="course-hold"))
    aircraft.obey(plane.engage())
    answers = aircraft.obey(plane.fly(asked(1.0, 24.0)))
    assert answers == [(43_002, "ACCEPTED"), (43_000, "ACCEPTED")]


@pytest.mark.parametrize(
    ("steering", "version"),
    [("position", (1, 15)), ("position", (1, 17)), ("position", (1, 18)), ("velocity", (1, 14))],
)
def test_px4_enters_offboard_once_setpoints_arrive_and_flies_the_course_and_airspeed(
    steering, version
):
    plane = Px4(address(component_id=1, px4_steering=steering))
    aircraft = new_station(autopilot="px4", version=version)

    def setpoint() -> list[Any]:
        where = aircraft.truth
        return plane.fly(
            replace(
                asked(2.5, 24.0), latitude_deg=where.latitude_deg, longitude_deg=where.longitude_deg
            )
        )

    assert aircraft.obey(plane.engage()) == [(176, "TEMPORARILY_REJECTED")]
    assert aircraft.obey(setpoint()) == [(178, "ACCEPTED")]
    assert aircraft.obey(plane.engage()) == [(176, "ACCEPTED")]
    stream(aircraft, setpoint, 60.0)
    truth = aircraft.truth
    assert truth.mode == "OFFBOARD"
    assert (truth.course_rad, truth.airspeed_m_s) == pytest.approx((2.5, 24.0), abs=1e-3)
    held_m = 588.0 if plane.holds_altitude else 500.0
    assert truth.altitude_amsl_m == pytest.approx(held_m, abs=0.1)
    assert dict(aircraft.autopilot.counters) == {}
    assert aircraft.obey(plane.hand_back()) == [(176, "ACCEPTED")]
    assert aircraft.truth.mode == "AUTO.LOITER"


def test_px4_in_guided_course_flies_course_airspeed_and_altitude():
    plane, aircraft = Px4(address(component_id=1)), new_station(autopilot="px4")
    assert aircraft.obey(plane.engage()) == [(176, "ACCEPTED")]
    assert aircraft.obey(plane.fly(asked(-1.0, 24.0))) == [(43_002, "ACCEPTED"), (178, "ACCEPTED")]
    assert aircraft.obey(plane.hold_altitude(520.0)) == [(186, "ACCEPTED")]
    stream(aircraft, list, 60.0)
    assert_flown(aircraft, "AUTO.COURSE")
    assert aircraft.obey(plane.hand_back()) == [(176, "ACCEPTED")]
    assert aircraft.truth.mode == "AUTO.LOITER"


def test_what_steers_1_14_steers_no_later_px4():
    plane = Px4(address(component_id=1, px4_steering="velocity"))
    aircraft = new_station(autopilot="px4")
    aircraft.obey(plane.fly(asked(2.5, 24.0)))
    aircraft.obey(plane.engage())
    before = aircraft.truth.course_rad
    stream(aircraft, lambda: plane.fly(asked(2.5, 24.0)), 30.0)
    assert aircraft.truth.course_rad == pytest.approx(before, abs=1e-3)


@pytest.mark.parametrize(("kind", "adapter"), [("ardupilot", ArduPlane), ("px4", Px4)])
def test_telemetry_is_granted(kind, adapter):
    aircraft = new_station(autopilot=kind)
    requests = adapter(address(component_id=1)).request_telemetry(20.0)
    assert aircraft.obey(requests) == [(511, "ACCEPTED")] * len(requests)
    assert len(requests) == 6


@pytest.mark.parametrize(("kind", "adapter"), [("ardupilot", ArduPlane), ("px4", Px4)])
def test_a_message_for_another_component_is_not_obeyed(kind, adapter):
    aircraft = new_station(autopilot=kind)
    assert aircraft.obey(adapter(address(component_id=3)).hand_back()) == []
    assert aircraft.autopilot.counters["for another"] == 1


HEADING, SPEED = 43_002, 43_000


def commands(messages: list[Any]) -> list[int]:
    return [getattr(message, "command", 0) for message in messages]


def test_arduplane_hears_all_at_first_and_after_a_reset_and_else_what_has_changed_alone():
    plane = ArduPlane(address())
    stream = SetpointStream(plane)

    def due(course: float, speed: float, now: float) -> list[int]:
        return commands(stream.due(plane.fly(asked(course, speed)), now))

    assert due(1.0, 20.0, 0.0) == [HEADING, SPEED]
    assert due(1.0, 20.02, 0.1) == [SPEED]
    assert due(1.001, 20.02, 0.2) == [HEADING]
    assert due(1.001, 20.02, 0.3) == []
    # Less than a centimetre a second is no change.
    assert due(1.001, 20.024, 0.4) == []
    stream.reset()
    assert due(1.001, 20.02, 0.41) == [HEADING, SPEED]


def test_px4_hears_the_speed_after_each_course_since_the_course_cancels_it():
    plane = Px4(address(px4_steering="position"))
    stream = SetpointStream(plane)
    stream.due(plane.fly(asked(1.0, 20.0)), 0.0)
    assert commands(stream.due(plane.fly(asked(1.01, 20.0)), 0.05)) == [0, 178]


@pytest.mark.parametrize(
    ("kind", "steering", "keep_alive_s"),
    [
        (ArduPlane, "auto", 0.5),
        (Px4, "guided-course", 0.5),
        (Px4, "position", 0.2),
        (Px4, "velocity", 0.2),
    ],
)
def test_what_has_not_changed_is_repeated_at_the_keep_alive_rate(kind, steering, keep_alive_s):
    plane = kind(address(px4_steering=steering))
    stream = SetpointStream(plane)
    stream.due(plane.fly(asked(1.0, 20.0)), 0.0)
    assert stream.due(plane.fly(asked(1.0, 20.0)), keep_alive_s - 0.01) == []
    assert len(stream.due(plane.fly(asked(1.0, 20.0)), keep_alive_s)) == 2


@given(steps=st.lists(st.floats(0.001, 0.4), min_size=1, max_size=50))
def test_px4_never_waits_longer_than_offboard_bears(steps):
    plane = Px4(address(px4_steering="position"))
    stream = SetpointStream(plane)
    now = sent = 0.0
    stream.due(plane.fly(asked(1.0, 20.0)), now)
    for step in steps:
        now += step
        if stream.due(plane.fly(asked(1.0, 20.0)), now):
            # The report after the keep-alive time brings it: a fifth of a second, and one step more.
            assert now - sent <= 0.2 + step + 1e-9
            sent = now


ARDUPILOT, PX4, PAPARAZZI = 3, 12, 9
GUIDED, OFFBOARD = 15, 6 << 16


def test_an_autopilot_that_was_not_heard_is_told_nothing():
    adapter = DetectedAutopilot(address())
    assert not adapter.is_ready
    assert adapter.questions() == []
    assert adapter.engage() == adapter.hand_back() == adapter.hold_altitude(500.0) == []
    assert adapter.fly(asked(1.0, 20.0)) == adapter.stay_ready(asked(1.0, 20.0)) == []
    assert not adapter.is_engaged(GUIDED)
    assert not adapter.is_handed_back(12)


@pytest.mark.parametrize(("number", "kind"), [(ARDUPILOT, ArduPlane), (PX4, Px4)])
def test_the_heartbeat_tells_how_to_speak(number, kind):
    adapter, known = DetectedAutopilot(address()), kind(address())
    assert adapter.recognise(number) is None
    for act, *arguments in (("engage",), ("hand_back",), ("fly", asked(1.0, 20.0))):
        found, expected = getattr(adapter, act)(*arguments), getattr(known, act)(*arguments)
        assert [str(one) for one in found] == [str(one) for one in expected]
    for mode in (GUIDED, OFFBOARD):
        assert adapter.is_engaged(mode) is known.is_engaged(mode)
    assert adapter.is_ready
    same = ("counts_ground_stations", "is_ready", "keep_alive_s", "parameters")
    for name in (*same, "streams_before_engaging"):
        assert getattr(adapter, name) == getattr(known, name)


def test_it_hears_the_version_of_what_was_found():
    adapter = DetectedAutopilot(address(px4_steering="auto"))
    adapter.recognise(PX4)
    assert not adapter.is_ready
    assert len(adapter.questions()) == 1
    assert "Guided Course" in str(adapter.hear(VersionReport(major=1, minor=18)))
    assert adapter.is_ready
    assert adapter.counts_ground_stations


def test_it_stays_with_the_first_autopilot():
    adapter = DetectedAutopilot(address())
    adapter.recognise(ARDUPILOT)
    assert "the mission says ArduPilot and the vehicle is PX4" in str(adapter.recognise(PX4))
    assert adapter.is_engaged(GUIDED)


def test_an_autopilot_that_is_not_spoken_here_is_told_so():
    complaint = DetectedAutopilot(address()).recognise(PAPARAZZI)
    assert complaint == ("the vehicle is autopilot number 9, which is not spoken here: not steered")


@pytest.mark.parametrize(("kind", "other"), [(ArduPlane, PX4), (Px4, ARDUPILOT)])
def test_another_autopilot_than_the_missions_is_told_in_words(kind, other):
    complaint = str(kind(address()).recognise(other))
    assert "ArduPilot" in complaint
    assert "PX4" in complaint
    assert "not steered" in complaint
