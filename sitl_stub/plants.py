"""The aircraft that can be flown, by name, and what an aircraft of one's own is made of.

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
from msgspec.structs import replace

from sitl_stub.air import Wind
from sitl_stub.aircraft import PlantParameters
from sitl_stub.geometry import displace, wrap_to_two_pi
from sitl_stub.lagging_plant import MAX_LAGGING_STEP_S, lagging_stepped
from sitl_stub.loops import Targets, bank_of_rad, climb_acceleration_m_s2
from sitl_stub.motion import Motion, body_motion, ideal_motion, lagging_motion
from sitl_stub.plant import MAX_STEP_S, PlantState, stepped
from sitl_stub.registry import plants
from sitl_stub.six_dof import MAX_SIX_DOF_STEP_S, six_dof_stepped

Kind = TypeVar("Kind", bound="type[Plant]")


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
        ValueError: it has no such options.
    """
    kind = plants.find(parameters.kind)
    # A slow hold of the speed makes of the first-order one another aircraft.
    if kind is Ideal and parameters.lags:
        kind = Lagging
    made: Plant = kind(parameters)
    return made


@plant("course-hold")
@plant("heading-hold")
class Ideal(Plant):
    """First order: see `plant`."""

    longest_step_s = MAX_STEP_S

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """A midpoint step."""
        return stepped(self.parameters, targets, state, wind, time_s=time_s, step_s=step_s)

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """By the rates of its loops."""
        return ideal_motion(self.parameters, targets, state, wind_m_s)


@plant("npfg")
@plant("bank")
class Lagging(Plant):
    """Roll and speed have states of their own: see `lagging_plant`."""

    longest_step_s = MAX_LAGGING_STEP_S

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """A midpoint step."""
        return lagging_stepped(self.parameters, targets, state, wind, time_s=time_s, step_s=step_s)

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """By the rates of its loops."""
        return lagging_motion(self.parameters, targets, state, wind_m_s)


@plant("six-dof")
class SixDof(Plant):
    """A rigid body: see `six_dof`."""

    longest_step_s = MAX_SIX_DOF_STEP_S

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """A midpoint step."""
        return six_dof_stepped(self.parameters, targets, state, wind, time_s=time_s, step_s=step_s)

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """Motion of the body."""
        del targets
        return body_motion(state, wind_m_s)


class AirState(msgspec.Struct, frozen=True, kw_only=True):
    """What the rates of an aircraft of one's own depend on."""

    heading_rad: float
    """Heading of the nose, which is where it flies through the air."""
    airspeed_m_s: float
    """True."""
    course_rad: float
    """Over ground."""
    altitude_amsl_m: float
    """m."""
    climb_m_s: float
    """Positive up: what a climb takes of the energy is missing for the speed."""
    memory: tuple[float, ...]
    """What the loops remember."""


class AirRates(msgspec.Struct, frozen=True, kw_only=True):
    """How such an aircraft moves."""

    turn_rate_rad_s: float
    """Turn rate of the nose, positive right."""
    acceleration_m_s2: float
    """Rate of change of the airspeed."""
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

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """A midpoint (second-order Runge-Kutta) step."""
        half_s = 0.5 * step_s
        start = self._advance(targets, state, state, wind.at(time_s), half_s)
        return self._advance(targets, state, start, wind.at(time_s + half_s), step_s)

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """Motion of the nose through the air, and with the air over ground."""
        seen = self._air_state(state, wind_m_s)
        rates = self.rates(targets, seen)
        north, east = over_ground(seen, wind_m_s)
        return Motion(
            north,
            east,
            -state.climb_m_s,
            wrap_to_two_pi(seen.course_rad),
            math.hypot(north, east),
            state.direction_rad,
            state.speed_m_s,
            rates.turn_rate_rad_s,
            bank_of_rad(rates.turn_rate_rad_s, state.speed_m_s),
        )

    def _air_state(self, state: PlantState, wind_m_s: tuple[float, float]) -> AirState:
        seen = AirState(
            heading_rad=state.direction_rad,
            airspeed_m_s=state.speed_m_s,
            course_rad=0.0,
            altitude_amsl_m=state.altitude_amsl_m,
            climb_m_s=state.climb_m_s,
            memory=state.memory or self.memory,
        )
        north, east = over_ground(seen, wind_m_s)
        return replace(seen, course_rad=math.atan2(east, north))

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
        north, east = over_ground(seen, wind_m_s)
        climb_rate = climb_acceleration_m_s2(
            parameters, targets.height, at.altitude_amsl_m, at.climb_m_s
        )
        latitude, longitude = displace(
            state.latitude_rad,
            state.longitude_rad,
            state.altitude_amsl_m,
            north_m=span_s * north,
            east_m=span_s * east,
        )
        speed_m_s = state.speed_m_s + span_s * rates.acceleration_m_s2
        memory = state.memory or self.memory
        numbers = (rates.turn_rate_rad_s, rates.acceleration_m_s2, *rates.memory)
        if len(rates.memory) != len(memory) or not all(map(math.isfinite, numbers)):
            raise ValueError(
                f"the plant {parameters.kind} gives rates that are not finite, or not {len(memory)} of memory"
            )
        return PlantState(
            wrap_to_two_pi(state.direction_rad + span_s * rates.turn_rate_rad_s),
            max(parameters.airspeed_min_m_s, min(parameters.airspeed_max_m_s, speed_m_s)),
            "airspeed",
            latitude,
            longitude,
            state.altitude_amsl_m + span_s * at.climb_m_s,
            memory=tuple(
                value + span_s * rate for value, rate in zip(memory, rates.memory, strict=True)
            ),
            climb_m_s=state.climb_m_s + span_s * climb_rate,
        )


def over_ground(state: AirState, wind_m_s: tuple[float, float]) -> tuple[float, float]:
    """(north, east) velocity over ground, m/s."""
    return (
        state.airspeed_m_s * math.cos(state.heading_rad) + wind_m_s[0],
        state.airspeed_m_s * math.sin(state.heading_rad) + wind_m_s[1],
    )


def options_of(values: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Options as parameters hold them."""
    return tuple(sorted((name, float(value)) for name, value in values.items()))
