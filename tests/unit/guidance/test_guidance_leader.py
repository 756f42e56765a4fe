"""A leader's guidance step, by hand and closed around a vehicle; all guidance is finite anywhere."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.following import follower_step
from tests.kit.states import Plant, choices, vehicle_at
from vfguide.guidance.formation import Slot, SlotLimits
from vfguide.guidance.path import Path
from vfguide.guidance.sliding_laws import GuidanceSettings, PathGains
from vfguide.laws.base import FollowerGuidance
from vfguide.laws.leader import FIRST, LeaderGuidance, LeaderTask, PathField, leader_step
from vfguide.mission.quantity import Section
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line
from vfguide.paths.racetrack import Racetrack
from vfguide.state import Airframe, LeaderState, VehicleState

HEADING_HOLD, COURSE_HOLD = Airframe(), Airframe(hold="course-hold")
PERIOD = 0.05
NORTHBOUND = Line(north=0.0, east=0.0, course=0.0)
CLOCKWISE = Circle(north=0.0, east=0.0, radius=150.0, direction=1)
INSIDE, OUTSIDE = (
    SlotLimits(slot=Slot(forward=0.0, right=right), airspeed_min=12.0, airspeed_max=32.0)
    for right in (67.5, -70.0)
)


def guide(
    state: VehicleState,
    task: LeaderTask,
    airframe: Airframe = HEADING_HOLD,
    settings: GuidanceSettings | None = None,
    *,
    memory: object = FIRST,
) -> LeaderGuidance:
    """One step, by the usual settings if nothing is said."""
    law = PathField(Section(), settings or choices(), airframe)
    return leader_step(state, law, task, period=PERIOD, memory=memory)


def along(path: Path, *followers: SlotLimits) -> LeaderTask:
    gains = PathGains(gain=0.03, approach_angle=math.pi / 2.0)
    return LeaderTask(path=path, path_gains=gains, airspeed=20.0, followers=followers)


@pytest.mark.parametrize("airframe", [HEADING_HOLD, COURSE_HOLD])
def test_on_its_line_in_calm_air_a_leader_keeps_course_and_speed(airframe):
    guidance = guide(vehicle_at(500.0, 0.0), along(NORTHBOUND), airframe)
    assert (guidance.setpoint.course, guidance.setpoint.speed) == (0.0, 20.0)
    assert (guidance.cross_track_error, guidance.course_error) == (0.0, 0.0)
    assert not guidance.setpoint.limited


def test_a_leader_keeps_its_airspeed_and_lets_the_wind_have_the_ground_speed():
    # 5 m/s from behind: 20 m/s of airspeed are 25 over the ground
    windy, task = vehicle_at(ground_speed=25.0, wind=(5.0, 0.0)), along(NORTHBOUND)
    assert guide(windy, task, HEADING_HOLD).setpoint.speed == pytest.approx(20.0)
    assert guide(windy, task, COURSE_HOLD).setpoint.speed == pytest.approx(25.0)


def test_flying_east_the_left_is_north():
    # 2 m/s² toward the south, from the left again
    state = vehicle_at(course=math.pi / 2.0, wind_rate=(-2.0, 1.5))
    task = along(Line(north=0.0, east=0.0, course=math.pi / 2.0))
    guidance = guide(state, task, HEADING_HOLD)
    assert guidance.setpoint.course == pytest.approx(math.pi / 2.0 - 0.0858333)


@pytest.mark.parametrize("airframe", [HEADING_HOLD, COURSE_HOLD])
def test_what_an_observing_leader_is_told_of_its_ground_speed_changes_nothing(airframe):
    # 67.5 m inside: an inner slot, so that giving way looks at the speed as well
    state = vehicle_at(151.0, 0.0, math.pi / 2.0 + 0.1)
    task, observing = along(CLOCKWISE, INSIDE), choices(speed_source="observer")
    states = [replace(state, ground_speed=told) for told in (20.0, 5.0, 40.0)]
    found = [guide(one, task, airframe, observing, memory=21.0) for one in states]
    assert found[0] == found[1] == found[2]


PATHS: list[Path] = [
    Line(north=10.0, east=20.0, course=2.0),
    CLOCKWISE,
    Circle(north=0.0, east=0.0, radius=150.0, direction=-1),
    Racetrack(north=0, east=0, course=1.0, leg=300, radius=150, direction=-1, easement=100.0),
]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("source", ["measured", "observer"])
@pytest.mark.parametrize(
    ("north", "east", "course_deg"),
    # The last is the centre of the circles.
    [(80.0, -60.0, 0.0), (80.0, -60.0, 130.0), (80.0, -60.0, 250.0), (0.0, 0.0, 115.0)],
)
def test_from_anywhere_a_leader_flies_onto_its_path(path, source, north, east, course_deg):
    flyer = Plant(north=north, east=east, course=math.radians(course_deg))
    settings, task, estimate = choices(speed_source=source), along(path), None
    worst = 0.0
    for step in range(1600):
        state = flyer.state(step * PERIOD)
        guidance = guide(state, task, COURSE_HOLD, settings, memory=estimate)
        estimate = guidance.memory
        flyer.fly(guidance.setpoint.course, guidance.setpoint.speed, PERIOD)
        if step > 1200:
            worst = max(worst, abs(guidance.cross_track_error))
    assert worst < 0.5
    assert flyer.speed == pytest.approx(20.0, abs=0.01)


REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=150)
PLACE, ANGLE = st.floats(-1e6, 1e6), st.floats(-1e3, 1e3)
SPEED, GROUND_SPEED = st.floats(1.0, 100.0), st.floats(0.0, 200.0)
WIND = st.floats(-100.0, 100.0)


@st.composite
def anywhere(draw: st.DrawFn) -> VehicleState:
    names = ("wind_north", "wind_east", "wind_rate_north", "wind_rate_east")
    winds = {name: draw(WIND) for name in (*names, "wind_jerk_north", "wind_jerk_east")}
    place = {"north": draw(PLACE), "east": draw(PLACE), "course": draw(ANGLE)}
    air = {"heading": draw(ANGLE), "airspeed": draw(SPEED), "ground_speed": draw(GROUND_SPEED)}
    return VehicleState(time_s=1.0, **place, **air, **winds)


RATE = st.floats(-5.0, 5.0)
LEADERS = st.builds(
    LeaderState,
    time_s=st.floats(-10.0, 1.0),
    north=PLACE,
    east=PLACE,
    course=ANGLE,
    ground_speed=GROUND_SPEED,
    acceleration=WIND,
    turn_rate=RATE,
    turn_acceleration=RATE,
)


def all_finite(guidance: FollowerGuidance | LeaderGuidance) -> bool:
    return all(
        math.isfinite(value)
        for part in (guidance, guidance.setpoint)
        for name in part.__struct_fields__
        if isinstance(value := getattr(part, name), float)
    )


@REPEATABLE
@given(
    state=anywhere(),
    leader=LEADERS,
    slot=st.builds(Slot, forward=st.floats(-1e4, 1e4), right=st.floats(-1e4, 1e4)),
    law=st.sampled_from(["slot", "article", "pid", "mpc"]),
)
def test_wherever_a_follower_is_its_guidance_is_finite(state, leader, slot, law):
    for airframe in (HEADING_HOLD, COURSE_HOLD):
        guidance = follower_step(state, leader, slot, choices(), airframe, period=PERIOD, law=law)
        assert all_finite(guidance)


@REPEATABLE
@given(
    state=anywhere(), path=st.sampled_from(PATHS), source=st.sampled_from(["measured", "observer"])
)
def test_wherever_a_leader_is_its_guidance_is_finite(state, path, source):
    task, settings = along(path, INSIDE, OUTSIDE), choices(speed_source=source)
    for airframe in (HEADING_HOLD, COURSE_HOLD):
        assert all_finite(guide(state, task, airframe, settings))
