"""Intended motion of a leader: extrapolation along its path, and separation from gusts.

**A silent leader.** For a second, dV/dt and omega of its last state predict it best. After that its path
does: the mission holds the path and the leader's airspeed, and every follower measures the wind itself.

**A heard leader.** Slots turn with the leader's course frame. A course disturbance swings a slot 50 m away by
50 m times the angle, and asks its follower for useless turns. A gust that takes leader and follower alike
asks it for speeds that both already have. The intent is known from the leader's place: along the path at its
airspeed, in the mean wind. The measured motion is split into that intent and a difference. The more the
course jitters, the less the difference counts. In calm air slots follow the measured motion at once, in
turbulence the intended one (the weight of a Wiener filter: signal power over signal and noise power).
"""

import math

import msgspec

from vfguide.elementwise import clip, low_pass, wrap_angle
from vfguide.guidance.airframe import ground_speed_on_course, polar
from vfguide.guidance.navigation import fading_memory_2
from vfguide.guidance.path import (
    Path,
    PathPoint,
    desired_course,
    desired_course_rate_per_speed,
    desired_course_slope,
    joining_turn_rate,
    tangent_rate_per_speed,
)
from vfguide.guidance.sliding_laws import PathGains
from vfguide.state import LeaderState, VehicleState


class KnownLeader(msgspec.Struct, frozen=True, kw_only=True):
    """Mission data about the leader."""

    path: Path
    """Path of the leader."""
    path_gains: PathGains
    """Gains of the field around the path."""
    airspeed: float
    """Cruise airspeed, m/s."""
    rate_filter_s: float
    """Time constant of the leader's rates, s."""
    height: float = 0.0
    """Flying height of the mission, the zero of the path's heights, m above the origin."""
    least_radius: float = 0.0
    """Smallest turn radius while joining the path, m; 0 leaves it to the field."""

    def point_beside(self, leader: LeaderState) -> PathPoint[float]:
        """Return the path point nearest to the leader."""
        return self.path.nearest_in_space(
            leader.north, leader.east, leader.course, leader.height - self.height
        )


def extrapolate_along_path(
    leader: LeaderState, follower: VehicleState, known: KnownLeader
) -> LeaderState:
    """Extrapolate the leader to the follower's time along its field, at its airspeed in the follower's wind.

    One call covers at most some tenths of a second; longer silences take several calls.
    """
    period = follower.time_s - leader.time_s
    point = known.point_beside(leader)
    field = (known.path_gains.gain, known.path_gains.approach_angle)
    course = desired_course(point, *field)
    wind = (follower.wind_north, follower.wind_east)
    # The speed is that of mid-step: the initial one would lag all the way round a circle in wind, by
    # decimetres each half turn.
    turn_rate = ground_speed_on_course(
        known.airspeed, course, *wind
    ) * desired_course_rate_per_speed(point, course, *field)
    if known.least_radius > 0.0:
        limit = joining_turn_rate(point, leader.ground_speed, known.least_radius)
        turn_rate = clip(turn_rate + wrap_angle(course - leader.course) / period, -limit, limit)
        course = leader.course
    middle = course + turn_rate * (period / 2.0)
    north, east = polar(ground_speed_on_course(known.airspeed, middle, *wind) * period, middle)
    course = course + turn_rate * period
    climb_rate = point.slope * ground_speed_on_course(known.airspeed, middle, *wind)
    ground_speed = ground_speed_on_course(known.airspeed, course, *wind)
    time_constant = known.rate_filter_s
    return LeaderState(
        time_s=follower.time_s,
        north=leader.north + north,
        east=leader.east + east,
        course=course,
        ground_speed=ground_speed,
        acceleration=low_pass(
            leader.acceleration,
            (ground_speed - leader.ground_speed) / period,
            period,
            time_constant,
        ),
        turn_rate=turn_rate,
        turn_acceleration=low_pass(
            leader.turn_acceleration, (turn_rate - leader.turn_rate) / period, period, time_constant
        ),
        height=leader.height + climb_rate * period,
        climb_rate=climb_rate,
    )


