"""Companion process: the only place with tasks, sockets and a clock."""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from random import Random, SystemRandom
from typing import Protocol

from msgspec.structs import replace

from vfguide.companion.alerts import Event
from vfguide.companion.clock import Clock
from vfguide.companion.consent import ConsentStore
from vfguide.companion.core import Companion
from vfguide.companion.ground_orders import ABORT, GroundOrders, OrderGiver
from vfguide.companion.plan import FlightPlan
from vfguide.companion.presence_figures import (
    Quantiles,
    figures_of_battery,
    figures_of_leader,
    latency_figures,
    refused_messages,
)
from vfguide.companion.role import Outgoing, Snapshot, flight_event
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.errors import VfguideError, described_error
from vfguide.formation.orders import Order, new_number
from vfguide.link.carrier import LinkAddress
from vfguide.link.codec import Kind
from vfguide.link.keys import write_revocations
from vfguide.link.member import Member, ignore
from vfguide.link.opening import Link, greeting_of, open_link
from vfguide.link.order_codec import encode_order
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import (
    LONGEST_WARNING,
    MOST_FINDINGS,
    ORDER,
    REVOKED_KEY,
    TERM,
    Presence,
    fit_text,
)
from vfguide.link.trust import RefusedError, Trust
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.address import Address
from vfguide.mavlink.connection import Connection, open_connection
from vfguide.mavlink.framing import ConnectionSigning, Introduction
from vfguide.record.guidance_log import GuidanceStep
from vfguide.record.recording import Recording

logger = logging.getLogger(__name__)

POLL_S = 0.1
"""Interval of checking for periodic duties, s of the companion's clock."""

ANNOUNCE_S = 1.0
"""Interval of presences, s of the companion's clock."""


OTHERS_HEARD = 3
"""Heartbeats of other vehicles, one a second, after which a companion complains that its own is missing."""

FAREWELLS, FAREWELL_S = 60, 0.1
"""Checks at the end for flight by the autopilot, and their real interval, s. Three heartbeats a second apart
may have to come, and the mode before them to settle."""

REPEAT_S, GIVEN_S = 0.5, 6.0
"""Interval of an issued order's copies, and how long after its time they continue, s."""

VERSION = version("vfguide")
"""Read once, because it comes from a file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """Connections, keys and files of a companion."""

    mavlink: Address
    """Address of the vehicle's autopilot."""
    links: tuple[LinkAddress, ...]
    formation: str
    """Name of the formation on the links."""
    trust: Trust
    """The vehicle's signing key, and the keys it believes."""
    clock: Clock
    engage: bool
    """Whether the companion may enter the guided mode by itself, once per flight."""
    record: Recording | None
    """Record of telemetry and guidance; closed at the end."""
    signing_key: bytes | None = None
    """Key of the connection to the autopilot; None if it is not signed."""
    consent: ConsentStore | None = None
    """Keeps the flight's consent; by default in memory."""
    by_mavsdk: bool = False
    """Whether MAVSDK maintains the connection to the autopilot."""
    leader: Address | None = None
    """Address at which a leader without a companion is heard."""
    followers: Address | None = None
    """Address at which followers without a companion receive FOLLOW_TARGET."""
    order_giver: OrderGiver | None = None
    """Issues orders that ground stations request; None ignores requests."""
    ground_orders: GroundOrders | None = None
    """Orders that ground stations may request."""
    revocations: Path | None = None
    """File of revoked keys; None keeps none."""


class Leaving(Protocol):
    """Companion, or its wrapper, during shutdown."""

    def stop(self, now: float) -> Outgoing:
        """Stop guidance; return the last messages."""

    def poll(self, now: float) -> Outgoing:
        """Return the output that time alone makes due."""

    def tell(self, text: str, now: float) -> Outgoing:
        """Tell operator and pilot."""

    @property
    def released(self) -> bool:
        """Whether the vehicle is seen to fly by itself, or was never steered."""


