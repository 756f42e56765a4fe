"""The laws on arrays are the laws on floats, and both stay finite wherever a vehicle may be."""

import math
from itertools import product
from typing import Any, TypeVar

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.following import follower_step
from tests.kit.states import choices
from vfguide.guidance.formation import Slot, SlotLimits
from vfguide.guidance.leader_motion import MotionEstimate, estimated_motion
from vfguide.guidance.navigation import FilterTimes, Sample, first_state, navigate, navigate_blind
from vfguide.guidance.path import Path
from vfguide.guidance.settings import PathGains
from vfguide.laws.keeper import FollowerGuidance
from vfguide.laws.leader import LeaderGuidance, LeaderTask, PathField, leader_step
from vfguide.mission.quantity import Section
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line
from vfguide.paths.racetrack import Racetrack
from vfguide.state import Airframe, LeaderState, VehicleState

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=150)
Record = TypeVar("Record", bound=msgspec.Struct)
COUNT, PERIOD = 120, 0.05
PATHS: list[Path] = [
    Line(north=10.0, east=-20.0, course=2.0),
    Circle(north=10.0, east=-20.0, radius=150.0, direction=-1),
    Racetrack(
        north=0.0, east=30.0, course=1.0, leg=300.0, radius=150.0, direction=1, easement=60.0
    ),
]
GAINS = PathGains(gain=0.03, approach_angle=1.2)
FOLLOWERS = [
    SlotLimits(slot=Slot(forward=-20.0, right=40.0), airspeed_min=14.0, airspeed_max=25.0),
    SlotLimits(slot=Slot(forward=-20.0, right=-70.0), airspeed_min=14.0, airspeed_max=25.0),
]
AIRFRAMES = [Airframe(), Airframe(hold="course-hold")]


def element(batch: Record, index: int) -> Record:
    """One member of a batch, as floats all the way down."""
    return replace(
        batch,
        **{
            name: float(value[index])
            for name in batch.__struct_fields__
            if isinstance(value := getattr(batch, name), np.ndarray)
        },
    )


def same(batch: object, index: int, single: msgspec.Struct) -> None:
    """Every number of a batch's member is the single one's."""
    for name in single.__struct_fields__:
        many, one = getattr(batch, name), getattr(single, name)
        if one is None:
            assert many is None
        elif isinstance(one, msgspec.Struct):
            same(many, index, one)
        elif isinstance(one, bool):
            assert bool(many[index]) is one
        else:
            here = many if isinstance(many, float) else many[index]
            assert here == pytest.approx(one, rel=1e-12, abs=1e-12), name


def random_states(seed: int) -> VehicleState[Any]:
    random = np.random.default_rng(seed)
    return VehicleState(
        time_s=0.1,
        north=random.uniform(-500.0, 500.0, COUNT),
        east=random.uniform(-500.0, 500.0, COUNT),
        course=random.uniform(-4.0, 4.0, COUNT),
        ground_speed=random.uniform(8.0, 35.0, COUNT),
        heading=random.uniform(-4.0, 4.0, COUNT),
        airspeed=random.uniform(8.0, 35.0, COUNT),
        wind_north=random.uniform(-15.0, 15.0, COUNT),
        wind_east=random.uniform(-15.0, 15.0, COUNT),
        wind_rate_north=random.uniform(-1.0, 1.0, COUNT),
        wind_rate_east=random.uniform(-1.0, 1.0, COUNT),
        wind_jerk_north=random.uniform(-1.0, 1.0, COUNT),
        wind_jerk_east=random.uniform(-1.0, 1.0, COUNT),
    )


def random_leaders(states: VehicleState[Any], seed: int) -> LeaderState[Any]:
    random = np.random.default_rng(seed)
    return LeaderState(
        time_s=0.0,
        north=states.north + random.uniform(-60.0, 60.0, COUNT),
        east=states.east + random.uniform(-60.0, 60.0, COUNT),
        course=states.course + random.uniform(-1.0, 1.0, COUNT),
        ground_speed=random.uniform(8.0, 35.0, COUNT),
        acceleration=random.uniform(-3.0, 3.0, COUNT),
        turn_rate=random.uniform(-0.8, 0.8, COUNT),
        turn_acceleration=random.uniform(-0.5, 0.5, COUNT),
    )


@pytest.mark.parametrize(
    ("airframe", "law", "switch"),
    list(product(AIRFRAMES, ["slot", "article", "pid"], [True, False])),
)
def test_followers_in_a_batch_are_followers_alone(airframe, law, switch):
    random = np.random.default_rng(3)
    states = random_states(1)
    leaders = random_leaders(states, 2)
    slots = Slot(
        forward=random.uniform(-60.0, 60.0, COUNT), right=random.uniform(-60.0, 60.0, COUNT)
    )
    chosen = choices(predict_leader=switch, wind_feedforward=switch)
    batch = follower_step(states, leaders, slots, chosen, airframe, period=PERIOD, law=law)
    for index in range(COUNT):
        single = follower_step(
            element(states, index),
            element(leaders, index),
            element(slots, index),
            chosen,
            airframe,
            period=PERIOD,
            law=law,
        )
        assert isinstance(single.setpoint.course, float)
        assert isinstance(single.setpoint.limited, bool)
        same(batch, index, single)


