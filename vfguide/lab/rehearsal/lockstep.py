"""Rehearsals in lockstep, in one process or several.

Time is virtual: a flight goes as fast as the computer, with the same bytes for the same seed.

Processes exchange the mail of followers at the end of each window of some instants. The links get it at the
beginning of the window after next, so that no process waits for another that flies the same window. The
number of processes changes no result.
"""

import multiprocessing
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from itertools import islice, takewhile
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection

from vfguide.companion.alerts import Event
from vfguide.companion.follower_role import PUBLISH_S
from vfguide.companion.role import flight_event
from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.aircraft import (
    Aircraft,
    Candidates,
    EmulatedForeignLeader,
    Instant,
    aircraft_of,
    fly_window,
)
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.link.memory import Mail
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.latency import Latency
from vfguide.record.tlog import TelemetryLog
from vfguide.record.vehicle import VehicleRecord
from vfguide.registry import plugin_fault

WINDOWS = 2
"""Number of windows from the publication of mail to its handover to the links."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleOutcome:
    """Results of one aircraft's flight."""

    name: str
    record: VehicleRecord
    events: list[Event]
    log: TelemetryLog | None


def outcome_of(aircraft: Aircraft | EmulatedForeignLeader) -> VehicleOutcome:
    """Return the results of an aircraft's flight so far."""
    return VehicleOutcome(
        name=aircraft.name,
        record=aircraft.recorder.record(),
        events=aircraft.events,
        log=aircraft.log,
    )


def launch(
    mission: Mission, names: Sequence[str], epoch_s: float | None
) -> list[Aircraft | EmulatedForeignLeader]:
    """Return aircraft at their starts, with telemetry logs where time 0 is given, s since 1970."""
    return [
        aircraft_of(mission, name, log=None if epoch_s is None else TelemetryLog(epoch_s))
        for name in names
    ]


