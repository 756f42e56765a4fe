"""Sources of the console's pages: a flight so far and its updates, from a record or a formation's link."""

import asyncio
import json
import math
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import astuple
from functools import partial
from random import Random

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.console.alarms import Alarm
from vfguide.lab.console.model import FormationModel
from vfguide.lab.console.orders import OrderPanel
from vfguide.lab.console.tiles import TileSource
from vfguide.lab.order_desk import OrderDesk, ask_for_order
from vfguide.lab.report.replay import describe_flight
from vfguide.link.opening import Link, WatchedFormation, open_link, watching_member
from vfguide.link.presence import Presence
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

MOST_PAGES = 20
"""Maximum number of pages at once."""

RESERVED = 5
"""Number of further pages for operators."""

WAITING = 50
"""Maximum number of queued updates of a page; a page that is farther behind starts again."""


class Source:
    """Flight with the pages that watch it."""

    panel: OrderPanel | None = None
    """Panel by which pages give orders; None where orders are not allowed."""
    tiles: TileSource | None = None
    """Map below the formation."""

    def __init__(self) -> None:
        self._pages: set[asyncio.Queue[str | None]] = set()

    @property
    def watched(self) -> bool:
        """Whether any page watches."""
        return bool(self._pages)

    def has_room(self, *, may_order: bool) -> bool:
        """Check whether there is room for one more page; some places are reserved for operators."""
        return len(self._pages) < MOST_PAGES + (RESERVED if may_order else 0)

    def opening(self) -> str:
        """Return JSON of the flight so far."""
        raise NotImplementedError

    @contextmanager
    def page(self) -> Iterator[asyncio.Queue[str | None]]:
        """Register a page; yield its queue of updates, in which None ends the stream."""
        queue: asyncio.Queue[str | None] = asyncio.Queue(WAITING)
        self._pages.add(queue)
        try:
            yield queue
        finally:
            self._pages.discard(queue)

    def publish(self, text: str) -> None:
        """Send an update to all pages; disconnect a page with a full queue, which then reloads the flight."""
        for queue in list(self._pages):
            if queue.full():
                self._let_go(queue)
            else:
                queue.put_nowait(text)

    def close(self) -> None:
        """End all streams."""
        for queue in list(self._pages):
            self._let_go(queue)

    def _let_go(self, queue: asyncio.Queue[str | None]) -> None:
        while not queue.empty():
            queue.get_nowait()
        queue.put_nowait(None)
        self._pages.discard(queue)


class RecordedFlight(Source):
    """Flight that has ended."""

    def __init__(self, record: FlightRecord, *, tiles: TileSource | None = None) -> None:
        """Show a record, on a map where there are tiles.

        Raises:
            InputError: there are tiles, but the record has no geographic origin.
        """
        super().__init__()
        self.tiles = tiles
        content = {**describe_flight(record), "live": False}
        if tiles is not None:
            if record.origin is None:
                raise InputError(
                    "--tiles: this record does not say where on the earth it was flown; leave the map out"
                )
            content["map"] = tiles.describe(*astuple(record.origin))
        self._opening = json.dumps(content, allow_nan=False)

    def opening(self) -> str:
        """Return JSON of the whole flight."""
        return self._opening


SAMPLE_S = 0.1
"""Interval of samples, s."""

WORDS_EVERY = 5
"""Samples per update of alarms and cards."""

ASK_EVERY = 10
"""Samples between requests for a flown order that was not heard."""


