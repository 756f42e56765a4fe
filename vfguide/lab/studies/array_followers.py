"""The followers' laws on arrays: the same objects that companions fly, one for each batch.

A law that takes no arrays is stepped vehicle by vehicle.
"""

from dataclasses import replace
from typing import Any, Protocol, TypeVar

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.formation import Slot
from vfguide.lab.studies.array_case import Conditions, Start
from vfguide.laws.keeper import SlotKeeper
from vfguide.mission.quantity import Section
from vfguide.state import LeaderState, Setpoint, VehicleState


class Followers(Protocol):
    """All followers of a batch, by one law."""

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """Setpoints by a leader state that is as old as it is."""

    def reset(self) -> None:
        """Forget what was learned."""


class TogetherFollowers:
    """By a law that takes arrays."""

    def __init__(self, start: Start, conditions: Conditions) -> None:
        law = conditions.law(start.gains, conditions.settings, conditions.airframe)
        self._keeper: SlotKeeper[FloatArray] = SlotKeeper(law, start.slot)

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """One step of all."""
        return self._keeper.step(state, leader, period=period).setpoint

    def reset(self) -> None:
        """Forget what was learned."""
        self._keeper.reset()


class SeparateFollowers:
    """By a law that takes one vehicle at a time."""

    def __init__(self, start: Start, conditions: Conditions) -> None:
        self._shape = start.north[1:].shape
        self._keepers: dict[tuple[int, ...], SlotKeeper[float]] = {
            (row, column): SlotKeeper(
                conditions.law(
                    gains_of_one(start.gains, column), conditions.settings, conditions.airframe
                ),
                Slot(
                    forward=float(start.slot.forward[row, column]),
                    right=float(start.slot.right[row, column]),
                ),
            )
            for row, column in np.ndindex(self._shape)
        }

    def step(
        self, state: VehicleState[FloatArray], leader: LeaderState[FloatArray], period: float
    ) -> Setpoint[FloatArray]:
        """One step of each."""
        course, speed = np.empty(self._shape), np.empty(self._shape)
        limited = np.empty(self._shape, dtype=bool)
        for (row, column), keeper in self._keepers.items():
            setpoint = keeper.step(
                one_of(state, (row, column)), one_of(leader, (column,)), period=period
            ).setpoint
            course[row, column], speed[row, column] = setpoint.course, setpoint.speed
            limited[row, column] = setpoint.limited
        return Setpoint(course=course, speed=speed, limited=limited)

    def reset(self) -> None:
        """Every one of them."""
        for keeper in self._keepers.values():
            keeper.reset()


One = TypeVar("One", VehicleState[Any], LeaderState[Any])


def one_of(states: One, place: tuple[int, ...]) -> One:
    """One vehicle's state out of many; what is no array is everybody's."""
    values = {name: getattr(states, name) for name in type(states).__dataclass_fields__}
    taken: dict[str, Any] = {
        name: float(value[place]) for name, value in values.items() if isinstance(value, np.ndarray)
    }
    return replace(states, **taken)


def gains_of_one(gains: Section, column: int) -> Section:
    """The gains of one formation: those of its column where they are arrays."""
    own = {
        name: value[column].item()
        for name in type(gains).model_fields
        if isinstance(value := getattr(gains, name), np.ndarray)
    }
    return gains.model_copy(update=own)


def followers_of(start: Start, conditions: Conditions) -> Followers:
    """The followers of a batch."""
    together = conditions.law.arrays
    return (TogetherFollowers if together else SeparateFollowers)(start, conditions)
