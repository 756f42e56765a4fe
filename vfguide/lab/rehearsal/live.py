"""Rehearsals in real time: emulators and companions run as processes of their own, joined by sockets.

These programs may run elsewhere, as in containers, and share a single file: the judge writes it, and the
emulators wait for it. It holds one number, the Unix time of simulation time 0, s. A file left from an earlier
flight holds a time in the past, so that waiting emulators ignore it.
"""

import asyncio
import json
import math
import os
import shlex
import socket
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import yaml

from vfguide.companion.clock import Clock
from vfguide.companion.consent import begin_flight
from vfguide.errors import InputError, VfguideError
from vfguide.lab.rehearsal.aircraft import settings_of
from vfguide.lab.rehearsal.processes import Account, Process, accounts_of, free_port, python_module
from vfguide.lab.rehearsal.recorder import TruthCollector
from vfguide.link.carrier import parse_links
from vfguide.link.keys import OPERATOR, key_places, make_keys, read_private_key, read_roster
from vfguide.link.opening import WatchedFormation, presences
from vfguide.link.presence import Presence
from vfguide.mission.model import Mission
from vfguide.mission.rehearsal import Loss
from vfguide.record.events import SUFFIX as EVENTS_SUFFIX
from vfguide.record.events import read_events
from vfguide.record.flight import FlightRecord
from vfguide.record.guidance_log import SUFFIX, read_guidance, read_newest
from vfguide.record.latency import Latency, latency_of
from vfguide.record.recording import parts_of
from vfguide.record.response import SUFFIX as RESPONSE_SUFFIX
from vfguide.record.response import read_response
from vfguide.registry import plugin_files

LEAD_S = 3.0
"""Real time that emulators get to start before simulation time 0, s."""

RECORDINGS = "recordings"
"""Directory of the companions' recordings, below that of the flight."""

START_LOOK_S = 0.05
"""Real time between checks of companions that are starting, s."""

WRITTEN_S = 0.5
"""Real time after which companions have written their records and the true states have arrived, s."""

START_PATIENCE_S = 30.0
"""Real time after simulation time 0 without any true state, after which the flight counts as broken, s."""


def emulator_command(
    mission: Mission,
    name: str,
    *,
    file: str | Path,
    mavlink: str,
    truth: str,
    epoch_s: float,
    speedup: float,
    also_to: Sequence[str] = (),
) -> list[str]:
    """Write the settings file of a vehicle's emulator, and return the command that runs the emulator.

    `mavlink` is the companion's address, or the one at which to wait for it; `truth` is the judge's.
    `also_to` lists further receivers of the telemetry. `epoch_s` is the Unix time of simulation time 0, s,
    and `speedup` is in simulation seconds per real second.
    """
    settings = settings_of(mission, name) | {
        # Plugins with laws or links do no harm in an emulator.
        "plugins": plugin_files(),
        "mavlink": mavlink,
        "truth": truth,
        "truth_rate_hz": mission.rehearsal.rate_hz,
        "epoch_s": epoch_s,
        "speedup": speedup,
        "also_to": list(also_to),
    }
    # JSON is valid YAML, and keeps every digit of a number.
    Path(file).write_text(json.dumps(settings, indent=1), encoding="utf-8")
    return python_module("sitl_stub", f"--config={file}")


def watched_by_anybody(mission: Mission, links: Sequence[str]) -> WatchedFormation:
    """Return a mission's formation on its links, for watchers without keys."""
    return WatchedFormation(
        addresses=parse_links(links),
        formation=mission.name,
        leader=mission.timekeeper,
        deputies=mission.deputies,
        roster=None,
    )


