"""Base classes of the emulated aircraft, for plug-ins too, and their registry.

A plant is an aircraft together with the loops that hold its targets. It is a pure function: from a state,
the targets and the air to the state a step later.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, ClassVar, TypeVar

import msgspec

from sitl_stub.air import Wind
from sitl_stub.geometry import displace, wrap_to_two_pi
from sitl_stub.loops import (
    PlantParameters,
    SpeedKind,
    Targets,
    bank_of_rad,
    climb_acceleration_m_s2,
)
from sitl_stub.registry import PlugInRegistry
from sitl_stub.rigid_body import Body

Kind = TypeVar("Kind", bound="type[Plant]")

plants = PlugInRegistry(
    "a plant", group="sitl_stub.plants", has=("step", "motion", "longest_step_s")
)
"""Plants by the name that `--plant` and `rehearsal.emulator.plant` give."""


class PlantState(msgspec.Struct, frozen=True):
    """Position, motion and loop states of an aircraft."""

    direction_rad: float
    """Course of the course-hold plant, heading of all others, in [0, 2 pi)."""

    speed_m_s: float
    speed_kind: SpeedKind
    """Always `airspeed` but on the course-hold plant."""

    latitude_rad: float
    longitude_rad: float
    """In (-pi, pi]."""

    altitude_amsl_m: float
    """Altitude, also used as height above the ellipsoid (an error of at most 100 m, or 2e-5)."""

    roll_rad: float = 0.0
    """Bank of the plants that roll, positive right."""

    memory: tuple[float, ...] = ()
    """Loop states of an `AirPlant`; empty before its first step."""

    body: Body | None = None
    """State of the `six-dof` plant's body; None before its first step in the air."""

    climb_m_s: float = 0.0
    """Climb rate of the height hold, positive up; the `six-dof` plant keeps its own in `body`."""


class Motion(msgspec.Struct, frozen=True):
    """True motion at one instant; north, east and down are the ground velocity."""

    north_m_s: float
    east_m_s: float
    down_m_s: float
    course_rad: float
    """In [0, 2 pi)."""

    ground_speed_m_s: float
    heading_rad: float
    """Direction of the nose, [0, 2 pi); it is the air velocity's on all plants but `six-dof`."""

    airspeed_m_s: float
    turn_rate_rad_s: float
    """Turn rate of the nose, positive right."""

    bank_rad: float
    """Bank, positive right: the roll of the plants that roll, else that of the coordinated turn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions:
    """Options of a plant that has none."""


class Plant(ABC):
    """An aircraft with its loops; `@plant("name")` registers a subclass as `--plant name`."""

    longest_step_s: ClassVar[float] = 0.025
    Options: ClassVar[type[Any]] = NoOptions
    """Options of the plant: a frozen dataclass of floats with defaults."""

    def __init__(self, parameters: PlantParameters) -> None:
        """Take limits, gains and options.

        Raises:
            ValueError: an option is unknown or not finite; the message names it.
        """
        self.parameters = parameters
        known = {one.name for one in fields(self.Options)}
        for name, value in parameters.options:
            if name not in known:
                those = ", ".join(sorted(known)) or "none"
                raise ValueError(f"{parameters.kind} has no option {name}; it has {those}")
            if not math.isfinite(value):
                raise ValueError(f"option {name} must be finite, not {value!r}")
        self.options = self.Options(**dict(parameters.options))

    @classmethod
    def of(cls, parameters: PlantParameters) -> "Plant":
        """Return the plant of these parameters; a subclass may choose another class."""
        return cls(parameters)

    @abstractmethod
    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """Return the state a step later.

        Args:
            targets: of the loops.
            state: at `time_s`, the start of the step.
            wind: at the aircraft; `at(time_s)` is (north, east) in m/s.
            time_s: simulation time of `state`.
            step_s: at most `longest_step_s`.
        """

    @abstractmethod
    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """Return the true motion in a state."""


def plant(name: str) -> Callable[[Kind], Kind]:
    """Return a decorator that registers a plant by a name.

    Raises:
        ValueError: the name is taken, or the class lacks something.
    """

    def add(found: Kind) -> Kind:
        plants.register(name)(found)
        plant_of.cache_clear()
        return found

    return add


@cache
def plant_of(parameters: PlantParameters) -> Plant:
    """Return the plant of these parameters.

    Raises:
        ValueError: the plant or one of its options is unknown.
    """
    made: Plant = plants.find(parameters.kind).of(parameters)
    return made


class AirState(msgspec.Struct, frozen=True, kw_only=True):
    """State from which an `AirPlant` computes its rates; north and east are the ground velocity."""

    heading_rad: float
    """Heading of the nose, the direction of the air velocity."""
    airspeed_m_s: float
    course_rad: float
    north_m_s: float
    east_m_s: float
    altitude_amsl_m: float
    climb_m_s: float
    """Climb rate of the height hold, positive up: energy for a climb is missing for the speed."""
    roll_rad: float
    """Bank, positive right; 0 where nothing rolls."""
    memory: tuple[float, ...]


class AirRates(msgspec.Struct, frozen=True, kw_only=True):
    """Rates of an `AirPlant`."""

    turn_rate_rad_s: float
    """Turn rate of the nose, positive right."""
    acceleration_m_s2: float
    roll_rate_rad_s: float = 0.0
    climb_m_s: float = 0.0
    """Climb rate in addition to the height hold's, positive up, such as from a change of speed."""
    memory: tuple[float, ...] = ()
    """Rate of each loop state, per second."""


