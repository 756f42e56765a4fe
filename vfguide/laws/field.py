"""Dual field that steers a follower onto its slot: around the slot's own motion, and the article's.

    chi_d = chi_s + chi_inf (2/pi) atan(k_y y_E)        V_d = V_s + V_inf (2/pi) atan(k_x x_E)

The article uses the leader's course and speed as the slot's, which leaves an error in every turn. The
sliding-mode laws of course and speed follow either field.

Field and laws are kept within the aircraft's bandwidth (`response.py`). A law slower than its hold feeds the
measured speed back through the setpoint V + (dV/dt)/beta. A hold that is not of first order (ArduPlane's
responds at once by pitch, seconds later by throttle) rings on it. For a total-energy hold the speed law is
made just so fast that the measured speed drops out.
"""

import copy
import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from msgspec.structs import replace
from pydantic import Field

from vfguide.elementwise import FloatArray, wrap_angle
from vfguide.guidance.airframe import bank_limited_turn_rate, resolve
from vfguide.guidance.formation import (
    FormationError,
    Offset,
    Slot,
    SlotMotion,
    aimed_error,
    arc_tangent_field,
    article_motion,
    field_slope,
    learning_growth,
    no_offset,
    update_offset,
)
from vfguide.guidance.response import Bandwidth
from vfguide.guidance.sliding_laws import sliding_acceleration, sliding_course_rate
from vfguide.laws.base import DesiredMotion, Law, View, law
from vfguide.mission import quantity
from vfguide.mission.feasibility import effective_layer
from vfguide.mission.finding import Finding, no_more_than, told_apart
from vfguide.mission.flight_limits import Conditions
from vfguide.mission.model import Mission
from vfguide.mission.quantity import Duration, Gain, Section, Switch
from vfguide.state import LeaderState


class FieldGains(Section):
    """Shape of the dual field."""

    k_x: Annotated[Gain, Field(le=10.0)] = 0.2
    """How sharply speed answers the error along track, 1/m."""

    k_y: Annotated[Gain, Field(le=10.0)] = 0.2
    """How sharply course answers the error across track, 1/m."""

    chi_inf_deg: Annotated[quantity.Number, Field(ge=1.0, le=90.0)] = 45.0
    """chi_inf of the article: largest course correction of a follower, degrees."""

    v_inf_m_s: Annotated[quantity.Number, Field(ge=0.1, le=100.0)] = 8.0
    """V_inf of the article: largest speed correction of a follower, m/s."""

    rate_feedforward: Switch = True
    """Let a follower's field know how the slot's course and speed change."""

    @property
    def chi_inf(self) -> float:
        """chi_inf, rad."""
        return math.radians(self.chi_inf_deg)


class SlotGains(FieldGains):
    """The dual field around the slot's own motion."""

    integral_s: Duration | None = None
    """Time in which the field of type `slot` learns what keeps a follower off its slot, s; 0: never. Absent:
    as fast as the field bears it."""


class ArticleGains(FieldGains):
    """The article's dual field."""

    exact: Switch = False
    """Fly the gains as they are written, whatever the aircraft bears, as the article does."""


def field_motion(motion: SlotMotion, error: FormationError, gains: FieldGains) -> DesiredMotion:
    """Return the motion that the dual field demands for an error, with the field's own rates."""
    turn, turn_rate = arc_tangent_field(
        error.cross_track, error.cross_track_rate, gains.k_y, gains.chi_inf
    )
    push, push_rate = arc_tangent_field(
        error.along_track, error.along_track_rate, gains.k_x, gains.v_inf_m_s
    )
    return DesiredMotion(
        course=motion.course + turn,
        course_rate=motion.turn_rate + turn_rate,
        speed=motion.speed + push,
        acceleration=motion.acceleration + push_rate,
    )


