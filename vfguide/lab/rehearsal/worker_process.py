"""Aircraft that fly in a process of their own, a little behind the leader's.

Nobody has to know at once what a follower publishes (`exchange.py`), so the formation splits: this process is
handed what was published elsewhere and needs nothing else. The instants, the seeds and therefore the bytes
are the same as in one process.
"""

import multiprocessing
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection

from vfguide.companion.role import Event
from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.aircraft import Aircraft, Instant, aircraft_of, fly_window
from vfguide.lab.rehearsal.foreign_leader import ForeignLeader
from vfguide.link.memory import Mail
from vfguide.mission.model import Mission
from vfguide.record.tlog import TelemetryLog
from vfguide.record.vehicle import VehicleRecord
from vfguide.registry import plugin_fault


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


def outcome_of(aircraft: Aircraft | ForeignLeader) -> Outcome:
    """What an aircraft brings home so far."""
    return Outcome(
        name=aircraft.name,
        record=aircraft.recorder.record(),
        events=aircraft.events,
        log=aircraft.log,
    )


def launch(
    mission: Mission, names: Sequence[str], epoch_s: float | None
) -> list[Aircraft | ForeignLeader]:
    """Aircraft at their starts, with telemetry logs where time 0 is given in seconds since 1970."""
    return [
        aircraft_of(mission, name, log=None if epoch_s is None else TelemetryLog(epoch_s))
        for name in names
    ]


class WorkerProcess:
    """The near end of such a process."""

    def __init__(self, mission: Mission, names: Sequence[str], epoch_s: float | None) -> None:
        """Start the process and launch these aircraft in it."""
        context = multiprocessing.get_context("spawn")
        instants, self._instants = context.Pipe(duplex=False)
        self._answers, answers = context.Pipe(duplex=False)
        self._flown = 0
        self._process = context.Process(
            target=fly_share, args=(mission, names, epoch_s, instants, answers), daemon=True
        )
        # Started by the first process otherwise, and with that it would lift the blocking of signals.
        resource_tracker.ensure_running()
        # Ctrl-C and SIGTERM may reach a whole group of processes; the near end tells this one when to stop.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        # With one holder for each end, the death of either process is an end of file for the other.
        instants.close()
        answers.close()

    def pass_on(self, window: list[Instant]) -> None:
        """Let the worker fly these instants.

        Raises:
            VfguideError: the process died.
        """
        try:
            self._instants.send(window)
        except OSError as error:
            raise self._death() from error
        self._flown += 1

    def published(self) -> list[Mail]:
        """What the worker published in the oldest window for which that was not asked yet; waits for it.

        Raises:
            VfguideError: the process died.
        """
        self._flown -= 1
        try:
            mail: list[Mail] = self._answers.recv()
        except (EOFError, OSError) as error:
            raise self._death() from error
        return mail

    def land(self) -> list[Outcome]:
        """Let the worker fly what was passed on to the end, and take what it brings home.

        Raises:
            VfguideError: the process died.
        """
        while self._flown:
            self.published()
        try:
            self._instants.send(None)
            outcomes: list[Outcome] = self._answers.recv()
        except (EOFError, OSError) as error:
            raise self._death() from error
        self._process.join()
        return outcomes

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.join()
        self._instants.close()
        self._answers.close()

    def _death(self) -> VfguideError:
        self._process.join()
        return VfguideError(f"a flight process died (exit code {self._process.exitcode})")


def fly_share(
    mission: Mission,
    names: Sequence[str],
    epoch_s: float | None,
    instants: Connection,
    answers: Connection,
) -> None:
    """The far end: fly every window that comes, say what was published, at last send home what there is."""
    try:
        share = launch(mission, names, epoch_s)
        # Without a near end there is nobody to fly for.
        with suppress(EOFError, BrokenPipeError):
            while (window := instants.recv()) is not None:
                answers.send(fly_window(share, window))
            answers.send([outcome_of(aircraft) for aircraft in share])
    except Exception as error:
        fault = plugin_fault(error)
        if fault is None:
            raise
        sys.stderr.write(f"{fault}\n")
        raise SystemExit(1) from error
