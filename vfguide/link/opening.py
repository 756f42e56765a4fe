"""A member's access to what its formation shares, over one link or several, and listening to presences."""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from random import Random
from typing import TYPE_CHECKING, Unpack

from vfguide.errors import InputError, VfguideError, described_error
from vfguide.link.carrier import Carrier, LinkAddress, carrier_of
from vfguide.link.codec import Kind
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Hearing, Member, Parcel
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.link.trust import Trust, new_session

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

FIRST_TRY_S = 1.0
"""s that opening waits for the first try."""

SETTLED_S = 6.0
"""s that those wait for the first try who cannot do without the link: all of a broker's answers are due
within."""

SHORTEST_PAUSE_S = 0.2
"""s from one question to the next, however much there is to hurry for."""

HEARD_SHARE = 1.5
"""Time in which all members are heard, in parts of the interval of their presences."""


class Link:
    """One member's access to what its formation shares. All of it belongs to one event loop."""

    def __init__(self, member: Member, carriers: Sequence[Carrier]) -> None:
        self._member = member
        self.carriers = tuple(carriers)
        """What carries its messages, one for each link."""
        self._stood: dict[str, bool] = {}
        member.send = self._send

    @property
    def connected(self) -> bool:
        """Whether any of the links stands."""
        return any(carrier.status.connected for carrier in self.carriers)

    @property
    def detail(self) -> str:
        """Why those links that do not stand do not; empty while all do."""
        details = (carrier.status.detail for carrier in self.carriers)
        return "; ".join(detail for detail in details if detail)

    def complaint(self) -> str:
        """What is wrong with the links, with their addresses, in one line."""
        statuses = [carrier.status for carrier in self.carriers]
        return "; ".join(
            f"link {status.address}: {status.detail or 'no answer'}"
            for status in statuses
            if not status.connected
        )

    @property
    def losses(self) -> int:
        """How often one of the links was lost."""
        return sum(carrier.status.counters["disconnected"] for carrier in self.carriers)

    @property
    def order_lead_s(self) -> float:
        """How long before its time an order is to be given, s: as the slowest link needs it."""
        return max(carrier.order_lead_s for carrier in self.carriers)

    async def settle(self) -> None:
        """Wait until each link has been tried once; some seconds at most."""
        with suppress(TimeoutError):
            async with asyncio.timeout(SETTLED_S):
                for carrier in self.carriers:
                    await carrier.status.settled.wait()

    @property
    def counters(self) -> Counter[str]:
        """What was dropped, refused and went wrong, by reason, of all links together."""
        total = Counter(self._member.counters)
        for carrier in self.carriers:
            total += carrier.status.counters
        return total

    def news(self) -> list[str]:
        """What has changed with the links since this was asked last, one sentence each.

        A single one that has never stood is not lost.
        """
        told = []
        expected = len(self.carriers) > 1
        for carrier in self.carriers:
            status = carrier.status
            before = self._stood.get(status.address, expected or status.connected)
            self._stood[status.address] = status.connected
            if before and not status.connected:
                rest = (
                    "the other goes on, nothing to do"
                    if self.connected
                    else "no other vehicle is heard; watch them, or take over"
                )
                told.append(f"link {status.address} is lost: {rest}")
            elif status.connected and not before:
                told.append(f"link {status.address} is back: nothing to do")
        return told

    def publish(self, data: bytes) -> None:
        """Publish this vehicle's state. Never waits: one that is not sent yet gives way to it."""
        self._member.publish(data)

    def say(self, kind: Kind, body: bytes) -> None:
        """Tell all an order, what is said to one, or a repeated one."""
        self._member.say(kind, body)

    def revoke(self, vehicle: str) -> None:
        """Say, as an operator, that a vehicle's key is out.

        Raises:
            InputError: it has none.
        """
        self._member.revoke(vehicle)

    def announce(self, presence: Presence) -> None:
        """Say how this vehicle is, again and again until something else is to be said."""
        for carrier in self.carriers:
            carrier.announce(presence)

    def _send(self, parcel: Parcel) -> None:
        for carrier in self.carriers:
            try:
                carrier.send(parcel)
            except Exception as error:  # noqa: BLE001 - of a link of one's own: the others go on
                carrier.status.warn("failed to send", described_error(error))


@asynccontextmanager
async def open_link(
    addresses: Sequence[LinkAddress], *, formation: str, member: Member, random: Random
) -> AsyncIterator[Link]:
    """Share in what a formation shares, for as long as the context lasts.

    A connection that is lost is made again for ever; being connected is not awaited for more than a second.

    Args:
        addresses: of all links; each message goes over every one, and the first copy counts.
        formation: name of the formation.
        member: says and hears.
        random: keeps companions that lost the same peer from coming back in step.

    Raises:
        InputError: an address names a certificate that cannot be read.
    """
    presence = Presence(
        status="online",
        mode="",
        time_s=member.clock(),
        version=version("vfguide"),
        signed=member.trust.signs,
    )
    carriers = [
        carrier_of(address.scheme)(
            address, formation=formation, member=member, presence=presence, random=random
        )
        for address in addresses
    ]
    link = Link(member, carriers)
    running = [
        asyncio.create_task(carrier.run(), name=f"link of {member.name}") for carrier in carriers
    ]
    asking = asyncio.create_task(keep_asking(member), name=f"clock of {member.name}")
    try:
        with suppress(TimeoutError):
            async with asyncio.timeout(FIRST_TRY_S):
                for carrier in carriers:
                    await carrier.status.settled.wait()
        yield link
    finally:
        asking.cancel()
        for carrier in carriers:
            carrier.stop()
        for ended in await asyncio.gather(*running, return_exceptions=True):
            if isinstance(ended, Exception):
                carriers[0].status.warn("failed", described_error(ended))
        await asyncio.wait([asking])
        for carrier in carriers:
            carrier.status.close()


