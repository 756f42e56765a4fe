"""`vfguide status`: how the vehicles of a formation are, as they say themselves."""

import asyncio
import json
import math
import signal
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from random import Random

from rich import box
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from vfguide.commands.credentials import KeyFiles, watched_formation
from vfguide.commands.terminal import Terminal
from vfguide.companion.succession import holder_of
from vfguide.formation.arrangement import agreed_number
from vfguide.link.opening import HEARD_SHARE, WatchedFormation, check_connected, watching
from vfguide.link.presence import LINKS_LOST, ORDER, TERM, Presence
from vfguide.mission import Mission
from vfguide.mission.feasibility import check_mission

LISTEN_S = 1.5
"""Long enough for a presence from everybody who lives."""

SILENT_S, SILENT_TURNS = 5.0, 2.5
"""A companion that has not said for so long how it is counts as gone: a kept presence may be old. On a slow
link that is more than two of its turns."""

LOOK_S = 0.05
"""Between looks at what has come in."""

ALL_THERE, SOME_MISSING = 0, 1

SIGNED, INSECURE = "signed", "INSECURE"

NOT_FRESH = "without an operator's private key nothing shows whether this was said today: give one with --key"

COLUMNS = {"answer, ms": "response_ms", "leader's age, ms": "leader_age_ms"}
"""Figures of a presence that the table shows: the median and the 99th percentile."""

WATCH_S = 1.0
"""Between two looks of `--watch`: everybody says once a second how it is."""


def show_status(
    mission: Mission, *, links: Sequence[str], keys: KeyFiles, as_json: bool, watch: bool
) -> int:
    """Print a line for each vehicle and whether the formation is ready, and return the exit status.

    Raises:
        InputError: an address is wrong, or a key is missing or in the wrong hands.
        VfguideError: no link stands.
    """
    credentials = keys.of_operator()
    watched = watched_formation(mission, links, credentials)
    output = Terminal()
    if credentials.roster is not None and credentials.key is None and not as_json:
        Terminal(stderr=True).tell(NOT_FRESH)
    if watch:
        asyncio.run(keep_showing(mission, watched, output, as_json=as_json))
        return ALL_THERE
    found = asyncio.run(living_presences(watched))
    if as_json:
        output.tell(json.dumps(status_json(mission, found), indent=2))
    else:
        output.print(status_table(mission, found))
        output.tell(flies(mission, found))
        output.tell(readiness(mission, found))
    online = all(name in found and found[name].status == "online" for name in mission.companions)
    return ALL_THERE if online else SOME_MISSING


async def living_presences(watched: WatchedFormation) -> dict[str, Presence]:
    """What each vehicle says about itself; who is not heard a second time is offline.

    Raises:
        VfguideError: no link stands.
    """
    loop, beats = asyncio.get_running_loop(), Beats()
    async with watching(watched, random=Random()) as (link, current):
        check_connected(link)
        slowest_s = max(carrier.presence_s for carrier in link.carriers)
        least_s = max(LISTEN_S, HEARD_SHARE * slowest_s)
        longest_s = max(SILENT_S, SILENT_TURNS * slowest_s)
        began_s, passed_s = loop.time(), 0.0
        while passed_s < least_s or (beats.missing(current) and passed_s < longest_s):
            await asyncio.sleep(LOOK_S)
            passed_s = loop.time() - began_s
        check_connected(link)
        return beats.judge(current, passed_s)


async def keep_showing(
    mission: Mission, watched: WatchedFormation, output: Terminal, *, as_json: bool
) -> None:
    """Show how the vehicles are, again and again, until Ctrl-C: in place on a terminal, else line by line.

    Raises:
        VfguideError: no link stands at first; one that is lost later comes back by itself.
    """
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    async with watching(watched, random=Random()) as (link, current):
        check_connected(link)
        slowest_s = max(carrier.presence_s for carrier in link.carriers)
        freshness = Freshness(max(SILENT_S, SILENT_TURNS * slowest_s))
        await asyncio.sleep(LISTEN_S)
        with Live(console=output, auto_refresh=False) as live:
            while not ended.is_set():
                found = freshness.judge(dict(current), loop.time())
                if as_json:
                    output.tell(json.dumps(status_json(mission, found)))
                elif output.is_terminal:
                    lines = Text(f"{flies(mission, found)}\n{readiness(mission, found)}")
                    live.update(Group(status_table(mission, found), lines), refresh=True)
                else:
                    output.tell(readiness(mission, found))
                with suppress(TimeoutError):
                    async with asyncio.timeout(WATCH_S):
                        await ended.wait()