class LiveFlight:
    """Processes of a live rehearsal, and what its judge has seen."""

    def __init__(
        self, mission: Mission, *, directory: Path, links: Sequence[str], speedup: float
    ) -> None:
        """Prepare the processes; `speedup` is in simulation seconds per real second."""
        self.mission = mission
        self.truth_collector = TruthCollector(mission)
        self.emulators: dict[str, Process] = {}
        self.companions: dict[str, Process] = {}
        self._directory = directory
        self._links = tuple(links)
        self._speedup = speedup
        self._state = TemporaryDirectory(prefix="vfguide-state-")
        self._epoch_s = 0.0
        self._companions_zero_s = 0.0
        self.keys = key_places(Path(self._state.name) / "rehearsal.yaml")
        """Keys for this rehearsal only: one per vehicle, and an operator's."""
        self._watched: WatchedFormation | None = None

    @property
    def watched(self) -> WatchedFormation:
        """Formation to watch on its links."""
        return self._watched or watched_by_anybody(self.mission, self._links)

    @property
    def mission_file(self) -> Path:
        """Mission file that the companions read."""
        return self._directory / "mission.yaml"

    @property
    def order_command(self) -> str:
        """Command line of an example order for this flight: to fly in a vee."""
        options = (
            *(f"--link={link}" for link in self._links),
            f"--key={self.keys.private(OPERATOR)}",
            f"--roster={self.keys.roster}",
        )
        return shlex.join(("vfguide", "order", str(self.mission_file), "vee", *options))

    @property
    def names(self) -> list[str]:
        """Names of all vehicles, leader first."""
        return [self.mission.leader.vehicle, *self.mission.followers_by_name]

    @property
    def time_s(self) -> float:
        """Simulation time by the clock, s; negative before the flight begins."""
        return (time.time() - self._epoch_s) * self._speedup

    async def start(self, truth_port: int) -> None:
        """Start every process."""
        mission_file = self.mission_file
        clock = Clock(epoch_s=time.monotonic(), rate=self._speedup)
        make_keys(self.keys, self.mission.name, self.mission.companions)
        # Watchers hold an operator's key.
        self._watched = replace(
            watched_by_anybody(self.mission, self._links),
            roster=read_roster(self.keys.roster),
            key=read_private_key(self.keys.private(OPERATOR)),
            clock=clock.now,
        )
        content = self.mission.model_dump(mode="json", exclude_unset=True)
        mission_file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        ports = {name: free_port(socket.SOCK_DGRAM) for name in self.mission.companions}
        foreign = self.mission.leader.is_foreign
        hears = {name: free_port(socket.SOCK_DGRAM) for name in ports} if foreign else {}
        for name, port in ports.items():
            # Each rehearsal is a first flight, and begins in the air.
            begin_flight(Path(self._state.name), name)
            options = [
                f"--mission={mission_file}",
                f"--mavlink=udpin://127.0.0.1:{port}",
                f"--key={self.keys.private(name)}",
                f"--roster={self.keys.roster}",
                *(f"--link={link}" for link in self._links),
                f"--record={self._directory / RECORDINGS}",
                f"--clock={clock.epoch_s!r},{clock.rate!r}",
                f"--state={self._state.name}",
                "--engage",
            ]
            if name in hears:
                options.append(f"--leader=udpin://127.0.0.1:{hears[name]}")
            companion = python_module("vfguide", "companion", name, *options)
            log = self._directory / f"{name}.companion.log"
            self.companions[name] = Process(f"companion of {name}", companion, log)
        await asyncio.gather(*(one.start() for one in self.companions.values()))
        await self._until_companions_listen()
        self._epoch_s = time.time() + LEAD_S
        self._companions_zero_s = clock.now() + LEAD_S * self._speedup
        leader = {self.mission.leader.vehicle: list(hears.values())} if hears else {}
        for name, heard_at in {**leader, **{name: [port] for name, port in ports.items()}}.items():
            first, *others = [f"udpout://127.0.0.1:{port}" for port in heard_at]
            emulator = emulator_command(
                self.mission,
                name,
                file=self._directory / f"{name}.emulator.yaml",
                mavlink=first,
                truth=f"udpout://127.0.0.1:{truth_port}",
                epoch_s=self._epoch_s,
                speedup=self._speedup,
                also_to=others,
            )
            log = self._directory / f"{name}.emulator.log"
            self.emulators[name] = Process(f"emulator of {name}", emulator, log)
        await asyncio.gather(*(one.start() for one in self.emulators.values()))

    async def _until_companions_listen(self) -> None:
        """Wait for each companion's first output: an aircraft that flies before its companion runs strays."""
        with suppress(TimeoutError):
            async with asyncio.timeout(START_PATIENCE_S):
                while any(one.running and not one.last_words() for one in self.companions.values()):
                    await asyncio.sleep(START_LOOK_S)

    async def lose(self, loss: Loss) -> None:
        """Kill a companion at the time of its loss, and restart it if the loss ends."""
        companion = self.companions[loss.vehicle]
        await self._until(loss.at_s)
        await companion.kill()
        if loss.for_s is not None:
            await self._until(loss.at_s + loss.for_s)
            await companion.start()

    async def _until(self, time_s: float) -> None:
        while (left_s := time_s - self.time_s) > 0.0:
            await asyncio.sleep(left_s / self._speedup)

    async def stop_companions(self) -> None:
        """Stop the companions: they hand their vehicles back and complete their records."""
        await asyncio.gather(*(one.stop() for one in self.companions.values()))

    async def stop(self) -> None:
        """Stop every process, companions first."""
        await self.stop_companions()
        await asyncio.gather(*(one.stop() for one in self.emulators.values()))
        self._state.cleanup()

    def accounts(self) -> dict[str, Account]:
        """Return the resources used so far by each process; "judge" is this process with all that it runs."""
        running = (*self.companions.values(), *self.emulators.values())
        pids = {one.name: one.pid for one in running if one.pid is not None}
        return accounts_of({**pids, "judge": os.getpid()})

    def check(self) -> None:
        """Check that all processes run and that the flight is seen.

        Raises:
            VfguideError: an emulator has ended, a companion has ended with an error or by a signal, or no
                true state has arrived for too long.
        """
        gone = [one for one in self.emulators.values() if not one.running]
        for process in (*gone, *(one for one in self.companions.values() if one.exit_code)):
            how = f"with status {process.exit_code}: {process.last_words()}"
            raise VfguideError(f"{process.name} has ended {how}")
        late = self.time_s / self._speedup > START_PATIENCE_S
        if late and self.truth_collector.time_s < 0.0:
            raise VfguideError("no emulator has flown")

    def record_now(self) -> FlightRecord | None:
        """Return a recent sample for which the companions' records are complete; None before the first.

        The sample shows slots where orders have put them.
        """
        tracks = {
            name: read_newest(*self._recorded(name, SUFFIX), zero_s=self._companions_zero_s)
            for name in self.mission.companions
        }
        moment_s = self.truth_collector.time_s - WRITTEN_S * self._speedup
        if moment_s < 0.0:
            return None
        return self.truth_collector.record(wall_s=0.0, tracks=tracks, only_at_s=moment_s)

    def record(self, *, wall_s: float) -> FlightRecord:
        """Return the record so far; the companions' part is complete once they have ended.

        Raises:
            VfguideError: nothing has been seen.
        """
        zero_s, names = self._companions_zero_s, self.mission.companions
        return self.truth_collector.record(
            wall_s=wall_s,
            tracks={
                name: read_guidance(*self._recorded(name, SUFFIX), zero_s=zero_s) for name in names
            },
            events=[
                event
                for name in names
                for event in read_events(name, *self._recorded(name, EVENTS_SUFFIX), zero_s=zero_s)
            ],
            responses={
                name: read_response(*self._recorded(name, RESPONSE_SUFFIX)) for name in names
            },
        )

    def _recorded(self, name: str, suffix: str) -> list[Path]:
        return parts_of(self._directory / RECORDINGS, name, suffix)


