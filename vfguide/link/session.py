"""What goes on over one connection to the broker, from subscribing until it is lost."""

import asyncio
import logging
from collections.abc import Callable, Collection, Coroutine, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

from vfguide.link.client import ANSWER_S, BrokerClient
from vfguide.link.codec import LinkDataError
from vfguide.link.echo import Echo
from vfguide.link.inbox import Inbox, NewestOnly
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence, encode_presence
from vfguide.link.status import LinkStatus
from vfguide.link.topics import Topics

logger = logging.getLogger(__name__)

BEAT_S = 1.0
"""s between presences. Each is acknowledged: a broker that hangs shows within this and an answer's time."""

ECHO_REST_S = 20.0
"""s from one time that own states are listened for to the next."""

INSISTENCE_S = 0.1
"""s after which a task that has not ended is cancelled again."""

REFUSED = 128
"""Subscriptions with this result or above are not granted."""


@dataclass(slots=True, kw_only=True)
class Parts:
    """What a link consists of, whether it is connected or not."""

    topics: Topics
    """Where everything is."""
    listen_to: str | None
    """Vehicle whose states are wanted; None for the leader."""
    receive: Callable[[bytes], None]
    """Takes them."""
    neighbours: Collection[str]
    """Other vehicles whose states are wanted."""
    receive_neighbour: Callable[[str, bytes], None]
    """Takes those, with the vehicle's name."""
    peer_clock: PeerClock | None
    """Learns that vehicle's clock."""
    clock: Callable[[], float]
    """This vehicle's clock, s."""
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


class Session:
    """One connection that stands."""

    def __init__(self, client: BrokerClient, inbox: Inbox, parts: Parts) -> None:
        self._client = client
        self._inbox = inbox
        self._parts = parts
        topics, listen_to = parts.topics, parts.listen_to
        self._own = topics.vehicle
        self._handlers: dict[str, Callable[[bytes], None]] = {}
        if listen_to is not None:
            self._handlers[topics.state(listen_to)] = partial(self._take, parts.receive)
            if parts.peer_clock is not None:
                self._handlers[topics.tell(listen_to)] = self._take_time
        for vehicle in parts.neighbours:
            receive = partial(parts.receive_neighbour, vehicle)
            self._handlers[topics.state(vehicle)] = partial(self._take, receive)

    async def run(self, stop: asyncio.Event) -> None:
        """Share until told to stop.

        Raises:
            MqttError: the connection is lost.
        """
        topics = list(self._handlers)
        if self._parts.listen_to is None:
            topics.append(self._parts.topics.every_ask())
        await self._subscribe(topics)
        self._parts.outbox.clear()
        self._parts.status.up()
        jobs: list[Coroutine[None, None, object]] = [
            stop.wait(),
            self._until_lost(),
            self._read(),
            self._send(),
            self._beat(),
            self._watch_echo(),
            self._ask(),
        ]
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

    def _dispatch(self, topic: str, payload: bytes) -> None:
        handler = self._handlers.get(topic)
        if handler is not None:
            handler(payload)
        elif self._parts.listen_to is None and (to := self._parts.topics.answer_to(topic)):
            self._tell_time(to, payload)
        else:
            self._parts.status.counters["dropped: other topic"] += 1

    def _take(self, receive: Callable[[bytes], None], payload: bytes) -> None:
        try:
            receive(payload)
        except Exception:
            # What comes over the network must not end the link, whatever a receiver makes of it.
            if not self._parts.status.counters["failed to use"]:
                logger.exception("a state from the link could not be used")
            self._parts.status.counters["failed to use"] += 1

    def _take_echo(self, payload: bytes) -> None:
        parts = self._parts
        if not parts.echo.hear(payload):
            text = f"somebody else publishes states of {self._own!r} too"
            parts.status.warn("somebody else's", text)

    def _take_time(self, payload: bytes) -> None:
        peer_clock = self._parts.peer_clock
        if peer_clock is not None and peer_clock.take(payload, self._parts.clock()):
            logger.warning("the clock of %r has stepped", self._parts.listen_to)

    def _tell_time(self, topic: str, payload: bytes) -> None:
        now = self._parts.clock()
        try:
            self._parts.outbox.put(topic, PeerClock.answer(payload, now, now))
        except LinkDataError:
            self._parts.status.counters["dropped: no question"] += 1

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
        topic, content = self._parts.topics.presence(self._own), encode_presence(presence)
        await self._client.publish(topic, content, qos=1, retain=True, timeout=patience_s)

    async def _watch_echo(self) -> None:
        """Listen for own states until one has come back, and after a while again."""
        topic = self._parts.topics.state(self._own)
        if topic in self._handlers:
            # Who follows his own states hears them anyway.
            await asyncio.Event().wait()
        while True:
            self._handlers[topic] = self._take_echo
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
            if echo.heard:
                return

    async def _ask(self) -> None:
        parts = self._parts
        peer_clock, listen_to = parts.peer_clock, parts.listen_to
        if peer_clock is None or listen_to is None:
            await asyncio.Event().wait()
            return
        while True:
            parts.outbox.put(parts.topics.ask(listen_to), peer_clock.request(parts.clock()))
            await asyncio.sleep(peer_clock.pause_s)


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
