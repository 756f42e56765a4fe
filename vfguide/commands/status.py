"""`vfguide status`: the state of a formation's vehicles, by their own reports."""

import asyncio
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from random import Random
from typing import Annotated

import typer
from msgspec.structs import replace
from rich import box
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from vfguide.commands.credentials import KeyFiles, watched_formation
from vfguide.commands.options import AsJson, Insecure, KeyFile, LinkUrls, MissionFile, RosterFile
from vfguide.commands.terminal import Terminal, stop_event
from vfguide.companion.roles import holder_of
from vfguide.formation.arrangement import agreed_number
from vfguide.link.opening import HEARD_SHARE, Link, WatchedFormation, check_connected, watching
from vfguide.link.presence import LINKS_LOST, ORDER, TERM, Presence
from vfguide.mission import Mission, read_mission
from vfguide.mission.feasibility import check_mission
from vfguide.system import run_watching_sockets

# A presence may be old: a broker keeps the last one of a companion that is gone, and links get lost.

SILENT_S = 5.0
"""Silence after which a companion counts as gone."""


SILENT_TURNS = 2.5
"""Silence on a slow link after which a companion counts as gone, as a multiple of the presence interval."""


@dataclass(slots=True)
class HeardPresence:
    """Newest presence of one vehicle."""

    said_s: float
    """Time of the presence, s on the companion's own clock."""
    heard_s: float
    """Time of its arrival, s."""
    again: bool = False
    """Whether an earlier presence was heard, which proves that the companion was alive lately."""


class Freshness:
    """Judges which companions are alive: those heard twice, and not long ago."""

    def __init__(self, silent_s: float = SILENT_S) -> None:
        """Start without presences; companions silent for longer than `silent_s` are offline."""
        self.silent_s = silent_s
        self._heard: dict[str, HeardPresence] = {}
        self._before: dict[str, float] = {}

    def note(self, found: Mapping[str, Presence], now: float) -> None:
        """Take the last presence of each vehicle."""
        for name, presence in found.items():
            if presence.time_s == self._before.get(name):
                continue
            heard = self._heard.get(name)
            if heard is None:
                self._heard[name] = HeardPresence(presence.time_s, now)
            elif presence.time_s != heard.said_s:
                self._heard[name] = HeardPresence(presence.time_s, now, again=True)

    def lose(self, found: Mapping[str, Presence]) -> None:
        """Forget all presences after a loss of the link, since a broker may next send kept but newer ones."""
        self._before = {name: presence.time_s for name, presence in found.items()}
        self._heard.clear()

    def missing(self, found: Mapping[str, Presence]) -> list[str]:
        """Return the vehicles that report to be online, but were not heard twice."""
        return [
            name
            for name, presence in found.items()
            if presence.status == "online" and not (name in self._heard and self._heard[name].again)
        ]

    def judge(self, found: Mapping[str, Presence], now: float) -> dict[str, Presence]:
        """Return the presences, with those that may be old at `now` (s) changed to offline."""
        self.note(found, now)
        return {name: self._judged(name, presence, now) for name, presence in found.items()}

    def _judged(self, name: str, presence: Presence, now: float) -> Presence:
        heard = self._heard.get(name)
        if presence.status == "offline":
            return presence
        if heard is None:
            text = "not heard since the link was lost: it may be gone"
        elif not heard.again:
            text = f"nothing new of its companion in {now - heard.heard_s:.0f} s: it may be gone"
        elif now - heard.heard_s > self.silent_s:
            text = f"its companion has been silent for {now - heard.heard_s:.0f} s"
        else:
            return presence
        return replace(presence, status="offline", obstacle=text)


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """Known state of a formation at one moment."""

    found: Mapping[str, Presence]
    """Last presence of each vehicle, offline where the companion may be gone."""
    complaint: str = ""
    """Disconnected links of this computer, with reasons; empty while all are connected."""
    deaf: bool = False
    """Whether no link is connected, so that nothing is known of the vehicles."""