class Beats:
    """Who has said twice how it is: a broker keeps the last word of a companion that is gone."""

    def __init__(self) -> None:
        self._first: dict[str, float] = {}

    def missing(self, found: Mapping[str, Presence]) -> list[str]:
        """Vehicles that are online by the only presence of them that was heard."""
        return [
            name
            for name, presence in found.items()
            if presence.status == "online"
            and self._first.setdefault(name, presence.time_s) == presence.time_s
        ]

    def judge(self, found: Mapping[str, Presence], listened_s: float) -> dict[str, Presence]:
        """The presences, those of which no second one was heard in so long (s) as offline."""
        silent = f"nothing new of its companion in {listened_s:.0f} s: it may be gone"
        gone = self.missing(found)
        return {
            name: replace(one, status="offline", obstacle=silent) if name in gone else one
            for name, one in found.items()
        }


class Freshness:
    """Which presences are of now: a broker keeps the last one of a companion that is gone, too."""

    def __init__(self, silent_s: float = SILENT_S) -> None:
        """Begin with nobody heard; who says nothing for so long (s) is offline."""
        self._silent_s = silent_s
        self._heard: dict[str, tuple[float, float]] = {}

    def judge(self, found: Mapping[str, Presence], now: float) -> dict[str, Presence]:
        """The presences, those that have not changed for a while as offline.

        Args:
            found: what each vehicle said last.
            now: s.
        """
        judged = {}
        for name, presence in found.items():
            said_s, heard = self._heard.get(name, (math.nan, now))
            if presence.time_s != said_s:
                heard = now
            self._heard[name] = (presence.time_s, heard)
            silent_s = now - heard
            if silent_s > self._silent_s and presence.status == "online":
                text = f"its companion has been silent for {silent_s:.0f} s"
                judged[name] = replace(presence, status="offline", obstacle=text)
            else:
                judged[name] = presence
        return judged


def readiness(mission: Mission, found: Mapping[str, Presence]) -> str:
    """Whether the formation may take off, in one line: go, or no-go and everything that speaks against it."""
    against = [
        f"mission: {one.message}" for one in check_mission(mission) if one.severity == "error"
    ]
    versions = {one.version for one in found.values() if one.status == "online"}
    for name in mission.companions:
        presence = found.get(name)
        if presence is None:
            against.append(f"{name}: no companion is heard")
        elif presence.status != "online":
            against.append(f"{name}: {presence.obstacle or 'its companion is offline'}")
        elif presence.obstacle:
            against.append(f"{name}: {presence.obstacle}")
        elif not presence.signed:
            against.append(f"{name}: its messages are not signed (--insecure)")
        elif presence.figures.get(LINKS_LOST, 0.0) > 0.0:
            against.append(f"{name}: {presence.figures[LINKS_LOST]:.0f} of its links is lost")
    if len(versions) > 1:
        against.append(f"companions of different versions: {', '.join(sorted(versions))}")
    if against:
        return f"NO-GO  {'; '.join(against)}"
    return f"GO  {mission.name}: all {len(mission.companions)} companions are ready"


def flies(mission: Mission, found: Mapping[str, Presence]) -> str:
    """Who leads, and the order that is flown, in one line."""
    online = {name: one.figures for name, one in found.items() if one.status == "online"}
    term = max(int(max((one.get(TERM, 0.0) for one in online.values()), default=0.0)), 0)
    leads = holder_of(term, (mission.leader.vehicle, *mission.deputies))
    numbers = {name: int(one.get(ORDER, 0.0)) for name, one in online.items()}
    number = agreed_number(numbers, leads)
    place = "" if term == 0 else f" in the leader's place (term {term})"
    order = f"order {number}" if number else "the mission's formation"
    return f"{leads} leads{place}; {order} is flown"


def status_json(mission: Mission, found: Mapping[str, Presence]) -> dict[str, object]:
    """Everybody's presence as JSON holds it."""
    return {name: described(found.get(name)) for name in mission.companions}


def described(presence: Presence | None) -> dict[str, object]:
    """A presence as JSON holds it."""
    if presence is None:
        return {"status": "never seen"}
    return {
        "status": presence.status,
        "mode": presence.mode,
        "version": presence.version,
        "signed": presence.signed,
        "obstacle": presence.obstacle,
        **presence.figures,
    }


def status_table(mission: Mission, found: Mapping[str, Presence]) -> Table:
    """A line for each vehicle."""
    table = Table(
        *("vehicle", "status", "mode", "messages"),
        box=box.SIMPLE,
        title=mission.name,
        title_justify="left",
    )
    for heading in (*COLUMNS, "refused"):
        table.add_column(heading, justify="right")
    for vehicle in mission.companions:
        presence = found.get(vehicle)
        if presence is None:
            table.add_row(vehicle, "never seen")
            continue
        cells = (
            " / ".join(
                "-"
                if (figure := presence.figures.get(f"{name}_{share}")) is None
                else f"{figure:.1f}"
                for share in ("p50", "p99")
            )
            for name in COLUMNS.values()
        )
        refused = f"{presence.figures.get('refused', 0.0):.0f}"
        messages = SIGNED if presence.signed else INSECURE
        table.add_row(vehicle, presence.status, presence.mode, messages, *cells, refused)
    return table
