"""One aircraft: its state, what its loops hold, the mode that decides about them.

From standing on the ground into the air. Loitering around a point: a course for every place, by a vector
field. What was commanded and what the loops know of it yet: commands may have a dead time.
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
    """The number in HEARTBEAT.custom_mode."""

    flies: Literal["commanded", "circle", "straight", "loiter", "home", "take-off"] = "straight"
    """Obeys commands; turns at a constant bank; keeps the course it had at entry; circles around the
    place of its entry, or around home; climbs, from the ground if need be, and then loiters.

    PX4's Guided Course keeps the course it was entered with until it is commanded another.
    Neither AUTO nor a pilot's mode has a mission or a stick here, so they fly straight on.
    """


def by_number(modes: Iterable[AutopilotMode]) -> dict[int, AutopilotMode]:
    """The modes by the number on the wire."""
    return {mode.custom_mode: mode for mode in modes}


ROLL_ACCELERATION_M_S2 = 4.0
"""Along the runway."""

LIFT_OFF_MARGIN = 1.1
"""Airspeed of lifting off, in parts of the slowest that is flown."""

REACHED_WITHIN_M = 2.0
"""Below the wanted height by which a climb counts as over, as in ArduPlane."""


def rolling_motion(state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
    """On the ground: along the nose, at the state's speed over ground."""
    north, east = math.cos(state.direction_rad), math.sin(state.direction_rad)
    against_m_s = north * wind_m_s[0] + east * wind_m_s[1]
    return Motion(
        state.speed_m_s * north,
        state.speed_m_s * east,
        0.0,
        state.direction_rad,
        state.speed_m_s,
        state.direction_rad,
        # What blows into the tube from ahead; from behind it shows nothing.
        max(0.0, state.speed_m_s - against_m_s),
        0.0,
        0.0,
    )


Phase = Literal["standing", "rolling", "climbing", "flying"]
"""Standing and rolling are on the ground; climbing is the take-off's part in the air."""


class Navigation(msgspec.Struct, frozen=True, kw_only=True):
    """Distances of the flight modes, which are parameters of the autopilot."""

    take_off_height_m: float = 50.0
    """Above home."""

    take_off_distance_m: float = 200.0
    """From the start of the roll to the loiter after it."""

    loiter_radius_m: float = 80.0
    """Negative is counter-clockwise."""

    return_height_m: float = 100.0
    """Above home, on the way back to it; negative keeps the present one."""


def rolled(state: PlantState, step_s: float) -> PlantState:
    """One step further along the runway."""
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
    """Whether the wings carry."""
    wanted_m_s = min(LIFT_OFF_MARGIN * plant.airspeed_min_m_s, plant.airspeed_max_m_s)
    return rolling_motion(state, wind_m_s).airspeed_m_s >= wanted_m_s


def airborne(
    plant: PlantParameters, state: PlantState, wind_m_s: tuple[float, float]
) -> PlantState:
    """A motion as a state of the plant in the air."""
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
"""Gain of the field around the circle, in parts of 1 / radius."""

LEAST_AIRSPEED_M_S = 1.0

GREATEST_BANK_DEG = 80.0
"""No parameter lets it fly slower or bank more: its turns would have no end."""

CIRCLE_BANK_RAD = math.radians(15.0)
"""Bank of a circle without a centre: 150 m of radius at 20 m/s."""


class Orbit(msgspec.Struct, frozen=True):
    """A circle to fly."""

    latitude_rad: float
    """Geodetic latitude of its centre."""

    longitude_rad: float
    """Longitude of its centre."""

    radius_m: float
    """Above zero."""

    clockwise: bool = True
    """Seen from above."""

    def course_rad(self, latitude_rad: float, longitude_rad: float, *, lead_rad: float) -> float:
        """Course over ground from here: to the circle, then along it.

        chi = beta + s (pi/2 + atan(k (d - R)) + lead), beta and d bearing and distance of the aircraft
        from the centre, s = 1 clockwise (Nelson et al., Vector Field Path Following, 2007). The lead
        makes up for the lag with which a course is followed on a circle.
        """
        meridian_m, transverse_m = radii_m(self.latitude_rad)
        north_m = (latitude_rad - self.latitude_rad) * meridian_m
        east_m = wrap_to_pi(longitude_rad - self.longitude_rad)
        east_m *= transverse_m * math.cos(self.latitude_rad)
        outside_m = math.hypot(north_m, east_m) - self.radius_m
        inward_rad = math.atan(FIELD_GAIN / self.radius_m * outside_m)
        sense = 1.0 if self.clockwise else -1.0
        # The lead belongs to the circle itself: on the way to it nothing turns.
        led_rad = lead_rad * math.cos(inward_rad)
        return math.atan2(east_m, north_m) + sense * (0.5 * math.pi + inward_rad + led_rad)