class WorkerProcess:
    """Handle of a process that flies some of the aircraft; methods raise VfguideError where it died."""

    def __init__(self, mission: Mission, names: Sequence[str], epoch_s: float | None) -> None:
        """Start the process and launch these aircraft in it."""
        context = multiprocessing.get_context("spawn")
        instants, self._instants = context.Pipe(duplex=False)
        self._answers, answers = context.Pipe(duplex=False)
        self._flown = 0
        self._process = context.Process(
            target=fly_share, args=(mission, names, epoch_s, instants, answers), daemon=True
        )
        with signals_blocked():
            self._process.start()
        # Each end has one holder then: the death of either process is an end of file for the other.
        instants.close()
        answers.close()

    def pass_on(self, window: list[Instant]) -> None:
        """Let the worker fly these instants."""
        try:
            self._instants.send(window)
        except OSError as error:
            raise self._death() from error
        self._flown += 1

    def published(self) -> list[Mail]:
        """Wait for and return the worker's mail of the oldest window that was not collected yet."""
        self._flown -= 1
        try:
            mail: list[Mail] = self._answers.recv()
        except (EOFError, OSError) as error:
            raise self._death() from error
        return mail

    def land(self) -> list[VehicleOutcome]:
        """Let the worker complete all windows that were passed on, and return its outcomes."""
        while self._flown:
            self.published()
        try:
            self._instants.send(None)
            outcomes: list[VehicleOutcome] = self._answers.recv()
        except (EOFError, OSError) as error:
            raise self._death() from error
        self._process.join()
        return outcomes

    def close(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.join()
        self._instants.close()
        self._answers.close()

    def _death(self) -> VfguideError:
        self._process.join()
        return VfguideError(f"a flight process died (exit code {self._process.exitcode})")


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Block SIGINT and SIGTERM in processes started in this context, since both may reach a whole group.

    The parent process tells a worker when to stop. Windows cannot block signals: there a worker ignores
    Ctrl-C once it has started.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # The start of the first process would start the tracker too, which would unblock the signals.
    resource_tracker.ensure_running()
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def fly_share(
    mission: Mission,
    names: Sequence[str],
    epoch_s: float | None,
    instants: Connection,
    answers: Connection,
) -> None:
    """Run a worker: fly each received window, send the published mail, and at the end the outcomes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        share = launch(mission, names, epoch_s)
        # The worker ends when its parent process is gone.
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


Progress = Callable[[float], None]
"""Receiver of the virtual time, s, at each step of the leader; followers fly it up to a window later."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LockstepFlight:
    """Results of a flight, completed or interrupted; dictionaries are by vehicle."""

    record: FlightRecord
    events: dict[str, list[Event]]
    logs: dict[str, TelemetryLog]
    """Telemetry logs, where they were kept."""
    interrupted: bool
    latency: Latency | None = None
    """Latencies of the programs of a live flight."""


def count_of_steps(mission: Mission) -> int:
    """Return the number of steps of a flight, with the first and the last."""
    return round(mission.rehearsal.duration_s * mission.rehearsal.rate_hz) + 1


def instants(mission: Mission) -> Iterator[float]:
    """Yield the times of the steps of a flight, s, from 0 to its duration."""
    for step in range(count_of_steps(mission)):
        yield step / mission.rehearsal.rate_hz


def windows(mission: Mission) -> Iterator[list[float]]:
    """Yield the times of the steps, s, in windows of the exchange between followers."""
    remaining = instants(mission)
    # A follower publishes about once in a window.
    length = max(round(PUBLISH_S * mission.rehearsal.rate_hz), 1)
    while window := list(islice(remaining, length)):
        yield window


class FormationShare:
    """Part of a formation that this process flies, candidates for leading ahead of all others."""

    def __init__(
        self,
        mission: Mission,
        aircraft: Mapping[str, Aircraft | EmulatedForeignLeader],
        workers: Sequence[WorkerProcess] = (),
    ) -> None:
        """Begin with nothing flown; `aircraft` are by name, candidates first, `workers` fly the others."""
        self._mission, self.aircraft, self._workers = mission, aircraft, workers
        flying, leading = [*aircraft.values()], 1 + len(mission.deputies)
        self._candidates, self._followers = Candidates(flying[:leading]), flying[leading:]
        self._mail: dict[int, list[Mail]] = {}
        self.times: list[float] = []
        """Times flown, s."""

    def post(self, window: int, mail: Iterable[Mail]) -> None:
        """Keep mail of this window until it is due."""
        self._mail.setdefault(window + WINDOWS, []).extend(mail)

    def fly(self, window: int, due: Iterable[float], progress: Progress | None = None) -> None:
        """Fly the due times, s, of a window, candidates before all others."""
        mail, published = self._mail.pop(window, []), list[Mail]()
        flown: list[Instant] = []
        for now in due:
            at_once, later = self._candidates.step(now, mail)
            flown.append((now, [*mail, *at_once]))
            published += later
            mail = []
            self.times.append(now)
            if progress is not None:
                progress(now)
        for worker in self._workers:
            worker.pass_on(flown)
        self.post(window, [*published, *fly_window(self._followers, flown)])

    @property
    def left(self) -> int:
        """Number of steps left of the mission."""
        return count_of_steps(self._mission) - len(self.times)

    def land(self, began: float) -> LockstepFlight:
        """End the flight and return it; `began` is its start by the performance counter, s."""
        outcomes = {name: outcome_of(one) for name, one in self.aircraft.items()}
        outcomes |= {one.name: one for worker in self._workers for one in worker.land()}
        names = [self._mission.leader.vehicle, *self._mission.followers_by_name]
        return flight_of(
            self._mission,
            self.times,
            [outcomes[name] for name in names],
            wall_s=time.perf_counter() - began,
            interrupted=self.left > 0,
        )


def leading_first(mission: Mission) -> list[str]:
    """Return the names of all vehicles, candidates for leading first."""
    first = [mission.leader.vehicle, *mission.deputies]
    return [*first, *(name for name in mission.followers_by_name if name not in first)]


def fly_lockstep(
    mission: Mission,
    *,
    processes: int = 1,
    epoch_s: float | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> LockstepFlight:
    """Fly a mission to its end, or until `stop` returns True.

    Args:
        mission: the mission.
        processes: number of processes; the result is the same for any.
        epoch_s: time 0 of the flight, s since 1970, to keep telemetry logs; None for no logs.
        progress: receiver of the virtual time.
        stop: asked before each step but the first whether to end the flight.

    Raises:
        VfguideError: one of the processes died.
    """
    began = time.perf_counter()
    names, leading = leading_first(mission), 1 + len(mission.deputies)
    # Candidates for leading are heard at once: they fly in one process, each window ahead of all others.
    first, rest = names[:leading], names[leading:]
    processes = min(processes, len(rest) + 1)
    with ExitStack() as stack:
        workers = [
            stack.enter_context(
                closing(WorkerProcess(mission, rest[number - 1 :: processes], epoch_s))
            )
            for number in range(1, processes)
        ]
        here = launch(mission, [*first, *rest[processes - 1 :: processes]], epoch_s)
        share = FormationShare(mission, {one.name: one for one in here}, workers)
        for window, due in enumerate(windows(mission)):
            if window >= WINDOWS:
                for worker in workers:
                    share.post(window - WINDOWS, worker.published())
            flown = takewhile(lambda _: not (stop() and share.times), due)
            share.fly(window, flown, progress)
            if share.times[-1] < due[-1]:
                break
        return share.land(began)


def flight_of(
    mission: Mission,
    times: Sequence[float],
    outcomes: Sequence[VehicleOutcome],
    *,
    wall_s: float,
    interrupted: bool,
) -> LockstepFlight:
    """Join the outcomes of all aircraft, leader first, to a flight that took `wall_s` of real time, s."""
    events = {outcome.name: outcome.events for outcome in outcomes}
    return LockstepFlight(
        record=flight_record(
            mission,
            times,
            [outcome.record for outcome in outcomes],
            wall_s=wall_s,
            events=[flight_event(name, one) for name, said in events.items() for one in said],
        ),
        events=events,
        logs={outcome.name: outcome.log for outcome in outcomes if outcome.log is not None},
        interrupted=interrupted,
    )
