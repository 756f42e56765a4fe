"""From the words of the command line to aircraft that can be served."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

from sitl_stub.air import LEAST_HEIGHT_M, Air, Turbulence, air_of
from sitl_stub.aircraft import PlantParameters, SpeedResponse
from sitl_stub.autopilot import Autopilot
from sitl_stub.bad_link import BadLink, Emulated
from sitl_stub.codec import Signing, key_of
from sitl_stub.config import AutopilotConfig
from sitl_stub.geometry import displace
from sitl_stub.links import Address, parse_address
from sitl_stub.options import (
    OptionError,
    checked,
    parse_gust,
    parse_numbers,
    parse_route,
    parse_stream,
    parse_wind,
)
from sitl_stub.personality import Loops
from sitl_stub.plants import options_of
from sitl_stub.registry import autopilots, load_plugins, plants
from sitl_stub.sensor_errors import Fault, SensorGrade

DEFAULT_HEIGHT_M = 100.0
"""Start above home, where home's altitude is not given."""

MAX_COUNT = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Aircraft:
    """How they fly, all of them alike."""

    autopilot: str
    """Whose manners they have."""
    autopilot_version: str | None
    """MAJOR.MINOR of them; None: the newest that is known."""
    plant: str | None
    """Which model flies; None: the autopilot's own, with its `loops` where nothing else is said."""
    alpha_1_s: float | None
    """Gain of the course or heading hold."""
    beta_1_s: float
    """Gain of the speed hold."""
    speed_response: SpeedResponse | None
    """Shape of the speed hold."""
    guided_p: float
    """0.01 deg of bank per rad of course error."""
    roll_time_s: float
    """Of the bank plant."""
    turn_efficiency: float
    """Of the bank plant."""
    roll_delay_s: float | None
    """Of the bank and the npfg plant."""
    course_dead_time_s: float | None
    """Of the lateral loop."""
    speed_dead_time_s: float | None
    """Of the speed loop; None: what belongs to its response."""
    airspeed_range: str
    """LO,HI in m/s."""
    max_bank_deg: float | None
    """Limit of the bank; None: the autopilot's own."""
    max_acceleration_m_s2: float
    """Limit of the rate of change of speed."""
    climb_range: str = "-3,3"
    """LO,HI in m/s, sinking and climbing."""
    height_delay_s: float = 2.0
    """How far the height is behind one that climbs steadily."""
    options: tuple[str, ...] = ()
    """NAME=VALUE of a plant of one's own."""
    plugins: tuple[Path, ...] = ()
    """Files with plants of one's own."""

    def parameters(self) -> PlantParameters:
        """The plant.

        Raises:
            ValueError: there is no such plant; the message is one line.
        """
        try:
            load_plugins(self.plugins)
        except ValueError as error:
            raise OptionError(f"--plugin {error}") from error
        if self.autopilot not in autopilots:
            known = ", ".join(autopilots.names())
            raise OptionError(f"--autopilot: {self.autopilot} is not one of {known}")
        own = autopilots.find(self.autopilot)
        loops = own.loops if self.plant is None else Loops(plant=self.plant)
        if loops.plant not in plants:
            raise OptionError(f"--plant: {loops.plant} is not one of {', '.join(plants.names())}")
        slowest, fastest = parse_numbers("--airspeed-range", self.airspeed_range, "LO,HI")
        sink, climb = parse_numbers("--climb-range", self.climb_range, "LO,HI")
        if not sink < 0.0 < climb:
            raise OptionError(
                f"--climb-range: {self.climb_range} does not reach from below to above 0"
            )
        max_bank_deg = given(self.max_bank_deg, own.max_bank_deg)
        if not 0.0 < max_bank_deg < 90.0:
            raise OptionError(f"--max-bank: {max_bank_deg:g} is not between 0 and 90")
        return PlantParameters(
            kind=loops.plant,
            alpha_1_s=given(self.alpha_1_s, loops.alpha_1_s),
            beta_1_s=self.beta_1_s,
            airspeed_min_m_s=slowest,
            airspeed_max_m_s=fastest,
            max_bank_rad=math.radians(max_bank_deg),
            max_acceleration_m_s2=self.max_acceleration_m_s2,
            climb_rate_max_m_s=climb,
            sink_rate_max_m_s=-sink,
            height_delay_s=self.height_delay_s,
            guided_p_cdeg_rad=self.guided_p,
            roll_time_s=self.roll_time_s,
            turn_efficiency=self.turn_efficiency,
            roll_delay_s=given(self.roll_delay_s, loops.roll_delay_s),
            speed_response=self.speed_response or loops.speed_response,
            course_dead_time_s=given(self.course_dead_time_s, loops.course_dead_time_s),
            speed_dead_time_s=self.speed_dead_time_s,
            options=options_of(dict(map(parse_option, self.options))),
        )