def orbit_lead_rad(plant: PlantParameters, airspeed_m_s: float, radius_m: float) -> float:
    """How far ahead of the course a command has to be for the turn of a circle, in calm air.

    First order: (V / R) / alpha. `bank`: the turn's bank over GUIDED_P.
    """
    if plant.banks:
        turning_m_s2 = airspeed_m_s * airspeed_m_s / (radius_m * plant.turn_efficiency)
        bank_rad = min(math.atan(turning_m_s2 / GRAVITY_M_S2), plant.max_bank_rad)
        return min(1.0, bank_rad / (plant.guided_p_cdeg_rad * CENTIDEGREE_RAD))
    return min(1.0, airspeed_m_s / radius_m / plant.alpha_1_s)


class Commanded:
    """The loops' targets now, and those on their way to the loops."""

    def __init__(self, plant: PlantParameters, targets: Targets) -> None:
        self.now = targets
        """What the loops hold."""
        self._turn_delay_us = round(plant.course_dead_time_s * 1e6)
        self._speed_delay_us = round(plant.speed_delay_s * 1e6)
        self._coming: list[tuple[int, TurnTarget | SpeedTarget]] = []

    @property
    def next_us(self) -> int | None:
        """When the loops learn of something next; None if nothing is on its way."""
        return min((due_us for due_us, _ in self._coming), default=None)

    def set_all(self, targets: Targets) -> None:
        """Change everything at once, as a change of mode does; what was on its way is forgotten."""
        self.now = targets
        self._coming.clear()

    def turn(self, target: TurnTarget, now_us: int) -> None:
        """A command to the lateral loop."""
        self._coming.append((now_us + self._turn_delay_us, target))
        self.take_effect(now_us)

    def speed(self, target: SpeedTarget, now_us: int) -> None:
        """A command to the speed loop."""
        self._coming.append((now_us + self._speed_delay_us, target))
        self.take_effect(now_us)

    def height(self, target: AltitudeTarget) -> None:
        """A command to the height loop, which has no dead time."""
        self.now = Targets(self.now.turn, self.now.speed, target)

    def take_effect(self, time_us: int) -> None:
        """Let the loops know what has reached them by now."""
        for due_us, target in self._coming:
            if due_us <= time_us:
                part = "turn" if isinstance(target, TurnTarget) else "speed"
                self.now = replace(self.now, **{part: target})
        self._coming = [one for one in self._coming if one[0] > time_us]


