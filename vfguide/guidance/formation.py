"""Slots: motion, vector field, breakaway, the leader's airspeed for its followers, and learned offsets.

**Field.** The dual field steers a follower onto its slot. In the article's printed y_E and x_E one sign
diverges, whichever way gamma_f is read; the pair here is consistent. Errors are resolved along and across the
slot's own motion. In straight flight that is exactly the article's frame; in a turn it removes the steady
error of a rigid slot.

**Breakaway.** Without a leader each follower turns away to its slot's side of the formation. Followers on one
side turn by the same angle at the same airspeed, and so keep their distances. Followers on the leader's track
go straight on between the two groups.

**Yielding airspeed.** The leader changes its airspeed where a slot needs more or less than its follower can
fly.

**Offset.** A field answers a lasting disturbance with a lasting error. So it aims at a point a learned offset
b beyond the slot, db/dt = e / T near the slot. With the field's slope s (1/s) on the slot, small errors obey
d²e/dt² + s de/dt + (s / T) e = 0: a damping of sqrt(s T) / 2 (integral action: Astrom and Murray, Feedback
Systems, 2nd edition, chapter 11).

Round a circle in wind, speeds and model errors vary with the course, and a mean offset follows a quarter of a
turn late. In turns the offset also has cosine and sine terms of the slot's course and of twice the course.
Each is learned in its own phase (adaptive feedforward cancellation: Bodson, Sacks and Khosla, IEEE
Transactions on Automatic Control 39(9), 1994).
"""

import math
from collections.abc import Sequence

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import Number, clip, wrap_angle
from vfguide.guidance.airframe import compose, resolve
from vfguide.state import Airframe, LeaderState, NamedState, VehicleState

LEAST_SLOT_SPEED = 3.0
"""Lower bound of V_l - omega g_y, m/s, so that a transient turn rate cannot reverse the slot's course."""


class Slot(NamedState, frozen=True, kw_only=True):
    """Place in the formation, in the leader's course frame: fixed there unless it has rates."""

    forward: float
    """g_x, m ahead of the leader."""
    right: float
    """g_y, m to the right of the leader."""
    forward_rate: float = 0.0
    """dg_x/dt, m/s, of a slot that moves within the formation."""
    right_rate: float = 0.0
    """dg_y/dt, m/s."""
    forward_acceleration: float = 0.0
    """d²g_x/dt², m/s²."""
    right_acceleration: float = 0.0
    """d²g_y/dt², m/s²."""


class SlotMotion(NamedState, frozen=True, kw_only=True):
    """Position of a slot and its motion over ground."""

    north: float
    """North coordinate, m."""
    east: float
    """East coordinate, m."""
    course: float
    """chi_s, rad."""
    speed: float
    """V_s, m/s."""
    turn_rate: float
    """dchi_s/dt, rad/s."""
    acceleration: float
    """dV_s/dt, m/s²."""
    drift_north: float = 0.0
    """Drift of the leader and its slots toward north, m/s: see `LeaderState`."""
    drift_east: float = 0.0
    """Drift toward east, m/s."""


class FormationError(NamedState, frozen=True, kw_only=True):
    """Position of the slot relative to the follower in the frame of the slot's motion, and its rates."""

    along_track: float
    """x_E, m, positive where the slot is ahead: fly faster."""
    cross_track: float
    """y_E, m, positive where the slot is to the right: turn right."""
    along_track_rate: float
    """dx_E/dt, m/s."""
    cross_track_rate: float
    """dy_E/dt, m/s."""


def extrapolate_by_rates(leader: LeaderState, time_s: float) -> LeaderState:
    """Extrapolate the leader to another time at constant dV/dt and turn acceleration.

    The chord of the arc runs along the mean course at the mean speed: an error of third order in the age.
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
    """Return (north, east) of a slot, m: the leader's position plus the offset turned into its course."""
    north, east = compose(slot.forward, slot.right, leader.course)
    return leader.north + north, leader.east + east


