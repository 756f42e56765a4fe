"""A link without a broker: every message goes to all at once, and everybody picks out what is of use.

A subclass opens something, sends bytes by it and hands over the bytes that arrive. What every such link needs
is done here: it is opened again after a fault or a silence, presences are repeated, and goodbye is said.
"""

import asyncio
import math
from abc import abstractmethod
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from random import Random
from typing import Any

from msgspec.structs import replace

from vfguide.backoff import retry_delay
from vfguide.errors import described_error
from vfguide.link.carrier import Carrier
from vfguide.link.envelope import state_sender
from vfguide.link.member import Member, Parcel
from vfguide.link.presence import Presence, shorter_presences

# States that one who only watches has not looked at yet, of each sender the newest first.
#
# A signature that is not looked at costs nothing, and of each sender the newest state is enough. A forged one
# must not stand before a true one: those before it are kept until one is believed.

WATCH_S = 0.25
"""s between looks of one who only watches."""

MOST_HELD = 64
"""States of one sender that are kept between two looks: honest ones are three or four."""

MOST_AT_ONCE = 64
"""Datagrams that are read before anything else gets its turn."""

MOST_SENDERS = 128
"""Names are not believed yet: beyond this nothing is kept."""


class HeldMail:
    """What has come since the last look."""

    def __init__(self) -> None:
        """Make one that holds nothing."""
        self._held: dict[bytes, deque[bytes]] = {}

    def __len__(self) -> int:
        """How many senders' states wait."""
        return len(self._held)

    def put(self, data: bytes) -> bool:
        """Keep a state for the next look; False for what is none, or has no room."""
        sender = state_sender(data)
        if sender is None or (sender not in self._held and len(self._held) >= MOST_SENDERS):
            return False
        self._held.setdefault(sender, deque(maxlen=MOST_HELD)).append(data)
        return True

    def take(self) -> Iterator[tuple[bytes, ...]]:
        """The states of each sender, the newest first; nothing is held any more."""
        held, self._held = self._held, {}
        for states in held.values():
            yield tuple(reversed(states))

    def clear(self) -> None:
        """Forget everything."""
        self._held.clear()


BEAT_S = 1.0
"""s between presences, by which others see that this member lives, and the link that it does."""

SILENCE_S = 3.0
"""After this long without a word from anybody the link counts as lost, and is opened again: an interface that
goes away and comes back is in no group any more, and says nothing of that."""

LARGEST_DATAGRAM = 1400
"""Bytes that pass every usual network in one piece: a presence that is longer goes with less in it."""

REMEMBERED = 64
"""Own datagrams that may come back: a second of them."""

GOODBYES = 3
"""Times that a member says that it leaves: nobody answers."""