CALM_RAD, CALM_TURN_RAD = 0.004, 0.002
"""Course jitter (rad) at which measured and intended motion have equal weight: for speeds, and for courses
and turn rates. A compass adds 0.005, which moves a slot 50 m behind by 0.25 m; speeds have no such lever."""

SLOW_S = 1.0
"""Time constant that separates jitter from slower changes, s."""

WATCH_S = 8.0
"""Time constant of the jitter's mean square, s."""

MEMORY_S = 5.0
"""Time constant of the ground speed's difference from the plan, s."""

FAR_RAD = 0.15
"""Course difference (rad) above which a leader joins its path, and slots follow the measured motion."""

ON_PATH_S = 4.0
"""Time on the path before course differences count as jitter again, s."""

FADE_S = 0.5
"""Time constant of the jitter's fading while a leader joins, s: the weight fades in about ten times that."""

TRUST_S = 2.0
"""Time constant of the transition to a trusted plan and back, s."""

SMALL_BEND = 0.1
"""Scale below which bends of the path's field lose weight, rad: near the path its tangent is the intent."""

PLAN_RATE_S = 0.6
"""Time constant of the planned turn acceleration, s."""

TURN_STEP = 1e-3
"""Course step for the numerical derivative of the ground speed, rad."""


class PlannedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Motion of a leader at a place in a wind, by the mission alone."""

    course: float
    """Course, rad."""
    turn_per_m: float
    """Course change along the way, rad/m."""
    ground_speed: float
    """Ground speed, m/s."""
    acceleration: float
    """Acceleration, m/s²."""
    point: PathPoint[float]
    """Path point nearest to the leader."""

    @property
    def turn_rate(self) -> float:
        """Turn rate at the planned ground speed, rad/s."""
        return self.ground_speed * self.turn_per_m


class IntendedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Estimate of a leader's intended motion."""

    motion: LeaderState
    """True position with the intended course, speed and rates."""
    planned: PlannedMotion
    """Planned motion at the leader's place."""
    turn_acceleration: float
    """Turn acceleration of the plan, rad/s²."""
    speed: tuple[float, float]
    """Measured ground speed minus the planned one, filtered, m/s; and its rate, m/s²."""
    slow: tuple[float, float]
    """Slow part of the course difference, rad; and its rate, rad/s."""
    jitter: float
    """Mean square of the fast part, rad²."""
    far_s: float
    """Time of the last large course difference, s."""
    trust: float = 0.0
    """Weight of the plan alone, 0 to 1, for a leader on its path that is taken to fly as planned."""


def planned_motion(
    leader: LeaderState, known: KnownLeader, wind: tuple[float, float]
) -> PlannedMotion:
    """Return the mission's plan at the leader's place, in a mean wind (north, east, m/s)."""
    point = known.point_beside(leader)
    course, slope = bent_course(point, known.path_gains)
    ground_speed = ground_speed_on_course(known.airspeed, course, *wind)
    # The nearest point runs along the path while the leader closes on it.
    tangent_rate = tangent_rate_per_speed(point, course)
    turn_per_m = tangent_rate + slope * math.sin(course - point.course)
    further = ground_speed_on_course(known.airspeed, course + TURN_STEP, *wind)
    return PlannedMotion(
        course=course,
        turn_per_m=turn_per_m,
        ground_speed=ground_speed,
        acceleration=(further - ground_speed) / TURN_STEP * ground_speed * turn_per_m,
        point=point,
    )


def bent_course(point: PathPoint[float], gains: PathGains) -> tuple[float, float]:
    """Return the field's course (rad) and its slope over cross-track error (rad/m), small bends reduced."""
    bend = desired_course(point, gains.gain, gains.approach_angle) - point.course
    size = abs(bend)
    kept = size / (size + SMALL_BEND)
    slope = desired_course_slope(point.cross_track_error, gains.gain, gains.approach_angle)
    change = kept * (size + 2.0 * SMALL_BEND) / (size + SMALL_BEND)
    return point.course + kept * bend, change * slope