def given(value: float | None, default: float) -> float:
    """A value, or what there is where none was given."""
    return default if value is None else value


def parse_option(text: str) -> tuple[str, float]:
    """NAME=VALUE as a name and a number.

    Raises:
        OptionError: it is no such thing.
    """
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise OptionError(f"--plant-option: {text} is not NAME=VALUE") from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather:
    """The air that all of them share."""

    wind: str
    """In the option's words."""
    turbulence: Turbulence
    """The standard's level."""
    height_m: float
    """Above the ground: for which the turbulence and the wind are meant."""
    gusts: tuple[str, ...]
    """AT,FOR,N,E each."""
    roughness_m: float | None
    """Of the ground below a wind that grows with height; None: it does not."""

    def air(self, seed: int) -> Air:
        """The air of a seed.

        Raises:
            ValueError: a word of it is wrong; the message is one line.
        """
        height_m = checked("--air-height", self.height_m, 0.0, 1e4)
        roughness_m = self.roughness_m
        if roughness_m is not None:
            checked("--roughness", roughness_m, 0.0, min(LEAST_HEIGHT_M, height_m) / 2.0)
        return air_of(
            parse_wind(self.wind),
            level=self.turbulence,
            height_m=height_m,
            seed=seed,
            gusts=tuple(map(parse_gust, self.gusts)),
            roughness_m=roughness_m,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where they begin."""

    where: str
    """LAT,LON,ALT,COURSE of the first."""
    airborne: bool
    """In the air, or on the ground at ALT."""
    airspeed_m_s: float
    """In the air, where none is commanded."""
    home_altitude_m: float | None
    """Of the ground below a start in the air."""
    spacing_m: float
    """From each to the next, to the right of the course."""
    ready_after_s: float
    """Until they can be armed."""
    route: str | None = None
    """LAT,LON;LAT,LON;… that they fly by themselves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """What is wrong with what they measure."""

    position_m: float
    """Standard deviation per axis."""
    velocity_m_s: float
    """Standard deviation per axis."""
    heading_deg: float
    """Standard deviation."""
    airspeed_m_s: float
    """Standard deviation."""
    sensors: SensorGrade
    """How good they are beside that."""
    gps_glitches: tuple[str, ...]
    """AT,FOR,N,E each."""

    def glitches(self) -> tuple[Fault, ...]:
        """The glitches.

        Raises:
            ValueError: one is none; the message is one line.
        """
        return tuple(
            Fault("offset", *parse_numbers("--gps-glitch", text, "AT,FOR,N,E"))
            for text in self.gps_glitches
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Telemetry:
    """In which way they report."""

    indicated_airspeed: bool
    """Indicated instead of true airspeed."""
    airspeed_calibration: float
    """Shown in parts of the right one."""
    loop_rate_hz: float | None
    """Of the scheduler, if there is one."""
    old_parameter_names: bool
    """ArduPlane's before 4.5."""
    streams: tuple[str, ...] = ()
    """NAME:HZ of what is sent without having been asked for; none: what the autopilot sends."""
    icao_address: int = 0
    """Of the first one's transponder; the others count up."""
    boot_time_s: float = 0.0
    """What its clock shows at the start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkQuality:
    """How their datagrams travel, both ways."""

    delay_s: float
    """Each way."""
    jitter_s: float
    """More or less than the delay."""
    loss: float
    """Share that does not arrive."""


def fleet_of(
    *,
    system_id: int,
    url: str,
    count: int,
    seed: int,
    signing_key: str | None,
    aircraft: Aircraft,
    weather: Weather,
    start: Start,
    errors: Errors,
    telemetry: Telemetry,
    quality: LinkQuality,
) -> list[tuple[Emulated, Address]]:
    """All aircraft with their addresses: system ids and ports count up from the first one's.

    Raises:
        ValueError: a word of the command line is wrong; the message is one line.
    """
    if not 1 <= count <= MAX_COUNT:
        raise OptionError(f"--count: {count} is not 1 to {MAX_COUNT}")
    first = parse_address(url)
    air = weather.air(seed)
    key = None if signing_key is None else key_of(signing_key)
    route = None if start.route is None else parse_route(start.route)
    streams = tuple(map(parse_stream, telemetry.streams)) or None
    plant, version = aircraft.parameters(), version_of(aircraft)
    fleet: list[tuple[Emulated, Address]] = []
    for index in range(count):
        latitude_deg, longitude_deg, altitude_m, course_deg = place_of(start, index)
        below_m = DEFAULT_HEIGHT_M if start.airborne else 0.0
        home_m = start.home_altitude_m
        config = AutopilotConfig(
            system_id=system_id + index,
            autopilot=aircraft.autopilot,
            autopilot_version=version,
            plant=plant,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_amsl_m=altitude_m,
            home_altitude_amsl_m=altitude_m - below_m if home_m is None else home_m,
            course_rad=math.radians(course_deg),
            airspeed_m_s=start.airspeed_m_s,
            airborne=start.airborne,
            armed=start.airborne,
            ready_after_s=start.ready_after_s,
            position_noise_m=errors.position_m,
            velocity_noise_m_s=errors.velocity_m_s,
            heading_noise_rad=math.radians(errors.heading_deg),
            airspeed_noise_m_s=errors.airspeed_m_s,
            sensors=errors.sensors,
            faults=errors.glitches(),
            indicated_airspeed=telemetry.indicated_airspeed,
            airspeed_calibration=telemetry.airspeed_calibration,
            loop_rate_hz=telemetry.loop_rate_hz,
            old_parameter_names=telemetry.old_parameter_names,
            route=route,
            streams=streams,
            icao_address=telemetry.icao_address + index,
            boot_time_s=telemetry.boot_time_s,
            seed=seed,
        )
        signing = None if key is None else Signing(key)
        one: Emulated = Autopilot(config, air, signing=signing, unix_time=time.time)
        if quality.delay_s or quality.jitter_s or quality.loss:
            one = BadLink(
                one,
                delay_s=quality.delay_s,
                jitter_s=quality.jitter_s,
                loss=quality.loss,
                seed=seed,
            )
        port = first.port + index if first.port else 0
        fleet.append((one, Address(first.scheme, first.host, port)))
    if first.port + count - 1 > 65_535:
        raise OptionError(f"--count: there are no {count} ports from {first.port} on")
    return fleet


def version_of(aircraft: Aircraft) -> tuple[int, int] | None:
    """Major and minor of the version whose manners they have.

    Raises:
        OptionError: it is no version.
    """
    text = aircraft.autopilot_version
    if text is None:
        return None
    if not autopilots.find(aircraft.autopilot).versions:
        raise OptionError(
            f"--autopilot-version: {aircraft.autopilot} has no versions; add --autopilot px4, or leave it out"
        )
    major, dot, minor = text.partition(".")
    if not (dot and major.isdecimal() and minor.isdecimal()):
        raise OptionError(f"--autopilot-version: {text} is not MAJOR.MINOR")
    return int(major), int(minor)


def place_of(start: Start, index: int) -> tuple[float, float, float, float]:
    """Latitude, longitude, altitude and course of one of them: each right of the one before.

    Raises:
        OptionError: the start is no place.
    """
    latitude_deg, longitude_deg, altitude_m, course_deg = parse_numbers(
        "--start", start.where, "LAT,LON,ALT,COURSE"
    )
    if index == 0 or abs(latitude_deg) > 89.0:
        return latitude_deg, longitude_deg, altitude_m, course_deg
    right_rad = math.radians(course_deg + 90.0)
    latitude_rad, longitude_rad = displace(
        math.radians(latitude_deg),
        math.radians(longitude_deg),
        altitude_m,
        north_m=index * start.spacing_m * math.cos(right_rad),
        east_m=index * start.spacing_m * math.sin(right_rad),
    )
    return math.degrees(latitude_rad), math.degrees(longitude_rad), altitude_m, course_deg
