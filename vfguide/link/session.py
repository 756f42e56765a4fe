"""MQTT: the topics that a formation shares, a session with the broker, and its coming back by itself."""

import asyncio
import logging
import secrets
import ssl
from collections.abc import Coroutine, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from random import Random
from urllib.parse import quote

from aiomqtt import MqttError, Will
from msgspec.structs import replace

from vfguide.backoff import retry_delay
from vfguide.link.address import MqttAddress
from vfguide.link.carrier import LinkStatus
from vfguide.link.client import ANSWER_S, BrokerClient, Echo, Inbox, NewestOnly, reason_of
from vfguide.link.datagrams import WATCH_S
from vfguide.link.envelope import Kind
from vfguide.link.member import Member, Parcel
from vfguide.link.presence import Presence

ORDERING = {Kind.ORDER: "order", Kind.REPEAT: "repeat", Kind.REPLY: "reply"}
"""Last level of the topics of orders."""

REVOCATION = "revocation"
"""Last level of the topics by which all say which keys are out."""

BEAT_S = 1.0
"""s between presences. Each is acknowledged: a broker that hangs shows within this and an answer's time."""

ECHO_REST_S = 20.0
"""s from one time that own states are listened for to the next."""

INSISTENCE_S = 0.1
"""s after which a task that has not ended is cancelled again."""

REFUSED = 128
"""Subscriptions with this result or above are not granted."""

STABLE_S = 5.0
"""A connection that lasted this long was a success: the next try follows soon."""

GOODBYE_S = 0.5
"""s that a broker gets to hear that this vehicle is leaving; one that does not answer finds out by itself."""

IDENTIFIER_BYTES = 8
"""Random bytes in the name of a client."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Topics:
    """Topics of one vehicle in one formation."""

    prefix: str
    """First levels of every topic."""
    formation: str
    """Name of the formation."""
    vehicle: str
    """Name of the vehicle."""

    def state(self, vehicle: str) -> str:
        """Where a vehicle's states are."""
        return f"{self._of(vehicle)}/state"

    def lead(self, vehicle: str) -> str:
        """Where the states are by which a vehicle leads in the place of the mission's leader."""
        return f"{self._of(vehicle)}/lead"

    def presence(self, vehicle: str) -> str:
        """Where a vehicle says whether it is there."""
        return f"{self._of(vehicle)}/presence"

    def every_presence(self) -> str:
        """Filter for what all vehicles say about themselves."""
        return f"{self.prefix}/{level(self.formation)}/+/presence"

    def ask(self, leader: str) -> str:
        """Where this vehicle asks a leader what its clock shows."""
        return f"{self._of(leader)}/clock/ask/{level(self.vehicle)}"

    def every_ask(self, leader: str) -> str:
        """Filter for all that others ask of a leader's clock."""
        return f"{self._of(leader)}/clock/ask/+"

    def answer_of(self, leader: str) -> str:
        """Where a leader answers to this vehicle."""
        return f"{self._of(leader)}/clock/tell/{level(self.vehicle)}"

    def answer(self, asker: str) -> str:
        """Where this vehicle answers to another."""
        return f"{self._of(self.vehicle)}/clock/tell/{level(asker)}"

    def about_orders(self, kind: Kind) -> str:
        """Where this member gives orders, repeats them, or says what becomes of them."""
        return f"{self._of(self.vehicle)}/{ORDERING.get(kind, REVOCATION)}"

    def every_revocation(self) -> str:
        """Filter for what all say of revoked keys."""
        return f"{self.prefix}/{level(self.formation)}/+/{REVOCATION}"

    def every_order(self) -> tuple[str, ...]:
        """Filters for all of that, of everybody."""
        every = f"{self.prefix}/{level(self.formation)}/+"
        return tuple(f"{every}/{name}" for name in ORDERING.values())

    def _of(self, vehicle: str) -> str:
        return f"{self.prefix}/{level(self.formation)}/{level(vehicle)}"


def level(name: str) -> str:
    """A name as one level of a topic: its slashes and wildcards would be read as something else."""
    return quote(name, safe=" !'()*,:;=@&")


