"""Emulated autopilots on sockets in real time, and a log of their true states as JSON lines."""

import asyncio
import json
import logging
import math
import selectors
import socket
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import AbstractContextManager, AsyncExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import asdict

from sitl_stub.autopilot import Truth
from sitl_stub.links import Address, AddressError, Emulated, EmulatorLink, open_link, parse_address
from sitl_stub.settings import Settings

BEGINNING = b'{"system_id": '
"""Beginning of every line of true states."""

Write = Callable[[bytes], object]
"""Writes one whole line."""

LONGEST_STRETCH_S = 0.05
"""Real time after which a late emulator that catches up listens again."""

LATE_STEP_S = 1.0
"""Delay in real time that is worth a warning."""


class TruthLog:
    """Periodic samples of one aircraft's true state."""

    def __init__(self, write: Write, *, rate_hz: float, system_id: int) -> None:
        self._write = write
        self._rate_hz = rate_hz
        self._system_id = system_id
        self._samples = 0

    @property
    def next_due_s(self) -> float:
        """Simulation time of the next sample: a multiple of 1 / rate, in whole microseconds."""
        return round(self._samples * 1e6 / self._rate_hz) * 1e-6

    def sample(self, truth: Truth) -> None:
        """Write one sample."""
        self._samples += 1
        fields = asdict(truth)
        # Rounded to microseconds, which drops the last digits of the conversion to seconds.
        fields["time_s"] = round(truth.time_s, 6)
        line = json.dumps({"system_id": self._system_id, **fields}, allow_nan=False)
        self._write(line.encode() + b"\n")


def truth_target(target: str | None) -> AbstractContextManager[Write | None]:
    """Return a context with a writer to `udpout://host:port` or a file, or None without a target.

    A file of earlier true states is overwritten, any other is not.

    Raises:
        AddressError: on entering, the target cannot be written to; the message is one line.
    """
    if target is None:
        return nullcontext()
    return datagrams(target) if "://" in target else lines(Path(target))


@contextmanager
def lines(path: Path) -> Iterator[Write]:
    """Write lines to a file without a buffer, so that the file is readable whenever the process ends."""
    try:
        if path.is_file() and not begins_like_truth(path):
            raise AddressError(
                f"{str(path)!r}: is there already, and holds no true states; remove it, or name another file"
            )
        file = path.open("wb", buffering=0)
    except OSError as error:
        raise AddressError(f"{str(path)!r}: cannot be written to ({error.strerror})") from error
    with file:
        yield file.write


def begins_like_truth(path: Path) -> bool:
    """Check whether a file is empty, or begins like a log of true states, even a truncated one.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        return BEGINNING.startswith(file.read(len(BEGINNING)))


@contextmanager
def datagrams(url: str) -> Iterator[Write]:
    """Send one datagram for each line, whether anybody listens or not."""
    address = parse_address(url)
    if address.scheme != "udpout":
        raise AddressError(f"{url!r}: true states go to udpout://host:port or into a file")
    try:
        family, _, _, _, peer = socket.getaddrinfo(
            address.host, address.port, type=socket.SOCK_DGRAM
        )[0]
    except socket.gaierror as error:
        raise AddressError(f"{url!r}: {str(error.strerror).lower()}") from error

    def send(line: bytes) -> None:
        try:
            channel.sendto(line, peer)
        except OSError:
            # Full or unreachable now: the sample is lost, as any datagram may be.
            return

    with socket.socket(family, socket.SOCK_DGRAM) as channel:
        channel.settimeout(0.0)
        yield send


logger = logging.getLogger("sitl_stub")


@dataclass(frozen=True, slots=True)
class SimulationClock:
    """Simulation time over the event loop's monotonic clock."""

    zero_s: float
    """The loop's time at which simulation time is zero."""

    speedup: float
    """Seconds of simulation in one real second."""

    def simulation_s(self, loop_s: float) -> float:
        """Convert a time of the loop to simulation time."""
        return (loop_s - self.zero_s) * self.speedup

    def loop_s(self, simulation_s: float) -> float:
        """Convert a simulation time to the loop's time."""
        return self.zero_s + simulation_s / self.speedup


