"""The followers' laws on arrays, each with what it remembers."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from vfguide.bench.array_case import Conditions, Start
from vfguide.elementwise import FloatArray
from vfguide.guidance.controller import MpcController
from vfguide.guidance.follower import learning_step
from vfguide.guidance.formation import Slot, formation_error, predict_leader, slot_motion
from vfguide.guidance.pid import PidMemory, first_memory, pid_step
from vfguide.guidance.settings import MpcWeights, PidGains
from vfguide.guidance.slot_integral import no_offset
from vfguide.state import LeaderState, Setpoint, VehicleState


class Followers(ABC):
    """All followers of a batch, by one law."""

    def __init__(self, start: Start, conditions: Conditions) -> None:
        self._slot = start.slot
        self._settings = conditions.settings
        self._airframe = conditions.airframe

    @abstractmethod
    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """Setpoints by a leader state that is as old as it is."""

    @abstractmethod
    def reset(self) -> None:
        """Forget what was learnt."""


class FieldFollowers(Followers):
    """By the dual field, which remembers what its integral has learned."""

    def __init__(self, start: Start, conditions: Conditions) -> None:
        super().__init__(start, conditions)
        self._offset = no_offset(start.north[1:])

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """One step of the dual field."""
        guidance, self._offset = learning_step(
            state,
            leader,
            self._slot,
            self._settings,
            self._airframe,
            period=period,
            offset=self._offset,
        )
        return guidance.setpoint

    def reset(self) -> None:
        """The disturbance is to be learned anew."""
        self._offset = no_offset(self._offset.ahead)


class PidFollowers(Followers):
    """By two PID controllers, whose gains may differ between formations."""

    def __init__(self, start: Start, conditions: Conditions, gains: PidGains[FloatArray]) -> None:
        super().__init__(start, conditions)
        self._gains = gains
        self._memory: PidMemory[FloatArray] | None = None

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """One step of both controllers."""
        settings = self._settings
        if settings.predict_leader:
            leader = predict_leader(leader, state.time_s)
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
            wind_feedforward=settings.wind_feedforward,
            rho=settings.sliding.rho,
        )
        return guidance.setpoint

    def reset(self) -> None:
        """Empty the integrals."""
        self._memory = None


class MpcFollowers(Followers):
    """By model predictive control: no programme on arrays, but one for each vehicle."""

    def __init__(self, start: Start, conditions: Conditions, weights: Sequence[MpcWeights]) -> None:
        super().__init__(start, conditions)
        self._shape = start.north[1:].shape
        self._controllers = {
            (row, column): MpcController(
                conditions.settings,
                Slot(
                    forward=float(start.slot.forward[row, column]),
                    right=float(start.slot.right[row, column]),
                ),
                conditions.airframe,
                weights[column],
            )
            for row, column in np.ndindex(self._shape)
        }

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """One step of each."""
        course, speed = np.empty(self._shape), np.empty(self._shape)
        limited = np.empty(self._shape, dtype=bool)
        for (row, column), controller in self._controllers.items():
            setpoint = controller.step(
                one_of(state, (row, column)), one_of(leader, (column,)), period=period
            ).setpoint
            course[row, column], speed[row, column] = setpoint.course, setpoint.speed
            limited[row, column] = setpoint.limited
        return Setpoint(course=course, speed=speed, limited=limited)

    def reset(self) -> None:
        """Every one of them."""
        for controller in self._controllers.values():
            controller.reset()


One = TypeVar("One", VehicleState[Any], LeaderState[Any])


def one_of(states: One, place: tuple[int, ...]) -> One:
    """One vehicle's state out of many; what is no array is everybody's."""
    values = {name: getattr(states, name) for name in type(states).__dataclass_fields__}
    taken: dict[str, Any] = {
        name: float(value[place]) for name, value in values.items() if isinstance(value, np.ndarray)
    }
    return replace(states, **taken)


def followers_of(start: Start, conditions: Conditions) -> Followers:
    """The law of a batch."""
    if start.pid is not None:
        return PidFollowers(start, conditions, start.pid)
    if start.mpc is not None:
        return MpcFollowers(start, conditions, start.mpc)
    return FieldFollowers(start, conditions)