@asynccontextmanager
async def live_flight(
    mission: Mission, *, directory: Path, links: Sequence[str], speedup: float = 1.0
) -> AsyncIterator[LiveFlight]:
    """Run a live rehearsal over a broker that runs already."""
    flight = LiveFlight(mission, directory=directory, links=links, speedup=speedup)
    async with truths_heard(flight.truth_collector, ("127.0.0.1", 0)) as port:
        try:
            await flight.start(port)
            yield flight
        finally:
            await flight.stop()


@asynccontextmanager
async def truths_heard(collector: TruthCollector, place: tuple[str, int]) -> AsyncIterator[int]:
    """Listen for true states at a host and port for as long as the context lasts; yield the port.

    Raises:
        VfguideError: the port is not available.
    """
    loop = asyncio.get_running_loop()
    try:
        transport, _ = await loop.create_datagram_endpoint(lambda: collector, local_addr=place)
    except OSError as error:
        host, port = place
        raise VfguideError(f"udpin://{host}:{port}: cannot listen ({error.strerror})") from error
    try:
        yield transport.get_extra_info("sockname")[1]
    finally:
        transport.close()


@asynccontextmanager
async def companions_lost(flight: LiveFlight) -> AsyncIterator[None]:
    """Carry out the mission's losses of companions for as long as the context lasts.

    Raises:
        OSError: a companion could not be restarted.
    """
    tasks = [asyncio.create_task(flight.lose(one)) for one in flight.mission.rehearsal.losses]
    try:
        yield
    finally:
        for one in tasks:
            one.cancel()
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
    # Losses still to come were cancelled, which is no `Exception`; others could not restart a companion.
    for outcome in outcomes:
        if isinstance(outcome, Exception):
            raise outcome