@pytest.mark.parametrize(
    ("path", "airframe", "source", "switch"),
    list(product(PATHS, AIRFRAMES, ["measured", "observer"], [True, False])),
)
def test_leaders_in_a_batch_are_leaders_alone(path, airframe, source, switch):
    states = random_states(4)
    task = LeaderTask(path=path, path_gains=GAINS, airspeed=20.0, followers=FOLLOWERS)
    chosen = choices(speed_source=source, give_way=switch, wind_feedforward=switch)
    law = PathField(Section(), chosen, airframe)
    estimates = np.random.default_rng(5).uniform(10.0, 30.0, COUNT) if switch else None
    batch = leader_step(states, law, task, period=PERIOD, memory=estimates)
    for index in range(COUNT):
        single = leader_step(
            element(states, index),
            law,
            task,
            period=PERIOD,
            memory=None if estimates is None else float(estimates[index]),
        )
        same(batch, index, single)


@pytest.mark.parametrize("step", [navigate, navigate_blind])
def test_navigation_and_leader_motion_in_a_batch_are_those_alone(step):
    random, times = np.random.default_rng(6), FilterTimes(position_s=2.0, wind_s=0.2)

    def sample(time: float) -> Sample[Any]:
        north, east = random.normal(0.0, 300.0, (2, COUNT))
        velocity_north, velocity_east = random.normal(0.0, 15.0, (2, COUNT))
        return Sample(
            time_s=time,
            north=north,
            east=east,
            velocity_north=velocity_north,
            velocity_east=velocity_east,
            heading=random.uniform(-3.0, 3.0, COUNT),
            airspeed=random.uniform(10.0, 30.0, COUNT),
        )

    before, after = sample(0.0), sample(PERIOD)
    batch = step(first_state(before), after, times)
    known = MotionEstimate(state=random_leaders(batch, 7), jerk=random.uniform(-1.0, 1.0, COUNT))
    motion = estimated_motion(known, batch, AIRFRAMES[0], 0.4)
    for index in range(COUNT):
        single = step(first_state(element(before, index)), element(after, index), times)
        same(batch, index, single)
        leader = element(random_leaders(batch, 7), index)
        alone = MotionEstimate(state=leader, jerk=float(known.jerk[index]))
        estimated = estimated_motion(alone, single, AIRFRAMES[0], 0.4)
        same(motion.state, index, estimated.state)
        assert float(motion.jerk[index]) == pytest.approx(estimated.jerk, rel=1e-12)


PLACE, ANGLE = st.floats(-1e6, 1e6), st.floats(-1e3, 1e3)
SPEED, WIND = st.floats(1.0, 100.0), st.floats(-100.0, 100.0)


@st.composite
def anywhere(draw: st.DrawFn) -> VehicleState[float]:
    return VehicleState(
        time_s=1.0,
        north=draw(PLACE),
        east=draw(PLACE),
        course=draw(ANGLE),
        ground_speed=draw(st.floats(0.0, 200.0)),
        heading=draw(ANGLE),
        airspeed=draw(SPEED),
        wind_north=draw(WIND),
        wind_east=draw(WIND),
        wind_rate_north=draw(WIND),
        wind_rate_east=draw(WIND),
        wind_jerk_north=draw(WIND),
        wind_jerk_east=draw(WIND),
    )


@st.composite
def any_leader(draw: st.DrawFn) -> LeaderState[float]:
    rate = st.floats(-5.0, 5.0)
    return LeaderState(
        time_s=draw(st.floats(-10.0, 1.0)),
        north=draw(PLACE),
        east=draw(PLACE),
        course=draw(ANGLE),
        ground_speed=draw(st.floats(0.0, 200.0)),
        acceleration=draw(WIND),
        turn_rate=draw(rate),
        turn_acceleration=draw(rate),
    )


def all_finite(guidance: FollowerGuidance[float] | LeaderGuidance[float]) -> bool:
    return all(
        math.isfinite(value)
        for part in (guidance, guidance.setpoint)
        for name in part.__struct_fields__
        if isinstance(value := getattr(part, name), float)
    )


@REPEATABLE
@given(
    state=anywhere(),
    leader=any_leader(),
    slot=st.builds(Slot, forward=st.floats(-1e4, 1e4), right=st.floats(-1e4, 1e4)),
    law=st.sampled_from(["slot", "article", "pid"]),
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
        guidance = leader_step(
            state, PathField(Section(), choices(speed_source=source), airframe), task, period=PERIOD
        )
        assert all_finite(guidance)
