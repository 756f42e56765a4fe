"""Mail that is worth something only while it is new: the newest of each topic, in and out."""

import asyncio
from collections import Counter
from collections.abc import Callable

from aiomqtt import Message

LARGEST = 4096
"""Bytes of a message: nothing that the formation shares is longer."""

MOST_TOPICS = 256
"""Topics with something new at the same time; more than vehicles in any formation."""

MOST_TURNS = 256
"""Messages that are read before any is used: a flood must not keep everything waiting."""


class NewestOnly:
    """One message for each topic: a newer one takes the place of one that nobody has fetched."""

    def __init__(self, replaced: Callable[[], None]) -> None:
        """Make it empty.

        Args:
            replaced: called for each message that is given up, for a newer one or for lack of room.
        """
        self._newest: dict[str, bytes] = {}
        self._replaced = replaced
        self._filled = asyncio.Event()

    def __len__(self) -> int:
        return len(self._newest)

    def put(self, topic: str, payload: bytes) -> None:
        """Add a message. The order is that of the first one that is not fetched yet of each topic."""
        if topic in self._newest:
            self._replaced()
        elif len(self._newest) >= MOST_TOPICS:
            self._replaced()
            return
        self._newest[topic] = payload
        self._filled.set()

    def take(self) -> tuple[str, bytes] | None:
        """The topic that waits longest and its newest message."""
        if not self._newest:
            self._filled.clear()
            return None
        topic = next(iter(self._newest))
        return topic, self._newest.pop(topic)

    def clear(self) -> None:
        """Forget everything."""
        self._newest.clear()
        self._filled.clear()

    async def wait(self) -> None:
        """Until there is something to take."""
        while not self._newest:
            self._filled.clear()
            await self._filled.wait()


class Inbox:
    """What the broker has delivered and nobody has read yet."""

    def __init__(self, counters: Counter[str]) -> None:
        self._counters = counters
        self.mail = NewestOnly(self._supersede)
        """The newest of each topic."""

    def _supersede(self) -> None:
        self._counters["superseded by a newer one"] += 1

    def deliver(self, message: Message) -> None:
        """Take a message from the network."""
        if len(message.payload) > LARGEST:
            self._counters["dropped: too long"] += 1
        else:
            self.mail.put(message.topic.value, message.payload)

    async def settle(self, has_more: Callable[[], bool]) -> None:
        """Wait for mail, then until the socket has nothing more to read this very moment.

        The client reads one message in each turn of the event loop. A reader that used each and took longer
        for it than the sender's interval would fall behind for ever, in a backlog inside the kernel.

        Args:
            has_more: whether something that was not read yet has arrived.
        """
        await self.mail.wait()
        for _ in range(MOST_TURNS):
            # To ask costs less than to turn the event loop, and nearly always there is nothing more.
            if not has_more():
                return
            # The first turn looks at the socket, the second comes after it was read.
            await asyncio.sleep(0)
            await asyncio.sleep(0)

    def as_queue(self) -> type[asyncio.Queue[Message]]:
        """Kind of queue that a client is to put its messages into, all of which end up here."""
        deliver = self.deliver

        class Delivered(asyncio.Queue[Message]):
            def put_nowait(self, item: Message) -> None:
                deliver(item)

        return Delivered
