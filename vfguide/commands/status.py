"""`vfguide status`: how the vehicles of a formation are, as they say themselves."""

import asyncio
import json
from collections.abc import Sequence
from random import Random

from rich import box
from rich.table import Table

from vfguide.commands.credentials import KeyFiles
from vfguide.commands.terminal import Terminal
from vfguide.link.address import parse_links
from vfguide.link.presence import Presence
from vfguide.link.watch import Watched, presences
from vfguide.mission import Mission

LISTEN_S = 1.5
"""Long enough for a presence from everybody who lives."""

ALL_THERE, SOME_MISSING = 0, 1

SIGNED, INSECURE = "signed", "INSECURE"

NOT_FRESH = "without an operator's private key nothing shows whether this was said today: give one with --key"

COLUMNS = {
    "response ms p50": "response_ms_p50",
    "p99": "response_ms_p99",
    "leader age ms p50": "leader_age_ms_p50",
    "age p99": "leader_age_ms_p99",
}
"""Figures of a presence that the table shows."""


def show_status(mission: Mission, *, links: Sequence[str], keys: KeyFiles, as_json: bool) -> int:
    """Print a line for each vehicle, and return the exit status.

    Raises:
        InputError: an address is wrong, or a key is missing or in the wrong hands.
        VfguideError: no link stands.
    """
    credentials = keys.of_operator()
    watched = Watched(
        addresses=parse_links(links),
        formation=mission.name,
        leader=mission.timekeeper,
        roster=credentials.roster,
        key=credentials.key,
    )
    found = asyncio.run(presences(watched, seconds=LISTEN_S, random=Random()))
    names = list(mission.companions)
    output = Terminal()
    if as_json:
        content = {name: described(found.get(name)) for name in names}
        output.tell(json.dumps(content, indent=2))
    else:
        output.print(status_table(mission.name, names, found))
        if credentials.roster is not None and credentials.key is None:
            Terminal(stderr=True).tell(NOT_FRESH)
    online = all(name in found and found[name].status == "online" for name in names)
    return ALL_THERE if online else SOME_MISSING


def described(presence: Presence | None) -> dict[str, object]:
    """A presence as JSON holds it."""
    if presence is None:
        return {"status": "never seen"}
    return {
        "status": presence.status,
        "mode": presence.mode,
        "version": presence.version,
        "signed": presence.signed,
        **presence.figures,
    }


def status_table(title: str, names: list[str], found: dict[str, Presence]) -> Table:
    """A line for each vehicle."""
    table = Table(
        "vehicle", "status", "mode", "messages", box=box.SIMPLE, title=title, title_justify="left"
    )
    for heading in (*COLUMNS, "refused"):
        table.add_column(heading, justify="right")
    for name in names:
        presence = found.get(name)
        if presence is None:
            table.add_row(name, "never seen")
            continue
        figures = (presence.figures.get(key) for key in COLUMNS.values())
        cells = ("-" if figure is None else f"{figure:.2f}" for figure in figures)
        refused = f"{presence.figures.get('refused', 0.0):.0f}"
        messages = SIGNED if presence.signed else INSECURE
        table.add_row(name, presence.status, presence.mode, messages, *cells, refused)
    return table
