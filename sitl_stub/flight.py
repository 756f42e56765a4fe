"""One aircraft in the air: its state, what its loops hold, the mode that decides about them."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from sitl_stub.angles import wrap_to_two_pi
from sitl_stub.loops import bank_of_rad, climb_rate_m_s
from sitl_stub.modes import Mode
from sitl_stub.plant import MAX_STEP_S, RATES, PlantParameters, PlantState, stepped, with_speed_kind
from sitl_stub.targets import HeightTarget, SpeedTarget, Targets, TurnTarget
from sitl_stub.wind import Wind

CIRCLE_BANK_RAD = math.radians(15.0)
"""Bank of a loiter: 150 m of radius at 20 m/s."""

WIND_ESTIMATE_TIME_CONSTANT_S = 20.0
"""How slowly the autopilot's own estimate of the wind follows the wind."""


class Motion(NamedTuple):
    """The true motion at one instant. A tuple, since one is made per report."""

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
    """Direction of the nose, which is that of the air velocity (no sideslip), [0, 2 pi)."""

    airspeed_m_s: float
    """Horizontal speed through the air."""

    turn_rate_rad_s: float
    """Of the velocity that the plant turns, positive right."""

    bank_rad: float
    """Of the coordinated turn, positive right."""


@dataclass(frozen=True, slots=True)
class Home:
    """Where the flight started, on the ground."""

    latitude_rad: float
    """Geodetic latitude."""

    longitude_rad: float
    """Longitude."""

    altitude_amsl_m: float
    """Altitude of the ground there."""


class Flight:
    """Plant, wind, targets and mode together; advanced in simulation time (whole microseconds)."""

    def __init__(
        self,
        *,
        plant: PlantParameters,
        wind: Wind,
        state: PlantState,
        home: Home,
        cruise_airspeed_m_s: float,
        mode: Mode,
        armed: bool,
    ) -> None:
        self.plant = plant
        self.state = state
        self.home = home
        self.mode = mode
        self.armed = armed
        self.time_us = 0
        self.texts: list[str] = []
        """Status texts not yet sent."""
        self.wind_estimate_m_s = (0.0, 0.0)
        """The autopilot's own (north, east): it starts knowing nothing."""
        self._wind = wind
        self._cruise_airspeed_m_s = cruise_airspeed_m_s
        # Straight on at first, so that there is a motion from which the mode is entered.
        straight = TurnTarget("course", state.direction_rad)
        hold_speed = SpeedTarget("airspeed", cruise_airspeed_m_s)
        self.targets = Targets(straight, hold_speed, HeightTarget(state.altitude_amsl_m))
        self._known = (self.state, self.targets, self._motion_now())
        self.targets = self._targets_at_entry(mode)

    @property
    def wind_m_s(self) -> tuple[float, float]:
        """The true wind now, (north, east)."""
        return self._wind.at(self.time_us * 1e-6)

    def motion(self) -> Motion:
        """The true motion now."""
        # Asked for several times at one instant. Both parts are immutable and replaced as they change.
        if self._known[0] is not self.state or self._known[1] is not self.targets:
            self._known = (self.state, self.targets, self._motion_now())
        return self._known[2]

    def _motion_now(self) -> Motion:
        wind_m_s = self.wind_m_s
        state = with_speed_kind(self.state, self.targets.speed.kind, wind_m_s)
        rates = RATES[self.plant.kind](
            self.plant, self.targets, state.direction_rad, state.speed_m_s, wind_m_s
        )
        north_m_s, east_m_s = rates.north_m_s, rates.east_m_s
        air_north_m_s, air_east_m_s = north_m_s - wind_m_s[0], east_m_s - wind_m_s[1]
        ground_speed_m_s = math.hypot(north_m_s, east_m_s)
        airspeed_m_s = math.hypot(air_north_m_s, air_east_m_s)
        turning_speed_m_s = airspeed_m_s if self.plant.kind == "heading-hold" else ground_speed_m_s
        return Motion(
            north_m_s,
            east_m_s,
            -climb_rate_m_s(self.plant, self.targets.height, state.altitude_amsl_m),
            wrap_to_two_pi(math.atan2(east_m_s, north_m_s)),
            ground_speed_m_s,
            wrap_to_two_pi(math.atan2(air_east_m_s, air_north_m_s)),
            airspeed_m_s,
            rates.turn_rate_rad_s,
            bank_of_rad(rates.turn_rate_rad_s, turning_speed_m_s),
        )

    def advance(self, to_us: int) -> None:
        """Integrate the plant up to `to_us`, in equal steps no longer than `MAX_STEP_S`."""
        start_s, span_s = self.time_us * 1e-6, (to_us - self.time_us) * 1e-6
        # A span a hair longer than n steps is still n steps.
        steps = math.ceil(span_s / MAX_STEP_S - 1e-6)
        for index in range(steps):
            step_s = span_s / steps
            self.state = stepped(
                self.plant,
                self.targets,
                self.state,
                self._wind,
                time_s=start_s + index * step_s,
                step_s=step_s,
            )
        self.time_us = to_us
        self._estimate_wind(span_s)

    def _estimate_wind(self, span_s: float) -> None:
        north, east = self.wind_m_s
        share = -math.expm1(-span_s / WIND_ESTIMATE_TIME_CONSTANT_S)
        known_north, known_east = self.wind_estimate_m_s
        self.wind_estimate_m_s = (
            known_north + share * (north - known_north),
            known_east + share * (east - known_east),
        )

    def enter(self, mode: Mode) -> None:
        """Change the mode and forget all commands. Entering the present mode changes nothing."""
        if mode is not self.mode:
            self.mode = mode
            self.targets = self._targets_at_entry(mode)

    def hold_turn(self, target: TurnTarget) -> None:
        """Give the lateral loop a new target."""
        self.targets = Targets(target, self.targets.speed, self.targets.height)

    def hold_speed(self, target: SpeedTarget) -> None:
        """Give the speed loop a new target."""
        self.targets = Targets(self.targets.turn, target, self.targets.height)

    def hold_height(self, target: HeightTarget) -> None:
        """Give the height loop a new target."""
        self.targets = Targets(self.targets.turn, self.targets.speed, target)

    def circle(self) -> None:
        """Turn right at the loiter's bank: what guided flight does until it is told a course."""
        self.hold_turn(TurnTarget("bank", CIRCLE_BANK_RAD))

    def cruise(self) -> None:
        """Back to the airspeed the flight started with."""
        self.hold_speed(SpeedTarget("airspeed", self._cruise_airspeed_m_s))

    def _targets_at_entry(self, mode: Mode) -> Targets:
        """Cruise airspeed and present height; straight on, or the loiter's circle."""
        if mode.flies == "straight":
            turn = TurnTarget("course", self.motion().course_rad)
        else:
            turn = TurnTarget("bank", CIRCLE_BANK_RAD)
        return Targets(
            turn,
            SpeedTarget("airspeed", self._cruise_airspeed_m_s),
            HeightTarget(self.state.altitude_amsl_m),
        )