class LiveSource(Source):
    """Formation heard on its link."""

    def __init__(
        self, mission: Mission, *, orders: bool = False, tiles: TileSource | None = None
    ) -> None:
        """Begin with nothing heard; `orders` allows pages to give orders."""
        super().__init__()
        self.tiles = tiles
        origin = mission.origin
        place = origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m
        self._map = {} if tiles is None else {"map": tiles.describe(*place)}
        self._formation = FormationModel(mission)
        self._began_s = time.monotonic()
        self._link: Link | None = None
        self._count = 0
        self._states: dict[str, bytes] = {}
        self._desk = OrderDesk(mission)
        if orders:
            self.panel = OrderPanel(
                mission, self._desk, clock=time.monotonic, changed=self._show_order
            )
        self._formation.sample(self.now)
        self.also: Callable[[FloatArray], None] | None = None
        """Further receiver of each sample: (vehicles, series), NaN where not known."""

    @property
    def now(self) -> float:
        """Time since the console began, s."""
        return time.monotonic() - self._began_s

    def opening(self) -> str:
        """Return JSON of the flight so far, with present cards, alarms and order."""
        content = {
            **self._formation.describe(),
            **self._map,
            **self._words(self.now),
            **self._order(),
        }
        return json.dumps(content, allow_nan=False)

    async def run(self, watched: WatchedFormation, *, random: Random) -> None:
        """Listen to the formation and update all pages, until cancelled."""
        formation, desk = self._formation, self._desk
        member = watching_member(
            watched,
            random,
            receive_presence=self._take_presence,
            receive=partial(self._take_state, watched.leader),
            neighbours=formation.names[1:],
            receive_neighbour=self._take_state,
            receive_lead=self._take_lead,
            receive_order=self._take_order,
            receive_reply=desk.heard_reply if self.panel is not None else None,
        )
        desk.member = member
        async with open_link(
            watched.addresses, formation=watched.formation, member=member, random=random
        ) as self._link:
            if self.panel is not None:
                self.panel.link = self._link
            try:
                while True:
                    self._show(self.now)
                    await asyncio.sleep(SAMPLE_S - self.now % SAMPLE_S)
            finally:
                if self.panel is not None:
                    self.panel.stop()

    @property
    def _proven(self) -> bool:
        """Whether received messages are proven to be new; without keys they are taken for new."""
        member = self._desk.member
        return member.peer_clock is None or member.trust.proven

    def _take_state(self, vehicle: str, data: bytes) -> None:
        self._formation.take_state(vehicle, data, self.now)
        if self._proven:
            self._states[vehicle] = data

    def _take_lead(self, vehicle: str, data: bytes) -> None:
        if self._proven and self._desk.heard_lead(vehicle, data):
            self._formation.take_lead(data, self.now)

    def _take_order(self, data: bytes, sealed: bytes, repeated: bool) -> None:
        self._desk.heard_order(data, sealed, repeated)

    def _take_presence(self, vehicle: str, presence: Presence) -> None:
        self._formation.take_presence(vehicle, presence, self.now)

    def _show(self, now: float) -> None:
        self._count += 1
        if self._count % WORDS_EVERY == 0:
            self._note_flown()
        values = self._formation.sample(now)
        if self.also is not None:
            self.also(values)
        if not self.watched:
            return
        content: dict[str, object] = {"t": round(now, 3), "v": rows_of(values)}
        if self._count % WORDS_EVERY == 0:
            content |= self._words(now)
        self.publish(json.dumps(content, allow_nan=False, separators=(",", ":")))

    def _note_flown(self) -> None:
        """Update the leader and the flown order from the newest states."""
        desk = self._desk
        # Only the newest of each vehicle: 30 aircraft send 300 states a second.
        for vehicle, data in self._states.items():
            desk.heard_state(vehicle, data)
        self._states.clear()
        number, order = desk.newest_number, desk.flown
        self._formation.take_order(number, order, leads=desk.leads)
        unknown = number > 0 and order is None
        if unknown and self.panel is not None and self._link and self._count % ASK_EVERY == 0:
            ask_for_order(self._link)

    def _order(self) -> dict[str, object]:
        return {} if self.panel is None else {"order": self.panel.describe()}

    def _show_order(self) -> None:
        self.publish(json.dumps(self._order(), allow_nan=False))

    def _words(self, now: float) -> dict[str, object]:
        alarms = self._formation.alarms(now)
        link = self._link
        if link is not None and not link.connected:
            text = f"No connection: {link.complaint()}. This page goes on trying; see that the broker runs."
            alarms.insert(0, Alarm(level="alarm", text=text))
        elif link is not None and not self._formation.heard_anything:
            refused = refusals(link)
            if refused:
                alarms.insert(0, Alarm(level="alarm", text=refused))
        return {
            "cards": self._formation.cards(now),
            "flies": self._formation.flies(),
            "alarms": [{"level": one.level, "text": one.text} for one in alarms],
        }


def refusals(link: Link) -> str:
    """Return in one sentence why messages were rejected; empty where none was."""
    counters = {
        reason.removeprefix("refused: "): count
        for reason, count in link.counters.items()
        if reason.startswith("refused: ")
    }
    if not counters:
        return ""
    reason = max(counters, key=lambda one: counters[one])
    return (
        f"{sum(counters.values())} messages were not believed, most of them as {reason}: give the console"
        " this formation's --roster and --key, or --insecure where nothing is signed."
    )


def rows_of(values: FloatArray) -> list[list[float | None]]:
    """Return numbers for JSON, rounded to a thousandth; None where not known."""
    return [
        [round(one, 3) if math.isfinite(one) else None for one in row] for row in values.tolist()
    ]


@asynccontextmanager
async def live_flight_of(
    mission: Mission,
    watched: WatchedFormation,
    *,
    orders: bool = False,
    tiles: TileSource | None = None,
) -> AsyncIterator[LiveSource]:
    """Listen to a formation for as long as the context lasts; `orders` allows pages to give orders."""
    flight = LiveSource(mission, orders=orders, tiles=tiles)
    try:
        # A group, so that a failed link ends the console instead of leaving a stale page.
        async with asyncio.TaskGroup() as tasks:
            running = tasks.create_task(flight.run(watched, random=Random()), name="console")
            yield flight
            running.cancel()
    except BaseExceptionGroup as failed:
        raise failed.exceptions[0] from None
