"""Settings of a fleet of emulators, from the command line, a file or Python.

A field has the name and the unit of its counterpart in a mission (`vehicles.*`, `wind`,
`rehearsal.emulator`). Its option is the name without the unit; the docstring is the option's help.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self, cast

from msgspec.structs import asdict
from pydantic import BeforeValidator, Field, PlainValidator, model_validator
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub.air import (
    LEAST_HEIGHT_M,
    Air,
    ArticleWind,
    CalmWind,
    DiscreteGust,
    SteadyWind,
    Turbulence,
    Wind,
    air_of,
)
from sitl_stub.autopilot import Autopilot
from sitl_stub.codec import Signing, key_of
from sitl_stub.config import (
    AircraftOptions,
    AutopilotConfig,
    Finite,
    Option,
    OptionError,
    Positive,
    option_name,
)
from sitl_stub.geometry import displace
from sitl_stub.links import Address, BadLink, Emulated, parse_address
from sitl_stub.loops import PlantParameters, SpeedResponse
from sitl_stub.messages import TELEMETRY
from sitl_stub.personality import autopilots
from sitl_stub.plant import options_of, plants
from sitl_stub.registry import load_plugins
from sitl_stub.route import Route
from sitl_stub.sensor_errors import Fault

MAX_WIND_M_S = 50.0
"""Stronger than any wind in which an aircraft of this size is flown."""

SLOWEST_HZ, FASTEST_HZ = 0.01, 100.0
"""Range of the rate of a stream."""


def parse_wind(value: object) -> Wind:
    """Parse `calm`, `article`, `steady:SPEED,TOWARD_DEG`, or a mission's `wind`.

    SPEED is in m/s; TOWARD_DEG is the direction in which the air moves, clockwise from north.

    Raises:
        OptionError: the value is not a wind.
    """
    if isinstance(value, Mapping):
        numbers = f":{value.get('speed_m_s')},{value.get('toward_deg')}"
        value = f"{value.get('type')}{numbers if value.get('type') == 'steady' else ''}"
    if value == "calm":
        return CalmWind()
    if value == "article":
        return ArticleWind()
    kind, _, numbers = str(value).partition(":")
    if kind != "steady":
        raise OptionError(f"--wind: {value!r} is not calm, article or steady:SPEED,TOWARD_DEG")
    speed_m_s, toward_deg = parse_numbers("--wind", numbers, "SPEED,TOWARD_DEG")
    if not 0.0 <= speed_m_s <= MAX_WIND_M_S:
        raise OptionError(f"--wind: {speed_m_s:g} m/s is not within 0 and {MAX_WIND_M_S:g}")
    return SteadyWind(speed_m_s, math.radians(toward_deg))


def parse_gust(value: object) -> DiscreteGust:
    """Parse AT,FOR,N,E (seconds and metres per second), or a gust of a mission's `wind.gusts`.

    Raises:
        ValueError: it is no gust; the message is one line.
    """
    if isinstance(value, Mapping):
        names = ("at_s", "for_s", "north_m_s", "east_m_s")
        value = [value.get(name, 0.0) for name in names]
    start_s, length_s, north_m_s, east_m_s = parse_numbers("--gust", value, "AT,FOR,N,E")
    return DiscreteGust(start_s=start_s, length_s=length_s, north_m_s=north_m_s, east_m_s=east_m_s)


def parse_numbers(option: str, value: object, names: str) -> list[float]:
    """Parse a list, or a text with commas, that has one finite number for each of the names.

    Raises:
        OptionError: they are fewer, more, or not finite numbers.
    """
    parts = value if isinstance(value, Sequence) and not isinstance(value, str) else None
    try:
        numbers = [float(part) for part in (str(value).split(",") if parts is None else parts)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != len(names.split(",")) or not all(map(math.isfinite, numbers)):
        raise OptionError(f"{option}: {value!r} is not {names}, all of them numbers")
    return numbers


def parse_route(value: object) -> Route:
    """Parse LAT,LON;LAT,LON;… in degrees, or a list of such pairs.

    Raises:
        OptionError: it is no route; the message is one line.
    """
    try:
        parts = (
            value.split(";") if isinstance(value, str) else list(cast("Iterable[object]", value))
        )
        pairs = [parse_numbers("--route", part, "LAT,LON") for part in parts]
        return Route(tuple((north, east) for north, east in pairs))
    except (TypeError, ValueError) as error:
        raise OptionError(f"--route: not LAT,LON;LAT,LON;… ({error})") from error


def parse_stream(value: object) -> tuple[int, int]:
    """Parse NAME:HZ into the message id and its interval in microseconds.

    Raises:
        OptionError: the message is unknown or the rate out of range.
    """
    text = str(value)
    name, _, rate = text.partition(":")
    number = int(getattr(mavlink, f"MAVLINK_MSG_ID_{name}", -1))
    try:
        rate_hz = float(rate)
    except ValueError:
        rate_hz = 0.0
    if number not in TELEMETRY or not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        raise OptionError(
            f"--stream: {text} is not a message and its rate, such as FOLLOW_TARGET:10"
        )
    return number, round(1e6 / rate_hz)


def numbers(option: str, names: str) -> BeforeValidator:
    """Return a validator of finite numbers in a list or in a text with commas."""
    return BeforeValidator(lambda value: tuple(parse_numbers(option, value, names)))


def each(parse: Callable[[Any], object]) -> PlainValidator:
    """Return a validator that parses each value of a list."""
    return PlainValidator(lambda values: tuple(parse(one) for one in listed(values)))


def listed(values: object) -> Iterable[object]:
    """Return the values of a list, or a list of a single value."""
    return values if isinstance(values, list | tuple) else [values]


def glitch(value: object) -> Fault:
    """Parse AT,FOR,N,E into a temporary offset of the position."""
    return Fault("offset", *parse_numbers("--gps-glitch", value, "AT,FOR,N,E"))


def named_numbers(value: object) -> dict[str, float]:
    """Parse numbers by name, or a list of NAME=VALUE.

    Raises:
        OptionError: a number is missing or none.
    """
    texts = (str(text).partition("=")[::2] for text in listed(value))
    found = {}
    for name, number in value.items() if isinstance(value, Mapping) else texts:
        try:
            found[str(name)] = float(number)
        except (TypeError, ValueError):
            raise OptionError(f"--plant-option: {name}={number} is not NAME=NUMBER") from None
    return found


DEFAULT_HEIGHT_M = 100.0
"""Height of a start above home, unless home's altitude is given."""