class Emulator:
    """Runs an autopilot in real time: due events at their time, received bytes at their arrival."""

    def __init__(
        self, autopilot: Emulated, *, truth: TruthLog | None = None, duration_s: float = math.inf
    ) -> None:
        self._autopilot = autopilot
        self._truth = truth
        self._duration_s = duration_s
        self._loop = asyncio.get_running_loop()
        self._clock: SimulationClock | None = None
        self._links: tuple[EmulatorLink, ...] = ()
        self._wake = asyncio.Event()
        self._flown_s = 0.0
        self._silent_before_s = 0.0
        self._warned = False
        self._fault: OSError | None = None

    def take(self, frames: bytes) -> None:
        """Handle received frames at the simulation time of their arrival; reply to all links.

        As on a radio, each listener then sees every sequence number once. Before simulation time zero the
        aircraft takes commands, but does not fly.
        """
        if self._clock is not None:
            try:
                self._fly_until(self._clock.simulation_s(self._loop.time()), exactly=True)
            except OSError as error:
                # An error of the truth log; raised here, it would only reach the event loop's own log.
                self._fault = error
                self._wake.set()
        next_s = self._next_s
        self._send(self._autopilot.receive(frames))
        if self._next_s != next_s:
            self._wake.set()

    async def run(self, links: Sequence[EmulatorLink], clock: SimulationClock) -> None:
        """Serve until the duration is over; telemetry due before the call is not sent."""
        self._links, self._clock = tuple(links), clock
        self._silent_before_s = clock.simulation_s(self._loop.time())
        while self._flown_s < self._duration_s:
            self._fly_until(clock.simulation_s(self._loop.time()))
            due_s = clock.loop_s(self._next_s)
            late_s = self._loop.time() - due_s
            if late_s >= 0.0:
                self._warn_if(late_s)
                await asyncio.sleep(0)
                continue
            timer = self._loop.call_at(due_s, self._wake.set)
            await self._wake.wait()
            self._wake.clear()
            timer.cancel()
            if self._fault is not None:
                raise self._fault

    @property
    def _next_s(self) -> float:
        truth_s = math.inf if self._truth is None else self._truth.next_due_s
        return min(self._autopilot.next_due_s, truth_s, self._duration_s)

    def _fly_until(self, to_s: float, *, exactly: bool = False) -> None:
        """Process all events due up to `to_s`, each at its own time; `exactly` then flies on to `to_s`.

        Stops after `LONGEST_STRETCH_S`, so that a computer too slow for the speed-up still listens.
        """
        give_up_s = self._loop.time() + LONGEST_STRETCH_S
        while self._flown_s < self._duration_s and (next_s := self._next_s) <= to_s:
            self._fly_to(next_s)
            if self._loop.time() > give_up_s:
                return
        if exactly and self._flown_s < to_s <= self._duration_s:
            self._fly_to(to_s)

    def _fly_to(self, instant_s: float) -> None:
        self._flown_s = instant_s
        telemetry = self._autopilot.advance(instant_s)
        if instant_s >= self._silent_before_s:
            self._send(telemetry)
        if self._truth is not None and self._truth.next_due_s <= instant_s:
            self._truth.sample(self._autopilot.truth())

    def _send(self, frames: bytes) -> None:
        if frames:
            for link in self._links:
                link.send(frames)

    def _warn_if(self, late_s: float) -> None:
        if late_s > LATE_STEP_S and self._next_s > self._silent_before_s and not self._warned:
            self._warned = True
            logger.warning("%.1f s behind the clock: this computer needs a lower speed-up", late_s)


async def serve_all(
    emulated: Sequence[tuple[Emulated, Address]],
    settings: Settings,
    *,
    on_open: Callable[[Emulated, Address], None] | None = None,
) -> None:
    """Serve autopilots at their addresses until their duration is over or this is cancelled.

    Raises:
        AddressError: an address or path is wrong; the message is one line.
        LinkError: an address cannot be used on this computer now.
        OSError: the file of true states can no longer be written to.
    """
    loop = asyncio.get_running_loop()
    with truth_target(settings.truth) as write:
        async with AsyncExitStack() as stack:
            opened = []
            for autopilot, address in emulated:
                truth = None
                if write is not None:
                    rate_hz = settings.truth_rate_hz
                    truth = TruthLog(write, rate_hz=rate_hz, system_id=autopilot.system_id)
                duration_s = math.inf if settings.duration_s is None else settings.duration_s
                emulator = Emulator(autopilot, truth=truth, duration_s=duration_s)
                link = await stack.enter_async_context(open_link(address, emulator.take))
                opened.append((emulator, [link]))
                if on_open is not None:
                    on_open(autopilot, link.address)
            for url in settings.also_to:
                emulator, links = opened[0]
                address = parse_address(url)
                links.append(await stack.enter_async_context(open_link(address, emulator.take)))
            waiting_s = 0.0 if settings.epoch_s is None else settings.epoch_s - time.time()
            clock = SimulationClock(loop.time() + waiting_s, settings.speedup)
            await all_of([emulator.run(links, clock) for emulator, links in opened])


async def all_of(runs: Sequence[Coroutine[None, None, None]]) -> None:
    """Wait for all coroutines; if one fails, cancel the others and raise its error."""
    tasks = [asyncio.ensure_future(run) for run in runs]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def precise_event_loop() -> asyncio.AbstractEventLoop:
    """Return an event loop whose timers are not rounded up to milliseconds, as epoll's are.

    On a virtual machine of two cores it wakes 0.3 ms after a timer is due, where asyncio's own loop
    wakes after 0.8 ms (medians). For `asyncio.Runner(loop_factory=precise_event_loop)`. File descriptors
    from 1024 on are refused, which no emulator comes near.
    """
    return asyncio.SelectorEventLoop(selectors.SelectSelector())
