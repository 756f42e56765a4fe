"""The interface of a follower's law: what it is told, what it returns, and what is done around it.

A law says which motion it wants. `SlotKeeper` does once what every law needs. It carries the leader's state
on to the same instant, compensates for late autopilots and keeps clear of other vehicles. It turns the
motion into setpoints through the wind triangle, within the vehicle's limits, and logs the Lyapunov
function.
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
"""1/m, rad, m/s: of the field by which a follower is expected to come onto its slot."""

law = laws.register
"""`@law("name")` makes a class known as the law `controller.type: name`."""


class View(NamedState, frozen=True, kw_only=True):
    """What a law is told in one step.

    North and east in metres from the mission's origin, angles in radians clockwise from north, speeds in m/s.
    """

    state: VehicleState
    """State of the follower: position, course, ground speed, heading, airspeed, wind, the wind's rates."""
    leader: LeaderState
    """State of the leader, at the same instant."""
    slot: Slot
    """Place in the formation: m ahead of the leader and m to its right."""
    motion: SlotMotion
    """Motion of the slot over the ground: place, course, speed and their rates."""
    error: FormationError
    """Where the slot is, along its own course: m ahead of the follower and m to its right; and the rates."""
    airframe: Airframe
    """The follower's response and limits."""
    period: float
    """Since the step before and until the next, s."""
    held: bool = False
    """Whether something else was flown than the law asked for in the step before, as to keep clear."""
    bandwidth: Bandwidth = UNBOUNDED
    """How fast loops around this aircraft may be, 1/s: a law's gains are best kept below."""


class DesiredMotion(NamedState, frozen=True, kw_only=True):
    """The motion that a law wants over the ground."""

    course: float
    """chi_d, rad; what the course differs from it is logged as the law's course error."""
    speed: float
    """V_d, m/s; what the ground speed differs from it is logged as the law's speed error."""
    course_rate: float
    """dchi/dt that is asked of the vehicle now, rad/s, positive to the right."""
    acceleration: float
    """dV/dt that is asked of it now, m/s²."""


def approach(
    view: View,
    *,
    course: float,
    speed: float,
    course_rate: float = 0.0,
    acceleration: float = 0.0,
) -> DesiredMotion:
    """Return a motion toward a course and a ground speed, as fast as the vehicle and its holds bear.

    Args:
        view: of the step.
        course: chi_d, rad.
        speed: V_d, m/s.
        course_rate: dchi_d/dt, rad/s.
        acceleration: dV_d/dt, m/s².
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
    """A law by which followers keep their slots.

    A subclass with `@law("name")` is known as `controller.type: name`, with the fields of its `Gains` in the
    mission's `controller:`.
    """

    name: ClassVar[str]
    """What a mission calls it; set by `@law`."""

    Gains: ClassVar[type[Section]] = Section
    """The law's gains: fields with their units, bounds and defaults."""

    forgets_when_held: ClassVar[bool] = True
    """Whether the memory begins anew while something else is flown than the law asks for."""

    slot_frame: ClassVar[SlotFrame | None] = None
    """What its slots turn with, where the law does not leave that to the mission."""

    libraries: ClassVar[tuple[str, ...]] = ()
    """Modules that it needs and that only an extra of vfguide installs: looked for before anything flies."""

    bandwidth: Bandwidth = UNBOUNDED
    """What the aircraft bears."""

    def __init__(self, gains: Any, settings: GuidanceSettings, airframe: Airframe) -> None:  # noqa: ANN401
        """Make the law of one follower.

        Args:
            gains: an instance of `Gains`.
            settings: what the mission sets for every law.
            airframe: response and limits of the vehicle.
        """
        self.gains = gains
        self.settings = settings
        self.airframe = airframe

    def start(self, view: View) -> Any:  # noqa: ANN401
        """What the law remembers before its first step."""
        del view

    @abstractmethod
    def step(self, view: View, memory: Any) -> tuple[DesiredMotion, Any]:  # noqa: ANN401
        """(motion, memory): what the law wants now, and what it remembers until the next step."""

    def learn(self, view: View, memory: Any, *, limited: bool) -> Any:  # noqa: ANN401
        """What to remember once it is known whether the vehicle's limits cut what the law asked for."""
        del view, limited
        return memory

    def motion(self, leader: LeaderState, slot: Slot) -> SlotMotion:
        """How the law takes a slot to move: as a point that is fixed to its leader's course."""
        return slot_motion(leader, slot)

    def expected_motion(self, motion: SlotMotion, error: FormationError) -> tuple[float, float]:
        """(course, speed) with which a follower is expected to come onto its slot, rad and m/s.

        Its track is predicted by this, so that it and others keep clear of each other: by the dual field with
        its usual gains, unless a law knows better.

        Args:
            motion: of the slot.
            error: where the slot is.
        """
        turn, _ = arc_tangent_field(
            error.cross_track, error.cross_track_rate, USUAL_GAIN, USUAL_TURN
        )
        push, _ = arc_tangent_field(
            error.along_track, error.along_track_rate, USUAL_GAIN, USUAL_PUSH
        )
        return motion.course + turn, motion.speed + push

    def within(self, bandwidth: Bandwidth) -> Self:
        """Return the law, slowed where its gains are more than the aircraft bears.

        Delays are predicted away beside this. A law that is not slowed here finds the bounds in its view.

        Args:
            bandwidth: of the aircraft, by its response and how well that is known.
        """
        bounded = copy.copy(self)
        bounded.bandwidth = bandwidth
        return bounded

    def for_speed(self) -> Self:
        """Return the law by which only the speed is asked for, of an autopilot that answers late."""
        return self

    @classmethod
    def findings(cls, mission: Mission, conditions: Conditions) -> Iterator[Finding]:
        """What `vfguide check` can say about the law's gains on a mission.

        Args:
            mission: with a follower at least.
            conditions: every course and turn of its path in every declared wind.
        """
        del mission, conditions
        return iter(())


SlotAt = Callable[[float], Slot]
"""A slot by the time, s on the follower's clock."""


class FollowerGuidance(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one step."""

    setpoint: Setpoint
    """For the autopilot."""
    error: FormationError
    """Where the slot is, as the follower knows it."""
    course_error: float
    """chi~_f, rad: the course less the one that the law wants."""
    speed_error: float
    """V~_f, m/s: the ground speed less the one that the law wants."""
    lyapunov: float
    """W, m²."""


class SlotKeeper:
    """A law with its slot and with what it remembers."""

    def __init__(
        self,
        law: Law,
        slot: Slot,
        *,
        slot_at: SlotAt | None = None,
    ) -> None:
        """Make one that remembers nothing.

        Args:
            law: of this follower alone.
            slot: its place in the formation.
            slot_at: the same at a time of the follower's clock (s), where it moves within the formation.
        """
        self._law = law
        self._slot: Slot = slot
        self._slot_at: SlotAt | None = slot_at
        self._memory: Any = None
        self._started = False

    def retune(self, law: Law) -> None:
        """Go on by the same law for another response of the vehicle; what it remembers is kept."""
        self._law = law

    def reset(self) -> None:
        """Forget what was learned: the setpoints are not being followed."""
        self._started = False

    def step(
        self,
        state: VehicleState,
        leader: LeaderState,
        *,
        period: float,
        held: bool = False,
    ) -> FollowerGuidance:
        """Setpoint for a navigated state, by the newest leader state, however old.

        Args:
            state: of the follower.
            leader: newest state of its leader.
            period: since the step before, s.
            held: whether something else was flown than what the step before asked for.
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
