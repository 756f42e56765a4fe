"""Guidance is finite wherever a vehicle may be."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kit.following import follower_step
from tests.kit.states import choices
from vfguide.guidance.formation import Slot, SlotLimits
from vfguide.guidance.path import Path
from vfguide.guidance.sliding_laws import PathGains
from vfguide.laws.base import FollowerGuidance
from vfguide.laws.leader import LeaderGuidance, LeaderTask, PathField, leader_step
from vfguide.mission.quantity import Section
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line
from vfguide.paths.racetrack import Racetrack
from vfguide.state import Airframe, LeaderState, VehicleState

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=150)
PERIOD = 0.05
PATHS: list[Path] = [
    Line(north=10.0, east=-20.0, course=2.0),
    Circle(north=10.0, east=-20.0, radius=150.0, direction=-1),
    Racetrack(north=0, east=30.0, course=1.0, leg=300, radius=150, direction=1, easement=60.0),
]
GAINS = PathGains(gain=0.03, approach_angle=1.2)
FOLLOWERS = [
    SlotLimits(slot=Slot(forward=-20.0, right=40.0), airspeed_min=14.0, airspeed_max=25.0),
    SlotLimits(slot=Slot(forward=-20.0, right=-70.0), airspeed_min=14.0, airspeed_max=25.0),
]
AIRFRAMES = [Airframe(), Airframe(hold="course-hold")]

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
    for airframe in AIRFRAMES:
        guidance = follower_step(state, leader, slot, choices(), airframe, period=PERIOD, law=law)
        assert all_finite(guidance)


@REPEATABLE
@given(
    state=anywhere(), path=st.sampled_from(PATHS), source=st.sampled_from(["measured", "observer"])
)
def test_wherever_a_leader_is_its_guidance_is_finite(state, path, source):
    task = LeaderTask(path=path, path_gains=GAINS, airspeed=20.0, followers=FOLLOWERS)
    for airframe in AIRFRAMES:
        law = PathField(Section(), choices(speed_source=source), airframe)
        assert all_finite(leader_step(state, law, task, period=PERIOD))
