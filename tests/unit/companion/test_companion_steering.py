"""What goes out to the autopilot is flyable, and what becomes of guidance that is not."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import vfguide.companion.steering
from tests.kit.companion import (
    ALTITUDE,
    HEADING,
    KINDS,
    SET_MODE,
    SPEED,
    Flight,
    assert_left_alone,
    companion_of,
    leader_bytes,
    new_flight,
)
from tests.kit.missions import content_of, plan_of
from tests.kit.states import vehicle_at
from tests.kit.wire import heartbeat, number_of, of_type, packed, parsed, position_report
from vfguide.companion.follower_role import FollowerRole
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.role import RoleStep
from vfguide.companion.steering import SetpointGuard, TrackingMonitor, is_flyable, slowest_of
from vfguide.companion.supervisor import Mode
from vfguide.guidance.response import Certainty, HoldCertainty
from vfguide.mission.model import Mission
from vfguide.state import Airframe, Setpoint


def bend_guidance(monkeypatch: pytest.MonkeyPatch, from_s: float, **change: Any) -> None:
    """Let the step of a follower ask for something else from a time on."""
    step = FollowerRole.step

    def bent(role: FollowerRole, navigated: NavigatedState, *rest: object) -> RoleStep:
        found = step(role, navigated, *rest)
        return found if navigated.state.time_s <= from_s else replace(found, **change)

    monkeypatch.setattr(FollowerRole, "step", bent)


UNFLYABLE = [
    *((math.nan, 20.0), (math.inf, 20.0), (-math.inf, 20.0)),
    *((1.0, math.nan), (1.0, math.inf), (1.0, -math.inf)),
    *((1.0, 11.999), (1.0, 32.001), (1.0, -20.0)),
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("course", "speed"), UNFLYABLE)
def test_a_setpoint_that_cannot_be_flown_never_becomes_bytes(monkeypatch, kind, course, speed):
    bend_guidance(monkeypatch, 3.0, setpoint=Setpoint(course=course, speed=speed))
    flown = new_flight(kind=kind, until_s=4.0)
    assert flown.times(HEADING)[-1] == 3.0
    assert flown.times(SPEED if kind == "ardupilot" else 178)[-1] == 3.0
    assert math.isfinite(flown.companion.snapshot.setpoint.course)


@pytest.mark.parametrize(
    ("hold", "speed", "flyable"),
    [
        *(("heading-hold", speed, True) for speed in (12.0, 20.0, 32.0)),
        # Airspeeds 12 to 32 m/s, in a wind of up to 0.75 * 32 = 24 m/s.
        *(("course-hold", speed, True) for speed in (3.0, 5.0, 45.0, 56.0)),
        *(("course-hold", speed, False) for speed in (0.14, 2.99, 56.01, 958.0)),
        *(("course-hold", speed, False) for speed in (0.0, -1.0, math.inf)),
    ],
)
def test_a_ground_speed_is_bound_by_the_airspeed_range_and_the_strongest_wind(hold, speed, flyable):
    known = plan_of()
    held = replace(known, airframe=replace(known.airframe, hold=hold))
    setpoint = Setpoint(course=-40.0, speed=speed)
    assert is_flyable(setpoint, held) is flyable


@pytest.mark.parametrize("hold", ["heading-hold", "course-hold"])
@pytest.mark.parametrize("hdg", [0, 9000, 65_535])
@pytest.mark.parametrize(("name", "system_id"), [("leader", 1), ("f1", 2)])
def test_an_aircraft_that_stands_on_the_ground_is_borne(hold, hdg, name, system_id):
    companion = companion_of(name, plant=hold)
    for step in range(60):
        now = step / 20
        companion.receive_link(leader_bytes(now), now)
        airspeed = mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 0, 0, 488.0, 0.0)
        place = position_report(time_boot_ms=step * 50, alt=488_000, hdg=hdg)
        said = packed(heartbeat(), airspeed, place, system_id=system_id, component_id=1)
        out = parsed(companion.receive_mavlink(said, now).to_autopilot)
        assert all(math.isfinite(message.param2) for message in of_type(out, "COMMAND_INT"))
    assert companion.snapshot.mode.steers


ORIGIN_M = 488.0
"""Altitude of the mission's origin; it flies 100 m above that."""