MAX_COUNT = 100

MAX_EPOCH_AWAY_S = 3600.0
"""Greatest distance between now and simulation time zero, in seconds of simulation."""

LowHigh = tuple[float, float]
Place = tuple[float, float, float, float]


class Settings(AircraftOptions):
    """Settings of emulated aircraft that are all alike."""

    mavlink: Annotated[str | None, Option("URL")] = None
    """udpin://, udpout://, tcpin:// or tcpout:// HOST:PORT. Required."""

    count: Annotated[int, Option("N")] = 1
    """Number of aircraft in this process; system ids and ports count up."""

    autopilot_version: Annotated[str | None, Option("X.Y")] = None
    """Version of px4, 1.14 to 1.18; default: the newest."""

    plant: Annotated[str | None, Option("NAME")] = None
    """How it flies. heading-hold: holds a heading, and the wind drifts it; course-hold: the article's model;
    bank: banks by its course error, as ArduPlane in GUIDED; npfg: turns as PX4; six-dof: a rigid body; or one
    of --plugin. Default: heading-hold; for px4 npfg as measured."""

    plant_options: Annotated[
        dict[str, float], BeforeValidator(named_numbers), Option("NAME=VALUE", "plant-option")
    ] = Field(default_factory=dict)
    """An option of your own plant. Repeatable."""

    plugins: Annotated[tuple[Path, ...], BeforeValidator(listed), Option("FILE", "plugin")] = ()
    """Python file with a plant or an autopilot of your own. Repeatable."""

    alpha_1_s: Annotated[float | None, Option("A")] = None
    """Gain of the course or heading hold, 1/s; default 1.2, for px4 0.88."""

    beta_1_s: Annotated[float, Option("B")] = 0.8
    """Gain of the speed hold, 1/s."""

    speed_response: Annotated[SpeedResponse | None, Option()] = None
    """Speed hold. tecs: ArduPlane's, slow to settle; px4: PX4's with a trimmed throttle; px4-untrimmed: PX4's
    with default parameters, which creeps. Default: first-order, for px4 px4-untrimmed."""

    guided_p: Annotated[float, Option("P")] = 12_000.0
    """Bank per course error, 0.01 deg/rad; for bank and six-dof."""

    roll_time_s: Annotated[float, Option("S")] = 0.4
    """Time constant of the roll, s; for bank and npfg."""

    roll_delay_s: Annotated[float | None, Option("S")] = None
    """Lag of the wanted bank before the roll, s; for bank and npfg. Default 0, for px4 0.2."""

    turn_efficiency: Annotated[float, Option("X")] = 1.0
    """Ratio of the turn rate to a coordinated turn's; for bank."""

    course_dead_time_s: Annotated[float | None, Option("S")] = None
    """Delay until a new course takes effect, s; default 0, for px4 0.06."""

    speed_dead_time_s: Annotated[float | None, Option("S")] = None
    """Delay until a new speed takes effect, s; default 0, with tecs 0.5."""

    airspeed_range_m_s: Annotated[
        LowHigh, numbers("--airspeed-range", "LO,HI"), Option("LO,HI")
    ] = (12.0, 32.0)
    """Slowest and fastest airspeed, m/s."""

    max_bank_deg: Annotated[float | None, Option("DEG")] = None
    """Largest bank; default 45, for px4 50."""

    max_acceleration_m_s2: Annotated[float, Option("A")] = 3.0
    """Largest change of speed, m/s2."""

    climb_range_m_s: Annotated[LowHigh, numbers("--climb-range", "LO,HI"), Option("LO,HI")] = (
        -3.0,
        3.0,
    )
    """Fastest sink, negative, and climb, m/s."""

    height_delay_s: Annotated[float, Option("S")] = 2.0
    """Lag of the height behind a target that climbs, s."""

    wind: Annotated[Wind, PlainValidator(parse_wind), Option("WIND", shown="calm")] = CalmWind()
    """calm, article or steady:SPEED,TOWARD_DEG: m/s, and where the air moves to."""

    turbulence: Annotated[Turbulence, Option()] = "none"
    """Dryden turbulence by MIL-F-8785C; aircraft with one seed share it."""

    air_height_m: Annotated[float, Field(gt=0.0, le=1e4), Option("M")] = 100.0
    """Height above the ground at which wind and turbulence are as given, m."""

    gusts: Annotated[tuple[DiscreteGust, ...], each(parse_gust), Option("AT,FOR,N,E", "gust")] = ()
    """Gust of one minus cosine: begin and length in s, north and east in m/s. Repeatable."""

    roughness_m: Annotated[float | None, Option("M")] = None
    """Roughness of the ground, above 0 to 0.5: the wind then grows with height."""

    start: Annotated[
        Place, numbers("--start", "LAT,LON,ALT,COURSE"), Option("LAT,LON,ALT,COURSE")
    ] = (47.397742, 8.545594, 588.0, 0.0)
    """Place and course at the start: degrees, m above mean sea level, degrees."""

    airborne: Annotated[bool, Option()] = False
    """Start in the air. Otherwise it stands disarmed on the ground at ALT."""

    home_altitude_m: Annotated[float | None, Option("M")] = None
    """Altitude of the ground below the start; default: 100 m below it."""

    spacing_m: Annotated[float, Option("M")] = 30.0
    """Distance between the starts of --count aircraft, to the right, m."""

    route: Annotated[Route | None, PlainValidator(parse_route), Option("LAT,LON;…")] = None
    """Points to fly to without commands; again and again if the last is the first."""

    heading_noise_deg: Annotated[float, Option("DEG")] = 0.0
    """Standard deviation of reported headings."""

    gps_glitches: Annotated[
        tuple[Fault, ...], each(glitch), Option("AT,FOR,N,E", "gps-glitch")
    ] = ()
    """Offset of reported positions: begin and length in s, north and east in m. Repeatable."""

    streams: Annotated[
        tuple[tuple[int, int], ...], each(parse_stream), Option("NAME:HZ", "stream")
    ] = ()
    """Message to send without a request, instead of the autopilot's usual ones. Repeatable."""

    also_to: Annotated[tuple[str, ...], BeforeValidator(listed), Option("URL")] = ()
    """Another udpout:// address that gets all it sends. Repeatable; not with --count."""

    delay_s: Annotated[float, Option("S")] = 0.0
    """Delay of every datagram, each way, s."""

    jitter_s: Annotated[float, Option("S")] = 0.0
    """Largest random change of the delay, s."""

    loss: Annotated[float, Option("P")] = 0.0
    """Share of datagrams lost, each way, 0 to below 1."""

    signing_key: Annotated[str | None, Option("KEY")] = None
    """Key to sign messages, and to drop unsigned ones: 64 hex digits, or a passphrase."""

    speedup: Annotated[float, Field(gt=0.0, le=1000.0), Option("X")] = 1.0
    """Seconds of simulation per real second."""

    truth: Annotated[str | None, Option("TO")] = None
    """True states as JSON lines: udpout://HOST:PORT or a file."""

    truth_rate_hz: Annotated[float, Field(gt=0.0, le=1000.0), Option("HZ")] = 20.0
    """True states per second of simulation."""

    duration_s: Annotated[Positive | None, Option("S")] = None
    """Simulation time at which it ends, s."""

    epoch_s: Annotated[Finite | None, Option("SECONDS")] = None
    """Unix time of simulation time zero, the same for a whole formation; default: now."""

    @model_validator(mode="before")
    @classmethod
    def _take_mission_s_wind(cls, values: object) -> object:
        """Take turbulence, gusts and roughness from inside a mission's `wind`."""
        if not (isinstance(values, Mapping) and isinstance(values.get("wind"), Mapping)):
            return values
        inside = ("turbulence", "gusts", "roughness_m")
        taken = {name: values["wind"][name] for name in inside if name in values["wind"]}
        return {**taken, **values}

    @model_validator(mode="after")
    def _catches_up(self) -> Self:
        """Check that the aircraft can catch up with simulation time zero."""
        now_s = time.time()
        if (
            not abs(now_s - (now_s if self.epoch_s is None else self.epoch_s)) * self.speedup
            <= MAX_EPOCH_AWAY_S
        ):
            raise OptionError(
                f"--epoch: {self.epoch_s:.0f} is more than {MAX_EPOCH_AWAY_S:.0f} s of simulation from now"
                f" ({now_s:.0f})"
            )
        return self

    def plant_parameters(self) -> PlantParameters:
        """Return the parameters of the aircraft's plant.

        Raises:
            ValueError: the plant is unknown or a value out of range; the message is one line.
        """
        own = self._autopilot()
        loops = own.loops if self.plant is None else PlantParameters(kind=self.plant)
        if loops.kind not in plants:
            raise OptionError(f"--plant: {loops.kind} is not one of {', '.join(plants.names())}")
        slowest, fastest = self.airspeed_range_m_s
        sink, climb = self.climb_range_m_s
        if not sink < 0.0 < climb:
            raise OptionError(
                f"--climb-range: {sink:g},{climb:g} does not reach from below to above 0"
            )
        max_bank_deg = given(self.max_bank_deg, own.max_bank_deg)
        if not 0.0 < max_bank_deg < 90.0:
            raise OptionError(f"--max-bank: {max_bank_deg:g} is not between 0 and 90")
        alike = {name: getattr(self, name, None) for name in PlantParameters.__struct_fields__}
        return PlantParameters(
            **asdict(loops)
            | {name: value for name, value in alike.items() if value is not None}
            | {
                "airspeed_min_m_s": slowest,
                "airspeed_max_m_s": fastest,
                "max_bank_rad": math.radians(max_bank_deg),
                "climb_rate_max_m_s": climb,
                "sink_rate_max_m_s": -sink,
                "guided_p_cdeg_rad": self.guided_p,
                "options": options_of(self.plant_options),
            }
        )

    def config(self, index: int = 0) -> AutopilotConfig:
        """Return the initial configuration of one aircraft, counted from 0.

        Raises:
            ValueError: it cannot start so; the message is one line.
        """
        latitude_deg, longitude_deg, altitude_m, course_deg = self.place(index)
        below_m = DEFAULT_HEIGHT_M if self.airborne else 0.0
        alike = (*AircraftOptions.model_fields, "airborne", "route")
        return AutopilotConfig.of(
            {name: getattr(self, name) for name in alike}
            | {
                "system_id": self.system_id + index,
                "uid": self.uid and self.uid + index,
                "icao_address": self.icao_address + index,
                "autopilot_version": self._version(),
                "plant": self.plant_parameters(),
                "latitude_deg": latitude_deg,
                "longitude_deg": longitude_deg,
                "altitude_amsl_m": altitude_m,
                "home_altitude_amsl_m": given(self.home_altitude_m, altitude_m - below_m),
                "course_rad": math.radians(course_deg),
                "heading_noise_rad": math.radians(self.heading_noise_deg),
                "faults": self.gps_glitches,
                "armed": self.airborne,
                "streams": self.streams or None,
            }
        )

    def air(self) -> Air:
        """Return the air that all aircraft share.

        Raises:
            ValueError: a value is out of range; the message is one line.
        """
        highest_m = min(LEAST_HEIGHT_M, self.air_height_m) / 2.0
        if self.roughness_m is not None and not 0.0 < self.roughness_m <= highest_m:
            raise OptionError(
                f"--roughness: {self.roughness_m:g} is not above 0 and at most {highest_m:g}"
            )
        return air_of(
            self.wind,
            level=self.turbulence,
            height_m=self.air_height_m,
            seed=self.seed,
            gusts=self.gusts,
            roughness_m=self.roughness_m,
        )

    def fleet(self) -> list[tuple[Emulated, Address]]:
        """Return all aircraft with their addresses: system ids and ports count up from the first.

        Raises:
            ValueError: a setting is wrong; the message is one line.
        """
        if self.mavlink is None:
            raise OptionError("--mavlink: is missing; write one like udpin://127.0.0.1:14540")
        if not 1 <= self.count <= MAX_COUNT:
            raise OptionError(f"--count: {self.count} is not 1 to {MAX_COUNT}")
        if self.also_to and self.count > 1:
            raise OptionError("--also-to: is not for --count; start an emulator for each aircraft")
        first = parse_address(self.mavlink)
        air = self.air()
        key = None if self.signing_key is None else key_of(self.signing_key)
        fleet: list[tuple[Emulated, Address]] = []
        for index in range(self.count):
            signing = None if key is None else Signing(key)
            one = Autopilot(self.config(index), air, signing=signing, unix_time=time.time)
            is_bad = self.delay_s or self.jitter_s or self.loss
            port = first.port + index if first.port else 0
            reached = self.behind_its_link(one) if is_bad else one
            fleet.append((reached, Address(first.scheme, first.host, port)))
        if first.port + self.count - 1 > 65_535:
            raise OptionError(f"--count: there are no {self.count} ports from {first.port} on")
        return fleet

    def behind_its_link(self, autopilot: Autopilot) -> BadLink:
        """Put an autopilot behind a link with the delay, jitter and loss of these settings.

        Raises:
            ValueError: a number is out of its range.
        """
        return BadLink(
            autopilot, delay_s=self.delay_s, jitter_s=self.jitter_s, loss=self.loss, seed=self.seed
        )

    def place(self, index: int) -> Place:
        """Return latitude, longitude, altitude and course of an aircraft, to the right of its predecessor."""
        latitude_deg, longitude_deg, altitude_m, course_deg = self.start
        if index == 0 or abs(latitude_deg) > 89.0:
            return self.start
        right_rad = math.radians(course_deg + 90.0)
        latitude_rad, longitude_rad = displace(
            math.radians(latitude_deg),
            math.radians(longitude_deg),
            altitude_m,
            north_m=index * self.spacing_m * math.cos(right_rad),
            east_m=index * self.spacing_m * math.sin(right_rad),
        )
        return math.degrees(latitude_rad), math.degrees(longitude_rad), altitude_m, course_deg

    def _autopilot(self) -> type[Any]:
        """Return the class of the autopilot.

        Raises:
            OptionError: there is none of this name, or a plugin cannot be loaded.
        """
        try:
            load_plugins(self.plugins)
        except ValueError as error:
            raise OptionError(f"--plugin {error}") from error
        try:
            return autopilots.find(self.autopilot)
        except ValueError as error:
            raise OptionError(f"--autopilot: {error}") from error

    def _version(self) -> tuple[int, int] | None:
        """Return major and minor number of the autopilot's version, or None for the newest.

        Raises:
            OptionError: it is no version.
        """
        text = self.autopilot_version
        if text is None:
            return None
        if not self._autopilot().versions:
            raise OptionError(
                f"--autopilot-version: {self.autopilot} has no versions; add --autopilot px4, or leave it out"
            )
        major, dot, minor = text.partition(".")
        if not (dot and major.isdecimal() and minor.isdecimal()):
            raise OptionError(f"--autopilot-version: {text} is not MAJOR.MINOR")
        return int(major), int(minor)


def given(value: float | None, default: float) -> float:
    """Return a value, or the default where it is None."""
    return default if value is None else value


def field_names() -> dict[str, str]:
    """Return the field of each spelling that a file may use: field or option name, with - or _."""
    spellings: dict[str, str] = {}
    for field in Settings.model_fields:
        option = option_name(Settings, field)
        spellings |= dict.fromkeys((field, option, option.replace("-", "_")), field)
    return spellings
