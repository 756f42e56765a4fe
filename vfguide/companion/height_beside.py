"""The height beside other vehicles: when one is passed above or below, and what that is worth in the plane.

A vehicle that its companion steers keeps clear itself, and may use height for it. One whose companion is
dead holds its height: to climb over it at once keeps the slot, where turning away leaves it.
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
"""Vehicles that will differ by less than this in height step apart by what they announce, or their ranks."""

LEAST_UP_M = 6.0
"""Height between two vehicles above each other, at least."""

LEAST_LEVEL_M = SPACING_SHARE * LEAST_M
"""Distance in the plane that a step in height counts by, at least: that of slots as near as they may be."""

OVER_M = 15.0
"""Over a silent vehicle that may come so near height is used at once: it holds its height, and a climb that
begins early is enough where one that begins late is not."""

OVER_PILOT_M = 22.0
"""The same over a leader that its pilot has taken: more is kept from it, and it may turn."""

OVER_SHARE = 0.85
"""Of the distance between two slots, at most this counts as near then."""

HEIGHT_OFF_M = 1.0
"""What heights between two vehicles may be off by."""

PILOTS_OFF_M_S = 2.0
"""How fast a pilot may change the height of a leader that was taken, beside the climb that is heard: 4 m in
1.5 s from level flight."""


class Obstacle(msgspec.Struct, frozen=True, kw_only=True):
    """Another vehicle, as far as a step in height beside it needs it."""

    name: str
    """As people read it."""
    least_m: float
    """Where no manoeuvre in the plane keeps more than this, height is used."""
    least_up_m: float
    """The height that is worth as much, m."""
    altitude_amsl: float
    """m; NaN where it is not known."""
    climb_rate: float
    """m/s."""
    under: bool
    """Whether to climb where both are as high, or the height is not known."""
    makes_room: bool
    """Whether it is heard to be steered by its companion: then it uses height by the same rules."""
    sense: int = 0
    """Which way it leaves its height, as it says: 1 up, -1 down."""
    slots_apart_m: float = math.inf
    """How near its slot and the own one come soon, level, where it is on its way to its slot."""
    over_m: float = 0.0
    """Within this distance in the plane it is passed above or below, m; 0 where height is no use early."""
    height_off_m: float = HEIGHT_OFF_M
    """What its height may be off by, m ..."""
    height_off_m_s: float = 0.0
    """... and how fast that grows, m/s."""


def height_sense(way: float) -> int:
    """Which way a vehicle leaves its height, as others are told, by the way (m) that is left to climb."""
    return (way > LEVEL_M) - (way < -LEVEL_M)


def worth_in_plane(heights: FloatArray, others: Others, those: Sequence[Obstacle]) -> FloatArray:
    """What the height between a vehicle and others is worth in the plane, see `Others.worth`.

    Args:
        heights: of the vehicle at `TIMES`, m above mean sea level.
        others: what they may do.
        those: whose each possibility is.
    """
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
    """Another vehicle as a step in height beside it needs it; heights are those above the own guidance's.

    Args:
        one: the vehicle.
        distance: of the closest approach in the plane, m.
        in_s: when that is, s from now.
        height: of the vehicle, m; NaN where it is not known: then it is thought to be the guidance's.
        climb_rate: relative to what the own guidance wants, m/s.
        own_height: m.
        own_climb_rate: likewise relative, m/s.
        own_sense: which way the own vehicle leaves its height: 1 up, -1 down, 0 neither.
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
    """The climb rate (m/s) that a vehicle goes on with: none where it is about to turn round."""
    return 0.0 if climb_rate * sense < 0.0 else climb_rate


def goes_over(one: Obstacle, above: float, own_sense: int) -> bool | None:
    """Whether to be above another vehicle; None: either way will do.

    Who will be higher stays so. Of two that will be as high each takes the way that the other has not
    announced; where both have announced the same at once, or nothing yet, their ranks tell.

    Args:
        one: the other vehicle.
        above: how much higher the own vehicle will be where they are closest, m.
        own_sense: which way it leaves its height: 1 up, -1 down, 0 neither.
    """
    if abs(above) > LEVEL_M:
        return above > 0.0
    if own_sense and own_sense != one.sense:
        return own_sense > 0
    if one.sense and not own_sense:
        return one.sense < 0
    if own_sense:
        # Both have announced the same: who is earlier in the mission keeps to it.
        return (own_sense > 0) != one.under
    return one.under if one.makes_room else None
