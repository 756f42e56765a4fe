"""What an aircraft of the emulator is made of, one of one's own too, and the aircraft by their names.

A plant is the aircraft together with the loops that hold its targets. It is a pure function of its state:
from one state, what is held and the air, to the state a step later.
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
"""Aircraft with their loops, by the name that `--plant` and `rehearsal.emulator.plant` give."""


class PlantState(msgspec.Struct, frozen=True):
    """Position, motion, and the states of loops that have some."""

    direction_rad: float
    """Heading (all others) or course (course-hold), in [0, 2 pi)."""

    speed_m_s: float
    """The speed that `speed_kind` names."""

    speed_kind: SpeedKind
    """Always `airspeed` but on the course-hold plant."""

    latitude_rad: float
    """Geodetic latitude."""

    longitude_rad: float
    """Longitude, in (-pi, pi]."""

    altitude_amsl_m: float
    """Altitude, also taken as height above the ellipsoid (the geoid's 100 m at most are 2e-5)."""

    roll_rad: float = 0.0
    """Bank of the plants that roll, positive right."""

    memory: tuple[float, ...] = ()
    """State of the loops of an `AirPlant`; empty before its first step."""

    body: Body | None = None
    """State of the `six-dof` plant's body; None before its first step in the air."""

    climb_m_s: float = 0.0
    """Climb rate of the height hold, positive up; the `six-dof` plant has its own in its body."""


class Motion(msgspec.Struct, frozen=True):
    """The true motion at one instant."""

    north_m_s: float
    """Ground velocity."""

    east_m_s: float
    """Ground velocity."""

    down_m_s: float
    """Ground velocity, positive down."""

    course_rad: float
    """Direction of the ground velocity, [0, 2 pi)."""

    ground_speed_m_s: float
    """Horizontal speed over ground."""

    heading_rad: float
    """Direction of the nose, which is that of the air velocity but on the six-dof plant, [0, 2 pi)."""

    airspeed_m_s: float
    """Horizontal speed through the air."""

    turn_rate_rad_s: float
    """Turn rate of the nose, positive right."""

    bank_rad: float
    """Bank of the coordinated turn, positive right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions:
    """A plant without numbers of its own."""


class Plant(ABC):
    """An aircraft with its loops. A subclass with `@plant("name")` is known as `--plant name`."""

    longest_step_s: ClassVar[float] = 0.025
    """Longest step of the integration."""

    Options: ClassVar[type[Any]] = NoOptions
    """Numbers of its own: a frozen dataclass of floats with defaults."""

    def __init__(self, parameters: PlantParameters) -> None:
        """Make one of these limits and gains, and of the options in them.

        Raises:
            ValueError: it has no such option, or the option is not a number; the message names it.
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
        """The aircraft of these parameters: one of this class, where it can be."""
        return cls(parameters)

    @abstractmethod
    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """The state a step later.

        Args:
            targets: what the loops hold.
            state: now.
            wind: (north, east) in m/s by its `at(time_s)`, where the aircraft is.
            time_s: now.
            step_s: at most `longest_step_s`.
        """

    @abstractmethod
    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """The true motion in a state, of which the sensors tell."""


def plant(name: str) -> Callable[[Kind], Kind]:
    """Decorator that makes a class known by a name.

    Raises:
        ValueError: another plant has this name already, or the class leaves something out.
    """

    def add(found: Kind) -> Kind:
        plants.register(name)(found)
        plant_of.cache_clear()
        return found

    return add


@cache
def plant_of(parameters: PlantParameters) -> Plant:
    """The aircraft of these parameters.

    Raises:
        ValueError: there is no such plant, or it has no such options.
    """
    made: Plant = plants.find(parameters.kind).of(parameters)
    return made


class AirState(msgspec.Struct, frozen=True, kw_only=True):
    """What the rates of an aircraft that the air carries depend on."""

    heading_rad: float
    """Heading of the nose, which is where it flies through the air."""
    airspeed_m_s: float
    """True."""
    course_rad: float
    """Over ground."""
    north_m_s: float
    """Ground velocity."""
    east_m_s: float
    """Ground velocity."""
    altitude_amsl_m: float
    """m."""
    climb_m_s: float
    """Positive up: what a climb takes of the energy is missing for the speed."""
    roll_rad: float
    """Bank, positive right; 0 where nothing rolls."""
    memory: tuple[float, ...]
    """What the loops remember."""


class AirRates(msgspec.Struct, frozen=True, kw_only=True):
    """How such an aircraft moves."""

    turn_rate_rad_s: float
    """Turn rate of the nose, positive right."""
    acceleration_m_s2: float
    """Rate of change of the airspeed."""
    roll_rate_rad_s: float = 0.0
    """Rate of change of the bank."""
    climb_m_s: float = 0.0
    """Climb beside that of the height hold, positive up: what a change of speed gives or takes."""
    memory: tuple[float, ...] = ()
    """Rate of each thing that the loops remember, per second."""


class AirPlant(Plant):
    """An aircraft that flies where its nose points, in air that carries it: a subclass says how it answers.

    Height is a hold of second order beside it. Airspeed stays within the range of the parameters.
    """

    memory: ClassVar[tuple[float, ...]] = ()
    """What the loops remember at first."""

    @abstractmethod
    def rates(self, targets: Targets, state: AirState) -> AirRates:
        """How it moves in a state, with what its loops hold."""

    def first_memory(self, state: PlantState) -> tuple[float, ...]:
        """What the loops remember at their first step."""
        del state
        return self.memory

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """A midpoint (second-order Runge-Kutta) step."""
        half_s = 0.5 * step_s
        middle = self._advance(targets, state, state, wind.at(time_s), half_s)
        return self._advance(targets, state, middle, wind.at(time_s + half_s), step_s)

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """Motion of the nose through the air, and with the air over ground."""
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
        """A state after a span at the rates of another."""
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
        # Of what is not finite the sum is not, either.
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
    """Options as parameters hold them."""
    return tuple(sorted((name, float(value)) for name, value in values.items()))
