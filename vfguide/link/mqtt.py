"""The link that a formation shares, over an MQTT broker.

States are sent once and not kept: a state that the broker repeats to those who come later has no age. Nothing
waits in a queue in either direction, since the next state is better than an old one.
"""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Collection
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version
from random import Random

from vfguide.link.address import LinkAddress
from vfguide.link.client import security_of
from vfguide.link.echo import Echo
from vfguide.link.inbox import NewestOnly
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.link.reconnecting import Reconnecting
from vfguide.link.session import Parts
from vfguide.link.status import LinkStatus
from vfguide.link.topics import Topics

FIRST_TRY_S = 1.0
"""s that opening waits for the first try."""


class Link:
    """One vehicle's access to what its formation shares. All of it belongs to one event loop."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    @property
    def connected(self) -> bool:
        """Whether the broker listens."""
        return self._parts.status.connected

    @property
    def detail(self) -> str:
        """Why the broker does not listen; empty while it does."""
        return self._parts.status.detail

    @property
    def counters(self) -> Counter[str]:
        """What was dropped and what went wrong, by reason."""
        return self._parts.status.counters

    def publish(self, data: bytes) -> None:
        """Publish this vehicle's state. Never waits: one that is not sent yet gives way to it."""
        parts = self._parts
        parts.echo.speak(data)
        if parts.status.connected:
            parts.outbox.put(parts.topics.state(parts.topics.vehicle), data)
        else:
            parts.status.counters["dropped: not connected"] += 1

    def announce(self, presence: Presence) -> None:
        """Say how this vehicle is; the broker keeps it for those who come later."""
        self._parts.presence = presence
        self._parts.announced.set()


def nobody(vehicle: str, data: bytes) -> None:
    """Takes the states of neighbours where there are none."""
    del vehicle, data


@asynccontextmanager
async def open_link(
    address: LinkAddress,
    *,
    formation: str,
    vehicle: str,
    listen_to: str | None,
    receive: Callable[[bytes], None],
    random: Random,
    neighbours: Collection[str] = (),
    receive_neighbour: Callable[[str, bytes], None] = nobody,
    peer_clock: PeerClock | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> AsyncIterator[Link]:
    """Share in a formation's link, for as long as the context lasts.

    A connection that is lost is made again for ever; being connected is not awaited for more than a second.

    Args:
        address: of the broker.
        formation: name of the formation.
        vehicle: name of this vehicle.
        listen_to: vehicle whose states are wanted; None for the leader, who tells others its clock instead.
        receive: called from the event loop with the newest state each time that there is a new one.
        neighbours: other vehicles whose states are wanted.
        receive_neighbour: called with the name of one of them and its newest state.
        random: keeps companions that lost the same broker from coming back in step.
        peer_clock: learns the clock of the vehicle that is listened to.
        clock: this vehicle's clock, s.

    Raises:
        InputError: the address names a certificate that cannot be read.
    """
    status = LinkStatus(str(address))
    parts = Parts(
        topics=Topics(prefix=address.prefix, formation=formation, vehicle=vehicle),
        listen_to=listen_to,
        receive=receive,
        neighbours=neighbours,
        receive_neighbour=receive_neighbour,
        peer_clock=peer_clock,
        clock=clock,
        status=status,
        outbox=NewestOnly(lambda: status.counters.update(["replaced before it was sent"])),
        echo=Echo(),
        presence=Presence(status="online", mode="", time_s=clock(), version=version("vfguide")),
    )
    reconnecting = Reconnecting(address, security_of(address), parts, random)
    running = asyncio.create_task(reconnecting.run(), name=f"link of {vehicle}")
    try:
        with suppress(TimeoutError):
            async with asyncio.timeout(FIRST_TRY_S):
                await status.settled.wait()
        yield Link(parts)
    finally:
        reconnecting.stop()
        await running
        status.close()
