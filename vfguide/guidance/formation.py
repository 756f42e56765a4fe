"""Slots: their motion, the field onto them, breaking away, giving way, and learned offsets.

**Field.** The dual field steers a follower onto its slot. The article's y_E and x_E, printed, have one sign
that diverges whichever way gamma_f is read; the pair here is consistent. Errors are resolved along and across
the slot's own motion. On straight flight that is the article's frame exactly; on a turn it removes the steady
error that a rigid slot has there.

**Breaking away.** Without a leader each follower turns away to the side of its own slot. Those on one side
turn by the same angle at the same airspeed, and so keep their distances. Those on the leader's track go
straight on between the two groups.

**Giving way.** The leader changes its airspeed where a slot needs more or less than its follower can fly.

**Offset.** A field answers a lasting disturbance with a lasting error. So it is put around a point that lies
a learned offset b beyond the slot, db/dt = e / T near the slot. With the field's slope s (1/s) at its middle
small errors obey d²e/dt² + s de/dt + (s / T) e = 0: a damping of sqrt(s T) / 2 (integral action: Astrom and
Murray, Feedback Systems, 2nd edition, chapter 11).

Round a circle in wind, speeds and the autopilot model's errors vary with the course. A mean offset follows a
quarter of a turn late. So in turns the offset also has parts that go as cosine and sine of the slot's course,
and of twice the course, each learned in its own phase (adaptive feedforward cancellation: Bodson, Sacks and
Khosla, IEEE Transactions on Automatic Control 39(9), 1994).
"""

import math
from collections.abc import Sequence

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import Number, clip, wrap_angle
from vfguide.guidance.airframe import compose, resolve
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


NEAR_M = 2.0
"""m: an error of this size is learned from half as fast, and a greater one hardly. On the way to the slot the
error is no sign of a disturbance."""

GREATEST_M = 5.0
"""m: of the offset on each axis."""


IN_GUSTS = 0.9
"""In gusts so much less is learned of an error: it is gone before it is known."""

HARMONICS = (1.0, 2.0)
"""Multiples of the slot's course that an offset is learned for: in a steady wind a slot's ground speed has
hardly any more."""

TURNING_RAD_S = 0.04
"""Turn rate at which harmonics count by half: on a straight they could not be told from the mean."""


class Harmonic(msgspec.Struct, frozen=True, kw_only=True):
    """A part of the offset that goes round with the slot's course, m."""

    ahead_cosine: float
    ahead_sine: float
    right_cosine: float
    right_sine: float


class Offset(msgspec.Struct, frozen=True, kw_only=True):
    """b: how far beyond the slot the field aims, in the frame of the slot's motion."""

    ahead: float
    """Mean, m along the slot's motion."""
    right: float
    """Mean, m across it."""
    harmonics: tuple[Harmonic, ...]
    """One for each of `HARMONICS`."""


def no_offset() -> Offset:
    """Nothing was learned yet."""
    still = Harmonic(ahead_cosine=0.0, ahead_sine=0.0, right_cosine=0.0, right_sine=0.0)
    return Offset(ahead=0.0, right=0.0, harmonics=(still,) * len(HARMONICS))


def nearness(error: FormationError) -> float:
    """Share of an error that is learned from: 1 in the slot, 1/2 at `NEAR_M`, with the fourth power."""
    squared = (
        error.along_track * error.along_track + error.cross_track * error.cross_track
    ) / NEAR_M**2
    return 1.0 / (1.0 + squared * squared)


def learning_rate(
    error: FormationError, integral_s: float, gust_share: float = 0.0
) -> tuple[float, float]:
    """(ahead, right) db/dt of the mean offset, m/s.

    Args:
        error: from the slot.
        integral_s: T, s; 0 learns nothing.
        gust_share: 0 to 1: how far errors are those of gusts, which do not last.
    """
    if integral_s <= 0.0:
        return 0.0, 0.0
    share = nearness(error) * (1.0 - IN_GUSTS * gust_share) / integral_s
    return share * error.along_track, share * error.cross_track


def turning_share(turn_rate: float) -> float:
    """How far harmonics count at a turn rate (rad/s): 0 on a straight, 1 in a turn."""
    squared = turn_rate * turn_rate
    return squared / (squared + TURNING_RAD_S**2)


def harmonic_share(turn_rate: float, integral_s: float) -> float:
    """How fast a harmonic is update_offset, in parts of the mean: as fast, but no faster than the slot turns.

    What is learned within less of a turn could not be told from the mean.

    Args:
        turn_rate: of the slot, rad/s.
        integral_s: T, s.
    """
    return clip(abs(turn_rate) * integral_s, 0.0, 1.0)