@pytest.mark.parametrize(
    ("height", "climb_m", "asked"),
    [
        # The floor is 20 m above the origin; without a height the last one is held.
        (-300.0, 0.0, ORIGIN_M + 20.0),
        (35.0, -20.0, ORIGIN_M + 20.0),
        (math.nan, 0.0, ORIGIN_M + 100.0),
        (math.inf, 0.0, ORIGIN_M + 100.0),
        (100.0, math.nan, ORIGIN_M + 100.0),
        (30.0, 0.0, ORIGIN_M + 30.0),
    ],
)
def test_no_altitude_that_is_sent_is_below_the_floor_or_no_number(
    monkeypatch, height, climb_m, asked
):
    bend_guidance(monkeypatch, 5.0, height=height, climb_m=climb_m)
    flown = new_flight(until_s=12.0)
    said = parsed(b"".join(data for time, data in flown.sent if time > 6.0))
    sent = [message.z for message in said if number_of(message) == ALTITUDE]
    assert sent
    assert sent == pytest.approx([asked] * len(sent), abs=0.05)
    assert flown.times(HEADING)[-1] > 11.0
    complaints = [text for _, text in flown.texts() if "a height that is no number" in text]
    assert len(complaints) == (not math.isfinite(height + climb_m))


@pytest.mark.parametrize(
    ("flying_m", "up_m", "end_m", "floor_m"),
    [
        (100.0, 0.0, 50.0, 20.0),
        (100.0, -30.0, 50.0, 20.0),
        # The path leads down to 30 m, and the slot to 24 m: half of that is left for what is filtered.
        (100.0, 0.0, -70.0, 15.0),
        (100.0, -6.0, -70.0, 12.0),
        # Low level flight.
        (18.0, 0.0, 50.0, 9.0),
    ],
)
def test_the_floor_leaves_room_for_the_missions_own_lowest_height(flying_m, up_m, end_m, floor_m):
    climb = {"climb_deg": math.copysign(5.0, end_m), "end_height_m": end_m}
    content = content_of("line-calm") | {"height_above_origin_m": flying_m}
    content["path"] = {"type": "line", "course_deg": 0.0, **climb}
    content["followers"][0]["slot"]["up_m"] = up_m
    guard = SetpointGuard(flight_plan(Mission.model_validate(content), "f1"))
    assert guard.height(-1000.0)[0] == pytest.approx(floor_m)
    assert guard.height(flying_m + up_m) == (flying_m + up_m, None)


def complaints(
    course: Callable[[float], float], wanted: Callable[[float], float], seconds: float
) -> list[tuple[float, str]]:
    """What is said of a course and a setpoint over time, at 20 Hz."""
    watch = TrackingMonitor(Airframe())
    found = []
    for step in range(round(seconds * 20)):
        now = step / 20
        setpoint = Setpoint(course=wanted(now), speed=20.0)
        complaint = watch.watch(vehicle_at(time_s=now, course=course(now)), setpoint)
        if complaint is not None:
            found.append((now, complaint))
    return found


def test_an_aircraft_that_ignores_its_course_is_told_of_within_ten_seconds():
    (when, text), (given_up, last) = complaints(lambda _: 0.0, lambda _: 0.5, 60.0)
    assert when < 10.0
    assert "the course does not follow the setpoints: asked to turn at" in text
    assert given_up < when + 5.0
    assert "accepts courses and flies none: handed back" in last
    # So is one that turns the wrong way.
    assert complaints(lambda now: -0.1 * now, lambda now: -0.1 * now + 0.4, 30.0)


@pytest.mark.parametrize(
    ("course", "wanted"),
    [
        # A first-order course, and one four times slower than the mission says.
        (lambda now: 1.0 - math.exp(-1.2 * now), lambda _: 1.0),
        (lambda now: 1.0 - math.exp(-0.3 * now), lambda _: 1.0),
        # A turn at the bank limit: 9.80665 / 20 m/s = 0.49 rad/s with 45 degrees of bank.
        (lambda now: 0.49 * now, lambda now: 0.49 * now + 2.0),
        # Small errors are nobody's business.
        (lambda _: 0.0, lambda _: 0.03),
    ],
)
def test_a_course_that_follows_is_not_complained_of(course, wanted):
    assert complaints(course, wanted, 60.0) == []


def test_a_nose_that_turns_into_a_swinging_wind_follows_although_the_course_stays():
    # the setpoint stands 0.08 rad/s / 1.2 1/s = 0.067 rad ahead all the time
    watch, setpoint = TrackingMonitor(Airframe()), Setpoint(course=0.067, speed=20.0)
    for step in range(1200):
        now = step / 20
        assert watch.watch(replace(vehicle_at(time_s=now), heading=0.08 * now), setpoint) is None