def slot_velocity(ground_speed: Number, turn_rate: Number, slot: Slot) -> tuple[Number, Number]:
    """Return (along, right) of a slot's velocity in the leader's course frame, m/s.

    (V_l - omega g_y + dg_x/dt, omega g_x + dg_y/dt): in a turn outer slots are faster, rear slots drift out.
    """
    return (
        ground_speed - turn_rate * slot.right + slot.forward_rate,
        turn_rate * slot.forward + slot.right_rate,
    )


def slot_velocity_rate(leader: LeaderState, slot: Slot) -> tuple[float, float]:
    """Return (along, right) of the slot velocity's rate in the leader's course frame, m/s²."""
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
    """Return a slot's motion: chi_s, V_s and their rates."""
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
    """Return the article's slot motion: every slot has the leader's course and speed, turning or not."""
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
    """Return x_E and y_E of a follower, and their rates in the turning frame of the slot's motion."""
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
    """Return a field's correction and its rate: c (2/pi) atan(k e), and its derivative by the chain rule.

    Error e in m, its rate in m/s, gain k in 1/m; `greatest` is c, chi_inf in rad or V_inf in m/s.
    """
    scaled = gain * error
    share = greatest * (2.0 / math.pi)
    return share * math.atan(scaled), share * gain / (1.0 + scaled * scaled) * error_rate


def field_slope(gain: float, greatest: float) -> float:
    """Return the field's slope on its slot, c (2/pi) k (see `arc_tangent_field`): rad or m/s per metre."""
    return greatest * (2.0 / math.pi) * gain


def lyapunov(error: FormationError, course_error: float, speed_error: float, rho: float) -> float:
    """Return W = (x_E^2 + y_E^2) / 2 + rho (V~^2 + chi~^2) / 2, which matches the x_E / rho term.

    The article prints 1/(2 rho) instead of rho / 2.
    """
    position = error.along_track * error.along_track + error.cross_track * error.cross_track
    rates = speed_error * speed_error + course_error * course_error
    return 0.5 * position + 0.5 * rho * rates


BREAKAWAY_ANGLE = math.radians(60.0)
"""Turn away from the leader's last course, rad."""

ON_TRACK_M = 5.0
"""Distance from the leader's track below which a slot is on neither side, m."""


def breakaway_course(leader_course: float, slot: Slot) -> float:
    """Return the course (rad) that leads a follower away from the others, given the leader's last (rad)."""
    if abs(slot.right) < ON_TRACK_M:
        return leader_course
    return leader_course + math.copysign(BREAKAWAY_ANGLE, slot.right)


MARGIN = 1.0
"""Speed that a follower keeps between its slot's need and the ends of its airspeed range, m/s."""


class SlotLimits(msgspec.Struct, frozen=True, kw_only=True):
    """Slot and the airspeed range of its vehicle."""

    slot: Slot
    """Place in the formation."""
    airspeed_min: float
    """Lowest airspeed, m/s."""
    airspeed_max: float
    """Highest airspeed, m/s."""


def slot_airspeed(state: VehicleState, turn_rate: float, slot: Slot) -> float:
    """Return the airspeed (m/s) that a slot needs: |slot velocity - wind| at a leader's turn rate (rad/s)."""
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
    """Return the leader's airspeed (m/s): cruise, changed by the worst deficit and excess of the slots.

    A slot's airspeed changes almost one to one with the leader's. So the leader adds the deficit that a slot
    would have at cruise (m/s), and subtracts an excess. `turn_rate` is the path's, rad/s.
    """
    deficit = excess = 0.0
    for follower in followers:
        needed = slot_airspeed(state, turn_rate, follower.slot) + (cruise - state.airspeed)
        deficit = max(deficit, follower.airspeed_min + MARGIN - needed)
        excess = max(excess, needed - (follower.airspeed_max - MARGIN))
    return clip(cruise + deficit - excess, airframe.airspeed_min, airframe.airspeed_max)


NEAR_M = 2.0
"""Error at which learning is half as fast, m; beyond, it nearly stops. On the way to the slot the error is no
sign of a disturbance."""

