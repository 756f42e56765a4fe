"""`vfguide status`: how the vehicles of a formation are, as they say themselves."""

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
from vfguide.commands.options import (
    AsJson,
    Insecure,
    KeyFile,
    LinkUrls,
    MissionFile,
    RosterFile,
)
from vfguide.commands.terminal import Terminal, stop_event
from vfguide.companion.roles import holder_of
from vfguide.formation.arrangement import agreed_number
from vfguide.link.opening import HEARD_SHARE, Link, WatchedFormation, check_connected, watching
from vfguide.link.presence import LINKS_LOST, ORDER, TERM, Presence
from vfguide.mission import Mission, read_mission
from vfguide.mission.feasibility import check_mission
from vfguide.system import run_watching_sockets

# Which presences are of now: a broker keeps the last word of a companion that is gone; links get lost.

SILENT_S = 5.0
"""A companion that has not said for so long how it is counts as gone."""


SILENT_TURNS = 2.5
"""On a slow link, who is silent for more than two of its turns counts as gone."""


@dataclass(slots=True)
class HeardPresence:
    """What was heard of one vehicle."""

    said_s: float
    """The time of its newest presence, s on its own clock."""
    heard_s: float
    """When that was heard, s."""
    again: bool = False
    """Whether it is not the first one: then its companion lives, or did so a moment ago."""


class Freshness:
    """Who has said how it is twice, and not long ago."""

    def __init__(self, silent_s: float = SILENT_S) -> None:
        """Begin with nobody heard; who says nothing for so long (s) is offline."""
        self.silent_s = silent_s
        """Who says nothing for longer (s) is offline."""
        self._heard: dict[str, HeardPresence] = {}
        self._before: dict[str, float] = {}

    def note(self, found: Mapping[str, Presence], now: float) -> None:
        """Take what each vehicle said last."""
        for name, presence in found.items():
            if presence.time_s == self._before.get(name):
                continue
            heard = self._heard.get(name)
            if heard is None:
                self._heard[name] = HeardPresence(presence.time_s, now)
            elif presence.time_s != heard.said_s:
                self._heard[name] = HeardPresence(presence.time_s, now, again=True)

    def lose(self, found: Mapping[str, Presence]) -> None:
        """Note that the link was lost: what a broker says next may be kept, and newer than what was heard."""
        self._before = {name: presence.time_s for name, presence in found.items()}
        self._heard.clear()

    def missing(self, found: Mapping[str, Presence]) -> list[str]:
        """Vehicles that say they are online, and were not heard twice."""
        return [
            name
            for name, presence in found.items()
            if presence.status == "online" and not (name in self._heard and self._heard[name].again)
        ]

    def judge(self, found: Mapping[str, Presence], now: float) -> dict[str, Presence]:
        """The presences, those that may be old as offline.

        Args:
            found: what each vehicle said last.
            now: s.
        """
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
    """What is known of a formation at a moment."""

    found: Mapping[str, Presence]
    """What each vehicle said last, those that may be gone as offline."""
    complaint: str = ""
    """Which of the own links do not stand, and why; empty while all do."""
    deaf: bool = False
    """Whether none stands: then nothing is known of the vehicles."""


class Lookout(Freshness):
    """Looks at what comes in by a link."""

    def __init__(self, link: Link, current: Mapping[str, Presence]) -> None:
        """Begin with nobody heard, by a link and what each vehicle said last by it."""
        self.slowest_s = max(carrier.presence_s for carrier in link.carriers)
        """Longest time between two words of a vehicle, s."""
        super().__init__(max(SILENT_S, SILENT_TURNS * self.slowest_s))
        self._link = link
        self._current = current
        self._losses = link.losses

    def look(self, now: float) -> None:
        """Take what has come in until now (s); often, or what was kept is taken for what was said."""
        if self._link.losses != self._losses:
            self._losses = self._link.losses
            self.lose(self._current)
        self.note(self._current, now)

    @property
    def waits(self) -> bool:
        """Whether a vehicle was heard, and not again since."""
        return bool(self.missing(self._current))

    def seen(self, now: float) -> Seen:
        """What is known now (s)."""
        self.look(now)
        return Seen(
            found=self.judge(self._current, now),
            complaint=self._link.complaint(),
            deaf=not self._link.connected,
        )


