"""Whether a vehicle is there, as JSON: what ground stations and people at the broker read."""

import json
import math
from collections.abc import Iterator
from typing import Annotated, Literal

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

Text = Annotated[str, msgspec.Meta(max_length=LONGEST_TEXT)]
Warned = Annotated[str, msgspec.Meta(max_length=LONGEST_WARNING)]
"""Texts of a length that is read."""


class Presence(msgspec.Struct, frozen=True, kw_only=True):
    """What a vehicle says about itself."""

    status: Literal["online", "offline"]
    """The broker itself says "offline" for a vehicle that it has lost."""
    mode: Text = ""
    """Mode of the supervisor; empty while not known."""
    time_s: float
    """When this was true, on the vehicle's own clock, s; in a last will, when it had connected."""
    version: Text = ""
    """Version of the vehicle's companion."""
    signed: bool = False
    """Whether its messages are signed; else anybody can say what it says."""
    obstacle: Text = ""
    """What would keep it from steering now, in words; empty where nothing would."""
    autopilot: Text = ""
    """What ground stations call the autopilot's mode; empty while not known."""
    warning: Warned = ""
    """The last warning that it gave its pilot; empty before the first."""
    findings: Annotated[tuple[Warned, ...], msgspec.Meta(max_length=MOST_FINDINGS)] = ()
    """What of the autopilot's parameters speaks against taking off, each with what to do; the first ones."""
    figures: Annotated[dict[Text, float], msgspec.Meta(max_length=MOST_FIGURES)] = msgspec.field(
        default_factory=dict
    )
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
        found = msgspec.json.decode(data, type=Presence)
    # Deep nesting exhausts the parser.
    except (ValueError, RecursionError) as error:
        raise LinkDataError(f"no presence: {error}") from None
    texts = (found.mode, found.version, found.obstacle, found.autopilot, found.warning)
    if not all(text.isprintable() for text in (*texts, *found.findings, *found.figures)):
        raise LinkDataError("a text is not printable")
    return found


def fit_text(text: str, longest: int = LONGEST_TEXT) -> str:
    """A text as a presence can hold it: printable, and cut where it is too long."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable if len(printable) <= longest else printable[: longest - 1] + "…"
