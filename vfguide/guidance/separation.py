"""Keeping clear of the others: what a follower's dual field asks for, less what would bring it too close.

Toward each of the others the closing speed is held below `CLOSING_RATE` times the distance left, a control
barrier function: h = d - keep, dh/dt >= -gamma h (Ames et al., "Control Barrier Functions: Theory and
Applications", 2019). Rigid slots keep their distances, so in a formation that flies as it should nothing is
ever taken off, turning or not. What is taken off a wish to go through somebody becomes a wish to go round,
as a rule to the right: a barrier alone would let two vehicles wait for each other for ever.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic

from vfguide.elementwise import BoolArray, Number, greater_of, hypot, like, where

CLOSING_RATE = 0.4
"""gamma, 1/s: slower than both responses of an aircraft, which have to follow."""

LEFT_M_S = 2.0
"""Whoever wants to pass somebody on the left by this speed or more, relative to that one, does; all others
go to the right, so that two who meet head on do the same. Any two see the same side of each other."""

PASSES = 3
"""Over all the others: what one takes off may bring nearer to the next."""

LEAST_DISTANCE = 0.1
"""m: from nearer than this no direction leads away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle(Generic[Number]):
    """Another vehicle, where it is now and how it moves."""

    north: Number
    """m."""
    east: Number
    """m."""
    velocity_north: Number
    """m/s."""
    velocity_east: Number
    """m/s."""
    keep: Number
    """Distance from it that is not to be fallen short of, m."""


def carried_on(obstacle: Obstacle[Number], after_s: float) -> Obstacle[Number]:
    """An obstacle some time later (s), by its velocity."""
    return replace(
        obstacle,
        north=obstacle.north + obstacle.velocity_north * after_s,
        east=obstacle.east + obstacle.velocity_east * after_s,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Bearing(Generic[Number]):
    """An obstacle as a vehicle sees it."""

    toward_north: Number
    """Unit vector toward it."""
    toward_east: Number
    """Unit vector toward it."""
    greatest: Number
    """Greatest own velocity in that direction, m/s: the obstacle's own plus gamma (d - keep)."""
    own: Number
    """The obstacle's velocity in that direction, m/s."""
    own_right: Number
    """The obstacle's velocity to the right of that direction, m/s."""


def bearing_of(north: Number, east: Number, obstacle: Obstacle[Number]) -> Bearing[Number]:
    """How an obstacle is seen from a place (m), and how fast it may be approached."""
    apart_north, apart_east = obstacle.north - north, obstacle.east - east
    distance = greater_of(hypot(apart_north, apart_east), LEAST_DISTANCE)
    toward_north, toward_east = apart_north / distance, apart_east / distance
    own = obstacle.velocity_north * toward_north + obstacle.velocity_east * toward_east
    return Bearing(
        toward_north=toward_north,
        toward_east=toward_east,
        greatest=own + CLOSING_RATE * (distance - obstacle.keep),
        own=own,
        own_right=obstacle.velocity_east * toward_north - obstacle.velocity_north * toward_east,
    )


def separated_velocity(
    place: tuple[Number, Number],
    wanted: tuple[Number, Number],
    obstacles: Sequence[Obstacle[Number]],
) -> tuple[Number, Number, bool | BoolArray]:
    """The velocity nearest to the wanted one, more or less, that keeps clear of all obstacles.

    Args:
        place: (north, east) of the vehicle, m.
        wanted: (north, east) velocity that guidance asks for, m/s.
        obstacles: the others.

    Returns:
        north and east velocity in m/s, and whether they are not the wanted ones.
    """
    north, east = wanted
    bearings = [bearing_of(*place, obstacle) for obstacle in obstacles]
    taken = like(0.0, north)
    for number in range(PASSES):
        for seen in bearings:
            closing = north * seen.toward_north + east * seen.toward_east
            excess = greater_of(closing - seen.greatest, 0.0)
            taken = taken + excess
            north, east = north - excess * seen.toward_north, east - excess * seen.toward_east
            if number == 0:
                # Of what was wanted toward the obstacle; being pushed away is no reason to go round.
                around = excess - greater_of(seen.own - seen.greatest, 0.0)
                around = greater_of(around, 0.0)
                rightward = wanted[1] * seen.toward_north - wanted[0] * seen.toward_east
                around = where(rightward - seen.own_right < -LEFT_M_S, -around, around)
                north, east = north - around * seen.toward_east, east + around * seen.toward_north
    return north, east, taken > 0.0
