"""Height targets: along the path, between two heights, and vertical separation from other vehicles.

A path gives its leader's height, and a follower knows the path. So a follower climbs with the leader's
command instead of after its motion: two aircraft that respond alike stay level through every bend. The
leader's deviation from its plan, as of a slow climb or a manual pilot, is filtered: in level flight noise
must move no follower.

An autopilot follows a steady climb some seconds late. Its setpoint is therefore the height to be flown that
much later.

A step in height separates vehicles where no horizontal manoeuvre suffices. Candidate heights are compared by
the smallest distance in space that each leaves to any other vehicle. A rule known to both decides which of
two vehicles at one height steps over the other. Against a vehicle that steps by the same rule, the other way
gains nothing. A height beyond another vehicle is reached only through that vehicle's own height.

A change of height has a bounded climb rate that changes smoothly. Where a leader changes to a higher or lower
path, its planned height goes there gradually, with a bounded acceleration. It uses half of the climb and sink
limits that all vehicles of the formation keep; the other half is left to the slots. The last metres are
closed by a square root and then exponentially, as in autopilots' position controllers. All who know the path
and the leader's position compute the same heights.
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
"""Longest time for which a look-ahead extrapolates the leader's acceleration, s."""

PLANNED_S = 5.0
"""Time constant of a leader's deviation from its plan, s: bends that all fly alike are over by then."""

UNPLANNED_S = 1.5
"""Filter time constant for a leader without a plan, s: its heights are the only information."""

BIAS_S = 5.0
"""Time constant of the bias between a leader's climb rate and the change of its height, s."""

LEAST_BIAS = 0.1
"""Bias below which a difference counts as noise of the height, m/s."""

GREATEST_RATE = 20.0
"""Bound of a leader's climb rate, and of its difference from the change of height, m/s."""

MOST_LATE_M = 15.0
"""Largest difference between filtered and measured deviation, m: profile bends lag by less."""

ALTIMETERS_S = 10.0
"""Time constant of the altimeter difference, s: barometers drift over minutes, receiver errors over one."""

ALTIMETERS_M_S = 0.3
"""Fastest change of the altimeter difference, m/s: a step in satellite altitude must not move an aircraft."""

ALTIMETERS_M = 10.0
"""Bound of the altimeter difference, m: barometers set at one place and time differ by less. A difference
beyond 1.5 times this is no altitude above sea level, and counts as none."""

LEAST_SHARE = 0.5
"""Share of the flying height below which no leader takes its followers, unless its path leads there."""

FLOOR_M = 20.0
"""Lowest height setpoint above the origin, m, unless the mission itself leads near or below it."""


def floor_of(planned: float) -> float:
    """Return the lowest height setpoint for the mission's lowest height, both m above the origin.

    For a low mission the floor is below `FLOOR_M`, to leave room about the mission's own height.
    """
    return min(FLOOR_M, planned - (1.0 - LEAST_SHARE) * abs(planned))


class HeightTarget(msgspec.Struct, frozen=True, kw_only=True):
    """Height now and when a setpoint takes effect."""

    height: float
    """Height to be flown now, m above the mission's origin."""
    climb_rate: float
    """Climb rate to be flown now, m/s, positive up."""
    ahead: float
    """Height to be flown once a setpoint takes effect, m above the mission's origin."""


def altimeter_difference(known: float, differ: float, interval: float) -> float:
    """Return how much more this altimeter shows than the leader's at one height, m.

    Barometers drift apart. Satellite altitudes do not: neighbours see the same satellites through the same
    air, and share most of their error. `known` is the estimate `interval` seconds ago, m. `differ` is the
    leader's satellite altitude minus its altimeter's, less that difference of this vehicle, m; NaN where
    unknown.
    """
    if math.isnan(differ):
        return known
    if abs(differ) > 1.5 * ALTIMETERS_M:
        differ = 0.0
    most = ALTIMETERS_M_S * interval
    moved = low_pass(known, differ, interval, ALTIMETERS_S) - known
    return min(max(known + min(max(moved, -most), most), -ALTIMETERS_M), ALTIMETERS_M)


def held_height(height: float) -> HeightTarget:
    """Return level flight at a height, m above the mission's origin."""
    return HeightTarget(height=height, climb_rate=0.0, ahead=height)


def path_speed(point: PathPoint[float], motion: LeaderState) -> float:
    """Return the speed of the nearest path point along the path, m/s."""
    if point.curvature == 0.0:
        return motion.ground_speed * math.cos(motion.course - point.course)
    return motion.ground_speed * tangent_rate_per_speed(point, motion.course) / point.curvature


