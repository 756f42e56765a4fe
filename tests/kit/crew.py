"""Members of a formation on real links, and what they have heard."""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from random import Random

from tests.kit.link import FORMATION, LEADER, trust_of
from tests.kit.sockets import PATIENCE_S
from vfguide.link.carrier import parse_links
from vfguide.link.member import Member, ignore
from vfguide.link.opening import Link, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import new_session


class Crew:
    """One member on its links."""

    def __init__(self, name: str, *, signed: bool = True) -> None:
        self.heard: list[bytes] = []
        """States of the leader."""
        self.neighbours: list[tuple[str, bytes]] = []
        leads = name == LEADER
        self.member = Member(
            trust_of(name, new_session(), signed=signed),
            clock=time.monotonic,
            receive=ignore if leads else self.heard.append,
            neighbours=[one for one in ("f1", "f2") if one != name],
            receive_neighbour=lambda vehicle, data: self.neighbours.append((vehicle, data)),
            peer_clock=None if leads else PeerClock(),
        )
        self.link: Link

    @property
    def counters(self) -> Counter[str]:
        return self.link.counters


@asynccontextmanager
async def crews_on(links: Mapping[str, Sequence[str]]) -> AsyncIterator[list[Crew]]:
    """Members on their links, by name and in that order."""
    async with AsyncExitStack() as stack:
        crews = []
        for name, addresses in links.items():
            crew = Crew(name)
            opening = open_link(
                parse_links(addresses), formation=FORMATION, member=crew.member, random=Random(name)
            )
            crew.link = await stack.enter_async_context(opening)
            crews.append(crew)
        yield crews


async def speak(link: Link, until_heard: Callable[[], object]) -> None:
    """Publish a state after the other until something is heard."""
    number = 0
    async with asyncio.timeout(PATIENCE_S):
        while not until_heard():
            number += 1
            link.publish(b"%d" % number)
            await asyncio.sleep(0.02)