def learning_growth(turn_rate: float, integral_s: float) -> float:
    """How much faster than a mean alone all parts together are learned: 1 or more. Arguments as above."""
    share = turning_share(turn_rate) * harmonic_share(turn_rate, integral_s)
    return 1.0 + share * float(len(HARMONICS))


def aimed_error(
    error: FormationError,
    offset: Offset,
    integral_s: float,
    motion: SlotMotion,
    gust_share: float = 0.0,
) -> FormationError:
    """The error from the point that the field aims at, and its rate: e + b and de/dt + db/dt.

    Args:
        error: from the slot.
        offset: b.
        integral_s: T, s; 0 learns nothing.
        motion: of the slot.
        gust_share: see `learning_rate`.
    """
    if integral_s <= 0.0:
        return error
    growth = learning_growth(motion.turn_rate, integral_s)
    ahead, right, ahead_rate, right_rate = sum_of(offset, motion)
    ahead_growth, right_growth = learning_rate(error, integral_s, gust_share)
    return replace(
        error,
        along_track=error.along_track + clip(ahead, -GREATEST_M, GREATEST_M),
        cross_track=error.cross_track + clip(right, -GREATEST_M, GREATEST_M),
        along_track_rate=error.along_track_rate + growth * ahead_growth + ahead_rate,
        cross_track_rate=error.cross_track_rate + growth * right_growth + right_rate,
    )


def sum_of(offset: Offset, motion: SlotMotion) -> tuple[float, float, float, float]:
    """(ahead, right) of all parts together, m, and how they change as the slot turns, m/s."""
    share = turning_share(motion.turn_rate)
    ahead, right = offset.ahead, offset.right
    ahead_rate = right_rate = 0.0
    for multiple, one in zip(HARMONICS, offset.harmonics, strict=True):
        cosine, sine = (
            share * math.cos(multiple * motion.course),
            share * math.sin(multiple * motion.course),
        )
        turn_rate = multiple * motion.turn_rate
        ahead = ahead + one.ahead_cosine * cosine + one.ahead_sine * sine
        right = right + one.right_cosine * cosine + one.right_sine * sine
        ahead_rate = ahead_rate + turn_rate * (one.ahead_sine * cosine - one.ahead_cosine * sine)
        right_rate = right_rate + turn_rate * (one.right_sine * cosine - one.right_cosine * sine)
    return ahead, right, ahead_rate, right_rate


def update_offset(
    offset: Offset,
    error: FormationError,
    integral_s: float,
    motion: SlotMotion,
    *,
    period: float,
    held: bool,
    gust_share: float = 0.0,
) -> Offset:
    """The offset a step later.

    Args:
        offset: b until now.
        error: of the step.
        integral_s: T; 0 learns nothing.
        motion: of the slot.
        period: since the step before, s.
        held: where something else than the field decides, or a limit: learning would only wind up.
        gust_share: see `learning_rate`.
    """
    if held:
        return offset
    ahead_rate, right_rate = learning_rate(error, integral_s, gust_share)
    share = harmonic_share(motion.turn_rate, integral_s)
    ahead, right, _, _ = sum_of(offset, motion)
    # Beyond the bound of all parts together each of them would only wind up.
    if abs(ahead) >= GREATEST_M and ahead * ahead_rate > 0.0:
        ahead_rate = 0.0
    if abs(right) >= GREATEST_M and right * right_rate > 0.0:
        right_rate = 0.0

    def grown(part: float, rate: float) -> float:
        return clip(part + rate * period, -GREATEST_M, GREATEST_M)

    harmonics = []
    for multiple, one in zip(HARMONICS, offset.harmonics, strict=True):
        cosine, sine = (
            share * math.cos(multiple * motion.course),
            share * math.sin(multiple * motion.course),
        )
        harmonics.append(
            Harmonic(
                ahead_cosine=grown(one.ahead_cosine, cosine * ahead_rate),
                ahead_sine=grown(one.ahead_sine, sine * ahead_rate),
                right_cosine=grown(one.right_cosine, cosine * right_rate),
                right_sine=grown(one.right_sine, sine * right_rate),
            )
        )
    return Offset(
        ahead=grown(offset.ahead, ahead_rate),
        right=grown(offset.right, right_rate),
        harmonics=tuple(harmonics),
    )
