"""What keeps a follower on its slot, with whatever it has to remember: one of these for each follower."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Protocol

from vfguide.guidance.follower import FollowerGuidance, learning_step
from vfguide.guidance.formation import Slot, formation_error, predict_leader, slot_motion
from vfguide.guidance.pid import PidMemory, first_memory, pid_step
from vfguide.guidance.settings import GuidanceSettings, MpcWeights, PidGains
from vfguide.guidance.slot_integral import aimed_error, learned, no_offset
from vfguide.state import Airframe, LeaderState, VehicleState


class FormationController(Protocol):
    """A law that keeps a slot."""

    def step(
        self,
        state: VehicleState[float],
        leader: LeaderState[float],
        *,
        period: float,
        held: bool = False,
    ) -> FollowerGuidance[float]:
        """Setpoint for a navigated state, by the newest leader state, however old.

        `held` says that something else was flown than what the step before asked for.
        """

    def reset(self) -> None:
        """Forget what was learnt: the setpoints are not being followed."""


class FieldController:
    """The dual field, which remembers what its integral has learned."""

    def __init__(self, settings: GuidanceSettings, slot: Slot[float], airframe: Airframe) -> None:
        self._settings = settings
        self._slot = slot
        self._airframe = airframe
        self._offset = no_offset(0.0)

    def step(
        self,
        state: VehicleState[float],
        leader: LeaderState[float],
        *,
        period: float,
        held: bool = False,
    ) -> FollowerGuidance[float]:
        """One step of the dual field."""
        guidance, self._offset = learning_step(
            state,
            leader,
            self._slot,
            self._settings,
            self._airframe,
            period=period,
            offset=self._offset,
            held=held,
        )
        return guidance

    def reset(self) -> None:
        """The disturbance is to be learned anew."""
        self._offset = no_offset(0.0)


class BaselineController(ABC):
    """A law to compare with, which forgets what it learned while something else is flown."""

    def __init__(self, settings: GuidanceSettings, slot: Slot[float], airframe: Airframe) -> None:
        self._settings = settings
        self._slot = slot
        self._airframe = airframe

    def step(
        self,
        state: VehicleState[float],
        leader: LeaderState[float],
        *,
        period: float,
        held: bool = False,
    ) -> FollowerGuidance[float]:
        """One step of the baseline."""
        if held:
            self.reset()
        if self._settings.predict_leader:
            leader = predict_leader(leader, state.time_s)
        return self._keep(state, leader, period)

    @abstractmethod
    def reset(self) -> None:
        """Forget what was learnt."""

    @abstractmethod
    def _keep(
        self, state: VehicleState[float], leader: LeaderState[float], period: float
    ) -> FollowerGuidance[float]:
        """Setpoint toward the slot, by the leader at the same time."""


class PidController(BaselineController):
    """Two PID controllers; the integrals and the rates are theirs."""

    def __init__(
        self,
        settings: GuidanceSettings,
        slot: Slot[float],
        airframe: Airframe,
        gains: PidGains[float],
    ) -> None:
        super().__init__(settings, slot, airframe)
        self._gains = gains
        self._memory: PidMemory[float] | None = None

    def reset(self) -> None:
        """Empty the integrals."""
        self._memory = None

    def _keep(
        self, state: VehicleState[float], leader: LeaderState[float], period: float
    ) -> FollowerGuidance[float]:
        motion = slot_motion(leader, self._slot)
        error = formation_error(motion, state)
        guidance, self._memory = pid_step(
            state,
            motion,
            error,
            self._memory or first_memory(error),
            gains=self._gains,
            airframe=self._airframe,
            period=period,
            wind_feedforward=self._settings.wind_feedforward,
            rho=self._settings.sliding.rho,
        )
        return guidance


class MpcController(BaselineController):
    """Model predictive control; its target lies beyond the slot by what an integral has learned.

    Without a model of what disturbs it a predictive law keeps an offset, as any law without an integral.
    """

    def __init__(
        self,
        settings: GuidanceSettings,
        slot: Slot[float],
        airframe: Airframe,
        weights: MpcWeights,
    ) -> None:
        # Here, because the solver brings 40 MB of libraries, and whoever flies a field has no use for them.
        from vfguide.guidance.mpc import Predictive

        super().__init__(settings, slot, airframe)
        self._predictive = Predictive(weights, airframe)
        self._learning = replace(settings.field, integral_s=weights.integral_s)
        self._offset = no_offset(0.0)

    def reset(self) -> None:
        """The disturbance is to be learned anew; any solution is as good to start from as any other."""
        self._offset = no_offset(0.0)

    def _keep(
        self, state: VehicleState[float], leader: LeaderState[float], period: float
    ) -> FollowerGuidance[float]:
        motion = slot_motion(leader, self._slot)
        error = formation_error(motion, state)
        guidance = self._predictive.step(
            state,
            leader,
            self._slot,
            motion,
            error,
            aimed=aimed_error(error, self._offset, self._learning),
            wind_feedforward=self._settings.wind_feedforward,
            rho=self._settings.sliding.rho,
            period=period,
        )
        self._offset = learned(
            self._offset, error, self._learning, period=period, held=guidance.setpoint.limited
        )
        return guidance


def formation_controller(
    settings: GuidanceSettings, slot: Slot[float], airframe: Airframe
) -> FormationController:
    """The law that a mission chooses, for one follower.

    Raises:
        ValueError: the law's gains are missing.
    """
    if settings.law == "field":
        return FieldController(settings, slot, airframe)
    if settings.law == "pid" and settings.pid is not None:
        return PidController(settings, slot, airframe, settings.pid)
    if settings.law == "mpc" and settings.mpc is not None:
        return MpcController(settings, slot, airframe, settings.mpc)
    raise ValueError(f"the law {settings.law} has no gains")
