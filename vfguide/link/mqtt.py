"""MQTT link of a formation: topics, one connection, and automatic reconnection.

States are sent once and not retained: a state that the broker repeats to latecomers has no known age. No
queue forms in either direction, since the next state is better than an old one.
"""

import asyncio
import secrets
from collections.abc import Coroutine, Iterable, Mapping
from dataclasses import dataclass
from urllib.parse import SplitResult, quote

from aiomqtt import Will
from msgspec.structs import replace

from vfguide.link.carrier import Carrier, link
from vfguide.link.client import (
    ANSWER_S,
    BrokerClient,
    Echo,
    Inbox,
    MqttAddress,
    NewestOnly,
    mqtt_address,
    reason_of,
    security_of,
)
from vfguide.link.codec import Kind
from vfguide.link.member import Member, Parcel
from vfguide.link.presence import Presence

ORDERING = {Kind.ORDER: "order", Kind.REPEAT: "repeat", Kind.REPLY: "reply"}
"""Last topic level of orders, repeated orders and replies."""

REVOCATION = "revocation"
"""Last topic level of revocations."""

WATCH_S = 0.25
"""Interval between reads of a member that only watches, s."""

ECHO_S, ECHO_REST_S = 1.0, 20.0
"""Intervals between checks for own states while listening, and between listening periods, s."""

INSISTENCE_S = 0.1
"""Interval after which a task that has not ended is cancelled again, s."""

REFUSED = 128
"""Smallest result code of a subscription that is not granted."""

GOODBYE_S = 0.5
"""Timeout of the broker's answer to the goodbye, s; a broker that does not answer notices by itself."""

IDENTIFIER_BYTES = 8
"""Number of random bytes in a client identifier."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Topics:
    """MQTT topics of one vehicle in one formation."""

    prefix: str
    """First levels of every topic."""
    formation: str
    vehicle: str

    def state(self, vehicle: str) -> str:
        """Return the topic of a vehicle's states."""
        return f"{self._of(vehicle)}/state"

    def lead(self, vehicle: str) -> str:
        """Return the topic of the states by which a vehicle leads in place of the mission's leader."""
        return f"{self._of(vehicle)}/lead"

    def presence(self, vehicle: str) -> str:
        """Return the topic of a vehicle's presence."""
        return f"{self._of(vehicle)}/presence"

    def every_presence(self) -> str:
        """Return the filter for the presences of all vehicles."""
        return f"{self.prefix}/{level(self.formation)}/+/presence"

    def ask(self, leader: str) -> str:
        """Return the topic on which this vehicle asks for a leader's clock."""
        return f"{self._of(leader)}/clock/ask/{level(self.vehicle)}"

    def every_ask(self, leader: str) -> str:
        """Return the filter for all questions about a leader's clock."""
        return f"{self._of(leader)}/clock/ask/+"

    def answer_of(self, leader: str) -> str:
        """Return the topic of a leader's answers to this vehicle."""
        return f"{self._of(leader)}/clock/tell/{level(self.vehicle)}"

    def answer(self, asker: str) -> str:
        """Return the topic of this vehicle's answers to another member."""
        return f"{self._of(self.vehicle)}/clock/tell/{level(asker)}"

    def every_revocation(self) -> str:
        """Return the filter for revocations by anybody."""
        return f"{self.prefix}/{level(self.formation)}/+/{REVOCATION}"

    def every_order(self) -> tuple[str, ...]:
        """Return the filters for orders, repeated orders and replies by anybody."""
        every = f"{self.prefix}/{level(self.formation)}/+"
        return tuple(f"{every}/{name}" for name in ORDERING.values())

    def of(self, parcel: Parcel) -> str:
        """Return the topic of a message of this vehicle."""
        match parcel.kind:
            case Kind.QUESTION:
                return self.ask(parcel.to)
            case Kind.ANSWER:
                return self.answer(parcel.to)
            case Kind.STATE:
                return self.state(self.vehicle)
            case Kind.LEADER:
                return self.lead(self.vehicle)
            case Kind.PRESENCE | Kind.WILL:
                return self.presence(self.vehicle)
            case _:
                return f"{self._of(self.vehicle)}/{ORDERING.get(parcel.kind, REVOCATION)}"

    def _of(self, vehicle: str) -> str:
        return f"{self.prefix}/{level(self.formation)}/{level(vehicle)}"


