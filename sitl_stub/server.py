"""One emulated autopilot on a real socket and a real clock; all else in here is neither."""

import asyncio
import logging
import math
import selectors
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

from sitl_stub.address import Address, parse_address
from sitl_stub.autopilot import Autopilot
from sitl_stub.links import Link, LinkError, open_link
from sitl_stub.options import OptionError
from sitl_stub.truth_log import TruthLog, truth_log

__all__ = ["LinkError", "SimulationClock", "precise_event_loop", "serve"]

LONGEST_STRETCH_S = 0.05
"""Real time for which a late emulator flies on before it listens again."""

LATE_S = 1.0
"""Real time behind the clock that is worth a warning."""

logger = logging.getLogger("sitl_stub")


@dataclass(frozen=True, slots=True)
class SimulationClock:
    """Simulation time over the event loop's monotonic clock."""

    zero_s: float
    """The loop's time at which simulation time is zero."""

    speedup: float
    """Seconds of simulation in one real second."""

    def simulation_s(self, loop_s: float) -> float:
        """Simulation time at a time of the loop."""
        return (loop_s - self.zero_s) * self.speedup

    def loop_s(self, simulation_s: float) -> float:
        """The loop's time at a simulation time."""
        return self.zero_s + simulation_s / self.speedup


class Emulator:
    """Moves an autopilot along the clock: events of its own when they are due, bytes as they come."""

    def __init__(
        self, autopilot: Autopilot, *, truth: TruthLog | None = None, duration_s: float = math.inf
    ) -> None:
        self._autopilot = autopilot
        self._truth = truth
        self._duration_s = duration_s
        self._loop = asyncio.get_running_loop()
        self._clock: SimulationClock | None = None
        self._link: Link | None = None
        self._wake = asyncio.Event()
        self._flown_s = 0.0
        self._silent_before_s = 0.0
        self._warned = False
        self._fault: OSError | None = None

    def take(self, frames: bytes) -> None:
        """Obey what has arrived, at the simulation time of its arrival; answer to all who listen.

        Answers go to all, as on a radio: each listener then sees every sequence number once.
        Before simulation time zero the aircraft takes orders, but stands still in time.
        """
        if self._clock is not None:
            try:
                self._fly_until(self._clock.simulation_s(self._loop.time()), exactly=True)
            except OSError as error:
                # Of the truth log. Raised here, it would end in the event loop's own log.
                self._fault = error
                self._wake.set()
        next_s = self._next_s
        self._send(self._autopilot.receive(frames))
        if self._next_s != next_s:
            self._wake.set()

    async def run(self, link: Link, clock: SimulationClock) -> None:
        """Serve until the duration is over; what was due before the call is flown but not sent."""
        self._link, self._clock = link, clock
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
        """The next simulation time at which anything is to be done."""
        truth_s = math.inf if self._truth is None else self._truth.next_due_s
        return min(self._autopilot.next_due_s, truth_s, self._duration_s)

    def _fly_until(self, to_s: float, *, exactly: bool = False) -> None:
        """Do what is due up to `to_s`, each at its own instant, then exactly: fly on to `to_s` itself.

        Gives up after `LONGEST_STRETCH_S`, so that a computer too slow for the speed-up still listens.
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
        if frames and self._link is not None:
            self._link.send(frames)

    def _warn_if(self, late_s: float) -> None:
        if late_s > LATE_S and self._next_s > self._silent_before_s and not self._warned:
            self._warned = True
            logger.warning("%.1f s behind the clock: this computer needs a lower speed-up", late_s)


async def serve(
    autopilot: Autopilot,
    url: str | Address,
    *,
    speedup: float = 1.0,
    epoch_s: float | None = None,
    truth_url: str | None = None,
    truth_rate_hz: float = 20.0,
    duration_s: float | None = None,
    on_open: Callable[[Address], None] | None = None,
) -> None:
    """Serve one autopilot that has not flown yet, until its duration is over or this is cancelled.

    Args:
        autopilot: At simulation time zero.
        url: Where to speak MAVLink, such as `udpin://127.0.0.1:14540`.
        speedup: Seconds of simulation in one real second.
        epoch_s: Unix time at which simulation time is zero, the same for a whole formation; by default
            the moment the socket is open. From one in the past the aircraft first catches up, unheard.
        truth_url: `udpout://host:port` or a file for the true states, as JSON lines.
        truth_rate_hz: True states in one second of simulation.
        duration_s: Simulation time at which to end.
        on_open: Called with the address once it is open, with the port it really has.

    Raises:
        AddressError: an address or path is wrong; the message is one line.
        OptionError: another argument is wrong; the message is one line.
        LinkError: the address cannot be used on this computer now.
        OSError: the file of true states can be written to no more.
    """
    address = parse_address(url) if isinstance(url, str) else url
    for name, value in (("speedup", speedup), ("duration_s", duration_s)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise OptionError(f"{name} must be finite and above zero, not {value!r}")
    if epoch_s is not None and not math.isfinite(epoch_s):
        raise OptionError(f"epoch_s must be finite, not {epoch_s!r}")
    loop = asyncio.get_running_loop()
    with ExitStack() as stack:
        truth = None
        if truth_url is not None:
            log = truth_log(truth_url, rate_hz=truth_rate_hz, system_id=autopilot.system_id)
            truth = stack.enter_context(log)
        emulator = Emulator(
            autopilot, truth=truth, duration_s=math.inf if duration_s is None else duration_s
        )
        async with open_link(address, emulator.take) as link:
            if on_open is not None:
                on_open(link.address)
            waiting_s = 0.0 if epoch_s is None else epoch_s - time.time()
            await emulator.run(link, SimulationClock(loop.time() + waiting_s, speedup))


def precise_event_loop() -> asyncio.AbstractEventLoop:
    """An event loop whose timers are not rounded up to milliseconds, as those of epoll are.

    On a virtual machine of two cores it wakes 0.3 ms after a timer is due, where asyncio's own loop
    wakes after 0.8 ms (medians). For `asyncio.Runner(loop_factory=precise_event_loop)`; a file
    descriptor from 1024 on is refused, which no emulator comes near.
    """
    return asyncio.SelectorEventLoop(selectors.SelectSelector())
