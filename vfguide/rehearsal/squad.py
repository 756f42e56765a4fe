"""Aircraft that fly in a process of their own, a little behind the leader's.

Followers hear the leader and nobody hears them, so the formation splits: this process is handed what was
published at each instant and needs nothing else. The instants, the seeds and therefore the bytes are the same
as in one process.
"""

import multiprocessing
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from vfguide.companion.core import Event
from vfguide.errors import VfguideError
from vfguide.mission.model import Mission
from vfguide.record.tlog import TelemetryLog
from vfguide.record.vehicle import VehicleRecord
from vfguide.rehearsal.aircraft import Aircraft, step_all

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

Instant = tuple[float, list[bytes]]
"""Virtual time, and what was published then."""

BATCH = 40
"""Instants handed over at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What one aircraft brings home."""

    name: str
    """Of the vehicle."""
    record: VehicleRecord
    """Its part of the flight record."""
    events: list[Event]
    """What its companion reported."""
    log: TelemetryLog | None
    """Its telemetry log, where one was kept."""


def outcome_of(aircraft: Aircraft) -> Outcome:
    """What an aircraft brings home so far."""
    return Outcome(
        name=aircraft.name,
        record=aircraft.recorder.record(),
        events=aircraft.events,
        log=aircraft.log,
    )


def launch(mission: Mission, names: Sequence[str], epoch_s: float | None) -> list[Aircraft]:
    """Aircraft at their starts, with telemetry logs where time 0 is given in seconds since 1970."""
    return [
        Aircraft(mission, name, log=None if epoch_s is None else TelemetryLog(epoch_s))
        for name in names
    ]


class Squad:
    """The near end of such a process."""

    def __init__(self, mission: Mission, names: Sequence[str], epoch_s: float | None) -> None:
        """Start the process and launch these aircraft in it."""
        context = multiprocessing.get_context("spawn")
        self._instants: Queue[list[Instant] | None] = context.Queue()
        self._outcomes, far_end = context.Pipe(duplex=False)
        self._batch: list[Instant] = []
        # A daemon: should this process die, that one does not stay.
        self._process = context.Process(
            target=fly_squad, args=(mission, names, epoch_s, self._instants, far_end), daemon=True
        )
        self._process.start()
        far_end.close()

    def pass_on(self, now: float, published: list[bytes]) -> None:
        """Let the squad fly the instant at which this was published."""
        self._batch.append((now, published))
        if len(self._batch) >= BATCH:
            self._hand_over()

    def land(self) -> list[Outcome]:
        """Let the squad fly what was passed on to the end, and take what it brings home.

        Raises:
            VfguideError: the process died.
        """
        self._hand_over()
        self._instants.put(None)
        try:
            outcomes: list[Outcome] = self._outcomes.recv()
        except EOFError as error:
            self._process.join()
            code = self._process.exitcode
            raise VfguideError(f"a flight process died (exit code {code})") from error
        self._process.join()
        return outcomes

    def _hand_over(self) -> None:
        self._instants.put(self._batch)
        self._batch = []


def fly_squad(
    mission: Mission,
    names: Sequence[str],
    epoch_s: float | None,
    instants: "Queue[list[Instant] | None]",
    outcomes: Connection,
) -> None:
    """The far end: fly every instant that comes, then send home what was brought along."""
    # Ctrl-C reaches every process of a terminal; the near end tells this one when to stop.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    squad = launch(mission, names, epoch_s)
    while (batch := instants.get()) is not None:
        for now, published in batch:
            step_all(squad, now, published)
    outcomes.send([outcome_of(aircraft) for aircraft in squad])
