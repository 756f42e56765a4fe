"""The formation in real time: emulators and companions as processes of their own, joined by sockets.

Its programs may run elsewhere, as in containers, and share nothing but a file: a judge writes it, emulators
wait for it. The file holds one number: Unix time of simulation time 0, s. One that is left from an earlier
flight lies in the past, and nobody who waits now takes it for his own.
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
from vfguide.link.keys import (
    OPERATOR,
    key_places,
    make_keys,
    read_private_key,
    read_roster,
)
from vfguide.link.opening import WatchedFormation, presences
from vfguide.link.presence import Presence
from vfguide.mission.model import Mission
from vfguide.mission.rehearsal import Loss
from vfguide.record.events import SUFFIX as EVENTS_SUFFIX
from vfguide.record.events import read_events
from vfguide.record.flight import FlightRecord
from vfguide.record.guidance_log import (
    SUFFIX,
    read_guidance,
    read_newest,
)
from vfguide.record.latency import Latency, latency_of
from vfguide.record.recording import parts_of
from vfguide.record.response import SUFFIX as RESPONSE_SUFFIX
from vfguide.record.response import read_response
from vfguide.registry import plugin_files

LEAD_S = 3.0
"""Real time that emulators get to start before simulation time 0."""

RECORDINGS = "recordings"
"""Where companions record, below the directory of the flight."""

START_LOOK_S = 0.05
"""Real time between looks at companions that are starting."""

WRITTEN_S = 0.5
"""Real time after which what a companion did is in its file, and the true states have come."""

START_PATIENCE_S = 30.0
"""Real time after simulation time 0 without a single true state, after which the flight counts as broken."""


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
    """Write down the settings of a vehicle's emulator, and return the command that runs it by them.

    Args:
        mission: the mission.
        name: of the vehicle.
        file: where the settings are written to.
        mavlink: address of its companion, or where it waits for one.
        truth: address of the judge.
        epoch_s: Unix time of simulation time 0.
        speedup: simulation seconds for each real one.
        also_to: where else it is heard.
    """
    settings = settings_of(mission, name) | {
        # A law or a link among them does no harm there.
        "plugins": plugin_files(),
        "mavlink": mavlink,
        "truth": truth,
        "truth_rate_hz": mission.rehearsal.rate_hz,
        "epoch_s": epoch_s,
        "speedup": speedup,
        "also_to": list(also_to),
    }
    # JSON is YAML, and writes every number with all its digits.
    Path(file).write_text(json.dumps(settings, indent=1), encoding="utf-8")
    return python_module("sitl_stub", f"--config={file}")


def watched_by_anybody(mission: Mission, links: Sequence[str]) -> WatchedFormation:
    """The formation of a mission on its links, for those who have no keys."""
    return WatchedFormation(
        addresses=parse_links(links),
        formation=mission.name,
        leader=mission.timekeeper,
        deputies=mission.deputies,
        roster=None,
    )


class LiveFlight:
    """The processes of a live rehearsal and what its judge has seen."""

    def __init__(
        self, mission: Mission, *, directory: Path, links: Sequence[str], speedup: float
    ) -> None:
        """Prepare the processes; `fly` starts them.

        Args:
            mission: the mission.
            directory: for logs and for the mission file that companions read.
            links: addresses of the formation's links.
            speedup: simulation seconds for each real one.
        """
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
        """Keys of this rehearsal alone: one for each vehicle, and an operator's."""
        self._watched: WatchedFormation | None = None

    @property
    def watched(self) -> WatchedFormation:
        """The formation, for those who want to know how it is."""
        return self._watched or watched_by_anybody(self.mission, self._links)

    @property
    def mission_file(self) -> Path:
        """The mission as its programs read it."""
        return self._directory / "mission.yaml"

    @property
    def order_command(self) -> str:
        """How an operator gives this flight an order, say to fly in a vee."""
        options = (
            *(f"--link={link}" for link in self._links),
            f"--key={self.keys.private(OPERATOR)}",
            f"--roster={self.keys.roster}",
        )
        return shlex.join(("vfguide", "order", str(self.mission_file), "vee", *options))

    @property
    def names(self) -> list[str]:
        """Vehicles, leader first."""
        return [self.mission.leader.vehicle, *self.mission.followers_by_name]

    @property
    def time_s(self) -> float:
        """Simulation time by the clock; negative before the flight begins."""
        return (time.time() - self._epoch_s) * self._speedup

    async def start(self, truth_port: int) -> None:
        """Start every process."""
        mission_file = self.mission_file
        clock = Clock(epoch_s=time.monotonic(), rate=self._speedup)
        make_keys(self.keys, self.mission.name, self.mission.companions)
        # An operator's key is for those who watch.
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
            # Each flight is a first one, and begins in the air.
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
        """Wait for the first words of each companion: aircraft that fly before it is there stray."""
        with suppress(TimeoutError):
            async with asyncio.timeout(START_PATIENCE_S):
                while any(one.running and not one.last_words() for one in self.companions.values()):
                    await asyncio.sleep(START_LOOK_S)

    async def lose(self, loss: Loss) -> None:
        """Kill a companion when the rehearsal loses it, and start it again where it comes back."""
        companion = self.companions[loss.vehicle]
        await self._until(loss.at_s)
        await companion.kill()
        if loss.for_s is not None:
            await self._until(loss.at_s + loss.for_s)
            await companion.start()

    async def _until(self, time_s: float) -> None:
        """Wait for a simulation time, s."""
        while (left_s := time_s - self.time_s) > 0.0:
            await asyncio.sleep(left_s / self._speedup)

    async def stop_companions(self) -> None:
        """Have companions hand their vehicles back, and write down what they did."""
        await asyncio.gather(*(one.stop() for one in self.companions.values()))

    async def stop(self) -> None:
        """Stop every process, companions first."""
        await self.stop_companions()
        await asyncio.gather(*(one.stop() for one in self.emulators.values()))
        self._state.cleanup()

    def accounts(self) -> dict[str, Account]:
        """What each process has taken so far, this one with whatever else it runs included."""
        running = (*self.companions.values(), *self.emulators.values())
        pids = {one.name: one.pid for one in running if one.pid is not None}
        return accounts_of({**pids, "judge": os.getpid()})

    def check(self) -> None:
        """Look after the processes.

        Raises:
            VfguideError: an emulator has ended, or a companion by itself, or nothing has been seen of the
                flight for too long.
        """
        for process in self.emulators.values():
            if not process.running:
                raise VfguideError(f"{process.name} has ended: {process.last_words()}")
        for process in self.companions.values():
            # One that is killed is a rehearsal's own doing.
            if (process.exit_code or 0) > 0:
                raise VfguideError(f"{process.name} has ended: {process.last_words()}")
        late = self.time_s / self._speedup > START_PATIENCE_S
        if late and self.truth_collector.time_s < 0.0:
            raise VfguideError("no emulator has flown")

    def record_now(self) -> FlightRecord | None:
        """One sample of a moment ago, of which what companions did is known; None before the first.

        By it slots are where orders have put them.
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
        """What has been seen so far; what companions did is known once they have ended.

        Raises:
            VfguideError: nothing has.
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
        """What a companion has written at all its starts, by the end of the files' names."""
        return parts_of(self._directory / RECORDINGS, name, suffix)


