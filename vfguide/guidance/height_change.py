"""How a formation goes over from one height to another: at a bounded climb rate that changes evenly.

Where a leader changes to a path that lies higher or lower, what is planned for it goes there step by step:
as fast as every vehicle of the formation climbs with half of its excess of power, the other half left to
the slots, and with a bounded acceleration. It closes the last metres by a square root and then
exponentially, as position controllers of autopilots do. All who know the path and where the leader is find
the same heights.
"""

import math

import msgspec

from vfguide.guidance.height import HeightTarget, within

ACCELERATION = 0.5
"""m/s²: so fast the climb rate changes, about as along the vertical curves between two legs of a route."""

CLOSING_ACCELERATION = 0.4
"""m/s²: the same on the last metres, with something to spare for a target that climbs itself."""

CLOSING_1_S = 0.8
"""Rate at which the last decimetres are closed, 1/s."""

SHARE = 0.5
"""Of the climb and sink limits, for a change of height."""

CATCH_UP_M_S = 0.5
"""A path that climbs as fast as that is caught up with at this, where the limits leave so much."""

STEP_S = 0.05
"""Longest step in which a change is followed."""

MOST_STEPS = 1200
"""A minute of them: after a longer silence they are longer."""

ARRIVED_M = 0.02
"""Nearer to the target than this, and as little faster or slower in m/s, a change is over."""


class ClimbLimits(msgspec.Struct, frozen=True, kw_only=True):
    """What every vehicle of a formation keeps up."""

    climb: float = math.inf
    """Fastest climb, m/s."""
    sink: float = math.inf
    """Fastest descent, m/s, positive."""

    def fastest(self, along: float) -> tuple[float, float]:
        """(fastest descent, negative; fastest climb) while the target itself climbs at a rate (m/s)."""
        return -_fastest(self.sink, -along), _fastest(self.climb, along)


def _fastest(limit: float, along: float) -> float:
    """The same in one direction: no faster than the limit, unless the target is."""
    return max(SHARE * limit, along, min(along + CATCH_UP_M_S, limit))


class HeightMotion(msgspec.Struct, frozen=True, kw_only=True):
    """A height that is planned, and how it changes."""

    time_s: float
    """s."""
    height: float
    """m above the mission's origin."""
    climb_rate: float
    """m/s, positive up."""

    def is_at(self, target: HeightTarget) -> bool:
        """Whether it has come to a target."""
        off, slower = target.height - self.height, target.climb_rate - self.climb_rate
        return abs(off) <= ARRIVED_M and abs(slower) <= ARRIVED_M


def closing_rate(error: float) -> float:
    """The climb rate (m/s) that closes a height error (m) with a bounded acceleration.

    In proportion to the error where it is small, else the rate that comes to rest there evenly.
    """
    size = abs(error)
    small = CLOSING_ACCELERATION / CLOSING_1_S**2
    if size <= small:
        return CLOSING_1_S * error
    return math.copysign(math.sqrt(2.0 * CLOSING_ACCELERATION * (size - 0.5 * small)), error)


def stopping_way(climb_rate: float) -> float:
    """The way (m, positive up) on which a climb rate (m/s) comes to rest evenly: see `closing_rate`."""
    size, small = abs(climb_rate), CLOSING_ACCELERATION / CLOSING_1_S
    if size <= small:
        return climb_rate / CLOSING_1_S
    way = 0.5 * (size * size / CLOSING_ACCELERATION + small / CLOSING_1_S)
    return math.copysign(way, climb_rate)


def changed_height(
    before: HeightMotion, target: HeightTarget, time_s: float, limits: ClimbLimits
) -> HeightMotion:
    """The planned height at a later time, on its way to a target.

    Args:
        before: the planned height before.
        target: where it is to be at that time, and the rate at which that climbs.
        time_s: s; an earlier one changes nothing.
        limits: of the formation.
    """
    passed_s = time_s - before.time_s
    if passed_s <= 0.0:
        return before
    count = min(math.ceil(passed_s / STEP_S), MOST_STEPS)
    period = passed_s / count
    lowest, highest = limits.fastest(target.climb_rate)
    height, rate = before.height, before.climb_rate
    for left in range(count, 0, -1):
        error = target.height - target.climb_rate * left * period - height
        wanted = min(max(target.climb_rate + closing_rate(error), lowest), highest)
        later = rate + within(wanted - rate, ACCELERATION * period)
        height += 0.5 * (rate + later) * period
        rate = later
    return HeightMotion(time_s=time_s, height=height, climb_rate=rate)


def target_on_the_way(
    motion: HeightMotion, target: HeightTarget, ahead_s: float, limits: ClimbLimits
) -> HeightTarget:
    """What is to be flown by a planned height that is on its way to a target.

    Args:
        motion: the planned height now.
        target: now, and so many seconds ahead.
        ahead_s: from now to when a setpoint takes effect, s.
        limits: of the formation.
    """
    climb_rate = (target.ahead - target.height) / ahead_s if ahead_s > 0.0 else target.climb_rate
    then = HeightTarget(height=target.ahead, climb_rate=climb_rate, ahead=target.ahead)
    later = changed_height(motion, then, motion.time_s + ahead_s, limits)
    return HeightTarget(height=motion.height, climb_rate=motion.climb_rate, ahead=later.height)


def change_duration(change: float, limits: ClimbLimits) -> float:
    """How long a change of height (m, positive up) takes about, s."""
    if change == 0.0:
        return 0.0
    fastest = SHARE * (limits.climb if change > 0.0 else limits.sink)
    # It gains its speed and loses it again, and closes what is left within four time constants.
    return abs(change) / fastest + fastest / CLOSING_ACCELERATION + 4.0 / CLOSING_1_S
