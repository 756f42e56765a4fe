"""How high to fly: along the path, from one height to another, and apart from others.

A path says how high its leader is to be, and a follower knows the path. So it climbs at the leader's
command and not after it: two aircraft that answer alike then stay at one height through every bend of the
profile. What the leader really flies beside that, since it cannot climb so fast or its pilot flies it
elsewhere, is filtered: in level flight noise is to move no follower.

An autopilot follows a height that climbs steadily some seconds late. What is asked of it is the height that
is to be flown so much later.

A step in height keeps a vehicle apart where no manoeuvre in the plane is enough. The heights that it may
go to are compared by the least distance in space that each leaves to any other vehicle. Two that are as
high and both step are told apart by a rule that both know: one of them goes over the other. To go the
other way gains nothing against a vehicle that steps by the same rule, and a height behind another vehicle
is reached only by passing that vehicle's own.

A change of height has a bounded climb rate that changes evenly. Where a leader changes to a path that lies
higher or lower, what is planned for it goes there step by step: as fast as every vehicle of the formation
climbs with half of its excess of power, the other half left to the slots, and with a bounded acceleration.
It closes the last metres by a square root and then exponentially, as position controllers of autopilots do.
All who know the path and where the leader is find the same heights.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from vfguide.elementwise import FloatArray, low_pass
from vfguide.guidance.path import Path, PathPoint, tangent_rate_per_speed
from vfguide.guidance.separation import TIMES
from vfguide.state import GAP_S, Airframe, LeaderState

FASTER_S = 10.0
"""What is looked at farther ahead takes a leader to go on accelerating for no longer than this."""

PLANNED_S = 5.0
"""Memory of what a leader flies beside its plan: bends of the profile, to which all answer alike, are over by
then."""

UNPLANNED_S = 1.5
"""The same of a leader without a plan: its heights are all that is known."""

BIAS_S = 5.0
"""Memory of what a leader's climb rate differs from the change of its height by."""

LEAST_BIAS = 0.1
"""m/s: less than this is noise of the height."""

GREATEST_RATE = 20.0
"""m/s: no leader climbs or descends faster, nor does a height that is believed change faster against it."""

MOST_LATE_M = 15.0
"""The filtered deviation is no farther from the found one: bends of a profile are flown late by less."""

ALTIMETERS_S = 10.0
"""Memory of how altimeters differ: a barometer drifts for minutes, and what is a receiver's own for one."""

ALTIMETERS_M_S = 0.3
"""No more than this is climbed because of them: a satellite altitude that steps moves no aircraft at once."""

ALTIMETERS_M = 10.0
"""Nor is more believed: barometers that are set at one place and time differ by less. What differs by half as
much again is no altitude above the sea, and counts as no difference."""

LEAST_SHARE = 0.5
"""No leader takes its followers below this share of the flying height, unless its path leads there."""

FLOOR_M = 20.0
"""Nothing lower than this above the origin is asked for, unless the mission itself leads near to it."""


def floor_of(planned: float) -> float:
    """The least height to ask for where the mission's lowest is this; both in m above the origin.

    Of a mission that flies low it is lower than `FLOOR_M`: it leaves room about the mission's own height.
    """
    return min(FLOOR_M, planned - (1.0 - LEAST_SHARE) * abs(planned))


class HeightTarget(msgspec.Struct, frozen=True, kw_only=True):
    """A height, now and when it takes effect."""

    height: float
    """To be flown now, m above the mission's origin."""
    climb_rate: float
    """With it, m/s, positive up."""
    ahead: float
    """To be flown once a setpoint takes effect, m above the mission's origin."""


def altimeter_difference(known: float, differ: float, interval: float) -> float:
    """By how much the own altimeter shows more than the leader's at one height, m.

    Barometers drift apart. Altitudes by satellites do not: neighbours see the same satellites through the
    same air, and share most of their error.

    Args:
        known: what was known before, m.
        differ: by how much the leader's altitude by satellites is above its altimeter's, less the same of
            the own; m, NaN where one of them is not known.
        interval: since then, s.
    """
    if math.isnan(differ):
        return known
    if abs(differ) > 1.5 * ALTIMETERS_M:
        differ = 0.0
    most = ALTIMETERS_M_S * interval
    moved = low_pass(known, differ, interval, ALTIMETERS_S) - known
    return min(max(known + min(max(moved, -most), most), -ALTIMETERS_M), ALTIMETERS_M)


def held_height(height: float) -> HeightTarget:
    """Level flight at a height, m above the mission's origin."""
    return HeightTarget(height=height, climb_rate=0.0, ahead=height)


