"""Interface of a follower's law, and the keeper that runs a law on its slot.

A law returns the motion that it wants. `SlotKeeper` extrapolates the leader to the same instant, turns the
motion into setpoints through the wind triangle and the limits, and computes the Lyapunov function.
"""

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Self

import msgspec

from vfguide.elementwise import wrap_angle
from vfguide.guidance.formation import (
    FormationError,
    Slot,
    SlotMotion,
    arc_tangent_field,
    extrapolate_by_rates,
    formation_error,
    lyapunov,
    slot_motion,
)
from vfguide.guidance.response import UNBOUNDED, Bandwidth
from vfguide.guidance.sliding_laws import GuidanceSettings, SlotFrame, setpoint_for
from vfguide.mission.finding import Finding
from vfguide.mission.flight_limits import Conditions
from vfguide.mission.model import Mission
from vfguide.mission.quantity import Section
from vfguide.registry import laws
from vfguide.state import Airframe, LeaderState, NamedState, Setpoint, VehicleState

USUAL_GAIN, USUAL_TURN, USUAL_PUSH = 0.2, math.radians(45.0), 8.0
"""Gain (1/m) and largest corrections (rad, m/s) of the field assumed for a follower's approach."""

law = laws.register
"""Decorator `@law("name")`: registers a class as the law `controller.type: name`."""


class View(NamedState, frozen=True, kw_only=True):
    """Input of a law in one step.

    North and east in metres from the mission's origin, angles in radians clockwise from north, speeds in m/s.
    """

    state: VehicleState
    """State of the follower: position, course, ground speed, heading, airspeed, wind and its rates."""
    leader: LeaderState
    """State of the leader at the same instant."""
    slot: Slot
    """Place in the formation: m ahead of the leader and m to its right."""
    motion: SlotMotion
    """Motion of the slot over ground: position, course, speed and their rates."""
    error: FormationError
    """Position of the slot ahead and right of the follower along the slot's course, m; and its rates."""
    airframe: Airframe
    """Response and limits of the follower."""
    period: float
    """Time since the previous step and until the next, s."""
    held: bool = False
    """Whether something else was flown than the law demanded in the previous step, as for separation."""
    bandwidth: Bandwidth = UNBOUNDED
    """Permitted loop bandwidths for this aircraft, 1/s; a law's gains should stay below."""


class DesiredMotion(NamedState, frozen=True, kw_only=True):
    """Motion over ground that a law wants."""

    course: float
    """chi_d, rad; the course minus chi_d is logged as the law's course error."""
    speed: float
    """V_d, m/s; the ground speed minus V_d is logged as the law's speed error."""
    course_rate: float
    """Demanded dchi/dt, rad/s, positive right."""
    acceleration: float
    """Demanded dV/dt, m/s²."""


def approach(
    view: View, *, course: float, speed: float, course_rate: float = 0.0, acceleration: float = 0.0
) -> DesiredMotion:
    """Return a motion toward a course and ground speed, as fast as the vehicle and its holds permit.

    Course chi_d in rad and its rate in rad/s; speed V_d in m/s and its rate in m/s².
    """
    state, airframe = view.state, view.airframe
    course_error = wrap_angle(state.course - course)
    speed_error = state.ground_speed - speed
    return DesiredMotion(
        course=course,
        speed=speed,
        course_rate=course_rate - min(airframe.alpha, view.bandwidth.course) * course_error,
        acceleration=acceleration - min(airframe.beta, view.bandwidth.speed) * speed_error,
    )


