"""Slots: their motion, the field onto them, how the leader gives way to them, how a formation comes apart.

The dual field steers a follower onto its slot. The article's y_E and x_E, printed, have one sign that
diverges whichever way gamma_f is read; the pair here is consistent. Errors are resolved along and across
the slot's own motion, which on straight flight is the article's frame exactly and on a turn removes the
steady error that a rigid slot has there.

A formation without a leader comes apart: everyone turns away to the side of its own slot. Vehicles on one
side keep their distances: they turn by the same angle and fly at the same airspeed. Those on the leader's
track go straight on between the two groups.
"""

import math
from collections.abc import Sequence

import msgspec

from vfguide.elementwise import Number, clip, wrap_angle
from vfguide.guidance.wind_triangle import compose, resolve
from vfguide.state import Airframe, LeaderState, NamedState, VehicleState

LEAST_SLOT_SPEED = 3.0
"""m/s: V_l - omega g_y is held above this, so that a transient turn rate cannot reverse the slot's course."""


class Slot(NamedState, frozen=True, kw_only=True):
    """A place in the formation, in the leader's course frame: fixed there, unless it has rates."""

    forward: float
    """g_x, m ahead of the leader."""
    right: float
    """g_y, m to the right of the leader."""
    forward_rate: float = 0.0
    """dg_x/dt, m/s: of a slot that moves within the formation."""
    right_rate: float = 0.0
    """dg_y/dt, m/s."""
    forward_acceleration: float = 0.0
    """m/s²."""
    right_acceleration: float = 0.0
    """m/s²."""


class SlotMotion(NamedState, frozen=True, kw_only=True):
    """Where a slot is and how it moves over the ground."""

    north: float
    """m."""
    east: float
    """m."""
    course: float
    """chi_s, rad."""
    speed: float
    """V_s, m/s."""
    turn_rate: float
    """dchi_s/dt, rad/s."""
    acceleration: float
    """dV_s/dt, m/s²."""
    drift_north: float = 0.0
    """Of the leader, and with it of the slot: see `LeaderState`, m/s."""
    drift_east: float = 0.0
    """m/s."""


class FormationError(NamedState, frozen=True, kw_only=True):
    """Where the slot is, seen from the follower, in the frame of the slot's motion; and the rates."""

    along_track: float
    """x_E, m, positive where the slot is ahead: fly faster."""
    cross_track: float
    """y_E, m, positive where the slot is to the right: turn right."""
    along_track_rate: float
    """m/s."""
    cross_track_rate: float
    """m/s."""


def extrapolate_by_rates(leader: LeaderState, time_s: float) -> LeaderState:
    """The leader at another time, by constant dV/dt and turn acceleration along the arc between.

    The chord of the arc runs along the mean course at the mean speed; its error is of third order in the age.
    """
    age = time_s - leader.time_s
    mean_turn_rate = leader.turn_rate + leader.turn_acceleration * (age / 2.0)
    mean_course = leader.course + (leader.turn_rate + leader.turn_acceleration * (age / 3.0)) * (
        age / 2.0
    )
    chord = (leader.ground_speed + leader.acceleration * (age / 2.0)) * age
    return LeaderState(
        time_s=time_s,
        north=leader.north + chord * math.cos(mean_course) + leader.drift_north * age,
        east=leader.east + chord * math.sin(mean_course) + leader.drift_east * age,
        course=leader.course + mean_turn_rate * age,
        ground_speed=leader.ground_speed + leader.acceleration * age,
        acceleration=leader.acceleration,
        turn_rate=leader.turn_rate + leader.turn_acceleration * age,
        turn_acceleration=leader.turn_acceleration,
        drift_north=leader.drift_north,
        drift_east=leader.drift_east,
        height=leader.height + leader.climb_rate * age,
        climb_rate=leader.climb_rate,
    )


def slot_position(leader: LeaderState, slot: Slot) -> tuple[float, float]:
    """(north, east) of a slot, m: the leader's position plus the offset turned into its course."""
    north, east = compose(slot.forward, slot.right, leader.course)
    return leader.north + north, leader.east + east


def slot_velocity(ground_speed: Number, turn_rate: Number, slot: Slot) -> tuple[Number, Number]:
    """(along, right) of a slot's velocity in the leader's course frame, m/s.

    (V_l - omega g_y + dg_x/dt, omega g_x + dg_y/dt): on a turn the outer slot is faster and the rear one
    slips outward.
    """
    return (
        ground_speed - turn_rate * slot.right + slot.forward_rate,
        turn_rate * slot.forward + slot.right_rate,
    )


def slot_velocity_rate(leader: LeaderState, slot: Slot) -> tuple[float, float]:
    """(along, right): how a slot's velocity changes in the leader's course frame, m/s²."""
    return (
        leader.acceleration
        - leader.turn_acceleration * slot.right
        - leader.turn_rate * slot.right_rate
        + slot.forward_acceleration,
        leader.turn_acceleration * slot.forward
        + leader.turn_rate * slot.forward_rate
        + slot.right_acceleration,
    )