def greeting_of(addresses: Sequence[LinkAddress]) -> float:
    """How long those who begin at once may take to be heard by each other over these links, s."""
    return min((carrier_of(address.scheme).greeting_s for address in addresses), default=0.0)


async def keep_asking(member: Member) -> None:
    """Ask for the leader's clock, for ever: soon again where something is new, else now and then."""
    clock = member.peer_clock
    if clock is None:
        return
    while True:
        member.ask()
        await asyncio.sleep(SHORTEST_PAUSE_S)
        with suppress(TimeoutError):
            async with asyncio.timeout(max(clock.pause_s - SHORTEST_PAUSE_S, 0.0)):
                await member.hurry.wait()


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedFormation:
    """A formation that is watched over its links."""

    addresses: tuple[LinkAddress, ...]
    """Addresses of its links."""
    formation: str
    """Name of the formation."""
    leader: str
    """Name of its leader."""
    roster: Roster | None
    """Everybody's public keys; None to believe anybody."""
    key: "Ed25519PrivateKey | None" = None
    """An operator's private key, with which the leader can be asked whether it lives."""
    deputies: tuple[str, ...] = ()
    """Who may lead in its place, and answer in it."""
    clock: Callable[[], float] = time.monotonic
    """By which its members tell time, s: a rehearsal's runs faster."""


def operator_of(roster: Roster, key: "Ed25519PrivateKey") -> str:
    """Name of the operator whose private key this is.

    Raises:
        InputError: the roster names no such operator.
    """
    public = public_bytes(key)
    for name, known in roster.operators.items():
        if known == public:
            return name
    raise InputError(
        "the key is no operator's in the roster; give operator.key, which `vfguide keys make` puts beside the"
        " vehicles' keys"
    )


async def presences(
    watched: WatchedFormation, *, seconds: float, random: Random
) -> dict[str, Presence]:
    """What each vehicle of a formation last said about itself, by name.

    Presences are kept by a broker, and repeated every second on other links.

    Args:
        watched: the formation.
        seconds: how long to listen; longer on a slow link, until everybody should have been heard.
        random: keeps those who lost the same broker from coming back in step.

    Raises:
        VfguideError: no link stands.
    """
    async with watching(watched, random=random) as (link, found):
        check_connected(link)
        slowest_s = max(carrier.presence_s for carrier in link.carriers)
        await asyncio.sleep(max(seconds, HEARD_SHARE * slowest_s))
        check_connected(link)
        return dict(found)


async def check_reachable(watched: WatchedFormation, *, random: Random) -> None:
    """See that a link stands.

    Raises:
        VfguideError: none does; the text says why.
    """
    async with watching(watched, random=random) as (link, _):
        check_connected(link)


def check_connected(link: Link) -> None:
    """See that a link stands.

    Raises:
        VfguideError: none does; the text says why.
    """
    if not link.connected:
        raise VfguideError(link.complaint())


@asynccontextmanager
async def watching(
    watched: WatchedFormation, *, random: Random, **hears: Unpack[Hearing]
) -> AsyncIterator[tuple[Link, Mapping[str, Presence]]]:
    """A link on which presences come in, and those that have, by vehicle; old ones while no link stands.

    Who takes replies, too, has an operator's turns on a radio.
    """
    found: dict[str, Presence] = {}
    hears["receive_presence"] = found.__setitem__
    member = watching_member(watched, random, **hears)
    async with open_link(
        watched.addresses, formation=watched.formation, member=member, random=random
    ) as link:
        await link.settle()
        yield link, found


def watching_member(
    watched: WatchedFormation,
    random: Random,
    *,
    neighbours: Sequence[str] = (),
    watches: bool = True,
    **hears: Unpack[Hearing],
) -> Member:
    """A member that says nothing about itself; it asks the leader whether it lives if it has a key for it.

    Args:
        watched: the formation.
        random: makes up a name where there is no key.
        neighbours: names of those whose states are wanted beside the leader's.
        watches: as of `Trust`.
        **hears: as of `Member`.
    """
    asks, name = True, f"watch-{random.getrandbits(32):08x}"
    if watched.roster is not None:
        asks = watched.key is not None
        name = operator_of(watched.roster, watched.key) if watched.key is not None else name
    trust = Trust(
        formation=watched.formation,
        name=name,
        leader=watched.leader,
        session=new_session(),
        roster=watched.roster,
        key=watched.key,
        watches=watches,
        deputies=watched.deputies,
    )
    return Member(
        trust,
        clock=watched.clock,
        neighbours=neighbours,
        peer_clock=PeerClock() if asks else None,
        **hears,
    )
