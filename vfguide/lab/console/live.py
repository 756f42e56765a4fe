"""The formation on its link, as the console shows it: the shell around the model, with clock and link."""

import asyncio
import json
import math
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from random import Random

from vfguide.elementwise import FloatArray
from vfguide.lab.console.alarms import Alarm
from vfguide.lab.console.model import Formation
from vfguide.lab.console.source import Source
from vfguide.link.opening import Link
from vfguide.link.presence import Presence
from vfguide.link.watch import Watched, overhearing
from vfguide.mission import Mission

SAMPLE_S = 0.1
"""Between two pictures."""

WORDS_EVERY = 5
"""Pictures from one look at the alarms and cards to the next."""


class LiveFlight(Source):
    """What is heard of a formation, for all pages that show it."""

    def __init__(self, mission: Mission) -> None:
        """Make one that has heard nothing."""
        super().__init__()
        self._formation = Formation(mission)
        self._began_s = time.monotonic()
        self._link: Link | None = None
        self._count = 0
        self._formation.sample(self.now)

    @property
    def now(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self._began_s

    def opening(self) -> str:
        """The flight so far, with what is said of it now."""
        return json.dumps({**self._formation.describe(), **self._words(self.now)}, allow_nan=False)

    async def run(self, watched: Watched, *, random: Random) -> None:
        """Listen, and tell all pages what there is to show, until cancelled."""
        formation = self._formation
        async with overhearing(
            watched,
            formation.names[1:],
            receive_state=self._take_state,
            receive_presence=self._take_presence,
            random=random,
        ) as self._link:
            while True:
                self._show(self.now)
                await asyncio.sleep(SAMPLE_S - self.now % SAMPLE_S)

    def _take_state(self, vehicle: str, data: bytes) -> None:
        self._formation.take_state(vehicle, data, self.now)

    def _take_presence(self, vehicle: str, presence: Presence) -> None:
        self._formation.take_presence(vehicle, presence, self.now)

    def _show(self, now: float) -> None:
        values = self._formation.sample(now)
        self._count += 1
        if not self.watched:
            return
        content: dict[str, object] = {"t": round(now, 3), "v": rows_of(values)}
        if self._count % WORDS_EVERY == 0:
            content |= self._words(now)
        self.publish(json.dumps(content, allow_nan=False, separators=(",", ":")))

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
            "alarms": [{"level": one.level, "text": one.text} for one in alarms],
        }


def refusals(link: Link) -> str:
    """Why nothing is believed of all that comes, in one sentence; empty where nothing was refused."""
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
    """Numbers for JSON, to a millimetre or thousandth; None is not known."""
    return [
        [round(one, 3) if math.isfinite(one) else None for one in row] for row in values.tolist()
    ]


@asynccontextmanager
async def live_flight_of(mission: Mission, watched: Watched) -> AsyncIterator[LiveFlight]:
    """A formation that is listened to for as long as the context lasts."""
    flight = LiveFlight(mission)
    try:
        # A group, so that a link that cannot be used ends the console instead of leaving its page to age.
        async with asyncio.TaskGroup() as tasks:
            running = tasks.create_task(flight.run(watched, random=Random()), name="console")
            yield flight
            running.cancel()
    except BaseExceptionGroup as failed:
        raise failed.exceptions[0] from None
