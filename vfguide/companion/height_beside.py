"""Height relative to other vehicles: when to pass above or below, and the worth of height in the plane.

A steered vehicle keeps clear by itself, and may use height for it. A vehicle whose companion is dead holds
its height. To climb over it at once keeps the slot, where turning away leaves it.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from vfguide.companion.possibilities import SPACING_SHARE
from vfguide.companion.traffic import SOON_S
from vfguide.elementwise import FloatArray
from vfguide.formation.transition import LEAST_M
from vfguide.guidance.height import Neighbour, height_between
from vfguide.guidance.separation import BEGINNINGS, TIMES, Others

LEVEL_M = 3.0
"""Predicted height difference below which vehicles step apart as announced, or by rank, m."""

LEAST_UP_M = 6.0
"""Least height between two vehicles above each other, m."""

LEAST_LEVEL_M = SPACING_SHARE * LEAST_M
"""Least horizontal distance that a step in height assumes, m: that of slots as near as allowed."""

OVER_M = 15.0
"""Horizontal distance of a silent vehicle at which height is used at once, m. It holds its height, and an
early climb is enough where a late one is not."""

OVER_PILOT_M = 22.0
"""Replaces `OVER_M` for a leader taken over by its pilot, m: it is given more room, and may turn."""

OVER_SHARE = 0.85
"""Upper bound of `OVER_M` and `OVER_PILOT_M` in parts of the distance between two slots."""

HEIGHT_OFF_M = 1.0
"""Error of the height between two vehicles, m."""

PILOTS_OFF_M_S = 2.0
"""Climb rate that a pilot may add to a leader's reported one, m/s: 4 m in 1.5 s from level flight."""


class Obstacle(msgspec.Struct, frozen=True, kw_only=True):
    """Another vehicle, as a step in height relative to it needs it."""

    name: str
    least_m: float
    """Horizontal room, m: height is used where no manoeuvre in the plane leaves more."""
    least_up_m: float
    """Height difference worth as much as `least_m`, m."""
    altitude_amsl: float
    """m above mean sea level; NaN where unknown."""
    climb_rate: float
    """m/s."""
    under: bool
    """Whether to climb over it at equal or unknown height."""
    makes_room: bool
    """Whether it is heard to be steered by its companion, which uses height by the same rules."""
    sense: int = 0
    """Announced direction of leaving its height: 1 up, -1 down, 0 neither."""
    slots_apart_m: float = math.inf
    """Least horizontal distance of both slots soon, m; infinite unless it is steered."""
    over_m: float = 0.0
    """Horizontal distance within which to pass above or below, m; 0 where early height is no use."""
    height_off_m: float = HEIGHT_OFF_M
    """Error of its height, m."""
    height_off_m_s: float = 0.0
    """Growth of the height error, m/s."""


def height_sense(way: float) -> int:
    """Return the direction of leaving the own height, for others, by the remaining way up, m."""
    return (way > LEVEL_M) - (way < -LEVEL_M)


def worth_in_plane(heights: FloatArray, others: Others, those: Sequence[Obstacle]) -> FloatArray:
    """Return the worth in the plane of height differences to each track, m, see `Others.worth`."""
    worth = np.zeros((len(those), len(BEGINNINGS)))
    for row, (one, keep) in enumerate(zip(those, others.keep, strict=True)):
        if one.over_m == 0.0 or math.isnan(one.altitude_amsl):
            continue
        soon = one.altitude_amsl + one.climb_rate * SOON_S
        lowest, highest = min(one.altitude_amsl, soon), max(one.altitude_amsl, soon)
        unsure = one.height_off_m + one.height_off_m_s * TIMES[1:]
        left = height_between(heights, lowest, highest) - unsure
        worth[row] = keep * np.clip(left / LEAST_UP_M, 0.0, 1.0)
    return worth


def neighbour_of(
    one: Obstacle,
    *,
    distance: float,
    in_s: float,
    height: float,
    climb_rate: float,
    own_height: float,
    own_climb_rate: float,
    own_sense: int,
) -> Neighbour:
    """Return another vehicle as a step in height needs it; heights count from that of the own guidance.

    Args:
        one: the vehicle.
        distance: horizontal distance at the closest approach, m.
        in_s: time to the closest approach, s.
        height: its height, m; NaN while unknown, which counts as 0.
        climb_rate: relative to the one that the own guidance wants, m/s.
        own_height: m.
        own_climb_rate: relative to the one that the own guidance wants, m/s.
        own_sense: direction in which the own vehicle leaves its height: 1 up, -1 down, 0 neither.
    """
    known = math.isfinite(height)
    above = 0.0
    if known:
        rising = kept_rate(own_climb_rate, own_sense) - kept_rate(climb_rate, one.sense)
        above = own_height - height + rising * min(in_s, SOON_S)
    now = height if known else 0.0
    soon = now + climb_rate * SOON_S
    return Neighbour(
        distance=distance,
        least=max(one.least_m, LEAST_LEVEL_M),
        least_up=one.least_up_m,
        lowest=min(now, soon),
        highest=max(now, soon),
        over=goes_over(one, above, own_sense),
    )


def kept_rate(climb_rate: float, sense: int) -> float:
    """Return the climb rate (m/s) that a vehicle continues: 0 where it is about to reverse."""
    return 0.0 if climb_rate * sense < 0.0 else climb_rate


def goes_over(one: Obstacle, above: float, own_sense: int) -> bool | None:
    """Decide whether to be above another vehicle; None leaves it open.

    The vehicle that will be higher stays higher: `above` is the predicted height above the other one, m. At
    equal heights, each takes the way that the other has not announced (1 up, -1 down, 0 neither). Ranks
    decide if both have announced the same at once, or neither has.
    """
    if abs(above) > LEVEL_M:
        return above > 0.0
    if own_sense and own_sense != one.sense:
        return own_sense > 0
    if one.sense and not own_sense:
        return one.sense < 0
    if own_sense:
        # Both have announced the same: the vehicle earlier in the mission keeps to it.
        return (own_sense > 0) != one.under
    return one.under if one.makes_room else None
