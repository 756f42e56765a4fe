"""The companion as a process: the one place with tasks, sockets and a clock."""

import asyncio
import gc
import logging
import math
import signal
import time
from contextlib import AsyncExitStack
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from random import Random

from vfguide.companion.clock import Clock
from vfguide.companion.core import Companion
from vfguide.companion.latency import Quantiles
from vfguide.companion.outgoing import Outgoing, Snapshot
from vfguide.companion.plan import FlightPlan
from vfguide.companion.shared_clock import SAME_CLOCK, SharedClock
from vfguide.link.address import LinkAddress
from vfguide.link.mqtt import Link, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.address import Address
from vfguide.mavlink.connection import Connection, open_connection
from vfguide.mavlink.signing import Signing
from vfguide.record.guidance_log import SUFFIX, GuidanceLog, GuidanceStep
from vfguide.record.tlog import TelemetryLog

logger = logging.getLogger(__name__)

POLL_S = 0.1
"""Between looks at what is due by time alone, s of the companion's clock."""

ANNOUNCE_S = 1.0
"""Between presences, s of the companion's clock."""


FAREWELLS, FAREWELL_S = 5, 0.1
"""How often a vehicle is handed back at the end, and the real time between, s."""

VERSION = version("vfguide")
"""Looked up once: it is read from a file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """Where a companion runs."""

    mavlink: Address
    """Its autopilot."""
    link: LinkAddress
    """The formation's link."""
    formation: str
    """Name of the formation on the link."""
    leader: str
    """Vehicle whose states are listened to."""
    clock: Clock
    """Its clock."""
    engage: bool
    """Whether it may put the autopilot into the guided mode by itself, the first time."""
    record: Path | None
    """Directory for its telemetry log and what guidance did."""
    signing_key: bytes | None = None
    """Of the connection to the autopilot, if it is signed."""
    by_mavsdk: bool = False
    """Whether MAVSDK keeps the connection to the autopilot."""


