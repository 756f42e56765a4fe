"""What options and their values mean: a text or a value of a file in, one checked value out."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, cast

from pydantic import BeforeValidator, PlainValidator
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub.air import ArticleWind, CalmWind, DiscreteGust, SteadyWind, Wind
from sitl_stub.config import OptionError
from sitl_stub.messages import TELEMETRY
from sitl_stub.route import Route
from sitl_stub.sensor_errors import Fault

MAX_WIND_M_S = 50.0
"""Stronger than any wind an aircraft of this size is flown in."""

SLOWEST_HZ, FASTEST_HZ = 0.01, 100.0
"""Least and greatest rate of a stream."""


def parse_wind(value: object) -> Wind:
    """`calm`, `article`, `steady:SPEED,TOWARD_DEG`, or a mission's `wind`.

    m/s, and degrees clockwise from north in the direction in which the air moves.

    Raises:
        OptionError: it is none of these.
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
    """AT,FOR,N,E (seconds and metres per second), or a gust of a mission's `wind.gusts`.

    Raises:
        ValueError: it is no gust; the message is one line.
    """
    if isinstance(value, Mapping):
        names = ("at_s", "for_s", "north_m_s", "east_m_s")
        value = [value.get(name, 0.0) for name in names]
    start_s, length_s, north_m_s, east_m_s = parse_numbers("--gust", value, "AT,FOR,N,E")
    return DiscreteGust(start_s=start_s, length_s=length_s, north_m_s=north_m_s, east_m_s=east_m_s)


def parse_numbers(option: str, value: object, names: str) -> list[float]:
    """As many finite numbers, in a list or a text with commas, as there are names.

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
    """LAT,LON;LAT,LON;… in degrees, or a list of such pairs.

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
    """NAME:HZ as the number of a message and its interval in microseconds.

    Raises:
        OptionError: it is no such thing.
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
    """Takes finite numbers from a list or from a text with commas."""
    return BeforeValidator(lambda value: tuple(parse_numbers(option, value, names)))


def each(parse: Callable[[Any], object]) -> PlainValidator:
    """Takes a list of values that are parsed one by one."""
    return PlainValidator(lambda values: tuple(parse(one) for one in listed(values)))


def listed(values: object) -> Iterable[object]:
    """The values of a list, or a single one."""
    return values if isinstance(values, list | tuple) else [values]


def glitch(value: object) -> Fault:
    """AT,FOR,N,E: positions off for a time."""
    return Fault("offset", *parse_numbers("--gps-glitch", value, "AT,FOR,N,E"))


def named_numbers(value: object) -> dict[str, float]:
    """Numbers by name, or a list of NAME=VALUE.

    Raises:
        OptionError: it is no such thing.
    """
    if isinstance(value, Mapping):
        return {str(name): float(number) for name, number in value.items()}
    found = {}
    for text in listed(value):
        name, _, number = str(text).partition("=")
        try:
            found[name] = float(number)
        except ValueError:
            raise OptionError(f"--plant-option: {text} is not NAME=VALUE") from None
    return found
