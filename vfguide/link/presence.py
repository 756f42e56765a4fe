"""Presence of a vehicle as JSON, for ground stations and people at the broker."""

import json
import math
from collections.abc import Iterator
from typing import Annotated, Literal

import msgspec
from msgspec.structs import asdict, replace

from vfguide.link.codec import LARGEST, LinkDataError

LONGEST_TEXT = 100
"""Maximum length of every text but warnings and findings, characters."""

LONGEST_WARNING = 200
"""Maximum length of a warning or a finding, characters."""

MOST_FINDINGS = 3
"""Maximum number of findings; the first ones are kept."""

MOST_FIGURES = 100
"""Maximum number of figures in one presence."""

LINKS_LOST = "links_lost"
"""Figure: number of a companion's links that are down."""

REVOKED_KEY = "revoked_"
"""Figure, followed by a vehicle's name: that key is known to be revoked; on a radio, some key is."""

TERM, ORDER = "term", "order"
"""Figures: term of the leader, where the mission names deputies, and number of the order that is flown."""

BATTERY, BATTERY_VOLTAGE = "battery_percent", "battery_v"
"""Figures: remaining charge, %, and voltage, V, of the battery as the autopilot reports them."""

LEADER_FIGURES = (
    "led_by_age_s",
    "led_by_north_m",
    "led_by_east_m",
    "led_by_altitude_m",
    "led_by_course_rad",
    "led_by_speed_m_s",
    "led_by_turn_rad_s",
)
"""Figures: motion of a leader without a companion in the mission's local frame, and its age."""

LEAST_FIGURES = frozenset(
    {
        *(LINKS_LOST, "links", "leader_age_ms_last", "refused", "wind_north_m_s", "wind_east_m_s"),
        *(TERM, ORDER, BATTERY, BATTERY_VOLTAGE),
    }
)
"""Figures by which people decide; all others are statistics."""

SHORT_TEXT = 60
"""Maximum length of each text where there is little room, characters."""

Text = Annotated[str, msgspec.Meta(max_length=LONGEST_TEXT)]
Warned = Annotated[str, msgspec.Meta(max_length=LONGEST_WARNING)]
"""Texts within the length limits."""


class Presence(msgspec.Struct, frozen=True, kw_only=True):
    """Status of a vehicle and its companion."""

    status: Literal["online", "offline"]
    """Whether the vehicle is there; a broker publishes "offline" for a vehicle that it has lost."""
    mode: Text = ""
    """Mode of the supervisor; empty while unknown."""
    time_s: float
    """Time of validity, s on the vehicle's own clock; in a last will, the time of connecting."""
    version: Text = ""
    """Version of the vehicle's companion."""
    signed: bool = False
    """Whether its messages are signed; otherwise anybody can forge them."""
    obstacle: Text = ""
    """Reason, for people, why it could not steer now; empty where it could."""
    autopilot: Text = ""
    """Name of the autopilot's mode as ground stations show it; empty while unknown."""
    warning: Warned = ""
    """Latest warning to its pilot; empty before the first."""
    findings: Annotated[tuple[Warned, ...], msgspec.Meta(max_length=MOST_FINDINGS)] = ()
    """First findings against take-off in the autopilot's parameters, each with its remedy."""
    figures: Annotated[dict[Text, float], msgspec.Meta(max_length=MOST_FIGURES)] = msgspec.field(
        default_factory=dict
    )
    """Latencies, counters and other values, by names that end in their units."""


def encode_presence(presence: Presence) -> bytes:
    """Encode a presence as JSON, without figures that are not finite.

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
    """Yield a presence as it is, then ever shorter ones, down to the indispensable.

    Statistics go first, then the ends of texts, then all findings but one and all figures but that of lost
    links.
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
    """Decode a presence, ignoring fields that others may add; raise LinkDataError if it is none."""
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
    """Return a text made printable and, where too long, cut."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable if len(printable) <= longest else printable[: longest - 1] + "…"
