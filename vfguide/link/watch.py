"""Listening to the presences of a formation, for people who want to know how it is."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from random import Random

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from vfguide.errors import InputError, VfguideError
from vfguide.link.address import LinkAddress
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Member, ignore, ignore_neighbour
from vfguide.link.opening import Link, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.link.trust import Trust, new_session

HEARD_SHARE = 1.5
"""Of the time within which everybody says how it is: so long it takes to hear all of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedFormation:
    """A formation that somebody wants to know something of."""

    addresses: tuple[LinkAddress, ...]
    """Of its links."""
    formation: str
    """Its name."""
    leader: str
    """Name of its leader."""
    roster: Roster | None
    """Everybody's public keys; None to believe anybody."""
    key: Ed25519PrivateKey | None = None
    """An operator's private key, with which the leader can be asked whether it lives."""
    deputies: tuple[str, ...] = ()
    """Who may lead in its place, and answer in it."""


def operator_of(roster: Roster, key: Ed25519PrivateKey) -> str:
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
    watched: WatchedFormation, *, random: Random
) -> AsyncIterator[tuple[Link, Mapping[str, Presence]]]:
    """A link on which presences come in, and those that have, by vehicle; old ones while no link stands."""
    found: dict[str, Presence] = {}
    member = watching_member(watched, random, receive_presence=found.__setitem__)
    async with open_link(
        watched.addresses, formation=watched.formation, member=member, random=random
    ) as link:
        await link.settle()
        yield link, found


def watching_member(
    watched: WatchedFormation,
    random: Random,
    *,
    receive_presence: Callable[[str, Presence], None],
    receive: Callable[[bytes], None] = ignore,
    neighbours: Sequence[str] = (),
    receive_neighbour: Callable[[str, bytes], None] = ignore_neighbour,
    receive_lead: Callable[[str, bytes], None] | None = None,
    receive_order: Callable[[bytes, bytes, bool], None] | None = None,
    receive_reply: Callable[[str, bytes], None] | None = None,
) -> Member:
    """A member that says nothing about itself; it asks the leader whether it lives if it has a key for it.

    Args:
        watched: the formation.
        random: makes up a name where there is no key.
        receive_presence: called with a vehicle's name and what it says about itself.
        receive: called with each new state of the leader.
        neighbours: names of those whose states are wanted beside the leader's.
        receive_neighbour: called with the name of one of them and its new state.
        receive_lead: as of `Member`.
        receive_order: as of `Member`.
        receive_reply: as of `Member`.
    """
    asks, name = True, f"watch-{random.getrandbits(32):08x}"
    if watched.roster is not None:
        asks = watched.key is not None
        name = operator_of(watched.roster, watched.key) if watched.key is not None else name
    clock = asyncio.get_running_loop().time
    trust = Trust(
        formation=watched.formation,
        name=name,
        leader=watched.leader,
        session=new_session(),
        roster=watched.roster,
        key=watched.key,
        watches=True,
        deputies=watched.deputies,
    )
    return Member(
        trust,
        clock=clock,
        receive=receive,
        neighbours=neighbours,
        receive_neighbour=receive_neighbour,
        receive_presence=receive_presence,
        receive_lead=receive_lead,
        receive_order=receive_order,
        receive_reply=receive_reply,
        peer_clock=PeerClock() if asks else None,
    )
