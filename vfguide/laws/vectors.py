"""A law's view and answer as vectors, for learned laws.

An environment (`vfguide.environment`) uses these; a learned law in flight needs no other module.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vfguide.elementwise import clip, wrap_angle
from vfguide.guidance.airframe import bank_limited_turn_rate, resolve, turning_speed
from vfguide.laws.base import DesiredMotion, View, approach

ActionKind = Literal["rates", "setpoints"]
"""Kind of an action: see `motion_of`."""

COURSE_SPAN = math.radians(90.0)
"""Course of 1 in `setpoints`, rad right of the slot's."""

SPEED_SPAN = 10.0
"""Ground speed of 1 in `setpoints`, m/s above the slot's."""


class Entry(NamedTuple):
    """Entry of an observation, clipped to its bounds."""

    name: str
    """Name of the entry."""
    unit: str
    """SI unit; 1 for a dimensionless entry."""
    low: float
    """Lower bound."""
    high: float
    """Upper bound."""
    meaning: str
    """Meaning and sign."""


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
"""Entries of an observation, in order; along and across refer to the slot's motion over ground."""

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
    """Return the largest turn rate that the bank limit of a view's aircraft allows, rad/s."""
    return bank_limited_turn_rate(view.airframe.max_bank, turning_speed(view.state, view.airframe))


def motion_of(view: View, action: ArrayLike, kind: ActionKind = "rates") -> DesiredMotion:
    """Return the motion for an action.

    Args:
        view: view of the step.
        action: two numbers, clipped to [-1, 1]; NaN counts as 0.
        kind: `rates`: course rate, positive right, as a share of the turn limit, and acceleration as a share
            of the largest. `setpoints`: course, positive right of the slot's, 1 for 90 degrees, and ground
            speed above the slot's, 1 for 10 m/s; both as fast as the aircraft permits.
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
    """Return a number of an action, clipped to [-1, 1]; 0 for NaN."""
    return 0.0 if math.isnan(number) else clip(float(number), -1.0, 1.0)