class Lookout(Freshness):
    """Judges the presences that arrive by a link."""

    def __init__(self, link: Link, current: Mapping[str, Presence]) -> None:
        """Start without presences, with a link and the last presences that it received."""
        self.slowest_s = max(carrier.presence_s for carrier in link.carriers)
        """Longest time between two presences of a vehicle, s."""
        super().__init__(max(SILENT_S, SILENT_TURNS * self.slowest_s))
        self._link = link
        self._current = current
        self._losses = link.losses

    def look(self, now: float) -> None:
        """Take what has arrived until `now` (s); call often, else kept presences count as new ones."""
        if self._link.losses != self._losses:
            self._losses = self._link.losses
            self.lose(self._current)
        self.note(self._current, now)

    @property
    def waits(self) -> bool:
        """Whether a vehicle was heard once, but not again."""
        return bool(self.missing(self._current))

    def seen(self, now: float) -> Seen:
        """Return the known state at `now` (s)."""
        self.look(now)
        return Seen(
            found=self.judge(self._current, now),
            complaint=self._link.complaint(),
            deaf=not self._link.connected,
        )


LISTEN_S = 1.5
"""Time within which all living companions are heard."""

ARRIVAL_LOOK_S = 0.05

ALL_THERE, SOME_MISSING = 0, 1

NOT_HEARD = "not heard"
NOTHING_KNOWN = "nothing is known of the vehicles until it stands again"

SIGNED, INSECURE = "signed", "INSECURE"

NOT_FRESH = "without an operator's private key nothing shows whether this was said today: give one with --key"

COLUMNS = {"answer, ms": "response_ms", "leader's age, ms": "leader_age_ms"}
"""Figures of a presence in the table: median and 99th percentile."""

WATCH_S = 1.0
"""Interval between two updates of `--watch`, as long as that between two presences."""


def status(
    mission: MissionFile,
    *,
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    as_json: AsJson = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Print it again once a second, until Ctrl-C.")
    ] = False,
) -> None:
    """Tell how the vehicles of a mission are, and whether they are ready: one line, go or no-go.

    Exit status: 0 every companion is online, 1 some are not, 2 the input is wrong, 3 no broker.
    """
    flown = read_mission(mission).mission
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    credentials = keys.of_operator()
    watched = watched_formation(flown, link, credentials)
    output = Terminal()
    if credentials.roster is not None and credentials.key is None and not as_json:
        Terminal(stderr=True).tell(NOT_FRESH)
    if watch:
        run_watching_sockets(keep_showing(flown, watched, output, as_json=as_json))
        raise typer.Exit(ALL_THERE)
    seen = run_watching_sockets(living_presences(watched))
    if as_json:
        output.tell(json.dumps(status_json(flown, seen), indent=2))
    else:
        output.print(status_table(flown, seen))
        output.tell(flies(flown, seen))
        output.tell(readiness(flown, seen))
    found = seen.found
    online = all(name in found and found[name].status == "online" for name in flown.companions)
    raise typer.Exit(ALL_THERE if online else SOME_MISSING)


async def living_presences(watched: WatchedFormation) -> Seen:
    """Return the state of the formation; companions that are not heard a second time are offline.

    Raises:
        VfguideError: no link is connected.
    """
    loop = asyncio.get_running_loop()
    async with watching(watched, random=Random()) as (link, current):
        check_connected(link)
        lookout = Lookout(link, current)
        await first_words(lookout, asyncio.Event())
        check_connected(link)
        return lookout.seen(loop.time())


async def keep_showing(
    mission: Mission, watched: WatchedFormation, output: Terminal, *, as_json: bool
) -> None:
    """Show the vehicles again and again until Ctrl-C: in place on a terminal, else line by line.

    Raises:
        VfguideError: no link is connected at first; one that is lost later reconnects by itself.
    """
    loop, ended = asyncio.get_running_loop(), stop_event()
    async with watching(watched, random=Random()) as (link, current):
        check_connected(link)
        lookout = Lookout(link, current)
        await first_words(lookout, ended)
        with Live(console=output, auto_refresh=False) as live:
            while not ended.is_set():
                seen = lookout.seen(loop.time())
                if as_json:
                    output.tell(json.dumps(status_json(mission, seen)))
                elif output.is_terminal:
                    lines = Text(f"{flies(mission, seen)}\n{readiness(mission, seen)}")
                    live.update(Group(status_table(mission, seen), lines), refresh=True)
                else:
                    output.tell(readiness(mission, seen))
                await look_on(lookout, WATCH_S, ended)