class Law(ABC):
    """Law that keeps a follower on its slot.

    A subclass with `@law("name")` is `controller.type: name` in a mission, with the fields of its `Gains`.
    """

    name: ClassVar[str]
    """Name in a mission; set by `@law`."""

    Gains: ClassVar[type[Section]] = Section
    """Gains of the law, with units, bounds and defaults."""

    forgets_when_held: ClassVar[bool] = True
    """Whether the memory restarts while something else is flown than the law demands."""

    slot_frame: ClassVar[SlotFrame | None] = None
    """Motion to which the law's slots are fixed; None leaves it to the mission."""

    libraries: ClassVar[tuple[str, ...]] = ()
    """Modules that only an extra of vfguide installs; their presence is checked before a flight."""

    bandwidth: Bandwidth = UNBOUNDED
    """Permitted loop bandwidths for the aircraft."""

    def __init__(self, gains: Any, settings: GuidanceSettings, airframe: Airframe) -> None:  # noqa: ANN401
        """Create the law of one follower; `gains` is an instance of `Gains`."""
        self.gains = gains
        self.settings = settings
        self.airframe = airframe

    def start(self, view: View) -> Any:  # noqa: ANN401
        """Return the memory before the first step."""
        del view

    @abstractmethod
    def step(self, view: View, memory: Any) -> tuple[DesiredMotion, Any]:  # noqa: ANN401
        """Return the wanted motion, and the memory for the next step."""

    def learn(self, view: View, memory: Any, *, limited: bool) -> Any:  # noqa: ANN401
        """Return the memory once it is known whether the limits cut the demand (`limited`)."""
        del view, limited
        return memory

    def motion(self, leader: LeaderState, slot: Slot) -> SlotMotion:
        """Return the slot's motion as assumed by the law: a point fixed in its leader's course frame."""
        return slot_motion(leader, slot)

    def expected_motion(self, motion: SlotMotion, error: FormationError) -> tuple[float, float]:
        """Return the (course, speed) of a follower's expected approach to its slot, rad and m/s.

        They predict its track for separation. The default is the dual field with its usual gains.
        """
        turn, _ = arc_tangent_field(
            error.cross_track, error.cross_track_rate, USUAL_GAIN, USUAL_TURN
        )
        push, _ = arc_tangent_field(
            error.along_track, error.along_track_rate, USUAL_GAIN, USUAL_PUSH
        )
        return motion.course + turn, motion.speed + push

    def within(self, bandwidth: Bandwidth) -> Self:
        """Return the law, slowed where its gains exceed the bandwidth that the aircraft permits.

        Delays are compensated separately. A law that is not slowed here finds the bounds in its view.
        """
        bounded = copy.copy(self)
        bounded.bandwidth = bandwidth
        return bounded

    def for_speed(self) -> Self:
        """Return the law used for the speed alone, for an autopilot with delay."""
        return self

    @classmethod
    def findings(cls, mission: Mission, conditions: Conditions) -> Iterator[Finding]:
        """Yield the findings of `vfguide check` about the law's gains on a mission with a follower.

        `conditions` are all courses and turns of its path in all declared winds.
        """
        del mission, conditions
        return iter(())


SlotAt = Callable[[float], Slot]
"""Slot as a function of time, s on the follower's clock."""


class FollowerGuidance(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one step."""

    setpoint: Setpoint
    """Setpoint for the autopilot."""
    error: FormationError
    """Position of the slot relative to the follower."""
    course_error: float
    """chi~_f, rad: the course minus the law's wanted course."""
    speed_error: float
    """V~_f, m/s: the ground speed minus the law's wanted speed."""
    lyapunov: float
    """W, m²."""


class SlotKeeper:
    """Law with its slot and memory."""

    def __init__(self, law: Law, slot: Slot, *, slot_at: SlotAt | None = None) -> None:
        """Create a keeper without memory, for a law of this follower alone.

        `slot_at` gives a moving slot at a time of the follower's clock (s); None for a fixed slot.
        """
        self._law = law
        self._slot: Slot = slot
        self._slot_at: SlotAt | None = slot_at
        self._memory: Any = None
        self._started = False

    def retune(self, law: Law) -> None:
        """Continue with the same law for another response of the vehicle, with the memory kept."""
        self._law = law

    def reset(self) -> None:
        """Discard the memory, as when the setpoints are not followed."""
        self._started = False

    def step(
        self, state: VehicleState, leader: LeaderState, *, period: float, held: bool = False
    ) -> FollowerGuidance:
        """Return the guidance for a navigated state and the latest leader state, however old.

        `period` is the time since the previous step, s; `held` means that something else was flown than
        demanded then.
        """
        law = self._law
        settings = law.settings
        if settings.predict_leader:
            leader = extrapolate_by_rates(leader, state.time_s)
        slot = self._slot if self._slot_at is None else self._slot_at(state.time_s)
        motion = law.motion(leader, slot)
        error = formation_error(motion, state)
        view = View(
            state=state,
            leader=leader,
            slot=slot,
            motion=motion,
            error=error,
            airframe=law.airframe,
            period=period,
            held=held,
            bandwidth=law.bandwidth,
        )
        if not self._started or (held and law.forgets_when_held):
            self._memory, self._started = law.start(view), True
        wanted, memory = law.step(view, self._memory)
        course_error = wrap_angle(state.course - wanted.course)
        speed_error = state.ground_speed - wanted.speed
        setpoint = setpoint_for(
            state,
            wanted.acceleration,
            wanted.course_rate,
            law.airframe,
            wind_feedforward=settings.wind_feedforward,
            hold=period,
        )
        self._memory = law.learn(view, memory, limited=setpoint.limited)
        return FollowerGuidance(
            setpoint=setpoint,
            error=error,
            course_error=course_error,
            speed_error=speed_error,
            lyapunov=lyapunov(error, course_error, speed_error, settings.sliding.rho),
        )
