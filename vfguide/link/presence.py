"""Whether a vehicle is there, as JSON: what ground stations and people at the broker read."""

import json
import math
from collections.abc import Iterator
from typing import Literal

import msgspec
from msgspec.structs import asdict, replace

from vfguide.link.codec import LinkDataError

LARGEST = 4096
"""Bytes of a presence: whatever is longer is not read."""

LONGEST_TEXT = 100
"""Characters of every other text."""

LONGEST_WARNING = 200
"""Characters of a warning, and of a finding."""

MOST_FINDINGS = 3
"""What speaks against taking off: the first of it."""

MOST_FIGURES = 100
"""Figures in one presence."""

LINKS_LOST = "links_lost"
"""Figure: how many of a companion's links do not stand."""

REVOKED_KEY = "revoked_"
"""Figure, followed by a vehicle's name: it knows that this key is out; on a radio, that some key is."""

TERM, ORDER = "term", "order"
"""Figures: the term of its leader, where the mission names deputies, and the order that it flies by."""

BATTERY, BATTERY_VOLTAGE = "battery_percent", "battery_v"
"""Figures: what is left of the battery, %, and its voltage, V, as the autopilot tells them."""

LEADER_FIGURES = (
    "led_by_age_s",
    "led_by_north_m",
    "led_by_east_m",
    "led_by_altitude_m",
    "led_by_course_rad",
    "led_by_speed_m_s",
    "led_by_turn_rad_s",
)
"""Figures: how a leader without a companion moved, in the mission's local frame, and how long ago."""

LEAST_FIGURES = frozenset(
    {
        *(LINKS_LOST, "links", "leader_age_ms_last", "refused", "wind_north_m_s", "wind_east_m_s"),
        *(TERM, ORDER, BATTERY, BATTERY_VOLTAGE),
    }
)
"""Figures by which people decide; the others are statistics."""

SHORT_TEXT = 60
"""Characters of each text where there is little room."""

Status = Literal["online", "offline"]


class Presence(msgspec.Struct, frozen=True, kw_only=True):
    """What a vehicle says about itself."""

    status: Status
    """The broker itself says "offline" for a vehicle that it has lost."""
    mode: str
    """Mode of the supervisor; empty while not known."""
    time_s: float
    """When this was true, on the vehicle's own clock, s; in a last will, when it had connected."""
    version: str
    """Version of the vehicle's companion."""
    signed: bool = False
    """Whether its messages are signed; else anybody can say what it says."""
    obstacle: str = ""
    """What would keep it from steering now, in words; empty where nothing would."""
    autopilot: str = ""
    """What ground stations call the autopilot's mode; empty while not known."""
    warning: str = ""
    """The last warning that it gave its pilot; empty before the first."""
    findings: tuple[str, ...] = ()
    """What of the autopilot's parameters speaks against taking off, each with what to do; the first ones."""
    figures: dict[str, float] = msgspec.field(default_factory=dict)
    """Latencies, counters and the like, by names that end in their units."""


def encode_presence(presence: Presence) -> bytes:
    """JSON of a presence; figures that are not finite are left out, since JSON has none.

    Raises:
        ValueError: the time is not finite.
    """
    content = asdict(presence)
    content["figures"] = {
        name: value for name, value in presence.figures.items() if math.isfinite(value)
    }
    # Letters beyond ASCII take 2 to 4 bytes as they are, and 6 to 12 as escapes.
    text = json.dumps(content, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return text.encode(errors="replace")


def shorter_presences(presence: Presence) -> Iterator[Presence]:
    """A presence as it is, then with less and less in it, down to what nobody can do without.

    Statistics go first, then the ends of texts, then all findings but one and all figures but the number of
    links that are lost.
    """
    yield presence
    figures = {
        name: value
        for name, value in presence.figures.items()
        if name in LEAST_FIGURES or name.startswith(REVOKED_KEY)
    }
    lean = replace(presence, figures=figures)
    yield lean
    lean = replace(
        lean,
        obstacle=fit_text(presence.obstacle, SHORT_TEXT),
        autopilot=fit_text(presence.autopilot, SHORT_TEXT),
        warning=fit_text(presence.warning, SHORT_TEXT),
        findings=tuple(fit_text(finding, SHORT_TEXT) for finding in presence.findings),
    )
    yield lean
    lost = {name: value for name, value in figures.items() if name == LINKS_LOST}
    yield replace(lean, figures=lost, findings=lean.findings[:1])


def decode_presence(data: bytes) -> Presence:
    """Presence of these bytes; fields that are not known are ignored, so that others can add some.

    Raises:
        LinkDataError: it is no presence.
    """
    if len(data) > LARGEST:
        raise LinkDataError(f"{len(data)} bytes where a presence has at most {LARGEST}")
    try:
        content: object = json.loads(data)
    # Deep nesting exhausts the parser, and a number of a thousand digits is refused as a ValueError.
    except (ValueError, RecursionError):
        raise LinkDataError("not JSON") from None
    if not isinstance(content, dict):
        raise LinkDataError("not a presence")
    return Presence(
        status=_status(content.get("status")),
        mode=_text(content.get("mode", "")),
        time_s=_number(content.get("time_s")),
        version=_text(content.get("version", "")),
        signed=content.get("signed") is True,
        obstacle=_text(content.get("obstacle", "")),
        autopilot=_text(content.get("autopilot", "")),
        warning=_text(content.get("warning", ""), LONGEST_WARNING),
        findings=_findings(content.get("findings", [])),
        figures=_figures(content.get("figures", {})),
    )


def fit_text(text: str, longest: int = LONGEST_TEXT) -> str:
    """A text as a presence can hold it: printable, and cut where it is too long."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable if len(printable) <= longest else printable[: longest - 1] + "…"


def _status(value: object) -> Status:
    if value == "online":
        return "online"
    if value == "offline":
        return "offline"
    raise LinkDataError("the status is neither online nor offline")


def _text(value: object, longest: int = LONGEST_TEXT) -> str:
    if not isinstance(value, str) or len(value) > longest or not value.isprintable():
        raise LinkDataError("a text is none, too long or not printable")
    return value


def _number(value: object) -> float:
    # A truth value is an int to Python.
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise LinkDataError("a number is none")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise LinkDataError("a number is not finite")
    return number


def _findings(value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or len(value) > MOST_FINDINGS:
        raise LinkDataError("the findings are none, or too many")
    return tuple(_text(one, LONGEST_WARNING) for one in value)


def _figures(value: object) -> dict[str, float]:
    if not isinstance(value, dict) or len(value) > MOST_FIGURES:
        raise LinkDataError("the figures are none, or too many")
    return {_text(name): _number(figure) for name, figure in value.items()}