async def first_words(lookout: Lookout, ended: asyncio.Event) -> None:
    """Listen until all living companions should be heard, and longer for second presences."""
    loop = asyncio.get_running_loop()
    least_s, longest_s = max(LISTEN_S, HEARD_SHARE * lookout.slowest_s), lookout.silent_s
    began_s, passed_s = loop.time(), 0.0
    while not ended.is_set() and (passed_s < least_s or (lookout.waits and passed_s < longest_s)):
        await look_on(lookout, ARRIVAL_LOOK_S, ended)
        passed_s = loop.time() - began_s


async def look_on(lookout: Lookout, seconds: float, ended: asyncio.Event) -> None:
    """Look at what arrives for some seconds, or until `ended`."""
    loop = asyncio.get_running_loop()
    until_s = loop.time() + seconds
    while not ended.is_set() and (left_s := until_s - loop.time()) > 0.0:
        with suppress(TimeoutError):
            async with asyncio.timeout(min(left_s, ARRIVAL_LOOK_S)):
                await ended.wait()
        lookout.look(loop.time())


def readiness(mission: Mission, seen: Seen) -> str:
    """Return whether the formation may take off: go, or no-go with all reasons, in one line."""
    if seen.deaf:
        return f"NO-GO  {seen.complaint}: {NOTHING_KNOWN}"
    found = seen.found
    against = [
        f"mission: {one.message}" for one in check_mission(mission) if one.severity == "error"
    ]
    if seen.complaint:
        against.append(f"{seen.complaint}: see that it stands again")
    versions = {one.version for one in found.values() if one.status == "online"}
    for name in mission.companions:
        against += [f"{name}: {text}" for text in doubts(found.get(name))]
    if len(versions) > 1:
        against.append(f"companions of different versions: {', '.join(sorted(versions))}")
    if against:
        return f"NO-GO  {'; '.join(against)}"
    return f"GO  {mission.name}: all {len(mission.companions)} companions are ready"


def doubts(presence: Presence | None) -> list[str]:
    """Return the reasons against a take-off in a vehicle's presence."""
    if presence is None:
        return ["no companion is heard"]
    if presence.status != "online":
        return [presence.obstacle or "its companion is offline"]
    found = [presence.obstacle] if presence.obstacle else []
    if not presence.signed:
        found.append("its messages are not signed (--insecure)")
    if (lost := presence.figures.get(LINKS_LOST, 0.0)) > 0.0:
        found.append(f"{lost:.0f} of its links {'is' if lost == 1.0 else 'are'} lost")
    return [*found, *presence.findings]


def flies(mission: Mission, seen: Seen) -> str:
    """Return who leads and which order is flown, in one line."""
    if seen.deaf:
        return "who leads and what is flown is not known: no link stands"
    online = {name: one.figures for name, one in seen.found.items() if one.status == "online"}
    term = max(int(max((one.get(TERM, 0.0) for one in online.values()), default=0.0)), 0)
    leads = holder_of(term, (mission.leader.vehicle, *mission.deputies))
    numbers = {name: int(one.get(ORDER, 0.0)) for name, one in online.items()}
    number = agreed_number(numbers, leads)
    place = "" if term == 0 else f" in the leader's place (term {term})"
    order = f"order {number}" if number else "the mission's formation"
    return f"{leads} leads{place}; {order} is flown"


def status_json(mission: Mission, seen: Seen) -> dict[str, object]:
    """Return the presences of all companions for JSON."""
    if seen.deaf:
        lost = {"status": NOT_HEARD, "obstacle": f"{seen.complaint}: {NOTHING_KNOWN}"}
        return dict.fromkeys(mission.companions, lost)
    return {name: described(seen.found.get(name)) for name in mission.companions}


def described(presence: Presence | None) -> dict[str, object]:
    """Return a presence for JSON."""
    if presence is None:
        return {"status": "never seen"}
    return {
        "status": presence.status,
        "mode": presence.mode,
        "version": presence.version,
        "signed": presence.signed,
        "obstacle": presence.obstacle,
        "findings": list(presence.findings),
        "warning": presence.warning,
        **presence.figures,
    }


def status_table(mission: Mission, seen: Seen) -> Table:
    """Return a table with a row for each vehicle."""
    table = Table(
        *("vehicle", "status", "mode", "messages"),
        box=box.SIMPLE,
        title=mission.name,
        title_justify="left",
    )
    for heading in (*COLUMNS, "refused"):
        table.add_column(heading, justify="right")
    for vehicle in mission.companions:
        presence = seen.found.get(vehicle)
        if seen.deaf or presence is None:
            table.add_row(vehicle, NOT_HEARD if seen.deaf else "never seen")
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
