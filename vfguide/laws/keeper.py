"""What is done around every law: from the newest leader state to a setpoint."""

from collections.abc import Callable
from typing import Any

import msgspec

from vfguide.elementwise import wrap_angle
from vfguide.guidance.formation import (
    FormationError,
    Slot,
    extrapolate_by_rates,
    formation_error,
    lyapunov,
)
from vfguide.guidance.sliding_laws import setpoint_for
from vfguide.laws.base import Law, View
from vfguide.state import LeaderState, Setpoint, VehicleState

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
