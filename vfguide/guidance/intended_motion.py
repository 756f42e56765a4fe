"""How a leader means to fly: carried on along its path where it is not heard, and split from what shakes it.

Of a leader that is not heard: for a second, dV/dt and omega of its last state say best where a leader is.
After that the path does: it is in the mission, the leader's airspeed is too, and the wind is measured by
every follower itself.

Of a leader that is heard: slots stand in the leader's course frame and turn with it, so whatever shakes
the leader's course swings a slot 50 m away by 50 m times the angle, and asks its follower for turns that
help nothing. A gust that takes leader and follower alike asks it for speeds that they both have already.
A formation means to fly along its path at its airspeed, in the mean wind: that is known where the
leader's place is. What the leader is seen to do is split into that and a difference. The more the course
jitters, the less the difference counts: in calm air slots follow the measured motion at once, in turbulence
the meant one (the weight is that of a Wiener filter, signal power over signal and noise power).
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
    """What the mission tells about the leader."""

    path: Path
    """The path that the leader follows."""
    path_gains: PathGains
    """The field around it."""
    airspeed: float
    """Cruise of the leader, m/s."""
    rate_filter_s: float
    """Time constant of its rates, s."""
    height: float = 0.0
    """The mission's flying height, from which the path's heights count, m above the origin."""
    least_radius: float = 0.0
    """It turns no tighter onto its path, m; 0 where that is left to the field."""

    def point_beside(self, leader: LeaderState) -> PathPoint[float]:
        """The point of the leader's path nearest to where it is."""
        return self.path.nearest_in_space(
            leader.north, leader.east, leader.course, leader.height - self.height
        )


def extrapolate_along_path(
    leader: LeaderState, follower: VehicleState, known: KnownLeader
) -> LeaderState:
    """The leader at the follower's time, had it kept to its field, its airspeed and the follower's wind.

    One step of at most some tenths of a second; longer silences are made of many.

    Args:
        leader: as last heard, or carried on before.
        follower: navigated state of the follower, later than that.
        known: what the mission tells.
    """
    period = follower.time_s - leader.time_s
    point = known.point_beside(leader)
    field = (known.path_gains.gain, known.path_gains.approach_angle)
    course = desired_course(point, *field)
    wind = (follower.wind_north, follower.wind_east)
    # The speed is that of the middle of the step: taken at its beginning, it would be late all the way
    # round a circle in wind, by decimetres each half turn.
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
            leader.turn_acceleration,
            (turn_rate - leader.turn_rate) / period,
            period,
            time_constant,
        ),
        height=leader.height + climb_rate * period,
        climb_rate=climb_rate,
    )


CALM_RAD, CALM_TURN_RAD = 0.004, 0.002
"""Jitter of the course at which measured and meant motion count alike: for speeds, and for courses and turn
rates. A compass adds 0.005, which moves a slot 50 m behind by 0.25 m; no such lever enlarges a speed."""

SLOW_S = 1.0
"""What changes more slowly than this is no jitter."""

WATCH_S = 8.0
"""Memory of the jitter."""

MEMORY_S = 5.0
"""Memory of the ground speed's difference from what is meant."""

FAR_RAD = 0.15
"""A leader whose course differs by more than this is on its way to its path: that is no jitter, and slots
follow the measured motion."""

ON_PATH_S = 4.0
"""Nor is what is left of that for so long."""

FADE_S = 0.5
"""In this time slots go over to the measured motion: the weight fades in about ten of it."""

TRUST_S = 2.0
"""In this time slots go over to a plan that is trusted, and back."""

SMALL_BEND = 0.1
"""rad: bends of the path's field that are smaller count less and less: near the path its tangent is meant."""

PLAN_RATE_S = 0.6
"""Time constant of how the planned turn rate changes."""

TURN_STEP = 1e-3
"""rad: over which the change of the ground speed with the course is found."""


class PlannedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """What the mission alone says of a leader at a place, in a wind."""

    course: float
    """rad."""
    turn_per_m: float
    """How the course changes along the way, rad/m."""
    ground_speed: float
    """m/s."""
    acceleration: float
    """m/s²."""
    point: PathPoint[float]
    """The point of the path nearest to the leader."""

    @property
    def turn_rate(self) -> float:
        """At the planned ground speed, rad/s."""
        return self.ground_speed * self.turn_per_m


class IntendedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """What is known of how a leader means to fly."""

    motion: LeaderState
    """The true place, and the intended course, speed and rates."""
    planned: PlannedMotion
    """At that place."""
    turn_acceleration: float
    """Turn acceleration of the plan, rad/s²."""
    speed: tuple[float, float]
    """Measured ground speed minus the planned one, filtered, m/s; and its rate, m/s²."""
    slow: tuple[float, float]
    """The difference of the course without what is fast in it, rad; and its rate, rad/s."""
    jitter: float
    """Mean square of what is fast in it, rad²."""
    far_s: float
    """When that difference was last a great one, s."""
    trust: float = 0.0
    """How far slots are fixed to the plan alone: 1 on the path of one that is taken to fly as planned."""


def planned_motion(
    leader: LeaderState, known: KnownLeader, wind: tuple[float, float]
) -> PlannedMotion:
    """What the mission says of a leader where it is, in a mean wind (north, east, m/s)."""
    point = known.point_beside(leader)
    course, slope = bent_course(point, known.path_gains)
    ground_speed = ground_speed_on_course(known.airspeed, course, *wind)
    # It runs along the path, and towards it on that course.
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
    """(course of the field in rad, its change with the cross-track error in rad/m), small bends left out."""
    bend = desired_course(point, gains.gain, gains.approach_angle) - point.course
    size = abs(bend)
    kept = size / (size + SMALL_BEND)
    slope = desired_course_slope(point.cross_track_error, gains.gain, gains.approach_angle)
    change = kept * (size + 2.0 * SMALL_BEND) / (size + SMALL_BEND)
    return point.course + kept * bend, change * slope


def intended_at_first(leader: LeaderState, planned: PlannedMotion) -> IntendedMotion:
    """From one state of the leader alone: as it flies."""
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
    before: IntendedMotion,
    leader: LeaderState,
    planned: PlannedMotion,
    *,
    as_planned: bool = False,
) -> IntendedMotion:
    """The motion that slots are fixed to.

    Args:
        before: the estimate before.
        leader: as it was heard, later than that.
        planned: see `planned_motion`, for this state.
        as_planned: whether a leader on its path is taken to fly on as planned, whatever its course shows.
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
        # Not at once: slots would jump.
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

    # A leader that stays on its path flies the path's course on average: what is left of its gusts in an
    # average of the difference would swing the slots for seconds.
    meant_course = planned.course + (1.0 - turn_weight) * difference
    meant_speed = between(leader.ground_speed, planned.ground_speed + speed[0], speed_weight)
    north, east = polar(leader.ground_speed, leader.course)
    meant_north, meant_east = polar(meant_speed, meant_course)
    # The path turns beneath the leader as fast as it truly passes along it, gusts included.
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
    """Return a value between the measured one, of weight 0, and the meant one, of weight 1."""
    return measured + weight * (meant - measured)


def _tracked(
    before: tuple[float, float], measured: float, period: float, memory_s: float
) -> tuple[float, float]:
    """(value, rate) of a second-order fading-memory filter; values are differences, far from half a turn."""
    gain, rate_gain = fading_memory_2(period, memory_s)
    expected = before[0] + before[1] * period
    surprise = measured - expected
    return expected + gain * surprise, before[1] + rate_gain / period * surprise
