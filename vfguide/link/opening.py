"""Opening of a member's links to its formation, and watching of presences."""

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
"""Time that opening waits for the first attempt, s."""

SETTLED_S = 6.0
"""Timeout of the first attempt for programs that need the link, s: long enough for all broker's answers."""

SHORTEST_PAUSE_S = 0.2
"""Minimum interval between questions for the leader's clock, s."""

HEARD_SHARE = 1.5
"""Time within which all members are heard, as a multiple of their presence interval."""


class Link:
    """One member's access to its formation over all its links, owned by one event loop."""

    def __init__(self, member: Member, carriers: Sequence[Carrier]) -> None:
        self._member = member
        self.carriers = tuple(carriers)
        """Carriers of its messages, one for each link."""
        self._stood: dict[str, bool] = {}
        member.send = self._send

    @property
    def connected(self) -> bool:
        """Whether any link is up."""
        return any(carrier.status.connected for carrier in self.carriers)

    @property
    def detail(self) -> str:
        """Reasons why links are down; empty while all are up."""
        details = (carrier.status.detail for carrier in self.carriers)
        return "; ".join(detail for detail in details if detail)

    def complaint(self) -> str:
        """Describe in one line the links that are down, with their addresses."""
        statuses = [carrier.status for carrier in self.carriers]
        return "; ".join(
            f"link {status.address}: {status.detail or 'no answer'}"
            for status in statuses
            if not status.connected
        )

    @property
    def losses(self) -> int:
        """Number of times that a link was lost."""
        return sum(carrier.status.counters["disconnected"] for carrier in self.carriers)

    @property
    def order_lead_s(self) -> float:
        """Lead of an order over its execution time that the slowest link needs, s."""
        return max(carrier.order_lead_s for carrier in self.carriers)

    async def settle(self) -> None:
        """Wait until each link has been tried once, at most some seconds."""
        with suppress(TimeoutError):
            async with asyncio.timeout(SETTLED_S):
                for carrier in self.carriers:
                    await carrier.status.settled.wait()

    @property
    def counters(self) -> Counter[str]:
        """Counts of dropped and refused messages and errors of all links, by reason."""
        total = Counter(self._member.counters)
        for carrier in self.carriers:
            total += carrier.status.counters
        return total

    def news(self) -> list[str]:
        """Return the changes of the links since the last call; a single link never up is not lost."""
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
        """Publish this vehicle's state without waiting; it replaces an unsent one."""
        self._member.publish(data)

    def say(self, kind: Kind, body: bytes) -> None:
        """Send all members an order, a reply or a repeated order."""
        self._member.say(kind, body)

    def revoke(self, vehicle: str) -> None:
        """As an operator, send the revocation of a vehicle's key.

        Raises:
            InputError: the vehicle has none.
        """
        self._member.revoke(vehicle)

    def announce(self, presence: Presence) -> None:
        """Set this vehicle's presence, which is sent again and again."""
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
    """Open the links of a member for as long as the context lasts.

    A lost connection is made again for ever. The first connection is awaited for at most a second.

    Args:
        addresses: addresses of all links; each message goes over every one, and the first copy counts.
        formation: name of the formation.
        member: member on the links.
        random: spreads the retries of companions that lost the same peer.

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
    """Return the time that members starting together may need to hear each other over these links, s."""
    return min((carrier_of(address.scheme).greeting_s for address in addresses), default=0.0)


async def keep_asking(member: Member) -> None:
    """Ask for the leader's clock for ever: quickly while something is new, otherwise now and then."""
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
    """Links, names and keys for watching a formation."""

    addresses: tuple[LinkAddress, ...]
    formation: str
    """Name of the formation."""
    leader: str
    roster: Roster | None
    """Public keys of all members; None to believe anybody."""
    key: "Ed25519PrivateKey | None" = None
    """An operator's private key, with which the leader can be asked whether it lives."""
    deputies: tuple[str, ...] = ()
    """Names of vehicles that may lead in the leader's place, and answer for it."""
    clock: Callable[[], float] = time.monotonic
    """Clock of its members, s; a rehearsal's runs faster."""


def operator_of(roster: Roster, key: "Ed25519PrivateKey") -> str:
    """Return the name of the operator with this private key; raise InputError if the roster lacks it."""
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
    """Listen, and return the latest presence of each vehicle by name.

    A broker retains presences; other links repeat them every second.

    Args:
        watched: the formation.
        seconds: listening time, s; longer on a slow link, until all members should have been heard.
        random: spreads the retries of members that lost the same broker.

    Raises:
        VfguideError: no link is up.
    """
    async with watching(watched, random=random) as (link, found):
        check_connected(link)
        slowest_s = max(carrier.presence_s for carrier in link.carriers)
        await asyncio.sleep(max(seconds, HEARD_SHARE * slowest_s))
        check_connected(link)
        return dict(found)


async def check_reachable(watched: WatchedFormation, *, random: Random) -> None:
    """Check that a link is up; raise VfguideError if none is, with the reasons."""
    async with watching(watched, random=random) as (link, _):
        check_connected(link)


def check_connected(link: Link) -> None:
    """Check that a link is up; raise VfguideError if none is, with the reasons."""
    if not link.connected:
        raise VfguideError(link.complaint())


@asynccontextmanager
async def watching(
    watched: WatchedFormation, *, random: Random, **hears: Unpack[Hearing]
) -> AsyncIterator[tuple[Link, Mapping[str, Presence]]]:
    """Open links and collect presences by vehicle; they grow old while no link is up.

    With a receiver of replies, the member has an operator's turns on a radio.
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
    """Return a member without a presence, which can ask for the leader's clock unless it lacks a key.

    Args:
        watched: the formation.
        random: makes up a name where there is no key.
        neighbours: names of vehicles whose states are wanted besides the leader's.
        watches: as in `Trust`.
        **hears: as in `Member`.
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