LISTEN_S = 1.5
"""Long enough for a presence from everybody who lives."""

ARRIVAL_LOOK_S = 0.05
"""Interval at which what has come in is looked at."""

ALL_THERE, SOME_MISSING = 0, 1

NOT_HEARD = "not heard"
NOTHING_KNOWN = "nothing is known of the vehicles until it stands again"

SIGNED, INSECURE = "signed", "INSECURE"

NOT_FRESH = "without an operator's private key nothing shows whether this was said today: give one with --key"

COLUMNS = {"answer, ms": "response_ms", "leader's age, ms": "leader_age_ms"}
"""Figures of a presence that the table shows: the median and the 99th percentile."""

WATCH_S = 1.0
"""Between two looks of `--watch`: everybody says once a second how it is."""


def status(
    mission: MissionFile,
    *,
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    as_json: AsJson = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Again and again, once a second, until Ctrl-C.")
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
    """What each vehicle says about itself; who is not heard a second time is offline.

    Raises:
        VfguideError: no link stands.
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
    """Show how the vehicles are, again and again, until Ctrl-C: in place on a terminal, else line by line.

    Raises:
        VfguideError: no link stands at first; one that is lost later comes back by itself.
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
    """Listen until everybody who lives should have been heard, and longer for the second word of some."""
    loop = asyncio.get_running_loop()
    least_s, longest_s = max(LISTEN_S, HEARD_SHARE * lookout.slowest_s), lookout.silent_s
    began_s, passed_s = loop.time(), 0.0
    while not ended.is_set() and (passed_s < least_s or (lookout.waits and passed_s < longest_s)):
        await look_on(lookout, ARRIVAL_LOOK_S, ended)
        passed_s = loop.time() - began_s


async def look_on(lookout: Lookout, seconds: float, ended: asyncio.Event) -> None:
    """Look at what comes in for so long, or until the end."""
    loop = asyncio.get_running_loop()
    until_s = loop.time() + seconds
    while not ended.is_set() and (left_s := until_s - loop.time()) > 0.0:
        with suppress(TimeoutError):
            async with asyncio.timeout(min(left_s, ARRIVAL_LOOK_S)):
                await ended.wait()
        lookout.look(loop.time())


def readiness(mission: Mission, seen: Seen) -> str:
    """Whether the formation may take off, in one line: go, or no-go and everything that speaks against it."""
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
    """What speaks against taking off with a vehicle that says this of itself."""
    if presence is None:
        return ["no companion is heard"]
    if presence.status != "online":
        return [presence.obstacle or "its companion is offline"]
    found = [presence.obstacle] if presence.obstacle else []
    if not presence.signed:
        found.append("its messages are not signed (--insecure)")
    if (lost := presence.figures.get(LINKS_LOST, 0.0)) > 0.0:
        found.append(f"{lost:.0f} of its links is lost")
    return [*found, *presence.findings]


def flies(mission: Mission, seen: Seen) -> str:
    """Who leads, and the order that is flown, in one line."""
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
    """Everybody's presence as JSON holds it."""
    if seen.deaf:
        lost = {"status": NOT_HEARD, "obstacle": f"{seen.complaint}: {NOTHING_KNOWN}"}
        return dict.fromkeys(mission.companions, lost)
    return {name: described(seen.found.get(name)) for name in mission.companions}


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
        "findings": list(presence.findings),
        "warning": presence.warning,
        **presence.figures,
    }


def status_table(mission: Mission, seen: Seen) -> Table:
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