FILE_LOOK_S = 0.05
"""Real time between checks of the file, s."""

WATCHED_LEAD_S = 5.0
"""Real time that emulators get to start before simulation time 0, s."""

LISTEN_S = 1.0
"""Real time to hear from every companion, s."""

PATIENCE_S = 20.0
"""Real time without a true state of some vehicle, after which the flight counts as broken, s."""


def give_start(file: Path, *, epoch_s: float) -> None:
    """Write the start signal in one step, so that nobody reads half of it.

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
    """Wait for a start signal in the future, and return the Unix time of simulation time 0, s.

    Raises:
        VfguideError: no signal has come within `patience_s`.
    """
    began_s = clock()
    while clock() - began_s < patience_s:
        with suppress(OSError, ValueError):
            epoch_s = float(file.read_text(encoding="ascii"))
            if began_s < epoch_s < math.inf:
                return epoch_s
        sleep(FILE_LOOK_S)
    raise VfguideError(
        f"no flight has begun within {patience_s:g} s: {file} holds no start to come"
    )


class WatchedFlight:
    """What a judge knows of a flight that runs elsewhere."""

    def __init__(self, mission: Mission, *, watched: WatchedFormation, speedup: float) -> None:
        """Prepare to watch; `speedup` is in simulation seconds per real second."""
        self.mission = mission
        self.truth_collector = TruthCollector(mission)
        self._watched = watched
        self._speedup = speedup
        self._epoch_s = 0.0

    @property
    def names(self) -> list[str]:
        """Names of all vehicles, leader first."""
        return [self.mission.leader.vehicle, *self.mission.followers_by_name]

    @property
    def elapsed_s(self) -> float:
        """Real time since simulation time 0, s."""
        return time.time() - self._epoch_s

    async def _presences(self) -> dict[str, Presence]:
        """Return the companions' presence messages; none while there is no broker."""
        try:
            return dict(await presences(self._watched, seconds=LISTEN_S, random=Random()))
        except VfguideError:
            return {}

    async def missing(self) -> list[str]:
        """Return the vehicles whose companions are not online."""
        found = await self._presences()
        online = {name for name, presence in found.items() if presence.status == "online"}
        return [name for name in self.mission.companions if name not in online]

    async def latency(self) -> Latency | None:
        """Return the latencies that the companions report; None if none is heard."""
        found = await self._presences()
        figures = {name: presence.figures for name, presence in found.items()}
        return latency_of(figures, leader=self.mission.leader.vehicle) if figures else None

    def start(self, file: Path) -> None:
        """Write the start signal for the emulators.

        Raises:
            InputError: the file cannot be written.
        """
        self._epoch_s = time.time() + WATCHED_LEAD_S
        give_start(file, epoch_s=self._epoch_s)

    def check(self) -> None:
        """Check that every emulator still flies.

        Raises:
            VfguideError: an emulator has been silent for too long.
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
    """Watch a flight, and receive true states at a host and port.

    Raises:
        VfguideError: the port is not available.
    """
    flight = WatchedFlight(mission, watched=watched, speedup=speedup)
    async with truths_heard(flight.truth_collector, truth):
        yield flight