def level(name: str) -> str:
    """Quote a name as one topic level, since slashes and wildcards have a meaning in topics."""
    return quote(name, safe=" !'()*,:;=@&")


def wanted_topics(topics: Topics, member: Member) -> list[str]:
    """Return the topics and filters that a member needs."""
    leader = member.trust.leader
    wanted = [topics.state(leader)] if member.listens else []
    wanted += [topics.state(vehicle) for vehicle in sorted(member.neighbours)]
    if member.peer_clock is not None:
        wanted += [topics.answer_of(one) for one in member.candidates]
    if member.trust.leads:
        wanted.append(topics.every_ask(member.name))
        # Answers of another companion of its name, which it asks whether it lives.
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


@link("mqtt")
@link("mqtts")
class MqttCarrier(Carrier):
    """Carrier over one broker, which reconnects whenever the connection is lost."""

    address: MqttAddress

    @classmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> MqttAddress:
        """Build a broker address."""
        return mqtt_address(parts, environment)

    def prepare(self) -> None:
        """Name the topics, and read the certificates; raise InputError if a certificate cannot be read."""
        counters, name = self.status.counters, self._member.name
        self._topics = Topics(prefix=self.address.prefix, formation=self._formation, vehicle=name)
        self._own_states = self._topics.state(name)
        self._security = security_of(self.address)
        self._outbox = NewestOnly(lambda: counters.update(["replaced before it was sent"]))
        self._echo = Echo()
        # With the same identifier each time, the broker ends an earlier connection before this one speaks.
        # Otherwise it would end it some seconds later, with "offline". The identifier cannot be guessed: a
        # broker ends a connection when any other client uses the same one, whatever that client's rights.
        own = self._topics.presence(name).removesuffix("/presence")
        self._identifier = f"{own}/{secrets.token_hex(IDENTIFIER_BYTES)}"

    def send(self, parcel: Parcel) -> None:
        """Send a message once, without waiting; it replaces an unsent message of its topic."""
        if parcel.kind is Kind.STATE:
            self._echo.speak(parcel.data)
        if self.status.connected:
            self._outbox.put(self._topics.of(parcel), parcel.data)
        elif parcel.kind is Kind.STATE:
            self.status.counters["dropped: not connected"] += 1

    def reason_of(self, error: Exception) -> str:
        """Describe in one line why there is no connection."""
        return reason_of(error)

    async def visit(self) -> str:
        """Hold one connection from the call to its end; raise MqttError if it is not made, or lost."""
        inbox = Inbox(self.status.counters)
        client = BrokerClient(
            self.address,
            identifier=self._identifier,
            will=None if self._member.watches else self._will(),
            queue=inbox.as_queue(),
            context=self._security,
        )
        await self._dial(client)
        try:
            await self._share(client, inbox)
            if not self._member.watches:
                goodbye = replace(self._presence, status="offline")
                await self._say(client, goodbye, patience_s=GOODBYE_S)
        finally:
            await client.close()
        return "closed"

    def _will(self) -> Will:
        """Return the last will, which the broker publishes once it has lost this vehicle."""
        offline = replace(self._presence, status="offline", time_s=self._member.clock(), figures={})
        said = self._member.presence(offline, will=True)
        return Will(self._topics.of(said), said.data, qos=1, retain=True)

    async def _dial(self, client: BrokerClient) -> None:
        """Connect, or give up at once when told to stop; raise MqttError if the connection is not made."""
        opening = asyncio.ensure_future(client.open())
        stopping = asyncio.ensure_future(self._stop.wait())
        try:
            await asyncio.wait({opening, stopping}, return_when=asyncio.FIRST_COMPLETED)
            if not opening.done():
                client.give_up()
            await opening
        finally:
            stopping.cancel()

    async def _share(self, client: BrokerClient, inbox: Inbox) -> None:
        """Exchange messages until told to stop; raise MqttError if the connection is lost."""
        if wanted := wanted_topics(self._topics, self._member):
            await self._subscribe(client, wanted)
        self._outbox.clear()
        self.status.up()
        self._member.hurry.set()
        jobs: list[Coroutine[None, None, object]] = [
            self._stop.wait(),
            until_lost(client),
            self._read(client, inbox),
            self._send(client),
        ]
        if not self._member.watches:
            jobs += [self._beat(client), self._watch_echo(client)]
        tasks = [asyncio.create_task(job) for job in jobs]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            await cancel(tasks)
            results = await asyncio.gather(*tasks, return_exceptions=True)
        for result in results:
            if isinstance(result, Exception):
                raise result

    async def _subscribe(self, client: BrokerClient, wanted: list[str]) -> None:
        results = await client.subscribe([(topic, 0) for topic in wanted])
        codes = [result if isinstance(result, int) else result.value for result in results]
        for topic, code in zip(wanted, codes, strict=True):
            if code >= REFUSED:
                self.status.warn(
                    "subscription refused", f"the broker does not let this vehicle read {topic}"
                )

    async def _read(self, client: BrokerClient, inbox: Inbox) -> None:
        while True:
            await inbox.settle(client.has_more)
            while (mail := inbox.mail.take()) is not None:
                topic, data = mail
                if not (topic == self._own_states and self._echo.hear(data)):
                    # The topic proves nothing about the sender: a broker may put a message anywhere.
                    self._member.take(data)
            if self._member.watches:
                await asyncio.sleep(WATCH_S)

    async def _send(self, client: BrokerClient) -> None:
        while True:
            await self._outbox.wait()
            while (mail := self._outbox.take()) is not None:
                # Returns at once unless the socket is full: then the outbox keeps only the newest.
                await client.send(*mail)

    async def _beat(self, client: BrokerClient) -> None:
        """Send the presence every second, which reveals a broker that hangs: each must be acknowledged."""
        while True:
            self._wake.clear()
            await self._say(client, self._presence)
            await self.until_due()

    async def _say(
        self, client: BrokerClient, presence: Presence, *, patience_s: float = ANSWER_S
    ) -> None:
        """Publish a presence that the broker retains, and wait for its answer for up to `patience_s`.

        Raises:
            MqttError: it does not answer.
        """
        parcel = self._member.presence(presence)
        topic = self._topics.of(parcel)
        await client.publish(topic, parcel.data, qos=1, retain=True, timeout=patience_s)

    async def _watch_echo(self, client: BrokerClient) -> None:
        """Check that own states come back: as long as another of this name may appear, and now and then."""
        echo, topic = self._echo, self._own_states
        hint = f"does the broker let this vehicle write and read {topic}?"
        while True:
            echo.listen()
            await self._subscribe(client, [topic])
            while not echo.heard or self._member.twins.is_young:
                # Not ended by the first echo: other companions of this name are heard meanwhile, too.
                await asyncio.sleep(ECHO_S)
                if echo.check():
                    self.status.warn("not heard", f"own states do not come back: {hint}")
            await client.unsubscribe(topic)
            await asyncio.sleep(ECHO_REST_S)


async def until_lost(client: BrokerClient) -> None:
    """Wait until the connection ends; messages go to the inbox, never to this iterator."""
    async for _ in client.messages:
        continue


async def cancel(tasks: Iterable[asyncio.Task[object]]) -> None:
    """Cancel tasks until they have ended: up to Python 3.11 `wait_for` may swallow a cancellation."""
    pending = set(tasks)
    while pending:
        for task in pending:
            task.cancel()
        _, pending = await asyncio.wait(pending, timeout=INSISTENCE_S)
