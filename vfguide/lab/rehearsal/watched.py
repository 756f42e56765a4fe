"""A live rehearsal whose programs run elsewhere, as in containers: waited for, started and watched.

The start of a flight whose programs share nothing but a file: a judge writes it, emulators wait for it.

The file holds one number: Unix time of simulation time 0, s. One that is left from an earlier flight lies in
the past, and nobody who waits now takes it for his own.
"""

import asyncio
import math
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from random import Random

from vfguide.errors import InputError, VfguideError
from vfguide.lab.rehearsal.truth_collector import TruthCollector
from vfguide.link.opening import WatchedFormation, presences
from vfguide.mission.model import Mission
from vfguide.record.latency import Latency, latency_of

LOOK_S = 0.05
"""Real time between looks at the file."""


def give_start(file: Path, *, epoch_s: float) -> None:
    """Write the signal, so that nobody ever reads half of it.

    Raises:
        InputError: the file cannot be written.
    """
    partial = file.with_name(file.name + ".partial")
    try:
        partial.write_text(f"{epoch_s!r}\n", encoding="ascii")
        partial.replace(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror})") from error


def await_start(
    file: Path,
    *,
    patience_s: float,
    clock: Callable[[], float] = time.time,
    sleep: Callable[[float], None] = time.sleep,
) -> float:
    """Unix time of simulation time 0, s, as soon as a signal is given for a time that is still to come.

    Args:
        file: where the signal appears.
        patience_s: how long to wait for it, s.
        clock: Unix time, s.
        sleep: lets time pass.

    Raises:
        VfguideError: none has come for this long.
    """
    began_s = clock()
    while clock() - began_s < patience_s:
        with suppress(OSError, ValueError):
            epoch_s = float(file.read_text(encoding="ascii"))
            if began_s < epoch_s < math.inf:
                return epoch_s
        sleep(LOOK_S)
    raise VfguideError(
        f"no flight has begun within {patience_s:g} s: {file} holds no start to come"
    )


LEAD_S = 5.0
"""Real time that emulators get to start before simulation time 0."""

LISTEN_S = 1.0
"""Real time to hear from every companion."""

PATIENCE_S = 20.0
"""Real time without a true state of some vehicle, after which the flight counts as broken."""


class WatchedFlight:
    """What a judge knows of a flight that runs elsewhere."""

    def __init__(self, mission: Mission, *, watched: WatchedFormation, speedup: float) -> None:
        """Prepare to watch.

        Args:
            mission: the mission.
            watched: the formation's links, where companions say how they are.
            speedup: simulation seconds for each real one.
        """
        self.mission = mission
        self.truth_collector = TruthCollector(mission)
        self._watched = watched
        self._speedup = speedup
        self._epoch_s = 0.0

    @property
    def names(self) -> list[str]:
        """Vehicles, leader first."""
        return [self.mission.leader.vehicle, *self.mission.followers_by_name]

    @property
    def elapsed_s(self) -> float:
        """Real time since simulation time 0."""
        return time.time() - self._epoch_s

    async def missing(self) -> list[str]:
        """Vehicles whose companions are not online; all of them while there is no broker."""
        try:
            found = await presences(self._watched, seconds=LISTEN_S, random=Random())
        except VfguideError:
            return list(self.mission.companions)
        online = {name for name, presence in found.items() if presence.status == "online"}
        return [name for name in self.mission.companions if name not in online]

    async def latency(self) -> Latency | None:
        """What the companions say of their latencies; nothing where there is no broker any more."""
        try:
            found = await presences(self._watched, seconds=LISTEN_S, random=Random())
        except VfguideError:
            return None
        figures = {name: presence.figures for name, presence in found.items()}
        return latency_of(figures, leader=self.mission.leader.vehicle)

    def start(self, file: Path) -> None:
        """Tell the emulators when to begin.

        Raises:
            InputError: the file cannot be written.
        """
        self._epoch_s = time.time() + LEAD_S
        give_start(file, epoch_s=self._epoch_s)

    def check(self) -> None:
        """See that every emulator still flies.

        Raises:
            VfguideError: one has not been heard for too long.
        """
        elapsed_s = self.elapsed_s
        for name, seen_s in self.truth_collector.last_seen_s().items():
            silence_s = elapsed_s - max(seen_s, 0.0) / self._speedup
            if silence_s > PATIENCE_S:
                raise VfguideError(f"{name}: no true state for {silence_s:.0f} s; has it ended?")


@asynccontextmanager
async def watched_flight(
    mission: Mission, *, truth: tuple[str, int], watched: WatchedFormation, speedup: float
) -> AsyncIterator[WatchedFlight]:
    """A flight to watch, with an open ear for true states at a host and port.

    Raises:
        VfguideError: the port is not to be had.
    """
    flight = WatchedFlight(mission, watched=watched, speedup=speedup)
    loop = asyncio.get_running_loop()
    try:
        transport, _ = await loop.create_datagram_endpoint(
            lambda: flight.truth_collector, local_addr=truth
        )
    except OSError as error:
        host, port = truth
        raise VfguideError(f"udpin://{host}:{port}: cannot listen ({error.strerror})") from error
    try:
        yield flight
    finally:
        transport.close()