class Daemon:
    """One companion with its sockets; everything it decides is in `Companion`."""

    def __init__(
        self, plan: FlightPlan, adapter: AutopilotAdapter, surroundings: Surroundings
    ) -> None:
        """Make a daemon that is not connected to anything yet."""
        self._name = plan.name
        self._clock = surroundings.clock
        self._surroundings = surroundings
        self._peer_clock = None if plan.leads else PeerClock()
        self._neighbours = plan.neighbours
        key = surroundings.signing_key
        self._companion = Companion(
            plan,
            adapter,
            engage=surroundings.engage,
            clock=shared_clock(self._peer_clock),
            inspect=True,
            signing=None if key is None else Signing(key, time.time),
        )
        self._log = None if surroundings.record is None else TelemetryLog(time.time())
        self._guidance_log = None if surroundings.record is None else GuidanceLog()
        self._began = self._clock.now()
        self._connection: Connection | None = None
        self._link: Link | None = None
        self._response = Quantiles()
        self._leader_age = Quantiles()
        self._announced = -ANNOUNCE_S
        self._stopped = False

    async def run(self, stop: asyncio.Event) -> None:
        """Fly until told to stop; then hand back and close everything."""
        random = Random()
        where = self._surroundings
        async with AsyncExitStack() as stack:
            self._connection = await stack.enter_async_context(
                open_connection(
                    where.mavlink,
                    self._take_mavlink,
                    random=random,
                    by_mavsdk=where.by_mavsdk,
                )
            )
            self._link = await stack.enter_async_context(
                open_link(
                    where.link,
                    formation=where.formation,
                    vehicle=self._name,
                    listen_to=None if self._peer_clock is None else where.leader,
                    receive=self._take_link,
                    neighbours=self._neighbours,
                    receive_neighbour=self._take_neighbour,
                    random=random,
                    peer_clock=self._peer_clock,
                    clock=self._clock.now,
                )
            )
            while not stop.is_set():
                self._dispatch(self._companion.poll(self._clock.now()))
                self._announce()
                try:
                    async with asyncio.timeout(self._clock.real_seconds(POLL_S)):
                        await stop.wait()
                except TimeoutError:
                    continue
            await self._take_leave()
        self._write_log()

    async def _take_leave(self) -> None:
        """Hand back until the autopilot is seen to fly by itself: the last words of a connection get lost."""
        self._stopped = True
        for _ in range(FAREWELLS):
            self._dispatch(self._companion.stop(self._clock.now()))
            if self._companion.released:
                return
            await asyncio.sleep(FAREWELL_S)
        logger.warning(
            "the autopilot has not answered: it may still be in its guided mode",
            extra={"vehicle": self._name},
        )

    def _take_mavlink(self, datagram: bytes) -> None:
        """One datagram in, one out, at once."""
        if self._stopped:
            # Handed back: its telemetry brings no more setpoints, only its answer.
            self._companion.receive_mavlink(datagram, self._clock.now())
            return
        began = time.perf_counter()
        now = self._clock.now()
        out = self._companion.receive_mavlink(datagram, now)
        self._dispatch(out)
        if out.steered:
            self._response.add(time.perf_counter() - began)
            self._leader_age.add(self._companion.leader_age(now))
        if self._log is not None:
            self._log.add(now - self._began, datagram)
        if self._guidance_log is not None and (out.steered or out.events):
            self._guidance_log.add(guidance_step(now, self._companion.snapshot))

    def _take_link(self, data: bytes) -> None:
        self._companion.receive_link(data, self._clock.now())

    def _take_neighbour(self, vehicle: str, data: bytes) -> None:
        self._companion.receive_neighbour(vehicle, data, self._clock.now())

    def _dispatch(self, out: Outgoing) -> None:
        """Send what the companion wants sent, and log what it has to say."""
        if out.to_autopilot and self._connection is not None:
            self._connection.send(out.to_autopilot)
            if self._log is not None:
                self._log.add(self._clock.now() - self._began, out.to_autopilot)
        if self._link is not None:
            for data in out.to_link:
                self._link.publish(data)
        for event in out.events:
            level = logging.WARNING if event.warning else logging.INFO
            logger.log(level, event.text, extra={"vehicle": self._name})
        if any(not event.warning for event in out.events):
            self._announced = -ANNOUNCE_S

    def _announce(self) -> None:
        """Tell the formation, once a second and after each change of mode, how this companion is."""
        now = self._clock.now()
        if self._link is None or now - self._announced < ANNOUNCE_S:
            return
        self._announced = now
        self._link.announce(
            Presence(
                status="online",
                mode=self._companion.snapshot.mode.value,
                time_s=now,
                version=VERSION,
                figures=self._figures(),
            )
        )

    def _figures(self) -> dict[str, float]:
        """Latencies in milliseconds and counters, for operators."""
        series = {"response_ms": self._response, "leader_age_ms": self._leader_age}
        figures: dict[str, float] = {}
        for name, values in series.items():
            found = values.quantiles(0.5, 0.99)
            for label, value in zip(("p50", "p99"), found, strict=False):
                figures[f"{name}_{label}"] = round(value * 1e3, 3)
            if values.last is not None:
                figures[f"{name}_last"] = round(values.last * 1e3, 3)
            figures[f"{name}_max"] = round(values.greatest * 1e3, 3)
        return figures

    def _write_log(self) -> None:
        record = self._surroundings.record
        if record is not None and self._log is not None:
            record.mkdir(parents=True, exist_ok=True)
            self._log.write(record / f"{self._name}.tlog")
        if record is not None and self._guidance_log is not None:
            self._guidance_log.write(record / f"{self._name}{SUFFIX}")


def guidance_step(now: float, snapshot: Snapshot) -> GuidanceStep:
    """What a companion did last, for the log."""
    setpoint = snapshot.setpoint
    return GuidanceStep(
        time_s=now,
        mode=snapshot.mode.value,
        course_rad=math.nan if setpoint is None else setpoint.course,
        speed_m_s=math.nan if setpoint is None else setpoint.speed,
        limited=setpoint is not None and bool(setpoint.limited),
        lyapunov_m2=snapshot.lyapunov,
    )


def shared_clock(peer_clock: PeerClock | None) -> SharedClock:
    """The formation's clock by way of what is known of its leader's; the leader's own is the formation's."""
    if peer_clock is None:
        return SAME_CLOCK
    return SharedClock(to_own=peer_clock.to_local, from_own=peer_clock.to_peer)


async def run_until_stopped(
    plan: FlightPlan, adapter: AutopilotAdapter, surroundings: Surroundings
) -> None:
    """Run a companion until SIGTERM or SIGINT.

    Raises:
        InputError: an address cannot be used.
    """
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    # What the program consists of stays: looking for garbage among it takes 10 to 20 ms each time.
    gc.collect()
    gc.freeze()
    await Daemon(plan, adapter, surroundings).run(stop)