@dataclass(slots=True, kw_only=True)
class Parts:
    """What a link by way of a broker consists of, whether it is connected or not."""

    topics: Topics
    """Where everything is."""
    member: Member
    """Says and hears."""
    status: LinkStatus
    """Whether it stands."""
    outbox: NewestOnly
    """What is to be sent once."""
    echo: Echo
    """Own states, as heard."""
    presence: Presence
    """What the broker keeps about this vehicle."""
    announced: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when that is new."""

    def topic_of(self, parcel: Parcel) -> str:
        """Where a message goes."""
        topics = self.topics
        match parcel.kind:
            case Kind.QUESTION:
                return topics.ask(parcel.to)
            case Kind.ANSWER:
                return topics.answer(parcel.to)
            case Kind.ORDER | Kind.REPLY | Kind.REPEAT | Kind.REVOCATION:
                return topics.about_orders(parcel.kind)
            case Kind.STATE:
                return topics.state(topics.vehicle)
            case Kind.LEADER:
                return topics.lead(topics.vehicle)
            case Kind.PRESENCE | Kind.WILL:
                return topics.presence(topics.vehicle)


def wanted_topics(topics: Topics, member: Member) -> list[str]:
    """Where all is that a member has a use for."""
    leader = member.trust.leader
    wanted = [topics.state(leader)] if member.listens else []
    wanted += [topics.state(vehicle) for vehicle in sorted(member.neighbours)]
    if member.peer_clock is not None:
        wanted += [topics.answer_of(one) for one in member.candidates]
    if member.trust.leads:
        wanted.append(topics.every_ask(member.name))
        # Of another companion of its name, which it asks whether it lives.
        wanted.append(topics.answer_of(member.name))
    elif member.name in member.trust.deputies:
        # A deputy answers in the leader's place while it leads.
        wanted.append(topics.every_ask(leader))
    if member.hears_leads:
        wanted += [topics.lead(one) for one in member.candidates]
    if member.watches:
        wanted.append(topics.every_presence())
    if member.heeds_orders:
        wanted += topics.every_order()
    return [*wanted, topics.every_revocation()] if member.trust.signs else wanted


class Session:
    """One connection that stands."""

    def __init__(self, client: BrokerClient, inbox: Inbox, parts: Parts) -> None:
        self._client = client
        self._inbox = inbox
        self._parts = parts
        self._own_states = parts.topics.state(parts.topics.vehicle)
        self._wanted = wanted_topics(parts.topics, parts.member)

    async def run(self, stop: asyncio.Event) -> None:
        """Share until told to stop.

        Raises:
            MqttError: the connection is lost.
        """
        if self._wanted:
            await self._subscribe(self._wanted)
        self._parts.outbox.clear()
        self._parts.status.up()
        self._parts.member.hurry.set()
        jobs: list[Coroutine[None, None, object]] = [
            stop.wait(),
            self._until_lost(),
            self._read(),
            self._send(),
        ]
        if not self._parts.member.watches:
            jobs += [self._beat(), self._watch_echo()]
        tasks = [asyncio.create_task(job) for job in jobs]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            await cancel(tasks)
            results = await asyncio.gather(*tasks, return_exceptions=True)
        for result in results:
            if isinstance(result, Exception):
                raise result

    async def _subscribe(self, wanted: list[str]) -> None:
        results = await self._client.subscribe([(topic, 0) for topic in wanted])
        codes = [result if isinstance(result, int) else result.value for result in results]
        for topic, code in zip(wanted, codes, strict=True):
            if code >= REFUSED:
                self._parts.status.warn(
                    "subscription refused", f"the broker does not let this vehicle read {topic}"
                )

    async def _until_lost(self) -> None:
        # Messages go to the inbox: all that comes out here is the end of the connection.
        async for _ in self._client.messages:
            continue

    async def _read(self) -> None:
        while True:
            await self._inbox.settle(self._client.has_more)
            while (mail := self._inbox.mail.take()) is not None:
                self._dispatch(*mail)
            if self._parts.member.watches:
                await asyncio.sleep(WATCH_S)

    def _dispatch(self, topic: str, payload: bytes) -> None:
        parts = self._parts
        if topic == self._own_states and parts.echo.hear(payload):
            return
        # Where a message comes from is for itself to prove: a broker may put it anywhere.
        parts.member.take(payload)

    async def _send(self) -> None:
        while True:
            await self._parts.outbox.wait()
            while (mail := self._parts.outbox.take()) is not None:
                # Returns at once unless the socket is full: then the outbox keeps only what is newest.
                await self._client.send(*mail)

    async def _beat(self) -> None:
        """Keep the presence fresh, which shows a broker that hangs."""
        parts = self._parts
        while True:
            parts.announced.clear()
            await self.announce(parts.presence)
            with suppress(TimeoutError):
                async with asyncio.timeout(BEAT_S):
                    await parts.announced.wait()

    async def announce(self, presence: Presence, *, patience_s: float = ANSWER_S) -> None:
        """Have the broker keep a presence.

        Args:
            presence: what it is to keep.
            patience_s: how long its answer is awaited.

        Raises:
            MqttError: it does not answer.
        """
        parcel = self._parts.member.presence(presence)
        topic = self._parts.topic_of(parcel)
        await self._client.publish(topic, parcel.data, qos=1, retain=True, timeout=patience_s)

    async def _watch_echo(self) -> None:
        """Listen for own states, at first as long as another of this name may show up, and now and then."""
        topic = self._own_states
        while True:
            self._parts.echo.listen()
            await self._subscribe([topic])
            await self._until_echo(topic)
            await self._client.unsubscribe(topic)
            await asyncio.sleep(ECHO_REST_S)

    async def _until_echo(self, topic: str) -> None:
        echo, status = self._parts.echo, self._parts.status
        hint = f"does the broker let this vehicle write and read {topic}?"
        while True:
            # The whole time even if the first one comes at once: others of this name are heard, too.
            await asyncio.sleep(BEAT_S)
            if echo.check():
                status.warn("not heard", f"own states do not come back: {hint}")
            if echo.heard and not self._parts.member.is_young:
                return


async def cancel(tasks: Iterable[asyncio.Task[object]]) -> None:
    """End tasks for certain.

    One that is cancelled at the very moment at which its wait ends may take the result and go on: up to
    Python 3.11 `wait_for` does.
    """
    pending = set(tasks)
    while pending:
        for task in pending:
            task.cancel()
        _, pending = await asyncio.wait(pending, timeout=INSISTENCE_S)


logger = logging.getLogger(__name__)


class Reconnecting:
    """Keeps a link connected until told to stop."""

    def __init__(
        self, address: MqttAddress, security: ssl.SSLContext | None, parts: Parts, random: Random
    ) -> None:
        self._address = address
        self._security = security
        self._parts = parts
        self._random = random
        self._stop = asyncio.Event()
        self._topic = parts.topics.presence(parts.topics.vehicle)
        # The same name each time: the broker then ends what is left of an earlier connection before this one
        # speaks, and not some seconds later, with "offline". Nobody can guess it: a broker ends the
        # connection of a client when another calls itself the same, whatever that other may read or write.
        self._identifier = (
            f"{self._topic.removesuffix('/presence')}/{secrets.token_hex(IDENTIFIER_BYTES)}"
        )

    def stop(self) -> None:
        """Say goodbye; `run` ends soon after, within seconds even if the broker does not answer."""
        self._stop.set()

    async def run(self) -> None:
        """Connect, and again whenever the connection is lost."""
        loop, failures = asyncio.get_running_loop(), 0
        while not self._stop.is_set():
            began = loop.time()
            try:
                await self._visit()
                reason = "closed"
            except (MqttError, OSError) as error:
                reason = reason_of(error)
            except Exception as error:
                # Whatever it is, a vehicle in the air is better off with another try.
                logger.exception("link: unforeseen")
                reason = reason_of(error)
            if self._stop.is_set():
                return
            failures = 1 if loop.time() - began >= STABLE_S else failures + 1
            self._parts.status.down(reason)
            with suppress(TimeoutError):
                async with asyncio.timeout(retry_delay(failures, self._random.random())):
                    await self._stop.wait()

    async def _visit(self) -> None:
        """One connection, from the call to its end."""
        parts = self._parts
        inbox = Inbox(parts.status.counters)
        client = BrokerClient(
            self._address,
            identifier=self._identifier,
            will=None if parts.member.watches else self._will(),
            queue=inbox.as_queue(),
            context=self._security,
        )
        await self._open(client)
        try:
            session = Session(client, inbox, parts)
            await session.run(self._stop)
            if not parts.member.watches:
                goodbye = replace(parts.presence, status="offline")
                await session.announce(goodbye, patience_s=GOODBYE_S)
        finally:
            await client.close()

    def _will(self) -> Will:
        """What the broker is to say once it has lost this vehicle."""
        member, presence = self._parts.member, self._parts.presence
        offline = replace(presence, status="offline", time_s=member.clock(), figures={})
        return Will(self._topic, member.presence(offline, will=True).data, qos=1, retain=True)

    async def _open(self, client: BrokerClient) -> None:
        """Connect; a stop meanwhile does not wait for an answer.

        Raises:
            MqttError: it does not work.
        """
        opening = asyncio.ensure_future(client.open())
        stopping = asyncio.ensure_future(self._stop.wait())
        try:
            await asyncio.wait({opening, stopping}, return_when=asyncio.FIRST_COMPLETED)
            if not opening.done():
                client.give_up()
            await opening
        finally:
            stopping.cancel()