class AirPlant(Plant):
    """An aircraft that flies along its nose in moving air; a subclass provides the rates.

    A second-order height hold is added. Airspeed is clamped to the range of the parameters.
    """

    memory: ClassVar[tuple[float, ...]] = ()
    """Initial loop states."""

    @abstractmethod
    def rates(self, targets: Targets, state: AirState) -> AirRates:
        """Return the rates in a state, for the targets of the loops."""

    def first_memory(self, state: PlantState) -> tuple[float, ...]:
        """Return the loop states before the first step."""
        del state
        return self.memory

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """Return the state after a midpoint (second-order Runge-Kutta) step."""
        half_s = 0.5 * step_s
        middle = self._advance(targets, state, state, wind.at(time_s), half_s)
        return self._advance(targets, state, middle, wind.at(time_s + half_s), step_s)

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """Return the motion of the nose through the air, and with the air over ground."""
        seen = self._air_state(state, wind_m_s)
        rates = self.rates(targets, seen)
        turning_rad = bank_of_rad(rates.turn_rate_rad_s, state.speed_m_s)
        return Motion(
            seen.north_m_s,
            seen.east_m_s,
            -(state.climb_m_s + rates.climb_m_s),
            wrap_to_two_pi(seen.course_rad),
            math.hypot(seen.north_m_s, seen.east_m_s),
            state.direction_rad,
            state.speed_m_s,
            rates.turn_rate_rad_s,
            state.roll_rad if self.parameters.rolls else turning_rad,
        )

    def _air_state(self, state: PlantState, wind_m_s: tuple[float, float]) -> AirState:
        north = state.speed_m_s * math.cos(state.direction_rad) + wind_m_s[0]
        east = state.speed_m_s * math.sin(state.direction_rad) + wind_m_s[1]
        return AirState(
            heading_rad=state.direction_rad,
            airspeed_m_s=state.speed_m_s,
            course_rad=math.atan2(east, north),
            north_m_s=north,
            east_m_s=east,
            altitude_amsl_m=state.altitude_amsl_m,
            climb_m_s=state.climb_m_s,
            roll_rad=state.roll_rad,
            memory=state.memory or self.first_memory(state),
        )

    def _advance(
        self,
        targets: Targets,
        state: PlantState,
        at: PlantState,
        wind_m_s: tuple[float, float],
        span_s: float,
    ) -> PlantState:
        """Return `state` after a span at the rates of the state `at`."""
        seen, parameters = self._air_state(at, wind_m_s), self.parameters
        rates = self.rates(targets, seen)
        climb_rate = climb_acceleration_m_s2(
            parameters, targets.height, at.altitude_amsl_m, at.climb_m_s
        )
        latitude, longitude = displace(
            state.latitude_rad,
            state.longitude_rad,
            state.altitude_amsl_m,
            north_m=span_s * seen.north_m_s,
            east_m=span_s * seen.east_m_s,
        )
        speed_m_s = state.speed_m_s + span_s * rates.acceleration_m_s2
        memory = state.memory or self.first_memory(state)
        # A sum with a non-finite term is not finite either.
        total = rates.turn_rate_rad_s + rates.acceleration_m_s2 + sum(rates.memory)
        if len(rates.memory) != len(memory) or not math.isfinite(total):
            raise ValueError(
                f"the plant {parameters.kind} gives rates that are not finite, or not {len(memory)} of memory"
            )
        return PlantState(
            wrap_to_two_pi(state.direction_rad + span_s * rates.turn_rate_rad_s),
            max(parameters.airspeed_min_m_s, min(parameters.airspeed_max_m_s, speed_m_s)),
            "airspeed",
            latitude,
            longitude,
            state.altitude_amsl_m + span_s * (at.climb_m_s + rates.climb_m_s),
            state.roll_rad + span_s * rates.roll_rate_rad_s,
            tuple(
                [value + span_s * rate for value, rate in zip(memory, rates.memory, strict=True)]
            ),
            climb_m_s=state.climb_m_s + span_s * climb_rate,
        )


def options_of(values: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Return options in the form that parameters hold."""
    return tuple(sorted((name, float(value)) for name, value in values.items()))
