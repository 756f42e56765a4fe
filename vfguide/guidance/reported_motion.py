"""Reported places and velocities, held against where an aircraft can be: innovations, and what explains them.

With a greatest acceleration a, a manoeuvre that begins within an interval T leaves the place open by
a T² / 8; a margin of two in a is allowed.
"""

import math
from typing import NamedTuple

import msgspec

from vfguide.guidance.airframe import GRAVITY
from vfguide.state import Airframe

LEAN_S = 6.0
"""Memory of the carried place: how long it takes to lean on believed positions. Places and velocities of
recorded estimators part by 3 m in it at most."""

UNBROKEN_S = 0.5
"""After a longer gap an innovation says nothing of the noise, and the carried place nothing any more."""

VELOCITY_TOLERANCE_M_S = 4.0
"""Noise and corrections of reported velocities."""

LEAST_ACCELERATION_M_S2 = 20.0
"""What any airframe can do in a pilot's hands."""

MARGIN = 2.0
"""Over the acceleration that a vehicle is asked for at most: gusts, and pilots."""

OVERSPEED = 1.5
"""Speed of a dive in parts of the greatest speed that a vehicle may be asked for."""

GREATEST_WIND_M_S = 40.0
"""No wind that these aircraft fly in is stronger."""


class Reach(msgspec.Struct, frozen=True, kw_only=True):
    """What an aircraft can do between two reports."""

    speed: float
    """Greatest speed over ground, m/s."""
    acceleration: float
    """Greatest change of the horizontal velocity, m/s²."""

    def velocity_change(self, interval_s: float) -> float:
        """By how much the reported velocity can change, m/s."""
        return VELOCITY_TOLERANCE_M_S + self.acceleration * interval_s

    def displacement(self, interval_s: float) -> float:
        """How far the place can be from the one that the mean of both velocities leads to, m."""
        # a T² / 8, a being the acceleration without its margin of two.
        return min(0.0625 * self.acceleration * interval_s**2, 2.0 * self.speed * interval_s)


def reach_of(airframe: Airframe) -> Reach:
    """What a vehicle with these limits can do, in a pilot's hands and in gusts too."""
    asked = GRAVITY * math.tan(airframe.max_bank) + airframe.max_acceleration
    return Reach(
        speed=OVERSPEED * airframe.airspeed_max + GREATEST_WIND_M_S,
        acceleration=max(MARGIN * asked, LEAST_ACCELERATION_M_S2),
    )


class ReportedMotion(NamedTuple):
    """Position and velocity at a time."""

    time_s: float
    """s, on any clock that runs evenly."""
    north: float
    """m."""
    east: float
    """m."""
    velocity_north: float
    """Over ground, m/s."""
    velocity_east: float
    """Over ground, m/s."""

    @property
    def speed(self) -> float:
        """Over ground, m/s."""
        return math.hypot(self.velocity_north, self.velocity_east)


def carried(motion: ReportedMotion, to: ReportedMotion) -> tuple[float, float]:
    """(north, east) of a place that is carried to the time of another motion by the mean velocity of both."""
    half = 0.5 * (to.time_s - motion.time_s)
    return (
        motion.north + half * (motion.velocity_north + to.velocity_north),
        motion.east + half * (motion.velocity_east + to.velocity_east),
    )


def velocity_change(motion: ReportedMotion, to: ReportedMotion) -> float:
    """By how much the velocity differs, m/s."""
    return math.hypot(
        to.velocity_north - motion.velocity_north, to.velocity_east - motion.velocity_east
    )


def innovation(
    motion: ReportedMotion, to: ReportedMotion, slack_s: float = 0.0, stood_s: float = 0.0
) -> tuple[float, float]:
    """(north, east) from the carried place to the reported one, m.

    Args:
        motion: the one before.
        to: the reported one.
        slack_s: by so much the time between both may have been longer than their stamps say.
        stood_s: by so much it may have been shorter.
    """
    north, east = carried(motion, to)
    north, east = to.north - north, to.east - east
    speed = to.speed
    if speed == 0.0 or (slack_s <= 0.0 and stood_s <= 0.0):
        return north, east
    ahead_north, ahead_east = to.velocity_north / speed, to.velocity_east / speed
    along = north * ahead_north + east * ahead_east
    excused = min(max(along, -speed * stood_s), speed * slack_s)
    return north - excused * ahead_north, east - excused * ahead_east


def leaned(motion: ReportedMotion, north: float, east: float, interval_s: float) -> ReportedMotion:
    """A carried place that leans on the reported one.

    Args:
        motion: as reported.
        north: of the innovation, m.
        east: of the innovation, m.
        interval_s: since the report before.
    """
    rest = 0.0 if interval_s > UNBROKEN_S else LEAN_S / (LEAN_S + interval_s)
    return motion._replace(north=motion.north - rest * north, east=motion.east - rest * east)