def intended_at_first(leader: LeaderState, planned: PlannedMotion) -> IntendedMotion:
    """Start from one state of the leader: intended is as measured."""
    difference = wrap_angle(leader.course - planned.course)
    return IntendedMotion(
        motion=leader,
        planned=planned,
        turn_acceleration=0.0,
        speed=(leader.ground_speed - planned.ground_speed, 0.0),
        slow=(difference, 0.0),
        jitter=0.0,
        far_s=leader.time_s,
    )


def intended_motion(
    before: IntendedMotion, leader: LeaderState, planned: PlannedMotion, *, as_planned: bool = False
) -> IntendedMotion:
    """Update the intended motion, to which slots are fixed, with a later state and its plan.

    `as_planned` assumes that a leader on its path flies as planned, whatever its course shows.
    """
    period = leader.time_s - before.motion.time_s
    difference = wrap_angle(leader.course - planned.course)
    slow = _tracked(before.slow, difference, period, SLOW_S)
    fast = wrap_angle(difference - slow[0])
    far_s = leader.time_s if abs(slow[0]) > FAR_RAD else before.far_s
    on_path = leader.time_s - far_s >= ON_PATH_S
    trust = low_pass(before.trust, 1.0 if as_planned and on_path else 0.0, period, TRUST_S)
    if on_path:
        jitter = low_pass(before.jitter, fast * fast, period, WATCH_S)
    else:
        # A gradual fade: slots would jump otherwise.
        jitter = low_pass(before.jitter, 0.0, period, FADE_S)
    turn_weight = max(jitter / (jitter + CALM_TURN_RAD * CALM_TURN_RAD), trust)
    speed_weight = max(jitter / (jitter + CALM_RAD * CALM_RAD), trust)
    speed = _tracked(before.speed, leader.ground_speed - planned.ground_speed, period, MEMORY_S)
    turn_acceleration = low_pass(
        before.turn_acceleration,
        (planned.turn_rate - before.planned.turn_rate) / period,
        period,
        PLAN_RATE_S,
    )

    # A leader on its path flies the path's course on average. Gusts that remain in an averaged difference
    # would swing the slots for seconds.
    meant_course = planned.course + (1.0 - turn_weight) * difference
    meant_speed = between(leader.ground_speed, planned.ground_speed + speed[0], speed_weight)
    north, east = polar(leader.ground_speed, leader.course)
    meant_north, meant_east = polar(meant_speed, meant_course)
    # The path's course changes with the leader's true speed along it, gusts included.
    passing = leader.ground_speed * math.cos(leader.course - planned.course)
    return IntendedMotion(
        motion=LeaderState(
            time_s=leader.time_s,
            north=leader.north,
            east=leader.east,
            course=meant_course,
            ground_speed=meant_speed,
            acceleration=between(
                leader.acceleration, planned.acceleration + speed[1], speed_weight
            ),
            turn_rate=between(leader.turn_rate, passing * planned.turn_per_m, turn_weight),
            turn_acceleration=between(leader.turn_acceleration, turn_acceleration, turn_weight),
            drift_north=north - meant_north,
            drift_east=east - meant_east,
            height=leader.height,
            climb_rate=leader.climb_rate,
        ),
        planned=planned,
        turn_acceleration=turn_acceleration,
        speed=speed,
        slow=slow,
        jitter=jitter,
        far_s=far_s,
        trust=trust,
    )


def between(measured: float, meant: float, weight: float) -> float:
    """Interpolate from the measured value at weight 0 to the intended one at weight 1."""
    return measured + weight * (meant - measured)


def _tracked(
    before: tuple[float, float], measured: float, period: float, memory_s: float
) -> tuple[float, float]:
    """Update (value, rate) of a second-order fading-memory filter; values must stay far from half a turn."""
    gain, rate_gain = fading_memory_2(period, memory_s)
    expected = before[0] + before[1] * period
    surprise = measured - expected
    return expected + gain * surprise, before[1] + rate_gain / period * surprise