class BesidePath(msgspec.Struct, frozen=True, kw_only=True):
    """Leader beside its path, and the look-ahead of its height."""

    path: Path
    """Path of the leader."""
    point: PathPoint[float]
    """The point of the path nearest to the leader."""
    motion: LeaderState
    """Motion of the leader."""
    flying: float
    """The mission's flying height, m above the origin, from which the path's heights count."""
    ahead_s: float
    """Time from the motion to the setpoint's effect, s."""


def path_height(leader: BesidePath) -> HeightTarget:
    """Return the path's height target for a leader beside it."""
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
    """Height deviation of a leader from its plan, positive above."""

    time_s: float
    """Time of the newest leader state, s."""
    height: float = 0.0
    """Filtered deviation, m."""
    climb_rate: float = 0.0
    """Filtered rate of the deviation, m/s."""
    found: float = math.nan
    """Latest measured deviation, not filtered, m; NaN before the first."""
    bias: float = 0.0
    """Filtered excess of the measured climb rate over the change of the measured deviation, m/s."""

    def at(self, time_s: float) -> float:
        """Return the deviation (m) at another time (s)."""
        return self.height + self.climb_rate * (time_s - self.time_s)


def height_deviation(
    before: HeightDeviation | None, leader: LeaderState, planned: HeightTarget, *, memory_s: float
) -> HeightDeviation:
    """Update the deviation with a leader state; one without a height changes nothing.

    The measured climb rate extrapolates the deviation, so that followers have no lasting error in a steady
    climb beside the plan. A climb rate that does not fit the heights, as of a stuck sensor, is corrected
    within some seconds. `memory_s` is the time constant of the filters, s.
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
    """Clip a value to [-most, most]."""
    return min(max(value, -most), most)


def followed_height(
    planned: HeightTarget,
    deviation: HeightDeviation,
    *,
    flying: float,
    now_s: float,
    ahead_s: float,
) -> HeightTarget:
    """Return the leader's height from which followers count their slots.

    `planned` and the leader's `deviation` are combined at `now_s` and `ahead_s` later, when a setpoint takes
    effect. `flying` is the mission's flying height, m above the origin.
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
"""Step in height where horizontal manoeuvres are not enough, m."""

STEP_SHARE = 0.25
"""Largest step down as a share of the height above the origin."""

ENOUGH = 1.7
"""Clearance beyond which no height is better, in minimum distances."""

BETTER = 0.25
"""Gain in clearance that another height must offer over the present one, in minimum distances."""

CLEAR = 1.2
"""Clearance for the return to the planned height, in minimum distances; hardly above a slot's smallest."""


class Neighbour(msgspec.Struct, frozen=True, kw_only=True):
    """Another vehicle, or one of its possible motions."""

    distance: float
    """Horizontal distance at the closest point of approach, m."""
    least: float
    """Minimum horizontal distance, m."""
    least_up: float
    """Equivalent minimum vertical distance, m."""
    lowest: float
    """Lowest expected height, m above the height that guidance wants."""
    highest: float
    """Highest expected height, m above the height that guidance wants."""
    over: bool | None
    """Whether ownship is above, or is to pass above at equal height; None for both."""


def clearance(height: float, neighbours: Sequence[Neighbour]) -> float:
    """Return the smallest clearance that a height (m) leaves to any vehicle, in minimum distances."""
    return min((clearance_from(one, height) for one in neighbours), default=ENOUGH)


def clearance_from(one: Neighbour, height: float) -> float:
    """Return the clearance that a height (m) leaves to one vehicle, in minimum distances."""
    return min(math.hypot(one.distance / one.least, gap(one, height) / one.least_up), ENOUGH)


def gap(one: Neighbour, height: float) -> float:
    """Return the vertical gap (m) from a height (m) to a vehicle; 0 on the wrong side of its level."""
    above, below = height - one.highest, one.lowest - height
    if one.over is None:
        return max(above, below, 0.0)
    return max(above if one.over else below, 0.0)


def deepest(height: float) -> float:
    """Return the largest step down (m) of a vehicle at a height (m above the origin)."""
    return min(STEP_M, STEP_SHARE * max(height, 0.0))


def best_step(present: float, steps: Sequence[float], neighbours: Sequence[Neighbour]) -> float:
    """Return the step in height to fly, m: the present one unless another leaves clearly more distance.

    The first of equal steps wins; `neighbours` are all vehicles that may come near.
    """
    left = {step: clearance(step, neighbours) for step in (*steps, present)}
    best = max(steps, key=left.__getitem__)
    return best if left[best] > left[present] + BETTER else present


TRUSTED_S = 0.8
"""Age (s) up to which a step in height is predicted at the limit: then the climb rate shows its speed."""

LAG_SHARE = 0.6
"""Time constant with which a climb or descent begins, as a share of the height delay."""


