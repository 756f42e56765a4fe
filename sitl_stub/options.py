"""What the command line's words mean: one text in, one checked value out."""

import math
import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub.air import ArticleWind, CalmWind, DiscreteGust, SteadyWind, Wind
from sitl_stub.route import Route
from sitl_stub.telemetry import TELEMETRY

MAX_WIND_M_S = 50.0
"""Stronger than any wind an aircraft of this size is flown in."""


MAX_EPOCH_AWAY_S = 3600.0
"""How far from now simulation time zero may lie, in seconds of simulation."""

SLOWEST_HZ, FASTEST_HZ = 0.01, 100.0
"""Of a stream."""


class OptionError(ValueError):
    """An option's value cannot be used; the message is one line."""


def parse_wind(text: str) -> Wind:
    """`calm`, `article`, or `steady:SPEED,TOWARD_DEG` (m/s, degrees clockwise from north, toward).

    Raises:
        OptionError: it is none of these.
    """
    if text == "calm":
        return CalmWind()
    if text == "article":
        return ArticleWind()
    kind, _, numbers = text.partition(":")
    if kind != "steady":
        raise OptionError(f"--wind: {text!r} is not calm, article or steady:SPEED,TOWARD_DEG")
    speed_m_s, toward_deg = parse_numbers("--wind", numbers, "SPEED,TOWARD_DEG")
    if not 0.0 <= speed_m_s <= MAX_WIND_M_S:
        raise OptionError(f"--wind: {speed_m_s:g} m/s is not within 0 and {MAX_WIND_M_S:g}")
    return SteadyWind(speed_m_s, math.radians(toward_deg))


def parse_gust(text: str) -> DiscreteGust:
    """AT,FOR,N,E: seconds and metres per second.

    Raises:
        ValueError: it is no gust; the message is one line.
    """
    return DiscreteGust(
        **dict(
            zip(
                ("start_s", "length_s", "north_m_s", "east_m_s"),
                parse_numbers("--gust", text, "AT,FOR,N,E"),
                strict=True,
            )
        )
    )


def parse_numbers(option: str, text: str, names: str) -> list[float]:
    """As many finite numbers, between commas, as there are names.

    Raises:
        OptionError: they are fewer, more, or not finite numbers.
    """
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != len(names.split(",")) or not all(map(math.isfinite, numbers)):
        raise OptionError(f"{option}: {text!r} is not {names}, all of them numbers")
    return numbers


def checked(option: str, value: float, low: float, high: float) -> float:
    """The value, if it is above `low` and at most `high`.

    Raises:
        OptionError: it is not.
    """
    if not low < value <= high:
        raise OptionError(f"{option}: {value:g} is not above {low:g} and at most {high:g}")
    return value


def checked_epoch(epoch_s: float, speedup: float) -> float:
    """The Unix time of simulation time zero, if it is a time the aircraft can catch up with.

    Raises:
        OptionError: it is too far from now.
    """
    if not abs(time.time() - epoch_s) * speedup <= MAX_EPOCH_AWAY_S:
        raise OptionError(
            f"--epoch: {epoch_s:.0f} is more than {MAX_EPOCH_AWAY_S:.0f} s of simulation from now"
            f" ({time.time():.0f})"
        )
    return epoch_s


def parse_route(text: str) -> Route:
    """LAT,LON;LAT,LON;… in degrees.

    Raises:
        OptionError: it is no route; the message is one line.
    """
    try:
        points = [part.partition(",") for part in text.split(";")]
        return Route(tuple((float(north), float(east)) for north, _, east in points))
    except ValueError as error:
        raise OptionError(f"--route: not LAT,LON;LAT,LON;… ({error})") from error


def parse_stream(text: str) -> tuple[int, int]:
    """NAME:HZ as the number of a message and its interval in microseconds.

    Raises:
        OptionError: it is no such thing.
    """
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
