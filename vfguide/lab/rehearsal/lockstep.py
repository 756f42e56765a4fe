"""The formation in virtual time: as fast as the computer goes, and the same bytes for the same seed.

Followers' states on their way to the other followers, in virtual time.

The aircraft of a formation may be flown by several processes. They exchange what followers publish at the
end of each window of some instants; it is handed to the links at the beginning of the window after next, so
that no process waits for another that is flying the same window. The number of processes changes nothing.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from itertools import islice

from vfguide.companion.follower_role import PUBLISH_S
from vfguide.companion.role import Event, flight_event
from vfguide.lab.rehearsal.aircraft import Candidates, Instant, fly_window
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.rehearsal.worker_process import WorkerProcess, launch, outcome_of
from vfguide.link.memory import Mail
from vfguide.mission.model import Mission
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord
from vfguide.record.latency import Latency
from vfguide.record.tlog import TelemetryLog

WINDOWS = 2
"""From the window in which something is published to the one in which it is handed to the links."""


def window_length(rate_hz: float) -> int:
    """Instants in a window: a follower publishes about once in it."""
    return max(round(PUBLISH_S * rate_hz), 1)


class Exchange:
    """Mail by the window in which it is due."""

    def __init__(self) -> None:
        self._due: dict[int, list[Mail]] = {}

    def post(self, window: int, mail: list[Mail]) -> None:
        """Mail that was published in this window."""
        self._due.setdefault(window + WINDOWS, []).extend(mail)

    def collect(self, window: int) -> list[Mail]:
        """Mail that is due when this window begins."""
        return self._due.pop(window, [])


Progress = Callable[[float], None]
"""Called with the virtual time, at each step of the leader: followers fly it up to a window later."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A flight that was flown, to its end or to where it was stopped."""

    record: FlightRecord
    """What happened."""
    events: dict[str, list[Event]]
    """What each companion reported, by vehicle."""
    logs: dict[str, TelemetryLog]
    """Telemetry logs by vehicle, where they were kept."""
    interrupted: bool
    """Whether it was stopped before its end."""
    latency: Latency | None = None
    """How quick the programs of a live flight were."""


def instants(mission: Mission) -> Iterator[float]:
    """Times of the steps of a flight, s, from 0 to its duration."""
    rate_hz = mission.rehearsal.rate_hz
    for step in range(round(mission.rehearsal.duration_s * rate_hz) + 1):
        yield step / rate_hz


def windows(mission: Mission) -> Iterator[list[float]]:
    """The same times, by windows of the exchange between followers."""
    remaining = instants(mission)
    length = window_length(mission.rehearsal.rate_hz)
    while window := list(islice(remaining, length)):
        yield window


def flight_events(events: Mapping[str, Sequence[Event]]) -> Iterator[FlightEvent]:
    """What the companions of a flight in virtual time reported, by vehicle, as entries of its record."""
    for vehicle, said in events.items():
        for event in said:
            yield flight_event(vehicle, event)


def fly_lockstep(
    mission: Mission,
    *,
    processes: int = 1,
    epoch_s: float | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Flight:
    """Fly a mission to its end, or until it is told to stop.

    Args:
        mission: the mission.
        processes: to spread the aircraft over; what happens is the same for any number.
        epoch_s: time 0 of the flight in seconds since 1970: telemetry logs are kept. None: they are not.
        progress: hears the virtual time.
        stop: asked before each step whether to end here; the first is flown in any case.

    Raises:
        VfguideError: one of the processes died.
    """
    began = time.perf_counter()
    names = [mission.leader.vehicle, *mission.followers_by_name]
    # Those who may lead are heard at once: they fly in one process, each window ahead of all others.
    first = [mission.leader.vehicle, *mission.deputies]
    rest = [name for name in names if name not in first]
    processes = min(processes, len(rest) + 1)
    times: list[float] = []
    interrupted = False
    with ExitStack() as stack:
        workers = [
            stack.enter_context(
                closing(WorkerProcess(mission, rest[number - 1 :: processes], epoch_s))
            )
            for number in range(1, processes)
        ]
        here = launch(mission, [*first, *rest[processes - 1 :: processes]], epoch_s)
        candidates, followers = Candidates(here[: len(first)]), here[len(first) :]
        exchange = Exchange()
        for window, due in enumerate(windows(mission)):
            if window >= WINDOWS:
                for worker in workers:
                    exchange.post(window - WINDOWS, worker.published())
            mail = exchange.collect(window)
            flown: list[Instant] = []
            published: list[Mail] = []
            for now in due:
                if interrupted := stop() and bool(times):
                    break
                at_once, later = candidates.step(now, mail)
                flown.append((now, [*mail, *at_once]))
                published += later
                mail = []
                times.append(now)
                if progress is not None:
                    progress(now)
            for worker in workers:
                worker.pass_on(flown)
            exchange.post(window, [*published, *fly_window(followers, flown)])
            if interrupted:
                break
        outcomes = [outcome_of(aircraft) for aircraft in here]
        for worker in workers:
            outcomes += worker.land()
    records = {outcome.name: outcome.record for outcome in outcomes}
    return Flight(
        record=flight_record(
            mission,
            times,
            [records[name] for name in names],
            wall_s=time.perf_counter() - began,
            events=flight_events({outcome.name: outcome.events for outcome in outcomes}),
        ),
        events={outcome.name: outcome.events for outcome in outcomes},
        logs={outcome.name: outcome.log for outcome in outcomes if outcome.log is not None},
        interrupted=interrupted,
    )