@law("slot")
class SlotField(Law):
    """Dual field around the slot's motion, with an integral that learns lasting errors."""

    Gains: ClassVar[type[Section]] = SlotGains
    forgets_when_held = False
    answers_course_error = True
    """Whether a follower turns toward its field, or with its slot alone where only its speed matters."""

    chosen: FieldGains
    """Gains of the mission, before the aircraft's bandwidth bounds them."""

    follows_drift = True
    """Whether the speed follows gusts on the leader at once; an autopilot with delay would be too late."""

    @property
    def integral_s(self) -> float:
        """T: time constant of the learning of lasting errors, s; 0 learns nothing.

        Without a value in the mission it is 4 / s for the slower field, a damping of 1.
        """
        gains = self.gains
        if gains.integral_s is not None:
            return float(gains.integral_s)
        along = field_slope(gains.k_x, gains.v_inf_m_s)
        across = field_slope(gains.k_y, gains.chi_inf) * self.airframe.cruise
        return max(4.0 / along, 4.0 / across)

    def start(self, view: View) -> Offset:
        """Return the offset before anything is learned."""
        del view
        return no_offset()

    def step(self, view: View, memory: Offset) -> tuple[DesiredMotion, Offset]:
        """Return the motion of the dual field through the sliding-mode laws."""
        state, motion, sliding = view.state, view.motion, self.settings.sliding
        if not self.gains.rate_feedforward:
            motion = replace(motion, turn_rate=0.0, acceleration=0.0)
        aimed = aimed_error(view.error, memory, self.integral_s, view.motion, view.state.gust_share)
        field = field_motion(motion, aimed, self.gains)
        if self.follows_drift:
            drift, _ = resolve(motion.drift_north, motion.drift_east, motion.course)
            field = replace(field, speed=field.speed + drift)
        layers = [
            sliding.layer_in(state, self.airframe, view.period, bandwidth)
            for bandwidth in (sliding.course_bandwidth, sliding.speed_bandwidth)
        ]
        course_rate = motion.turn_rate
        if self.answers_course_error:
            course_error = wrap_angle(state.course - field.course)
            course_rate = sliding_course_rate(
                course_error, field.course_rate, sliding.kappa, layers[0]
            )
        acceleration = sliding_acceleration(
            state.ground_speed - field.speed,
            aimed.along_track,
            field.acceleration,
            gain=sliding.kappa,
            layer=layers[1],
            rho=sliding.rho,
        )
        return replace(field, course_rate=course_rate, acceleration=acceleration), memory

    def learn(self, view: View, memory: Offset, *, limited: bool) -> Any:  # noqa: ANN401 - of the law's own memory
        """Return the updated offset; it stays while something else is flown, or at a limit."""
        held = view.held or limited
        return update_offset(
            memory,
            view.error,
            self.integral_s,
            view.motion,
            period=view.period,
            held=held,
            gust_share=view.state.gust_share,
        )

    def expected_motion(self, motion: SlotMotion, error: FormationError) -> tuple[float, float]:
        """Return the course and speed of the mission's field."""
        expected = field_motion(motion, error, self.gains)
        return expected.course, expected.speed

    def within(self, bandwidth: Bandwidth) -> Self:
        """Return the law with its fields, and the laws beneath them, within a bandwidth."""
        bounded = super().within(bandwidth)
        bounded.settings = replace(
            self.settings,
            sliding=replace(
                self.settings.sliding,
                course_bandwidth=bandwidth.course,
                speed_bandwidth=bandwidth.speed,
            ),
        )
        bounded.chosen = self.gains
        bounded.gains = bounded_field(
            self.gains,
            k_x=bandwidth.speed_field / field_slope(1.0, self.gains.v_inf_m_s),
            k_y=bandwidth.course_field
            / (field_slope(1.0, self.gains.chi_inf) * self.airframe.cruise),
        )
        bounded.follows_drift = self.airframe.is_ideal
        return bounded

    def for_speed(self) -> Self:
        """Return the speed law for an autopilot with delay: for total-energy holds, free of measured speed.

        With the gains g of the speed law and k of its field, V + (dV/dt)/beta contains 1 - (g + k)/beta of
        the measured speed. g = beta - k removes it, and k is at most half of g. Course oscillations about the
        field then do not change the airspeed either.
        """
        sliding, beta = self.settings.sliding, self.airframe.beta
        if self.airframe.speed_hold == "first-order" or sliding.boundary_layer_factor <= 0.0:
            return self
        slope = field_slope(1.0, self.gains.v_inf_m_s)
        k_x = min(self.chosen.k_x, self.bandwidth.energy_field / slope)
        quiet = copy.copy(self)
        quiet.gains = self.gains.model_copy(update={"k_x": k_x})
        quiet.settings = replace(
            self.settings,
            sliding=replace(sliding, loop_delay_s=0.0, speed_bandwidth=beta - slope * k_x),
        )
        quiet.answers_course_error = False
        return quiet

    @classmethod
    def findings(cls, mission: Mission, conditions: Conditions) -> Iterator[Finding]:
        """Yield findings on loops that do not fit each other or the turns."""
        gains: Any = mission.controller
        return field_findings(mission, conditions, gains)