async def take_leave(leaving: Leaving, send: Callable[[Outgoing], None], clock: Clock) -> None:
    """Hand back, and repeat until the autopilot flies by itself: a connection's last messages get lost."""
    send(leaving.stop(clock.now()))
    for _ in range(FAREWELLS):
        if leaving.released:
            return
        await asyncio.sleep(FAREWELL_S)
        send(leaving.poll(clock.now()))
    text = "the autopilot does not show that it has left its guided mode: take it by hand"
    send(leaving.tell(text, clock.now()))


class Daemon:
    """One companion with its sockets; all decisions are made in `Companion`."""

    def __init__(
        self, plan: FlightPlan, adapter: AutopilotAdapter, surroundings: Surroundings
    ) -> None:
        self._name = plan.name
        self._clock = surroundings.clock
        self._surroundings = surroundings
        self._peer_clock = None if plan.keeps_time else PeerClock()
        self._foreign = plan.foreign_leader is not None
        self._timekeeper = plan.timekeeper
        self._neighbours = plan.neighbours
        self._own_member: Member | None = None
        key = surroundings.signing_key
        signing = None if key is None else ConnectionSigning(key, time.time)
        self._introduction = Introduction(plan.system_id, plan.component_id, signing=signing)
        self._introduced = self._complained = False
        self._shared_clock = shared_clock(self._peer_clock)
        self._companion = Companion(
            plan,
            adapter,
            engage=surroundings.engage,
            consent=surroundings.consent,
            clock=self._shared_clock,
            inspect=True,
            signing=signing,
            sends_target=surroundings.followers is not None,
            ground_orders=surroundings.ground_orders,
            greeting_s=greeting_of(surroundings.links),
        )
        self._orders = set[asyncio.Task[None]]()
        self._keeping = ThreadPoolExecutor(max_workers=1, thread_name_prefix="revocations")
        self._record = surroundings.record
        self._connection: Connection | None = None
        self._leader_connection: Connection | None = None
        self._target_connection: Connection | None = None
        self._link: Link | None = None
        self._response = Quantiles()
        self._leader_age = Quantiles()
        self._announced = -ANNOUNCE_S
        self._warning = ""
        self._leader_failed = False
        self._failure: Exception | None = None

    async def run(self, stop: asyncio.Event) -> None:
        """Fly until told to stop; then hand back and close everything."""
        try:
            await self._fly(stop)
        finally:
            self._close_record()

    async def _fly(self, stop: asyncio.Event) -> None:
        random = Random()
        where = self._surroundings
        async with AsyncExitStack() as stack:
            self._connection = await stack.enter_async_context(
                open_connection(
                    where.mavlink,
                    self._take_mavlink,
                    random=random,
                    by_mavsdk=where.by_mavsdk,
                    introduction=self._introduction,
                )
            )
            if where.leader is not None:
                self._leader_connection = await stack.enter_async_context(
                    open_connection(where.leader, self._take_leader, random=random)
                )
            if where.followers is not None:
                self._target_connection = await stack.enter_async_context(
                    open_connection(where.followers, ignore, random=random)
                )
            self._link = await stack.enter_async_context(
                open_link(
                    where.links,
                    formation=where.formation,
                    member=self._joined(where.trust),
                    random=random,
                )
            )
            while not stop.is_set() and self._failure is None:
                self._guarded(self._poll)
                try:
                    async with asyncio.timeout(self._clock.real_seconds(POLL_S)):
                        await stop.wait()
                except TimeoutError:
                    continue
            for task in self._orders:
                task.cancel()
            try:
                await take_leave(self._companion, self._dispatch, self._clock)
            except Exception as error:  # noqa: BLE001 - as above
                # What has failed may fail again; the autopilot's own fail-safe is for that.
                self._failure = self._failure or error
        if self._failure is not None:
            raise VfguideError(
                f"the companion has failed ({described_error(self._failure)}): see that the autopilot"
                " loiters, or take over"
            ) from self._failure

    def _poll(self) -> None:
        self._dispatch(self._companion.poll(self._clock.now()))
        self._stand_back()
        self._stand_in()
        self._announce()
        self._tell_of_record()
        self._tell_of_links()
        self._complain_of_others()

    def _stand_back(self) -> None:
        """Leave the vehicle to another companion of this name, or to its autopilot if the key is revoked."""
        if self._own_member is not None:
            why = self._own_member.standing_back
            self._dispatch(self._companion.stand_back(self._clock.now(), why))

    def _stand_in(self) -> None:
        """Answer for the formation's clock while this deputy leads."""
        leadership = self._companion.leadership
        if self._own_member is not None and leadership is not None:
            holder, term = leadership
            self._own_member.stands_in = term > 0 and holder == self._name

    def _guarded(self, step: Callable[[], None]) -> None:
        """Run a step in flight; on failure hand back and end, instead of flying on without it."""
        try:
            step()
        except Exception as error:  # noqa: BLE001 - of whatever was loaded
            self._failure = self._failure or error

    def _joined(self, trust: Trust) -> Member:
        """Create and keep the link member of this companion."""
        self._own_member = self._member(trust)
        return self._own_member

    def _member(self, trust: Trust) -> Member:
        receive, neighbours = self._take_link, set(self._neighbours)
        if self._foreign:
            # The timekeeper is a follower like the others.
            receive = partial(self._take_neighbour, self._timekeeper)
            neighbours.discard(self._timekeeper)
        return Member(
            trust,
            clock=self._clock.now,
            receive=ignore if self._peer_clock is None else receive,
            neighbours=neighbours,
            receive_neighbour=self._take_neighbour,
            receive_lead=self._take_lead if trust.deputies else None,
            receive_order=self._take_order,
            receive_reply=self._take_reply,
            receive_revocation=self._take_revocation,
            peer_clock=self._peer_clock,
        )

    def _take_mavlink(self, datagram: bytes) -> None:
        self._guarded(lambda: self._answer(datagram))

    def _answer(self, datagram: bytes) -> None:
        if not self._introduced:
            self._introduced = self._introduction.is_given_by(datagram)
        began = time.perf_counter()
        now = self._clock.now()
        if self._link is not None and not self._link.connected:
            self._companion.lose_link(now)
        out = self._companion.answer(datagram, now)
        self._send(out)
        if out.steered:
            self._response.add(time.perf_counter() - began)
            self._leader_age.add(self._companion.leader_age(now))
        # Half of all datagrams yield nothing: periodic duties can wait for the next poll.
        if not out.is_empty:
            self._companion.settle(out, now)
            self._dispatch(out)
        if self._record is not None:
            self._record.add_datagram(now, datagram)

    def _take_link(self, data: bytes) -> None:
        self._companion.receive_link(data, self._clock.now())

    def _take_leader(self, datagram: bytes) -> None:
        """Take a datagram of a leader without a companion, or of anybody else on its connection."""
        try:
            self._take_link(datagram)
        except Exception:
            # These datagrams are not authenticated: none may end the companion.
            if not self._leader_failed:
                logger.exception("a message of the leader cannot be used: tell the authors")
            self._leader_failed = True
        if self._record is not None:
            self._record.add_datagram(self._clock.now(), datagram)

    def _take_neighbour(self, vehicle: str, data: bytes) -> None:
        self._companion.receive_neighbour(vehicle, data, self._clock.now())

    def _take_lead(self, vehicle: str, data: bytes) -> None:
        self._companion.receive_lead(vehicle, data, self._clock.now())

    def _take_order(self, data: bytes, sealed: bytes, repeated: bool) -> None:
        self._companion.receive_order(data, sealed, self._clock.now(), repeated=repeated)

    def _take_reply(self, vehicle: str, data: bytes) -> None:
        self._companion.receive_reply(vehicle, data, self._clock.now())

    def _take_revocation(self, vehicle: str) -> None:
        """Tell the pilot of a revoked key, and store it in a thread: a slow disk delays no setpoint."""
        where = self._surroundings
        text = f"the key of {vehicle} is revoked: nothing that comes with it is believed any more"
        self._dispatch(self._companion.tell(text, self._clock.now()))
        if where.revocations is not None:
            statements = tuple(where.trust.statements.values())
            self._keeping.submit(self._keep, where.revocations, statements)

    def _keep(self, file: Path, statements: Sequence[bytes]) -> None:
        try:
            write_revocations(file, statements)
        except OSError as error:
            text = f"{file}: cannot be written ({error.strerror}): revoked keys are forgotten at a restart"
            logger.warning(text, extra={"vehicle": self._name})

    def _dispatch(self, out: Outgoing) -> None:
        """Send the companion's output, and log its events."""
        self._send(out)
        if out.to_leader and self._leader_connection is not None:
            self._leader_connection.send(out.to_leader)
        if out.to_others and self._target_connection is not None:
            self._target_connection.send(out.to_others)
        if self._record is not None and (out.steered or out.events):
            now, snapshot = self._clock.now(), self._companion.snapshot
            self._record.add_step(self._step(snapshot, now))
            self._record.add_response(now, snapshot.response)
            for event in out.events:
                formation_time_s = self._shared_clock.from_own(event.time_s)
                self._record.add_event(flight_event(self._name, event), formation_time_s)
        if self._link is not None:
            share(self._link, out)
        for order in out.requested:
            task = asyncio.get_running_loop().create_task(self._give(order))
            # The event loop keeps no strong reference to a task.
            self._orders.add(task)
            task.add_done_callback(self._orders.discard)
        self._note(out.events)

    def _send(self, out: Outgoing) -> None:
        if out.to_autopilot and self._connection is not None:
            self._connection.send(out.to_autopilot)
            if self._record is not None:
                self._record.add_datagram(self._clock.now(), out.to_autopilot)

    async def _give(self, order: Order) -> None:
        """Issue an order that a ground station has requested; its pilot hears of a failure."""
        giver, requests = self._surroundings.order_giver, self._companion.ground_orders
        if giver is None or requests is None:
            return
        try:
            await self._give_by(giver, order)
        except Exception as error:  # noqa: BLE001 - of laws and paths that the order is tried with
            expected = isinstance(error, VfguideError | RefusedError)
            text = f"the order cannot be given: {error if expected else described_error(error)}"
            self._dispatch(self._companion.tell(text, self._clock.now()))
        finally:
            requests.finish(order)

    async def _give_by(self, giver: OrderGiver, order: Order) -> None:
        """Resolve an order, and repeat it until it is decided.

        Raises:
            VfguideError: the order cannot be carried out.
            RefusedError: no session of the leader is known.
        """
        member, link, now = self._own_member, self._link, self._clock.now()
        if member is None or link is None:
            return
        aborts, then_s = order == ABORT, now + link.order_lead_s
        known = self._companion.formation_at(then_s, now)
        time_s = self._shared_clock.from_own(then_s)
        # An abort waits for nothing: it is the same whatever is flown.
        if self._companion.misses_order(now) and not aborts:
            raise VfguideError(
                "the others fly by an order that is not known here: see that all are heard"
            )
        if not math.isfinite(time_s) or not (aborts or self._foreign or known.leader):
            raise VfguideError("the leader is not heard: see that its companion runs")
        number = new_number(known.number, time.time(), SystemRandom())
        # In a thread: checking each wind and turn takes some tenths of a second.
        found = await asyncio.to_thread(giver.resolved, order, known, number=number, time_s=time_s)
        body = encode_order(found)
        while self._clock.now() < then_s + GIVEN_S:
            member.give(giver.operator, body)
            if not (aborts or self._companion.awaits(number)):
                return
            await asyncio.sleep(self._clock.real_seconds(REPEAT_S))

    def _note(self, events: Sequence[Event]) -> None:
        """Log events; a warning goes into the next presence, any other event sends one at once."""
        for event in events:
            level = logging.WARNING if event.warning else logging.INFO
            logger.log(level, event.text, extra={"vehicle": self._name})
            if event.warning:
                self._warning = event.text
            else:
                self._announced = -ANNOUNCE_S

    def _announce(self) -> None:
        """Publish this companion's presence once a second and after each change of mode."""
        now = self._clock.now()
        if self._link is None or now - self._announced < ANNOUNCE_S:
            return
        self._announced = now
        if self._own_member is not None:
            self._own_member.pass_on()
        self._link.announce(
            Presence(
                status="online",
                mode=self._companion.snapshot.mode.value,
                time_s=now,
                version=VERSION,
                signed=self._surroundings.trust.signs,
                obstacle=fit_text(self._obstacle(now) or ""),
                autopilot=fit_text(self._companion.flight_mode),
                warning=fit_text(self._warning, LONGEST_WARNING),
                findings=tuple(
                    fit_text(one, LONGEST_WARNING)
                    for one in self._companion.findings[:MOST_FINDINGS]
                ),
                figures=self._figures(),
            )
        )

    def _obstacle(self, now: float) -> str | None:
        """Return what keeps the vehicle from being steered, first of all an autopilot that is not its own."""
        unknown = None if self._introduced else self._introduction.complaint()
        return unknown or self._companion.obstacle(now)

    def _figures(self) -> dict[str, float]:
        """Return latencies (ms) and counters for operators."""
        figures = latency_figures("response_ms", self._response)
        figures |= latency_figures("leader_age_ms", self._leader_age)
        if self._companion.wind is not None:
            wind_north, wind_east = self._companion.wind
            figures["wind_north_m_s"] = round(wind_north, 2)
            figures["wind_east_m_s"] = round(wind_east, 2)
        figures |= figures_of_battery(self._companion.sensors(self._clock.now()))
        if self._companion.leadership is not None:
            figures[TERM] = float(self._companion.leadership[1])
        if self._companion.order_number:
            figures[ORDER] = float(self._companion.order_number)
        figures |= {f"{REVOKED_KEY}{one}": 1.0 for one in self._surroundings.trust.revoked}
        if (leader := self._companion.foreign_leader) is not None:
            figures |= figures_of_leader(leader, self._clock.now())
        if self._link is not None:
            figures |= refused_messages(self._link.counters)
            figures["links"] = float(len(self._link.carriers))
            figures["links_lost"] = float(
                sum(not carrier.status.connected for carrier in self._link.carriers)
            )
        return figures

    def _step(self, snapshot: Snapshot, now: float) -> GuidanceStep:
        step = snapshot.guidance_step(now, self._companion.leader_age(now))
        return replace(step, formation_time_s=self._shared_clock.from_own(now))

    def _tell_of_record(self) -> None:
        """Tell the pilot when a full disk stops the record, and when it goes on: neither ends a flight."""
        if self._record is not None:
            for text in self._record.news():
                self._dispatch(self._companion.tell(text, self._clock.now()))

    def _tell_of_links(self) -> None:
        """Tell the pilot when one of several links is lost, and when it is back."""
        if self._link is not None:
            for text in self._link.news():
                self._dispatch(self._companion.tell(text, self._clock.now()))

    def _complain_of_others(self) -> None:
        """Warn once if only another vehicle's port is heard: the companion would wait for ever."""
        if self._introduced or self._complained:
            return
        text = self._introduction.complaint()
        if text is not None and self._introduction.refused >= OTHERS_HEARD:
            self._complained = True
            logger.warning(text, extra={"vehicle": self._name})

    def _close_record(self) -> None:
        if self._record is None:
            return
        missing = self._record.close()
        if missing:
            text = f"{self._record.directory}: {missing} entries of the record are missing"
            logger.warning(text, extra={"vehicle": self._name})


def share(link: Link, out: Outgoing) -> None:
    """Send the companion's output for the link."""
    for data in out.to_link:
        link.publish(data)
    for kind, said in (
        (Kind.LEADER, out.to_followers),
        (Kind.REPLY, out.replies),
        (Kind.REPEAT, out.repeats),
    ):
        for data in said:
            link.say(kind, data)


def shared_clock(peer_clock: PeerClock | None) -> SharedClock:
    """Return the formation's clock by the timekeeper's; without a peer clock, the own one is shared."""
    if peer_clock is None:
        return SAME_CLOCK
    return SharedClock(to_own=peer_clock.to_local, from_own=peer_clock.to_peer)