def heights_ahead(
    now: float, climb_rate: float, target: HeightTarget, airframe: Airframe, *, begun_s: float
) -> FloatArray:
    """Predict a vehicle's heights at `TIMES`, m, on the way to a target, at the climb rate it has shown.

    Present height `now` in m, climb rate in m/s; the vehicle turned to the target `begun_s` seconds ago.
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
    """Return the smallest gap (m) between heights and a band of heights in each interval of `TIMES`."""
    gaps = np.maximum(np.maximum(heights - highest, lowest - heights), 0.0)
    # A vehicle that crosses the upper bound within an interval has no gap there.
    passes = np.sign(heights[1:] - highest) != np.sign(heights[:-1] - highest)
    between: FloatArray = np.where(passes, 0.0, np.minimum(gaps[1:], gaps[:-1]))
    return between


ACCELERATION = 0.5
"""Vertical acceleration, m/s², about that of the vertical curves between two legs of a route."""

CLOSING_ACCELERATION = 0.4
"""Vertical deceleration on the last metres, m/s², with reserve for a target that climbs itself."""

CLOSING_1_S = 0.8
"""Rate at which the last decimetres are closed, 1/s."""

SHARE = 0.5
"""Share of the climb and sink limits for a change of height."""

CATCH_UP_M_S = 0.5
"""Closing speed, m/s, on a target that climbs at `SHARE` of the limits or more, within the limits."""

STEP_S = 0.05
"""Longest integration step, s."""

MOST_STEPS = 1200
"""Largest number of steps, a minute of them; after a longer silence steps are longer."""

ARRIVED_M = 0.02
"""Tolerance of height (m) and climb rate (m/s) at the end of a change."""


class ClimbLimits(msgspec.Struct, frozen=True, kw_only=True):
    """Climb and sink rates that every vehicle of a formation can sustain."""

    climb: float = math.inf
    """Fastest climb, m/s."""
    sink: float = math.inf
    """Fastest descent, m/s, positive."""

    def fastest(self, along: float) -> tuple[float, float]:
        """Return (fastest descent, negative; fastest climb), m/s, for a target's climb rate (m/s)."""
        return -_fastest(self.sink, -along), _fastest(self.climb, along)


def _fastest(limit: float, along: float) -> float:
    """Return the rate limit in one direction, m/s: that of the target where it is faster."""
    return max(SHARE * limit, along, min(along + CATCH_UP_M_S, limit))


class HeightMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Planned height and its rate."""

    time_s: float
    """Time, s."""
    height: float
    """m above the mission's origin."""
    climb_rate: float
    """Climb rate, m/s, positive up."""

    def is_at(self, target: HeightTarget) -> bool:
        """Check whether the height has reached a target."""
        off, slower = target.height - self.height, target.climb_rate - self.climb_rate
        return abs(off) <= ARRIVED_M and abs(slower) <= ARRIVED_M


def closing_rate(error: float) -> float:
    """Return the climb rate (m/s) that closes a height error (m) with a bounded acceleration.

    The rate is proportional to small errors; for larger ones it follows a constant deceleration.
    """
    size = abs(error)
    small = CLOSING_ACCELERATION / CLOSING_1_S**2
    if size <= small:
        return CLOSING_1_S * error
    return math.copysign(math.sqrt(2.0 * CLOSING_ACCELERATION * (size - 0.5 * small)), error)


def stopping_way(climb_rate: float) -> float:
    """Return the height (m, positive up) to stop a climb rate (m/s): the inverse of `closing_rate`."""
    size, small = abs(climb_rate), CLOSING_ACCELERATION / CLOSING_1_S
    if size <= small:
        return climb_rate / CLOSING_1_S
    way = 0.5 * (size * size / CLOSING_ACCELERATION + small / CLOSING_1_S)
    return math.copysign(way, climb_rate)


def changed_height(
    before: HeightMotion, target: HeightTarget, time_s: float, limits: ClimbLimits
) -> HeightMotion:
    """Advance the planned height to `time_s`, toward a target that holds then; earlier times do nothing."""
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
    """Return the target for a planned height on its way to another one, now and `ahead_s` seconds later."""
    climb_rate = (target.ahead - target.height) / ahead_s if ahead_s > 0.0 else target.climb_rate
    then = HeightTarget(height=target.ahead, climb_rate=climb_rate, ahead=target.ahead)
    later = changed_height(motion, then, motion.time_s + ahead_s, limits)
    return HeightTarget(height=motion.height, climb_rate=motion.climb_rate, ahead=later.height)


def change_duration(change: float, limits: ClimbLimits) -> float:
    """Estimate the duration (s) of a change of height (m, positive up)."""
    if change == 0.0:
        return 0.0
    fastest = SHARE * (limits.climb if change > 0.0 else limits.sink)
    # It accelerates, decelerates, and closes the rest within four time constants.
    return abs(change) / fastest + fastest / CLOSING_ACCELERATION + 4.0 / CLOSING_1_S