def test_what_was_ignored_before_does_not_count_against_the_next_turn():
    def course(now: float) -> float:
        # It takes up the turn of 40 s after 1 s.
        return 0.5 * (1.0 - math.exp(-1.2 * max(now - 41.0, 0.0)))

    texts = [text for _, text in complaints(course, lambda now: 0.5 * (not 6 <= now < 40), 60.0)]
    assert len(texts) == 2
    assert texts[1] == "the course follows again, nothing to do"


def test_a_turn_that_is_asked_for_no_more_is_not_missed():
    # 3 s are asked for and not flown; what is remembered of them lasts for as long again.
    assert complaints(lambda _: 0.0, lambda now: 0.5 * (now < 3), 60.0) == []


def test_of_a_response_that_is_hardly_known_the_slowest_is_expected():
    plan = plan_of("circle-wind", "f1")
    known = HoldCertainty(spread=3.0, late=0.0)
    guessed = replace(plan, certainty=Certainty(course=known, speed=known))
    assert slowest_of(guessed).alpha == pytest.approx(plan.airframe.alpha / 3.0)


def test_it_says_when_the_course_follows_again():
    def course(now: float) -> float:
        return 0.0 if now < 20.0 else 0.3 * (now - 20.0)

    texts = [text for _, text in complaints(course, lambda now: course(now) + 0.3, 40.0)]
    assert len(texts) == 3
    assert texts[2] == "the course follows again, nothing to do"


@pytest.mark.parametrize(("off", "words"), [(25.0, "25 m above"), (-30.0, "30 m below")])
def test_an_altitude_that_cannot_be_told_is_complained_of_once(off, words):
    watch = TrackingMonitor(Airframe())
    first, *others = (watch.watch_altitude(off) for _ in range(10))
    assert words in str(first)
    assert others == [None] * 9
    assert watch.watch_altitude(5.0) is None
    assert watch.watch_altitude(off) is not None


REASON = "setpoint not flyable"


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Stands for guidance that goes wrong: what it closes to counts as impossible to fly."""
    made, steering = SimpleNamespace(is_open=True), vfguide.companion.steering
    judge = steering.is_flyable
    monkeypatch.setattr(steering, "is_flyable", lambda *wanted: made.is_open and judge(*wanted))
    return made


def complained(flown: Flight) -> list[float]:
    """When it was told that setpoints cannot be flown."""
    return [time for time, text in flown.events if "cannot be flown" in text]


def test_setpoints_that_cannot_be_flown_are_told_once_and_the_vehicle_is_handed_back_soon(gate):
    flown = new_flight(until_s=10.0)
    assert flown.companion.counters[REASON] == 0
    gate.is_open = False
    # Looked at once a second: 0.9 s after the first of them is too early.
    flown.run(11.5)
    assert_left_alone(flown, "GUIDED", since_s=10.0)
    flown.run(15.0)
    assert flown.companion.counters[REASON] == 50
    assert complained(flown) == [pytest.approx(10.1)]
    assert flown.later(HEADING, 10.0) == []
    assert flown.later(SET_MODE, 10.0) == [12.0]
    assert flown.autopilot_mode == "LOITER"
    # It is steered again once its pilot says so.
    gate.is_open = True
    flown.run(20.0)
    assert flown.autopilot_mode == "LOITER"
    flown.pilot("GUIDED", until_s=85.0)
    assert flown.later(HEADING, 10.0)[0] == pytest.approx(20.1)
    assert flown.state == (Mode.TRACKING, "GUIDED")


def test_the_complaint_is_a_warning(gate):
    flown = new_flight(until_s=10.0)
    gate.is_open = False
    telemetry = flown.waiting + flown.autopilot.advance(10.1)
    out = flown.companion.receive_mavlink(telemetry, 10.1)
    assert [event.warning for event in out.events] == [True]
    assert not out.steered


def test_a_moment_without_them_passes_by_itself(gate):
    flown = new_flight(until_s=10.0)
    gate.is_open = False
    flown.run(10.5)
    gate.is_open = True
    flown.run(40.0)
    assert flown.later(HEADING, 10.0)[0] == pytest.approx(10.6)
    assert flown.later(SET_MODE, 10.0) == []
    assert flown.mode is Mode.TRACKING
    # The next time is told again.
    gate.is_open = False
    flown.run(41.0)
    assert complained(flown) == pytest.approx([10.1, 40.1])


def test_autopilots_that_need_a_stream_are_not_engaged_without_one(gate):
    gate.is_open = False
    flown = new_flight(kind="px4", version=(1, 16), until_s=5.0)
    assert flown.times(SET_MODE) == []
    gate.is_open = True
    flown.run(10.0)
    assert flown.autopilot_mode == "OFFBOARD"