class DatagramCarrier(Carrier):
    """Carries messages by datagrams."""

    def __init__(
        self,
        address: Any,  # noqa: ANN401 - each carrier has addresses of its own
        *,
        formation: str,
        member: Member,
        presence: Presence,
        random: Random,
    ) -> None:
        """Make one that is not open yet; arguments as of `Carrier`."""
        super().__init__(
            address, formation=formation, member=member, presence=presence, random=random
        )
        self._open = False
        self._stop = asyncio.Event()
        self._wake = asyncio.Event()
        self._broken = ""
        self._heard_s = -math.inf
        self._sent: deque[bytes] = deque(maxlen=REMEMBERED)
        self._held = HeldMail()
        self._look_at: asyncio.TimerHandle | None = None

    @abstractmethod
    def open(self) -> None:
        """Open what it sends and hears by; `arrived` is called with all that is heard.

        Raises:
            OSError: it cannot be opened; it is tried again.
        """

    @abstractmethod
    def close(self) -> None:
        """Close it."""

    @abstractmethod
    def transmit(self, data: bytes) -> None:
        """Send a datagram to all, without waiting.

        Raises:
            OSError: it cannot be sent. A BlockingIOError loses this datagram; after any other exception it is
                opened again.
        """

    def arrived(self, data: bytes) -> None:
        """Take a datagram, of whomever; own ones that come back are passed over.

        Who only watches looks at states four times a second.
        """
        if data in self._sent:
            return
        if self._member.watches and self._held.put(data):
            if self._look_at is None:
                self._look_at = asyncio.get_running_loop().call_later(WATCH_S, self._look)
        elif self._member.take(data):
            self.heard()

    def _look(self) -> None:
        """Take the newest state of each sender."""
        self._look_at = None
        for newest_first in self._held.take():
            if self._member.take_newest(newest_first):
                self.heard()

    def heard(self) -> None:
        """Note that a member of the formation was heard: the link stands."""
        self._heard_s = asyncio.get_running_loop().time()
        if not self.status.connected:
            self._up()

    def broke(self, error: Exception) -> None:
        """Note that sending or hearing failed: it is opened again."""
        self._broken = getattr(error, "strerror", None) or described_error(error)
        self._wake.set()

    async def run(self) -> None:
        """Carry until told to stop; a network that goes away is tried again for ever."""
        failures = 0
        while not self._stop.is_set():
            try:
                reason = await self._visit()
            except OSError as error:
                reason = error.strerror or described_error(error)
            except Exception as error:  # noqa: BLE001 - of a link of one's own
                reason = described_error(error)
            if self._stop.is_set():
                return
            recent = asyncio.get_running_loop().time() - self._heard_s < SILENCE_S + BEAT_S
            failures = 1 if recent else failures + 1
            self.status.down(reason)
            with suppress(TimeoutError):
                async with asyncio.timeout(retry_delay(failures, self._random.random())):
                    await self._stop.wait()

    def stop(self) -> None:
        """Say goodbye; `run` ends at once."""
        self._stop.set()
        self._wake.set()

    def send(self, parcel: Parcel) -> None:
        """Send a message to all, once."""
        self._send(parcel.data)

    def announce(self, presence: Presence) -> None:
        """Go on saying this about the member, at once and every second."""
        changed = presence.mode != self._presence.mode
        self._presence = presence
        if changed:
            self._wake.set()

    async def _visit(self) -> str:
        """From opening it until it is of no use; why that is.

        Raises:
            OSError: it cannot be opened.
        """
        loop = asyncio.get_running_loop()
        self._broken = ""
        self.open()
        self._open, opened_s = True, loop.time()
        try:
            while not self._stop.is_set() and not self._broken:
                self._wake.clear()
                self.say(self._presence)
                silent_s = loop.time() - max(self._heard_s, opened_s)
                if silent_s > SILENCE_S:
                    return "nobody is heard; is anybody else on this network?"
                if not self.status.settled.is_set():
                    self._up()
                with suppress(TimeoutError):
                    async with asyncio.timeout(BEAT_S):
                        await self._wake.wait()
            if not self._broken and not self._member.watches:
                for _ in range(GOODBYES):
                    self.say(replace(self._presence, status="offline"))
            return self._broken
        finally:
            self._open = False
            self.close()
            if self._look_at is not None:
                self._look_at.cancel()
                self._look_at = None
            self._held.clear()

    def _up(self) -> None:
        if not self.status.connected:
            self.status.up()
            self._member.hurry.set()

    def say(self, presence: Presence) -> None:
        """Say how this member is: once a second, and at the end."""
        if self._member.watches:
            return
        data = b""
        for one in shorter_presences(presence):
            data = self._member.presence(one).data
            if len(data) <= LARGEST_DATAGRAM:
                break
        self._send(data)

    def _send(self, data: bytes) -> None:
        if not self._open:
            self.status.counters["dropped: not connected"] += 1
            return
        self._sent.append(data)
        try:
            self.transmit(data)
        except BlockingIOError:
            self.status.counters["dropped: no room"] += 1
        except Exception as error:  # noqa: BLE001 - of a link of one's own
            self.status.counters["failed to send"] += 1
            self.broke(error)