def path_speed(point: PathPoint[float], motion: LeaderState) -> float:
    """How fast the nearest point of a path runs along it, m/s."""
    if point.curvature == 0.0:
        return motion.ground_speed * math.cos(motion.course - point.course)
    return motion.ground_speed * tangent_rate_per_speed(point, motion.course) / point.curvature


class BesidePath(msgspec.Struct, frozen=True, kw_only=True):
    """A leader beside its path, and how far its height is looked ahead."""

    path: Path
    """The leader's."""
    point: PathPoint[float]
    """The point of the path nearest to the leader."""
    motion: LeaderState
    """Motion of the leader at that place."""
    flying: float
    """The mission's flying height, m above the origin, from which the path's heights count."""
    ahead_s: float
    """From the motion's time to when a setpoint takes effect, s."""


def path_height(leader: BesidePath) -> HeightTarget:
    """The height that a path asks of a leader beside it."""
    point, motion, ahead_s = leader.point, leader.motion, leader.ahead_s
    speed = path_speed(point, motion)
    growth = motion.acceleration / max(motion.ground_speed, 1.0)
    run = speed * ahead_s * (1.0 + 0.5 * growth * min(ahead_s, FASTER_S))
    return HeightTarget(
        height=leader.flying + point.height,
        climb_rate=point.slope * speed,
        ahead=leader.flying + leader.path.at(point.progress + run).height,
    )


class HeightDeviation(msgspec.Struct, frozen=True, kw_only=True):
    """By how much a leader flies above what is planned."""

    time_s: float
    """Time of the newest leader state, s."""
    height: float = 0.0
    """m."""
    climb_rate: float = 0.0
    """m/s."""
    found: float = math.nan
    """The height as it was found last, not filtered, m."""
    bias: float = 0.0
    """By how much the measured climb rate is above the change of the found height, filtered, m/s."""

    def at(self, time_s: float) -> float:
        """The deviation at another time (s), m."""
        return self.height + self.climb_rate * (time_s - self.time_s)


def height_deviation(
    before: HeightDeviation | None,
    leader: LeaderState,
    planned: HeightTarget,
    *,
    memory_s: float,
) -> HeightDeviation:
    """The deviation after another state of the leader; one without a height changes nothing.

    The measured climb rate carries it on, so that a leader that climbs steadily beside its plan is followed
    without a lasting error. One that does not fit to the heights, as of a sensor that is stuck, is set right
    by them within some seconds.

    Args:
        before: the deviation before; None at first.
        leader: as it was heard.
        planned: for the leader at that place.
        memory_s: of the filters, s.
    """
    time_s = leader.time_s
    if not math.isfinite(leader.height):
        return before or HeightDeviation(time_s=time_s)
    found = leader.height - planned.height
    if before is None or math.isnan(before.found) or not 0.0 < time_s - before.time_s <= GAP_S:
        return HeightDeviation(time_s=time_s, height=found, found=found)
    period = time_s - before.time_s
    rate = within(leader.climb_rate, GREATEST_RATE) - planned.climb_rate
    excess = within(rate - (found - before.found) / period, GREATEST_RATE)
    bias = low_pass(before.bias, excess, period, BIAS_S)
    true_rate = rate - bias if abs(bias) > LEAST_BIAS else rate
    climb_rate = low_pass(before.climb_rate, true_rate, period, memory_s)
    carried = before.height + 0.5 * (before.climb_rate + climb_rate) * period
    height = low_pass(carried, found, period, memory_s)
    return HeightDeviation(
        time_s=time_s,
        height=min(max(height, found - MOST_LATE_M), found + MOST_LATE_M),
        climb_rate=climb_rate,
        found=found,
        bias=bias,
    )


def within(value: float, most: float) -> float:
    """A value, held within [-most, most]."""
    return min(max(value, -most), most)


def followed_height(
    planned: HeightTarget,
    deviation: HeightDeviation,
    *,
    flying: float,
    now_s: float,
    ahead_s: float,
) -> HeightTarget:
    """The height that followers count their slots from.

    Args:
        planned: for the leader.
        deviation: of the leader from that.
        flying: the mission's flying height, m above the origin.
        now_s: time of the target's present, s.
        ahead_s: from then to when a setpoint takes effect, s.
    """
    lowest = LEAST_SHARE * flying

    def kept(height: float, off: float) -> float:
        return max(height + off, min(height, lowest))

    return HeightTarget(
        height=kept(planned.height, deviation.at(now_s)),
        climb_rate=planned.climb_rate + deviation.climb_rate,
        ahead=kept(planned.ahead, deviation.at(now_s + ahead_s)),
    )