GREATEST_M = 5.0
"""Bound of the offset on each axis, m."""


IN_GUSTS = 0.9
"""Reduction of learning in full gusts: their errors vanish before they are learned."""

HARMONICS = (1.0, 2.0)
"""Multiples of the slot's course in the offset: in steady wind its ground speed has hardly any others."""

TURNING_RAD_S = 0.04
"""Turn rate at which harmonics have half weight, rad/s: in straight flight they look like the mean."""


class Harmonic(msgspec.Struct, frozen=True, kw_only=True):
    """Part of the offset that varies with a multiple of the slot's course, m."""

    ahead_cosine: float
    ahead_sine: float
    right_cosine: float
    right_sine: float


class Offset(msgspec.Struct, frozen=True, kw_only=True):
    """Offset b from the slot to the field's aim point, in the frame of the slot's motion."""

    ahead: float
    """Mean along the slot's motion, m, positive ahead."""
    right: float
    """Mean across the slot's motion, m, positive right."""
    harmonics: tuple[Harmonic, ...]
    """One for each of `HARMONICS`."""


def no_offset() -> Offset:
    """Return the offset before anything is learned."""
    still = Harmonic(ahead_cosine=0.0, ahead_sine=0.0, right_cosine=0.0, right_sine=0.0)
    return Offset(ahead=0.0, right=0.0, harmonics=(still,) * len(HARMONICS))


def nearness(error: FormationError) -> float:
    """Return the weight of an error in learning, 1 / (1 + (e / NEAR_M)^4): 1 in the slot, 1/2 at `NEAR_M`."""
    squared = (
        error.along_track * error.along_track + error.cross_track * error.cross_track
    ) / NEAR_M**2
    return 1.0 / (1.0 + squared * squared)


def learning_rate(
    error: FormationError, integral_s: float, gust_share: float = 0.0
) -> tuple[float, float]:
    """Return (ahead, right) db/dt of the mean offset, m/s.

    `integral_s` is T, s; 0 learns nothing. `gust_share` (0 to 1) of the error is due to gusts and does not
    last.
    """
    if integral_s <= 0.0:
        return 0.0, 0.0
    share = nearness(error) * (1.0 - IN_GUSTS * gust_share) / integral_s
    return share * error.along_track, share * error.cross_track


def turning_share(turn_rate: float) -> float:
    """Return the weight of harmonics at a turn rate (rad/s): 0 in straight flight, near 1 in a turn."""
    squared = turn_rate * turn_rate
    return squared / (squared + TURNING_RAD_S**2)


def harmonic_share(turn_rate: float, integral_s: float) -> float:
    """Return a harmonic's learning rate relative to the mean's, at most 1, at the slot's turn rate (rad/s).

    A harmonic learned in less than a turn would look like the mean. `integral_s` is T, s.
    """
    return clip(abs(turn_rate) * integral_s, 0.0, 1.0)


def learning_growth(turn_rate: float, integral_s: float) -> float:
    """Return the learning rate of the whole offset relative to the mean's, 1 or more."""
    share = turning_share(turn_rate) * harmonic_share(turn_rate, integral_s)
    return 1.0 + share * float(len(HARMONICS))


def aimed_error(
    error: FormationError,
    offset: Offset,
    integral_s: float,
    motion: SlotMotion,
    gust_share: float = 0.0,
) -> FormationError:
    """Return error and rate from the field's aim point, e + b and de/dt + db/dt: see `learning_rate`."""
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
    """Return (ahead, right) of the whole offset, m, and their rates due to the slot's turn, m/s."""
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
    """Update the offset by one step of `period` seconds; see `learning_rate`.

    `held` is true where a limit or something other than the field decides: learning would wind up.
    """
    if held:
        return offset
    ahead_rate, right_rate = learning_rate(error, integral_s, gust_share)
    share = harmonic_share(motion.turn_rate, integral_s)
    ahead, right, _, _ = sum_of(offset, motion)
    # Where the whole offset is at its bound, its parts would wind up.
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