@law("article")
class ArticleField(SlotField):
    """The article's field: every slot is assumed to have the leader's course and speed, turning or not.

    It learns nothing: its error in a turn is no disturbance.
    """

    Gains = ArticleGains
    slot_frame = "leader"

    def within(self, bandwidth: Bandwidth) -> Self:
        """Return the law within a bandwidth, unless it must be exact."""
        if not self.gains.exact:
            return super().within(bandwidth)
        exact = copy.copy(self)
        exact.bandwidth = bandwidth
        return exact

    def for_speed(self) -> Self:
        """Return the law for the speed of an autopilot with delay, or itself where it must be exact."""
        return self if self.gains.exact else super().for_speed()

    @property
    def integral_s(self) -> float:
        """T = 0: nothing is learned."""
        return 0.0

    def motion(self, leader: LeaderState, slot: Slot) -> SlotMotion:
        """Return a motion with the leader's course and speed."""
        return article_motion(leader, slot)


def bounded_field(gains: FieldGains, *, k_x: float, k_y: float) -> FieldGains:
    """Return a field with gains of at most k_x and k_y (1/m), its integral slowed like its slowest axis.

    The integral's damping is sqrt(s T) / 2, with the field's slope s proportional to its gain.
    """
    slower = max(gains.k_x / k_x, gains.k_y / k_y, 1.0)
    changes = {"k_x": min(gains.k_x, k_x), "k_y": min(gains.k_y, k_y)}
    if isinstance(gains, SlotGains) and gains.integral_s is not None:
        changes["integral_s"] = gains.integral_s * slower
    return gains.model_copy(update=changes)


# Checks of `vfguide check` on the field's gains: is each loop around a slot slower than the one inside it?
# Nelson et al., Vector field path following for miniature air vehicles, IEEE T-RO 2007, gives the turn rate
# of a field.


def error_for_correction(correction: FloatArray, greatest: float, gain: float) -> FloatArray:
    """Return the error (m) for a correction c: tan(pi c / (2 c_inf)) / k; infinite beyond c_inf.

    Inverse of the article's c_inf (2/pi) atan(k e): c and c_inf (`greatest`) in rad or m/s, k in 1/m.
    """
    share = np.abs(correction) / greatest
    inside = np.minimum(share, 1.0 - 1e-9)
    return np.where(share < 1.0, np.tan(math.pi / 2.0 * inside) / gain, np.inf)