STEP_M = 20.0
"""Height that is climbed or descended where the plane is not enough."""

STEP_SHARE = 0.25
"""At most this of the height above the origin is descended."""

ENOUGH = 1.7
"""Least distances: more than this from all others makes no height better."""

BETTER = 0.25
"""Least distances that another height has to leave beyond the present one's to be gone to."""

CLEAR = 1.2
"""Least distances that a vehicle needs to go back to its own height: it may be nearer in its slot, hardly."""


class Neighbour(msgspec.Struct, frozen=True, kw_only=True):
    """Another vehicle, or one possibility of what it does."""

    distance: float
    """In the plane, at the closest approach, m."""
    least: float
    """In the plane it is to be no less than this, m."""
    least_up: float
    """The height that is worth as much, m."""
    lowest: float
    """The lowest that it may be soon, m above the own guidance's height."""
    highest: float
    """The highest that it may be soon, m above the own guidance's height."""
    over: bool | None
    """Whether the own vehicle is above it, or is to go over it where they are as high; None: either way."""


def clearance(height: float, neighbours: Sequence[Neighbour]) -> float:
    """The least distance from any other vehicle that a height (m) leaves, in least distances."""
    return min((clearance_from(one, height) for one in neighbours), default=ENOUGH)


def clearance_from(one: Neighbour, height: float) -> float:
    """The distance from one other vehicle that a height (m) leaves, in least distances."""
    return min(math.hypot(one.distance / one.least, gap(one, height) / one.least_up), ENOUGH)


def gap(one: Neighbour, height: float) -> float:
    """Height (m) between a height (m) and another vehicle; 0 where it is passed on the way there."""
    above, below = height - one.highest, one.lowest - height
    if one.over is None:
        return max(above, below, 0.0)
    return max(above if one.over else below, 0.0)


def deepest(height: float) -> float:
    """By how many metres a vehicle at some height (m above the origin) descends at most."""
    return min(STEP_M, STEP_SHARE * max(height, 0.0))


def best_step(present: float, steps: Sequence[float], neighbours: Sequence[Neighbour]) -> float:
    """The step in height to fly, m: the present one, unless another one leaves clearly more distance.

    Args:
        present: step that is flown, m.
        steps: that may be flown, m; of those that leave as much the first one counts.
        neighbours: all that may come near.
    """
    left = {step: clearance(step, neighbours) for step in (*steps, present)}
    best = max(steps, key=left.__getitem__)
    return best if left[best] > left[present] + BETTER else present


TRUSTED_S = 0.8
"""A step in height that began this short a time ago is taken to become as fast as the vehicle may climb or
descend: by then it shows."""

LAG_SHARE = 0.6
"""Of the delay of heights: time constant with which a climb or descent begins."""


def heights_ahead(
    now: float, climb_rate: float, target: HeightTarget, airframe: Airframe, *, begun_s: float
) -> FloatArray:
    """Heights of a vehicle at `TIMES`, m: it goes for a height, as fast as it has been seen to.

    Args:
        now: its height, m.
        climb_rate: its own, m/s.
        target: the height that it goes for, m.
        airframe: how fast it may climb and descend, and how late it is.
        begun_s: for how long it has gone for that height, s.
    """
    way = math.copysign(1.0, target.height - now)
    limit = airframe.climb_max if way > 0.0 else airframe.sink_max
    lag = max(LAG_SHARE * airframe.height_delay, 0.1)
    reached = limit
    if begun_s > TRUSTED_S:
        reached = min(max(way * climb_rate, 0.0) / -math.expm1(-begun_s / lag), limit)
    reached *= way
    late = -lag * np.expm1(-TIMES / lag)
    found = now + climb_rate * late + reached * (TIMES - late)
    goal = target.height + target.climb_rate * TIMES
    heights: FloatArray = np.minimum(found, goal) if way > 0.0 else np.maximum(found, goal)
    return heights


def height_between(heights: FloatArray, lowest: float, highest: float) -> FloatArray:
    """Least height (m) between a vehicle at heights at `TIMES` and one within bounds, in each interval."""
    gaps = np.maximum(np.maximum(heights - highest, lowest - heights), 0.0)
    # Above it before and below it after is no height in between.
    passes = np.sign(heights[1:] - highest) != np.sign(heights[:-1] - highest)
    between: FloatArray = np.where(passes, 0.0, np.minimum(gaps[1:], gaps[:-1]))
    return between


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
