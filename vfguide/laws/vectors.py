"""A law's view and its answer as vectors, for laws that are learned.

An environment (`vfguide.environment`) shows and takes these, and so does a learned law in flight: it needs
nothing but this module there.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vfguide.elementwise import clip, wrap_angle
from vfguide.guidance.airframe import bank_limited_turn_rate, resolve, turning_speed
from vfguide.laws.base import DesiredMotion, View, approach

ActionKind = Literal["rates", "setpoints"]
"""What an action says: see `motion_of`."""

COURSE_SPAN = math.radians(90.0)
"""Of `setpoints`: the course that 1 stands for, rad to the right of the slot's own."""

SPEED_SPAN = 10.0
"""Of `setpoints`: the ground speed that 1 stands for, m/s above the slot's own."""


class Entry(NamedTuple):
    """One entry of an observation. What is beyond its bounds is shown as the bound."""

    name: str
    """What it is called."""
    unit: str
    """SI unit; 1 of what has none."""
    low: float
    """Least value."""
    high: float
    """Greatest value."""
    meaning: str
    """What it says, and its sign."""


OBSERVATION = (
    Entry("along_track", "m", -2000.0, 2000.0, "the slot, positive ahead of the follower"),
    Entry("cross_track", "m", -2000.0, 2000.0, "the slot, positive right of the follower"),
    Entry("along_track_rate", "m/s", -100.0, 100.0, "rate of along_track"),
    Entry("cross_track_rate", "m/s", -100.0, 100.0, "rate of cross_track"),
    Entry("course", "rad", -math.pi, math.pi, "own course, positive right of the slot's"),
    Entry("speed", "m/s", -100.0, 100.0, "own ground speed, positive above the slot's"),
    Entry("slot_turn_rate", "rad/s", -2.0, 2.0, "turn of the slot's course, positive right"),
    Entry("slot_acceleration", "m/s²", -20.0, 20.0, "growth of the slot's ground speed"),
    Entry("airspeed", "m/s", 0.0, 100.0, "own airspeed"),
    Entry("crab", "rad", -math.pi, math.pi, "own heading, positive right of the own course"),
    Entry("wind_along", "m/s", -50.0, 50.0, "where the air moves to, positive with the slot"),
    Entry("wind_across", "m/s", -50.0, 50.0, "the same, positive to the slot's right"),
    Entry("turn_limit", "rad/s", 0.0, 10.0, "fastest turn that the bank limit allows now"),
    Entry("held", "1", 0.0, 1.0, "1 where something else was flown than was asked for last"),
)
"""Entries of an observation, in order. Along and across are of the slot's own motion over the ground."""

LOW = np.array([entry.low for entry in OBSERVATION], dtype=np.float32)
HIGH = np.array([entry.high for entry in OBSERVATION], dtype=np.float32)


def observed(view: View) -> NDArray[np.float32]:
    """Return a view as a vector: the entries of `OBSERVATION`, shape (14,)."""
    state, slot, error = view.state, view.motion, view.error
    along, across = resolve(state.wind_north, state.wind_east, slot.course)
    entries = (
        error.along_track,
        error.cross_track,
        error.along_track_rate,
        error.cross_track_rate,
        wrap_angle(state.course - slot.course),
        state.ground_speed - slot.speed,
        slot.turn_rate,
        slot.acceleration,
        state.airspeed,
        wrap_angle(state.heading - state.course),
        along,
        across,
        turn_limit(view),
        float(view.held),
    )
    return np.clip(np.array(entries, dtype=np.float32), LOW, HIGH)


def turn_limit(view: View) -> float:
    """Return the fastest turn that the bank limit of a view's aircraft allows, rad/s."""
    return bank_limited_turn_rate(view.airframe.max_bank, turning_speed(view.state, view.airframe))


def motion_of(view: View, action: ArrayLike, kind: ActionKind = "rates") -> DesiredMotion:
    """Return the motion that an action asks for.

    Args:
        view: of the step.
        action: two numbers from -1 to 1; what is beyond counts as the bound, what is no number as 0.
        kind: `rates`: course rate, positive right, as a share of the turn limit, and acceleration as a
            share of the greatest. `setpoints`: course, positive right of the slot's, 1 for 90 degrees,
            and ground speed above the slot's, 1 for 10 m/s; both as fast as the aircraft bears.
    """
    turn, push = (share_of(number) for number in np.asarray(action, dtype=np.float64).reshape(2))
    slot = view.motion
    if kind == "setpoints":
        return approach(
            view,
            course=slot.course + COURSE_SPAN * turn,
            speed=slot.speed + SPEED_SPAN * push,
            course_rate=slot.turn_rate,
            acceleration=slot.acceleration,
        )
    return DesiredMotion(
        course=view.state.course,
        speed=view.state.ground_speed,
        course_rate=turn * turn_limit(view),
        acceleration=push * view.airframe.max_acceleration,
    )


def share_of(number: float) -> float:
    """Return a number of an action within -1 and 1; 0 of what is none."""
    return 0.0 if math.isnan(number) else clip(float(number), -1.0, 1.0)