def turns_beyond_field(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Yield a finding where the article's field cannot supply the slots' own motion in a turn.

    A rigid slot moves with (V_l - omega g_y, omega g_x), the field aims at (V_l, 0). The difference in course
    and speed requires a lasting error.
    """
    if isinstance(gains, SlotGains):
        return
    airspeed = mission.leader.airspeed_m_s
    turning = conditions.curvature != 0.0
    for follower in mission.followers:
        slot = Slot(forward=follower.slot.forward_m, right=follower.slot.right_m)
        along, right = conditions.slot_velocity(airspeed, slot)
        extra_speed = np.hypot(along, right) - conditions.ground_speed(airspeed)
        lateral = error_for_correction(np.arctan2(right, along), gains.chi_inf, gains.k_y)
        ahead = error_for_correction(extra_speed, gains.v_inf_m_s, gains.k_x)
        if np.isinf(np.hypot(lateral, ahead)[turning]).any():
            message = "on the turn the field cannot correct as much as the slots' own motion takes"
            remedy = "use controller type slot, which steers around the slots' own motion"
            yield Finding("warning", ("controller",), message, remedy)
            return


LEAST_DAMPING = 0.5
"""Smallest damping of the integral's loop: with less, a follower oscillates through its slot."""


def field_findings(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Yield all findings on a field's gains in a mission, up to the first check with an error."""
    for check in (field_beyond_bank, fields_beyond_the_loop, integral_too_fast, turns_beyond_field):
        found = list(check(mission, conditions, gains))
        yield from found
        if any(one.severity == "error" for one in found):
            return


def field_pulls(gains: FieldGains, speed: float) -> tuple[float, float]:
    """Return the field's slopes (along, across), 1/s, at a ground speed (m/s)."""
    across = field_slope(gains.k_y, gains.chi_inf) * speed
    return field_slope(gains.k_x, gains.v_inf_m_s), across


def law_pull(mission: Mission) -> float:
    """Return the bandwidth of the course and speed laws: kappa / epsilon, 1/s."""
    controller = mission.controller
    return controller.kappa / effective_layer(controller, 1.0 / mission.rehearsal.rate_hz)


def integral_damping(slope: float, integral_s: float) -> float:
    """Return the damping sqrt(s T) / 2 of a field with slope s (1/s) and learning time T (s)."""
    return math.sqrt(slope * integral_s) / 2.0


def fields_beyond_the_loop(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Yield findings on fields steeper than the laws beneath them: the two oscillate."""
    followed = law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).max())
    along, across = field_pulls(gains, speed)
    for name, gain, pull in (("k_y", gains.k_y, across), ("k_x", gains.k_x, along)):
        if pull <= followed:
            continue
        pulls, follows = told_apart(pull, followed, 1)
        message = (
            f"near its slot the field pulls at {pulls} 1/s, "
            f"faster than the {follows} 1/s at which the law follows: the formation swings"
        )
        remedy = f"lower {name} to {no_more_than(gain * followed / pull)} 1/m or less"
        yield Finding("warning", ("controller", name), message, remedy)


def integral_too_fast(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Yield a finding on an integral faster than the field beneath it: the follower oscillates, or worse.

    With the law's bandwidth g the loop is e'''/g + e'' + s e' + (s/T) e = 0, stable where T > 1/g (Routh). In
    a turn, harmonics are learned beside the mean, and T counts as shorter by that factor.
    """
    if not isinstance(gains, SlotGains) or not gains.integral_s:
        return
    location = ("controller", "integral_s")
    turn_rate = float(abs(conditions.turn_rate(mission.leader.airspeed_m_s)).max())
    shortest = learning_growth(turn_rate, gains.integral_s) / law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).min())
    slope = min(field_pulls(gains, speed))
    usual = math.ceil(10.0 * (2.0 * LEAST_DAMPING) ** 2 / slope) / 10.0
    remedy = f"set it to {max(usual, math.ceil(10.0 * shortest) / 10.0):g} s or more, or to 0"
    if gains.integral_s <= shortest:
        message = (
            f"the field learns in {gains.integral_s:g} s, which the law beneath it follows from "
            f"{shortest:.2f} s on: followers swing ever wider"
        )
        yield Finding("error", location, message, remedy)
    elif (damping := integral_damping(slope, gains.integral_s)) < LEAST_DAMPING:
        message = (
            f"the field learns in {gains.integral_s:g} s and draws onto the slot at "
            f"{slope:.1f} 1/s: a damping of {damping:.2f}, followers swing through their slots"
        )
        yield Finding("warning", location, message, remedy)


def course_field_turn_rate(gain: float, ground_speed: float, greatest: float) -> float:
    """Return the largest turn rate (rad/s): max of c (2/pi) k V sin(c (2/pi) atan u) / (1 + u^2).

    The maximum over u = k e is found numerically. Unlike `turn_limits.field_turn_rate` this is also exact for
    corrections c far below a quarter turn. Gain k in 1/m, ground speed V in m/s, `greatest` correction c in
    rad.
    """
    share = greatest * (2.0 / math.pi)
    scaled = np.linspace(0.0, 3.0, 301)
    shape = np.sin(share * np.arctan(scaled)) / (1.0 + scaled * scaled)
    return share * gain * ground_speed * float(shape.max())


def field_beyond_bank(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Yield a note where a course field exceeds a follower's turn rate at its slot's speed and turn.

    The field is that around a path, with k_y and the followers' chi_inf. It is only a note: the setpoint is
    limited while joining, and the field demands less near the slot.
    """
    airspeed = mission.leader.airspeed_m_s
    turn = float(np.abs(conditions.turn_rate(airspeed)).max())
    for follower in mission.followers:
        name, offset = follower.vehicle, follower.slot
        slot = Slot(forward=offset.forward_m, right=offset.right_m)
        speed = float(np.hypot(*conditions.slot_velocity(airspeed, slot)).max())
        allowed = bank_limited_turn_rate(math.radians(mission.vehicles[name].max_bank_deg), speed)
        needed = turn + course_field_turn_rate(gains.k_y, speed, gains.chi_inf)
        if needed > allowed:
            asked, given = told_apart(needed, allowed, 2)
            message = (
                f"joining its slot, '{name}' is asked to turn at up to {asked} rad/s at "
                f"{speed:.1f} m/s over ground; its bank gives {given}, so it joins less sharply"
            )
            yield Finding("note", ("controller", "k_y"), message)
            return