def slot_motion(leader: LeaderState, slot: Slot) -> SlotMotion:
    """Motion of a slot: chi_s, V_s and their rates, from those of the leader and of the slot in its frame."""
    north, east = slot_position(leader, slot)
    along, right = slot_velocity(leader.ground_speed, leader.turn_rate, slot)
    along = max(along, LEAST_SLOT_SPEED)
    along_rate, right_rate = slot_velocity_rate(leader, slot)
    speed = math.hypot(along, right)
    return SlotMotion(
        north=north,
        east=east,
        course=leader.course + math.atan2(right, along),
        speed=speed,
        turn_rate=leader.turn_rate + (along * right_rate - right * along_rate) / (speed * speed),
        acceleration=(along * along_rate + right * right_rate) / speed,
        drift_north=leader.drift_north,
        drift_east=leader.drift_east,
    )


def article_motion(leader: LeaderState, slot: Slot) -> SlotMotion:
    """The article's reading: every slot moves with the leader's course and speed, turning or not."""
    north, east = slot_position(leader, slot)
    return SlotMotion(
        north=north,
        east=east,
        course=leader.course,
        speed=leader.ground_speed,
        turn_rate=leader.turn_rate,
        acceleration=leader.acceleration,
    )


def formation_error(motion: SlotMotion, follower: VehicleState) -> FormationError:
    """x_E and y_E of a follower, and their rates in the turning frame of the slot's motion."""
    along, right = resolve(
        motion.north - follower.north, motion.east - follower.east, motion.course
    )
    drift_along, drift_right = resolve(motion.drift_north, motion.drift_east, motion.course)
    relative_course = wrap_angle(follower.course - motion.course)
    return FormationError(
        along_track=along,
        cross_track=right,
        along_track_rate=motion.speed
        + drift_along
        - follower.ground_speed * math.cos(relative_course)
        + motion.turn_rate * right,
        cross_track_rate=drift_right
        - follower.ground_speed * math.sin(relative_course)
        - motion.turn_rate * along,
    )


def arc_tangent_field(
    error: float, error_rate: float, gain: float, greatest: float
) -> tuple[float, float]:
    """Correction of a field and its rate: c (2/pi) atan(k e) and its derivative by the chain rule.

    Args:
        error: e, m.
        error_rate: de/dt, m/s.
        gain: k, 1/m.
        greatest: c, the correction far away: chi_inf in rad or V_inf in m/s.
    """
    scaled = gain * error
    share = greatest * (2.0 / math.pi)
    return share * math.atan(scaled), share * gain / (1.0 + scaled * scaled) * error_rate


def field_slope(gain: float, greatest: float) -> float:
    """Slope of a field on its slot, c (2/pi) k: correction (rad or m/s) for each metre of error.

    Args:
        gain: k, 1/m.
        greatest: c, rad or m/s.
    """
    return greatest * (2.0 / math.pi) * gain


def lyapunov(error: FormationError, course_error: float, speed_error: float, rho: float) -> float:
    """W = (x_E^2 + y_E^2) / 2 + rho (V~^2 + chi~^2) / 2, the function that matches the x_E / rho term.

    The article prints 1/(2 rho) there.
    """
    position = error.along_track * error.along_track + error.cross_track * error.cross_track
    rates = speed_error * speed_error + course_error * course_error
    return 0.5 * position + 0.5 * rho * rates


BREAKAWAY_ANGLE = math.radians(60.0)
"""Turn away from the leader's last course, rad."""

ON_TRACK_M = 5.0
"""A slot nearer than this to the leader's track is on neither side."""


def breakaway_course(leader_course: float, slot: Slot) -> float:
    """Course (rad) that leads a follower away from the others.

    Args:
        leader_course: the leader's last course, rad.
        slot: the follower's place in the formation.
    """
    if abs(slot.right) < ON_TRACK_M:
        return leader_course
    return leader_course + math.copysign(BREAKAWAY_ANGLE, slot.right)


MARGIN = 1.0
"""m/s that a follower keeps between what its slot needs and the ends of its airspeed range."""


class SlotLimits(msgspec.Struct, frozen=True, kw_only=True):
    """A slot, and the airspeed range of the vehicle that holds it."""

    slot: Slot
    """The slot."""
    airspeed_min: float
    """m/s."""
    airspeed_max: float
    """m/s."""


def slot_airspeed(state: VehicleState, turn_rate: float, slot: Slot) -> float:
    """Airspeed (m/s) that holding a slot takes: |slot velocity - wind|, the leader turning at turn_rate."""
    along, right = slot_velocity(state.ground_speed, turn_rate, slot)
    north, east = compose(along, right, state.course)
    return math.hypot(north - state.wind_north, east - state.wind_east)


def airspeed_that_gives_way(
    cruise: float,
    state: VehicleState,
    turn_rate: float,
    followers: Sequence[SlotLimits],
    airframe: Airframe,
) -> float:
    """The leader's airspeed (m/s): its cruise, moved by what the worst-off slots lack on either side.

    A slot's airspeed moves with the leader's nearly one to one, so the deficit that a slot would have at
    cruise is what the leader adds, and an excess is what it takes off.

    Args:
        cruise: airspeed of the mission, m/s.
        state: navigated state of the leader.
        turn_rate: of the path, rad/s.
        followers: slots and their vehicles' airspeed ranges.
        airframe: the leader's own.
    """
    deficit = excess = 0.0
    for follower in followers:
        needed = slot_airspeed(state, turn_rate, follower.slot) + (cruise - state.airspeed)
        deficit = max(deficit, follower.airspeed_min + MARGIN - needed)
        excess = max(excess, needed - (follower.airspeed_max - MARGIN))
    return clip(cruise + deficit - excess, airframe.airspeed_min, airframe.airspeed_max)
