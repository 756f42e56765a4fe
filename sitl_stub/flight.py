"""Flight of one aircraft: its state, flight phase, mode and loop targets.

Includes the take-off, loitering in a vector field around a point, and the dead times of commands.
"""

import math
from collections.abc import Callable, Iterable
from typing import Literal

import msgspec
from msgspec.structs import replace

from sitl_stub.air import Air, AirData, AirPlace, Wind, followed_wind_m_s
from sitl_stub.geometry import Home, displace, radii_m, wrap_to_pi, wrap_to_two_pi
from sitl_stub.loops import (
    CENTIDEGREE_RAD,
    GRAVITY_M_S2,
    AltitudeTarget,
    PlantParameters,
    SpeedTarget,
    Targets,
    TurnTarget,
    in_true_height,
)
from sitl_stub.plant import Motion, PlantState, plant_of
from sitl_stub.route import Route, RouteFollower


class AutopilotMode(msgspec.Struct, frozen=True):
    """One flight mode."""

    name: str
    """Name in status texts and ground stations."""

    custom_mode: int
    flies: Literal["commanded", "circle", "straight", "loiter", "home", "take-off"] = "straight"
    """Behaviour of the mode.

    `commanded` obeys commands, `circle` turns at a constant bank, and `straight` keeps the course at entry.
    `loiter` circles around the position at entry, `home` around home. `take-off` climbs, from the ground if
    need be, and then loiters.

    PX4's Guided Course keeps the course it was entered with until it is commanded another.
    AUTO and pilots' modes fly straight on, since there is no mission and no stick.
    """


def by_number(modes: Iterable[AutopilotMode]) -> dict[int, AutopilotMode]:
    """Return the modes by their number on the wire."""
    return {mode.custom_mode: mode for mode in modes}


ROLL_ACCELERATION_M_S2 = 4.0
"""Acceleration along the runway."""

LIFT_OFF_MARGIN = 1.1
"""Ratio of the lift-off airspeed to the slowest airspeed."""

REACHED_WITHIN_M = 2.0
"""Distance below the wanted height at which a climb is complete, as in ArduPlane."""


