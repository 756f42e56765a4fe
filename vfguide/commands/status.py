"""`vfguide status`: how the vehicles of a formation are, as they say themselves."""

import asyncio
import json
from random import Random

from rich import box
from rich.table import Table

from vfguide.commands.terminal import Terminal
from vfguide.link.address import parse_link
from vfguide.link.presence import Presence
from vfguide.link.watch import presences
from vfguide.mission import Mission

LISTEN_S = 1.5
"""Long enough for a presence from everybody who lives."""

ALL_THERE, SOME_MISSING = 0, 1

COLUMNS = {
    "response ms p50": "response_ms_p50",
    "p99": "response_ms_p99",
    "leader age ms p50": "leader_age_ms_p50",
    "age p99": "leader_age_ms_p99",
}
"""Figures of a presence that the table shows."""


def show_status(mission: Mission, *, link: str, as_json: bool) -> int:
    """Print a line for each vehicle, and return the exit status.

    Raises:
        InputError: the address is wrong.
        VfguideError: the broker does not answer, or refuses.
    """
    address = parse_link(link)
    listening = presences(address, mission.name, seconds=LISTEN_S, random=Random())
    found = asyncio.run(listening)
    names = [mission.leader.vehicle, *mission.followers_by_name]
    output = Terminal()
    if as_json:
        content = {name: described(found.get(name)) for name in names}
        output.tell(json.dumps(content, indent=2))
    else:
        output.print(status_table(mission.name, names, found))
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
        **presence.figures,
    }


def status_table(title: str, names: list[str], found: dict[str, Presence]) -> Table:
    """A line for each vehicle."""
    table = Table("vehicle", "status", "mode", box=box.SIMPLE, title=title, title_justify="left")
    for heading in COLUMNS:
        table.add_column(heading, justify="right")
    for name in names:
        presence = found.get(name)
        if presence is None:
            table.add_row(name, "never seen")
            continue
        figures = (presence.figures.get(key) for key in COLUMNS.values())
        cells = ("-" if figure is None else f"{figure:.2f}" for figure in figures)
        table.add_row(name, presence.status, presence.mode, *cells)
    return table