@asynccontextmanager
async def live_flight(
    mission: Mission, *, directory: Path, links: Sequence[str], speedup: float = 1.0
) -> AsyncIterator[LiveFlight]:
    """A live rehearsal in the air, over a broker that runs already."""
    flight = LiveFlight(mission, directory=directory, links=links, speedup=speedup)
    async with truths_heard(flight.truth_collector, ("127.0.0.1", 0)) as port:
        try:
            await flight.start(port)
            yield flight
        finally:
            await flight.stop()


@asynccontextmanager
async def truths_heard(collector: TruthCollector, place: tuple[str, int]) -> AsyncIterator[int]:
    """Listen for true states at a host and port for as long as the context lasts; yields the port.

    Raises:
        VfguideError: the port is not to be had.
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
    """Have a flight lose its companions as its mission says, for as long as the context lasts.

    Raises:
        OSError: one could not be started again.
    """
    tasks = [asyncio.create_task(flight.lose(one)) for one in flight.mission.rehearsal.losses]
    try:
        yield
    finally:
        for one in tasks:
            one.cancel()
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
    # A companion that could not be started again; that a loss is still to come is none of these.
    for outcome in outcomes:
        if isinstance(outcome, Exception):
            raise outcome


FILE_LOOK_S = 0.05
"""Real time between looks at the file."""

WATCHED_LEAD_S = 5.0
"""Real time that emulators get to start before simulation time 0."""

LISTEN_S = 1.0
"""Real time to hear from every companion."""

PATIENCE_S = 20.0
"""Real time without a true state of some vehicle, after which the flight counts as broken."""


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
        sleep(FILE_LOOK_S)
    raise VfguideError(
        f"no flight has begun within {patience_s:g} s: {file} holds no start to come"
    )


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

    async def _presences(self) -> dict[str, Presence]:
        """What companions say of themselves; nothing while there is no broker."""
        try:
            return dict(await presences(self._watched, seconds=LISTEN_S, random=Random()))
        except VfguideError:
            return {}

    async def missing(self) -> list[str]:
        """Vehicles whose companions are not online."""
        found = await self._presences()
        online = {name for name, presence in found.items() if presence.status == "online"}
        return [name for name in self.mission.companions if name not in online]

    async def latency(self) -> Latency | None:
        """What the companions say of their latencies; None where nobody is heard."""
        found = await self._presences()
        figures = {name: presence.figures for name, presence in found.items()}
        return latency_of(figures, leader=self.mission.leader.vehicle) if figures else None

    def start(self, file: Path) -> None:
        """Tell the emulators when to begin.

        Raises:
            InputError: the file cannot be written.
        """
        self._epoch_s = time.time() + WATCHED_LEAD_S
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
    async with truths_heard(flight.truth_collector, truth):
        yield flight