def rolling_motion(state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
    """Return the motion on the ground: along the nose, at the state's ground speed."""
    north, east = math.cos(state.direction_rad), math.sin(state.direction_rad)
    against_m_s = north * wind_m_s[0] + east * wind_m_s[1]
    return Motion(
        state.speed_m_s * north,
        state.speed_m_s * east,
        0.0,
        state.direction_rad,
        state.speed_m_s,
        state.direction_rad,
        # A tailwind does not register in the pitot tube.
        max(0.0, state.speed_m_s - against_m_s),
        0.0,
        0.0,
    )


Phase = Literal["standing", "rolling", "climbing", "flying"]
"""Standing and rolling are on the ground; climbing is the airborne part of the take-off."""


class Navigation(msgspec.Struct, frozen=True, kw_only=True):
    """Distances of the flight modes, from the autopilot's parameters."""

    take_off_height_m: float = 50.0
    """Above home."""

    take_off_distance_m: float = 200.0
    """Distance from home to the centre of the loiter after a take-off."""

    loiter_radius_m: float = 80.0
    """Negative is counter-clockwise."""

    return_height_m: float = 100.0
    """Height above home on the return to it; negative keeps the present one."""


def rolled(state: PlantState, step_s: float) -> PlantState:
    """Return the state after one more step of rolling along the runway."""
    speed_m_s = state.speed_m_s + ROLL_ACCELERATION_M_S2 * step_s
    way_m = 0.5 * (state.speed_m_s + speed_m_s) * step_s
    latitude_rad, longitude_rad = displace(
        state.latitude_rad,
        state.longitude_rad,
        state.altitude_amsl_m,
        north_m=way_m * math.cos(state.direction_rad),
        east_m=way_m * math.sin(state.direction_rad),
    )
    return replace(
        state, speed_m_s=speed_m_s, latitude_rad=latitude_rad, longitude_rad=longitude_rad
    )


def lifts_off(plant: PlantParameters, state: PlantState, wind_m_s: tuple[float, float]) -> bool:
    """Check whether the airspeed suffices for lifting off."""
    wanted_m_s = min(LIFT_OFF_MARGIN * plant.airspeed_min_m_s, plant.airspeed_max_m_s)
    return rolling_motion(state, wind_m_s).airspeed_m_s >= wanted_m_s


def airborne(
    plant: PlantParameters, state: PlantState, wind_m_s: tuple[float, float]
) -> PlantState:
    """Convert the state on the ground to the plant's state in the air."""
    motion = rolling_motion(state, wind_m_s)
    air_north_m_s, air_east_m_s = motion.north_m_s - wind_m_s[0], motion.east_m_s - wind_m_s[1]
    heading_rad = wrap_to_two_pi(math.atan2(air_east_m_s, air_north_m_s))
    airspeed_m_s = math.hypot(air_north_m_s, air_east_m_s)
    return replace(
        state,
        direction_rad=state.direction_rad if plant.kind == "course-hold" else heading_rad,
        speed_m_s=max(plant.airspeed_min_m_s, min(plant.airspeed_max_m_s, airspeed_m_s)),
        speed_kind="airspeed",
    )


FIELD_GAIN = 2.0
"""Gain of the field around the circle, as a multiple of 1 / radius."""

LEAST_AIRSPEED_M_S = 1.0

GREATEST_BANK_DEG = 80.0
"""Limits of the parameters: a slower airspeed or a larger bank would make turns without bound."""

CIRCLE_BANK_RAD = math.radians(15.0)
"""Bank of a circle without a centre: 150 m of radius at 20 m/s."""


class Orbit(msgspec.Struct, frozen=True):
    """A circle around a geodetic position."""

    latitude_rad: float
    longitude_rad: float
    radius_m: float
    clockwise: bool = True

    def course_rad(self, latitude_rad: float, longitude_rad: float, *, lead_rad: float) -> float:
        """Return the course over ground at a position: toward the circle, then along it.

        chi = beta + s (pi/2 + atan(k (d - R)) + lead), beta and d bearing and distance of the aircraft
        from the centre, s = 1 clockwise (Nelson et al., Vector Field Path Following, 2007). The lead
        compensates the lag of the course loop on a circle.
        """
        meridian_m, transverse_m = radii_m(self.latitude_rad)
        north_m = (latitude_rad - self.latitude_rad) * meridian_m
        east_m = wrap_to_pi(longitude_rad - self.longitude_rad)
        east_m *= transverse_m * math.cos(self.latitude_rad)
        outside_m = math.hypot(north_m, east_m) - self.radius_m
        inward_rad = math.atan(FIELD_GAIN / self.radius_m * outside_m)
        sense = 1.0 if self.clockwise else -1.0
        # Only the circle itself needs the lead: the way to it has no turn.
        led_rad = lead_rad * math.cos(inward_rad)
        return math.atan2(east_m, north_m) + sense * (0.5 * math.pi + inward_rad + led_rad)


def orbit_lead_rad(plant: PlantParameters, airspeed_m_s: float, radius_m: float) -> float:
    """Return the lead of the commanded over the actual course in a steady turn, in calm air.

    First order: (V / R) / alpha. `bank`: the turn's bank over GUIDED_P.
    """
    if plant.banks:
        turning_m_s2 = airspeed_m_s * airspeed_m_s / (radius_m * plant.turn_efficiency)
        bank_rad = min(math.atan(turning_m_s2 / GRAVITY_M_S2), plant.max_bank_rad)
        return min(1.0, bank_rad / (plant.guided_p_cdeg_rad * CENTIDEGREE_RAD))
    return min(1.0, airspeed_m_s / radius_m / plant.alpha_1_s)


class Commanded:
    """Present targets of the loops, and commands that are still in their dead time."""

    def __init__(self, plant: PlantParameters, targets: Targets) -> None:
        self.now = targets
        self._turn_delay_us = round(plant.course_dead_time_s * 1e6)
        self._speed_delay_us = round(plant.speed_delay_s * 1e6)
        self._coming: list[tuple[int, TurnTarget | SpeedTarget]] = []

    @property
    def next_us(self) -> int | None:
        """Time at which the next command reaches its loop; None if there is none."""
        return min((due_us for due_us, _ in self._coming), default=None)

    def set_all(self, targets: Targets) -> None:
        """Replace all targets at once, as a change of mode does, and forget pending commands."""
        self.now = targets
        self._coming.clear()

    def turn(self, target: TurnTarget, now_us: int) -> None:
        """Command the lateral loop."""
        self._coming.append((now_us + self._turn_delay_us, target))
        self.take_effect(now_us)

    def speed(self, target: SpeedTarget, now_us: int) -> None:
        """Command the speed loop."""
        self._coming.append((now_us + self._speed_delay_us, target))
        self.take_effect(now_us)

    def height(self, target: AltitudeTarget) -> None:
        """Command the height loop, which has no dead time."""
        self.now = Targets(self.now.turn, self.now.speed, target)

    def take_effect(self, time_us: int) -> None:
        """Apply the commands whose dead time has passed."""
        for due_us, target in self._coming:
            if due_us <= time_us:
                part = "turn" if isinstance(target, TurnTarget) else "speed"
                self.now = replace(self.now, **{part: target})
        self._coming = [one for one in self._coming if one[0] > time_us]


class EmulatedFlight:
    """Plant, wind, targets and mode of one aircraft, advanced in simulation time (whole microseconds)."""

    def __init__(
        self,
        *,
        plant: PlantParameters,
        air: Air,
        state: PlantState,
        home: Home,
        cruise_airspeed_m_s: float,
        mode: AutopilotMode,
        armed: bool,
        on_ground: bool = False,
        air_data: AirData | None = None,
        altitude_drift_m: Callable[[float], float] = lambda _time_s: 0.0,
    ) -> None:
        self.state = state
        self.home = home
        self.mode = mode
        self.armed = armed
        self.time_us = 0
        self.phase: Phase = "standing" if on_ground else "flying"
        self.texts: list[str] = []
        self.wind_estimate_m_s = (0.0, 0.0)
        """The autopilot's own wind estimate (north, east), initially zero."""
        self.navigation = Navigation()
        self.cruise_airspeed_m_s = cruise_airspeed_m_s
        """Shown airspeed that is flown without commands."""
        self.airspeed_range_m_s = (plant.airspeed_min_m_s, plant.airspeed_max_m_s)
        """Range of commanded airspeeds, as shown."""
        self._air_data = air_data or AirData()
        self._altitude_drift_m = altitude_drift_m
        self._air = air
        self._orbit: Orbit | None = None
        self._route: RouteFollower | None = None
        self.plant = self._in_true_airspeed(plant)
        # Start straight, so that there is a motion from which the mode is entered.
        straight = TurnTarget("course", state.direction_rad)
        hold_speed = SpeedTarget("airspeed", self.true_airspeed_m_s(cruise_airspeed_m_s))
        targets = Targets(straight, hold_speed, AltitudeTarget(self.measured_altitude_m))
        self._commanded = Commanded(self.plant, targets)
        self._known = (self.state, self.targets, self._motion_now())
        self._enter_in_flight(mode, starts=True)

    @property
    def targets(self) -> Targets:
        """Present targets of the loops, with the altitude as measured."""
        return self._commanded.now

    @property
    def present_orbit(self) -> Orbit | None:
        """Present circle around a point; None without one."""
        return self._orbit

    @property
    def on_ground(self) -> bool:
        """Whether the wheels are on the ground."""
        return self.phase in {"standing", "rolling"}

    @property
    def wind_m_s(self) -> tuple[float, float]:
        """True wind now, (north, east)."""
        return self.wind_here.at(self.time_us * 1e-6)

    @property
    def wind_here(self) -> Wind:
        """Wind at the aircraft as a function of time alone, for one step."""
        state = self.state
        return self._air.near(
            AirPlace(
                state.latitude_rad,
                state.longitude_rad,
                state.altitude_amsl_m,
                state.altitude_amsl_m - self.home.altitude_amsl_m,
            )
        )

    def motion(self) -> Motion:
        """Return the true motion now."""
        # Cached, since several reports need it at one instant; state and targets are immutable.
        if self._known[0] is not self.state or self._known[1] is not self.targets:
            self._known = (self.state, self.targets, self._motion_now())
        return self._known[2]

    @property
    def measured_altitude_m(self) -> float:
        """Altitude above mean sea level that the autopilot measures."""
        return self.state.altitude_amsl_m + self._altitude_drift_m(self.time_us * 1e-6)

    def shown_airspeed_m_s(self, true_m_s: float) -> float:
        """Return the reading of the airspeed sensor at a true airspeed."""
        return true_m_s * self._air_data.shown_per_true(self.state.altitude_amsl_m)

    def true_airspeed_m_s(self, shown_m_s: float) -> float:
        """Return the true airspeed at a reading of the airspeed sensor."""
        return shown_m_s / self._air_data.shown_per_true(self.state.altitude_amsl_m)

    def advance(self, to_us: int) -> None:
        """Fly on to `to_us`; commands take effect when their dead time ends."""
        span_s = (to_us - self.time_us) * 1e-6
        while (reach_us := self._commanded.next_us) is not None and reach_us <= to_us:
            self._integrate(reach_us)
            self._commanded.take_effect(reach_us)
        self._integrate(to_us)
        self.wind_estimate_m_s = followed_wind_m_s(self.wind_estimate_m_s, self.wind_m_s, span_s)

    def enter(self, mode: AutopilotMode) -> None:
        """Change the mode and forget all commands; the present mode again changes nothing."""
        if mode is not self.mode:
            self.mode = mode
            if not self.on_ground:
                self.phase = "flying"
                self._enter_in_flight(mode)
            self._roll_or_stand()

    def set_armed(self, *, armed: bool) -> None:
        """Arm or disarm; an armed aircraft on the ground in a take-off mode rolls, all others stand."""
        self.armed = armed
        self._roll_or_stand()

    def set_airspeed_range(self, slowest_m_s: float, fastest_m_s: float) -> None:
        """Change the range of shown airspeeds that are commanded and flown."""
        self.airspeed_range_m_s = (slowest_m_s, fastest_m_s)
        limits = replace(self.plant, airspeed_min_m_s=slowest_m_s, airspeed_max_m_s=fastest_m_s)
        self.plant = self._in_true_airspeed(limits)

    def set_max_bank_deg(self, max_bank_deg: float) -> None:
        """Change the bank limit, unless the new one cannot be flown."""
        if 0.0 < max_bank_deg <= GREATEST_BANK_DEG:
            self.plant = replace(self.plant, max_bank_rad=math.radians(max_bank_deg))

    def hold_turn(self, target: TurnTarget) -> None:
        """Give the lateral loop a new target."""
        self._orbit = self._route = None
        self._commanded.turn(target, self.time_us)

    def hold_speed(self, target: SpeedTarget) -> None:
        """Give the speed loop a new target: a shown airspeed or a true ground speed."""
        if target.kind == "airspeed":
            true_m_s = self.true_airspeed_m_s(target.speed_m_s)
            target = SpeedTarget(target.kind, true_m_s, target.max_acceleration_m_s2)
        self._commanded.speed(target, self.time_us)

    def hold_height(self, target: AltitudeTarget) -> None:
        """Give the height loop a new target."""
        self._commanded.height(target)

    def circle(self) -> None:
        """Turn right at the circle's bank, as guided flight does until it is commanded a course."""
        self.hold_turn(TurnTarget("bank", CIRCLE_BANK_RAD))

    def follow(self, route: Route) -> None:
        """Fly a route, until the mode changes."""
        self._orbit, self._route = None, RouteFollower(route)

    def orbit(self, orbit: Orbit) -> None:
        """Loiter around a point."""
        self.circle()
        self._orbit = orbit

    def orbit_at(self, latitude_rad: float, longitude_rad: float) -> Orbit:
        """Return the loiter around a point, with the radius of the parameters."""
        radius_m = self.navigation.loiter_radius_m
        return Orbit(latitude_rad, longitude_rad, max(abs(radius_m), 1.0), radius_m >= 0.0)

    def cruise(self) -> None:
        """Return to the airspeed without commands."""
        self.hold_speed(SpeedTarget("airspeed", self.cruise_airspeed_m_s))

    def _roll_or_stand(self) -> None:
        """Let an aircraft on the ground roll, if it is armed in a mode that takes off, or stop."""
        if not self.on_ground:
            return
        if self.armed and self.mode.flies == "take-off":
            self.phase = "rolling"
        else:
            self.phase = "standing"
            self.state = replace(self.state, speed_m_s=0.0)

    def _in_true_airspeed(self, plant: PlantParameters) -> PlantParameters:
        """Convert the airspeed range of the plant from shown to true airspeed."""
        if self._air_data == AirData():
            return plant
        return replace(
            plant,
            airspeed_min_m_s=self.true_airspeed_m_s(plant.airspeed_min_m_s),
            airspeed_max_m_s=self.true_airspeed_m_s(plant.airspeed_max_m_s),
        )

    def _motion_now(self) -> Motion:
        if self.on_ground:
            return rolling_motion(self.state, self.wind_m_s)
        return plant_of(self.plant).motion(self.targets, self.state, self.wind_m_s)

    def _integrate(self, to_us: int) -> None:
        """Integrate up to `to_us`, in equal steps no longer than the plant's longest."""
        start_s, span_s = self.time_us * 1e-6, (to_us - self.time_us) * 1e-6
        longest_s = plant_of(self.plant).longest_step_s
        # The tolerance keeps a span that is slightly longer than n steps at n steps.
        steps = math.ceil(span_s / longest_s - 1e-6)
        for index in range(steps):
            step_s = span_s / steps
            self._step(start_s + index * step_s, step_s)
        self.time_us = to_us

    def _step(self, time_s: float, step_s: float) -> None:
        if self.on_ground:
            self._step_on_ground(time_s, step_s)
            return
        if self._orbit is not None:
            self._steer_around(self._orbit)
        elif self._route is not None:
            self._steer_along(self._route)
        targets = in_true_height(self.targets, self._altitude_drift_m(time_s))
        self.state = plant_of(self.plant).step(
            targets, self.state, self.wind_here, time_s=time_s, step_s=step_s
        )
        if self.phase == "climbing" and self._has_climbed():
            self.phase = "flying"
            course_rad, home = self.targets.turn.angle_rad, self.home
            distance_m = self.navigation.take_off_distance_m
            ahead = displace(
                home.latitude_rad,
                home.longitude_rad,
                home.altitude_amsl_m,
                north_m=distance_m * math.cos(course_rad),
                east_m=distance_m * math.sin(course_rad),
            )
            self.orbit(self.orbit_at(*ahead))

    def _step_on_ground(self, time_s: float, step_s: float) -> None:
        if self.phase == "standing":
            return
        self.state = rolled(self.state, step_s)
        wind_m_s = self.wind_here.at(time_s + step_s)
        if lifts_off(self.plant, self.state, wind_m_s):
            course_rad = self.state.direction_rad
            self.state = airborne(self.plant, self.state, wind_m_s)
            self.phase = "climbing"
            height_m = self.home.altitude_amsl_m + self.navigation.take_off_height_m
            cruise_m_s = self.true_airspeed_m_s(self.cruise_airspeed_m_s)
            self._orbit = self._route = None
            self._commanded.set_all(
                Targets(
                    TurnTarget("course", course_rad),
                    SpeedTarget("airspeed", cruise_m_s),
                    AltitudeTarget(height_m),
                )
            )

    def _steer_around(self, orbit: Orbit) -> None:
        lead_rad = orbit_lead_rad(self.plant, self.state.speed_m_s, orbit.radius_m)
        course_rad = orbit.course_rad(
            self.state.latitude_rad, self.state.longitude_rad, lead_rad=lead_rad
        )
        now = self._commanded.now
        self._commanded.now = Targets(TurnTarget("course", course_rad), now.speed, now.height)

    def _steer_along(self, route: RouteFollower) -> None:
        state, now = self.state, self._commanded.now
        course_rad = route.course_rad(
            state.latitude_rad, state.longitude_rad, self.motion().ground_speed_m_s
        )
        self._commanded.now = Targets(TurnTarget("course", course_rad), now.speed, now.height)

    def _has_climbed(self) -> bool:
        wanted_m = self.targets.height.altitude_amsl_m
        return self.measured_altitude_m >= wanted_m - REACHED_WITHIN_M

    def _enter_in_flight(self, mode: AutopilotMode, *, starts: bool = False) -> None:
        """Set the targets of a mode: cruise airspeed, its height, and a turn or straight flight."""
        altitude_m = self.measured_altitude_m
        self._orbit = self._route = None
        if mode.flies == "straight":
            turn = TurnTarget("course", self.motion().course_rad)
        else:
            turn = TurnTarget("bank", CIRCLE_BANK_RAD)
        cruise_m_s = self.true_airspeed_m_s(self.cruise_airspeed_m_s)
        if mode.flies == "home" and self.navigation.return_height_m >= 0.0:
            altitude_m = self.home.altitude_amsl_m + self.navigation.return_height_m
        if mode.flies == "take-off":
            wanted_m = self.home.altitude_amsl_m + self.navigation.take_off_height_m
            altitude_m = max(altitude_m, wanted_m)
        speed = SpeedTarget("airspeed", cruise_m_s)
        self._commanded.set_all(Targets(turn, speed, AltitudeTarget(altitude_m)))
        if mode.flies == "home":
            self._orbit = self.orbit_at(self.home.latitude_rad, self.home.longitude_rad)
        elif mode.flies in {"loiter", "take-off"} and not starts:
            # A flight that starts in a loiter is already on its circle, whose centre is unknown.
            self._orbit = self.orbit_at(self.state.latitude_rad, self.state.longitude_rad)