class EmulatedFlight:
    """Plant, wind, targets and mode together; advanced in simulation time (whole microseconds)."""

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
        """Status texts not yet sent."""
        self.wind_estimate_m_s = (0.0, 0.0)
        """The autopilot's own (north, east): it starts knowing nothing."""
        self.navigation = Navigation()
        """Distances of the flight modes."""
        self.cruise_airspeed_m_s = cruise_airspeed_m_s
        """As shown: what is flown when nothing is commanded."""
        self.airspeed_range_m_s = (plant.airspeed_min_m_s, plant.airspeed_max_m_s)
        """As shown: what a command may ask for."""
        self._air_data = air_data or AirData()
        self._altitude_drift_m = altitude_drift_m
        self._air = air
        self._orbit: Orbit | None = None
        self._route: RouteFollower | None = None
        self.plant = self._in_true_airspeed(plant)
        # Straight on at first, so that there is a motion from which the mode is entered.
        straight = TurnTarget("course", state.direction_rad)
        hold_speed = SpeedTarget("airspeed", self.true_airspeed_m_s(cruise_airspeed_m_s))
        targets = Targets(straight, hold_speed, AltitudeTarget(self.measured_altitude_m))
        self._commanded = Commanded(self.plant, targets)
        self._known = (self.state, self.targets, self._motion_now())
        self._enter_in_flight(mode, starts=True)

    @property
    def targets(self) -> Targets:
        """What the loops hold now; the height as it is measured."""
        return self._commanded.now

    @property
    def present_orbit(self) -> Orbit | None:
        """The point that is circled around, if one is."""
        return self._orbit

    @property
    def on_ground(self) -> bool:
        """Whether the wheels are on the ground."""
        return self.phase in {"standing", "rolling"}

    @property
    def wind_m_s(self) -> tuple[float, float]:
        """The true wind now, (north, east)."""
        return self.wind_here.at(self.time_us * 1e-6)

    @property
    def wind_here(self) -> Wind:
        """The air about the aircraft, as a wind that only time changes: good for a step."""
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
        """The true motion now."""
        # Asked for several times at one instant. Both parts are immutable and replaced as they change.
        if self._known[0] is not self.state or self._known[1] is not self.targets:
            self._known = (self.state, self.targets, self._motion_now())
        return self._known[2]

    @property
    def measured_altitude_m(self) -> float:
        """Altitude that the autopilot flies by, above mean sea level."""
        return self.state.altitude_amsl_m + self._altitude_drift_m(self.time_us * 1e-6)

    def shown_airspeed_m_s(self, true_m_s: float) -> float:
        """What the airspeed sensor says."""
        return true_m_s * self._air_data.shown_per_true(self.state.altitude_amsl_m)

    def true_airspeed_m_s(self, shown_m_s: float) -> float:
        """What is flown where the airspeed sensor says this."""
        return shown_m_s / self._air_data.shown_per_true(self.state.altitude_amsl_m)

    def advance(self, to_us: int) -> None:
        """Fly on to `to_us`; commands that reach their loops meanwhile take effect as they do."""
        span_s = (to_us - self.time_us) * 1e-6
        while (reach_us := self._commanded.next_us) is not None and reach_us <= to_us:
            self._integrate(reach_us)
            self._commanded.take_effect(reach_us)
        self._integrate(to_us)
        self.wind_estimate_m_s = followed_wind_m_s(self.wind_estimate_m_s, self.wind_m_s, span_s)

    def enter(self, mode: AutopilotMode) -> None:
        """Change the mode and forget all commands. Entering the present mode changes nothing."""
        if mode is not self.mode:
            self.mode = mode
            if self.phase == "rolling":
                self.phase = "standing"
                self.state = replace(self.state, speed_m_s=0.0)
            elif self.phase == "climbing":
                self.phase = "flying"
            if self.phase == "flying":
                self._enter_in_flight(mode)
            self.take_off_if_asked()

    def set_armed(self, *, armed: bool) -> None:
        """Arm or disarm. In the take-off mode an armed aircraft on the ground starts to roll."""
        self.armed = armed
        self.take_off_if_asked()

    def set_airspeed_range(self, slowest_m_s: float, fastest_m_s: float) -> None:
        """Change what may be commanded, and with it what is flown."""
        self.airspeed_range_m_s = (slowest_m_s, fastest_m_s)
        limits = replace(self.plant, airspeed_min_m_s=slowest_m_s, airspeed_max_m_s=fastest_m_s)
        self.plant = self._in_true_airspeed(limits)

    def set_max_bank_deg(self, max_bank_deg: float) -> None:
        """Change the bank limit; what is no limit that can be flown leaves it as it was."""
        if 0.0 < max_bank_deg <= GREATEST_BANK_DEG:
            self.plant = replace(self.plant, max_bank_rad=math.radians(max_bank_deg))

    def hold_turn(self, target: TurnTarget) -> None:
        """Give the lateral loop a new target."""
        self._orbit = self._route = None
        self._commanded.turn(target, self.time_us)

    def hold_speed(self, target: SpeedTarget) -> None:
        """Give the speed loop a new target, an airspeed as shown or a true ground speed."""
        if target.kind == "airspeed":
            true_m_s = self.true_airspeed_m_s(target.speed_m_s)
            target = SpeedTarget(target.kind, true_m_s, target.max_acceleration_m_s2)
        self._commanded.speed(target, self.time_us)

    def hold_height(self, target: AltitudeTarget) -> None:
        """Give the height loop a new target."""
        self._commanded.height(target)

    def circle(self) -> None:
        """Turn right at the circle's bank: what guided flight does until it is told a course."""
        self.hold_turn(TurnTarget("bank", CIRCLE_BANK_RAD))

    def follow(self, route: Route) -> None:
        """Fly a route, until the mode changes."""
        self._orbit, self._route = None, RouteFollower(route)

    def orbit(self, orbit: Orbit) -> None:
        """Loiter around a point."""
        self.circle()
        self._orbit = orbit

    def orbit_at(self, latitude_rad: float, longitude_rad: float) -> Orbit:
        """The loiter around a point, with the radius of the parameters."""
        radius_m = self.navigation.loiter_radius_m
        return Orbit(latitude_rad, longitude_rad, max(abs(radius_m), 1.0), radius_m >= 0.0)

    def cruise(self) -> None:
        """Back to the airspeed of flying without commands."""
        self.hold_speed(SpeedTarget("airspeed", self.cruise_airspeed_m_s))

    def take_off_if_asked(self) -> None:
        """Start to roll, if this is an armed aircraft on the ground in a mode that takes off."""
        if self.phase == "standing" and self.armed and self.mode.flies == "take-off":
            self.phase = "rolling"

    def _in_true_airspeed(self, plant: PlantParameters) -> PlantParameters:
        """The plant with its range in true airspeed, which the configuration gives as shown."""
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
        # A span a hair longer than n steps is still n steps.
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
            self._orbit = None
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
        """Cruise airspeed and present height; straight on, or what the mode flies by itself."""
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
            # A flight that starts in a loiter is on its circle already, wherever that has its centre.
            self._orbit = self.orbit_at(self.state.latitude_rad, self.state.longitude_rad)
