"""The dual field that draws a follower onto its slot: around the slot's own motion, and the article's.

    chi_d = chi_s + chi_inf (2/pi) atan(k_y y_E)        V_d = V_s + V_inf (2/pi) atan(k_x x_E)

The article takes the leader's course and speed for the slot's, which leaves an error on every turn. Both are
followed by the sliding-mode laws of course and speed.

Field and laws are kept within what the aircraft bears (`bandwidth.py`). The setpoint V + (dV/dt)/beta of a
law slower than the hold itself has the measured speed in it, and a hold that is not of first order
(ArduPlane's answers at once by pitch, seconds later by throttle) rings on it. For a total-energy hold the
speed law is made just so fast that the measured speed drops out.
"""

import copy
import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Self

from msgspec.structs import replace
from pydantic import Field

from vfguide.elementwise import wrap_angle
from vfguide.guidance.bandwidth import Bandwidth
from vfguide.guidance.formation import (
    FormationError,
    Slot,
    SlotMotion,
    arc_tangent_field,
    article_motion,
    field_slope,
)
from vfguide.guidance.sliding_laws import sliding_acceleration, sliding_course_rate
from vfguide.guidance.slot_integral import Offset, aimed_error, no_offset, update_offset
from vfguide.guidance.wind_triangle import resolve
from vfguide.laws.base import DesiredMotion, Law, View, law
from vfguide.mission import quantity
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
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
    """What the dual field asks of a follower that is this far from its slot, with the field's own rates."""
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
    """The dual field around the slot's motion, whose integral learns what keeps a follower off its slot."""

    Gains: ClassVar[type[Section]] = SlotGains
    forgets_when_held = False
    drawn = ("k_x", "k_y")
    answers_course_error = True
    """Whether a follower turns toward its field, or with its slot alone; where only its speed counts."""

    chosen: FieldGains
    """Gains as the mission has them, before the aircraft bounds them."""

    follows_drift = True
    """Whether the speed follows what gusts make of the leader's at once; an autopilot that answers late would
    follow a gust when it is over."""

    @property
    def integral_s(self) -> float:
        """T: time in which a lasting error is learned, s; 0 learns nothing.

        Where the mission chooses none it is 4 / s for the slower of both fields, a damping of 1.
        """
        gains = self.gains
        if gains.integral_s is not None:
            return float(gains.integral_s)
        along = field_slope(gains.k_x, gains.v_inf_m_s)
        across = field_slope(gains.k_y, gains.chi_inf) * self.airframe.cruise
        return max(4.0 / along, 4.0 / across)

    def start(self, view: View) -> Offset:
        """Nothing was learned yet."""
        del view
        return no_offset()

    def step(self, view: View, memory: Offset) -> tuple[DesiredMotion, Offset]:
        """One step of the dual field and of the sliding-mode laws that follow it."""
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
        """The offset a step later; nothing is learned while something else is flown, nor at a limit."""
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
        """As the field of the mission asks."""
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
        """Return the law for the speed of a late autopilot: of a total-energy hold without measured speed.

        With the gains g of the speed law and k of its field, 1 - (g + k)/beta of the measured speed is in
        V + (dV/dt)/beta; g = beta - k leaves nothing, and k is at most half of g. What the course swings
        about the field is then no reason either to change the airspeed.
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
        """Whether the loops fit each other, and the turns."""
        # Here, because a companion in the air has no use for it.
        from vfguide.laws.field_findings import field_findings

        return field_findings(mission, conditions, cls.gains_in(mission))


@law("article")
class ArticleField(SlotField):
    """The article's field: every slot is taken to move with the leader's course and speed, turning or not.

    It learns nothing: what keeps it off its slot on a turn is no disturbance.
    """

    Gains = ArticleGains
    slot_frame = "leader"

    def within(self, bandwidth: Bandwidth) -> Self:
        """Return the law within a bandwidth, unless it is to be exact."""
        if not self.gains.exact:
            return super().within(bandwidth)
        exact = copy.copy(self)
        exact.bandwidth = bandwidth
        return exact

    def for_speed(self) -> Self:
        """Return the law for the speed of a late autopilot; itself, where it is to be exact."""
        return self if self.gains.exact else super().for_speed()

    @property
    def integral_s(self) -> float:
        """Nothing is learned."""
        return 0.0

    def motion(self, leader: LeaderState, slot: Slot) -> SlotMotion:
        """With the leader's course and speed."""
        return article_motion(leader, slot)


def bounded_field(gains: FieldGains, *, k_x: float, k_y: float) -> FieldGains:
    """Return a field no sharper than these gains (1/m), its integral as much slower as its slowest axis.

    The integral's damping is sqrt(s T) / 2, with the field's slope s in proportion to its gain.
    """
    slower = max(gains.k_x / k_x, gains.k_y / k_y, 1.0)
    changes = {"k_x": min(gains.k_x, k_x), "k_y": min(gains.k_y, k_y)}
    if isinstance(gains, SlotGains) and gains.integral_s is not None:
        changes["integral_s"] = gains.integral_s * slower
    return gains.model_copy(update=changes)
