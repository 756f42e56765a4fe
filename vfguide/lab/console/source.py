"""What a page of the console shows: a flight to begin with, and what is added to it."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple

from vfguide.errors import InputError
from vfguide.lab.console.orders import OrderPanel
from vfguide.lab.console.tiles import TileSource
from vfguide.lab.report.replay.data import describe_flight
from vfguide.record.flight import FlightRecord

MOST_PAGES = 20
"""Pages that are served at once, at most."""

RESERVED = 5
"""Pages of operators beyond that."""

WAITING = 50
"""Pictures that wait for a page: one that falls farther behind begins anew."""


class Source:
    """A flight, and the pages that watch it."""

    panel: OrderPanel | None = None
    """By which pages give orders; None where nobody may."""
    tiles: TileSource | None = None
    """The map below the formation; None without one."""

    def __init__(self) -> None:
        self._pages: set[asyncio.Queue[str | None]] = set()

    @property
    def watched(self) -> bool:
        """Whether any page looks on."""
        return bool(self._pages)

    def has_room(self, *, may_order: bool) -> bool:
        """Whether one more page is served; an operator's where those who look on have taken all others."""
        return len(self._pages) < MOST_PAGES + (RESERVED if may_order else 0)

    def opening(self) -> str:
        """JSON of the flight so far."""
        raise NotImplementedError

    @contextmanager
    def page(self) -> Iterator[asyncio.Queue[str | None]]:
        """A page's queue of what is added to the flight; None in it ends the stream."""
        queue: asyncio.Queue[str | None] = asyncio.Queue(WAITING)
        self._pages.add(queue)
        try:
            yield queue
        finally:
            self._pages.discard(queue)

    def publish(self, text: str) -> None:
        """Hand something to all pages. One that has not kept up is let go: it comes back for the whole."""
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
    """A flight that has ended."""

    def __init__(self, record: FlightRecord, *, tiles: TileSource | None = None) -> None:
        """Show a record.

        Args:
            record: of the flight.
            tiles: the map below it, if there is one.

        Raises:
            InputError: there is a map, and the record does not say where on the earth it was flown.
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
        """JSON of the whole flight."""
        return self._opening
