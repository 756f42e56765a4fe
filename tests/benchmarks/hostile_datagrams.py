"""A million hostile datagrams into a companion's link: what becomes of them, and what that takes.

    python tests/benchmarks/hostile_datagrams.py [COUNT] [udp|mqtt]

They are noise, cut and changed messages, repeated ones, forgeries with a real header, and messages of another
formation, sent as fast as it goes. Between them a true leader publishes. The program fails if anything is
raised, memory grows by more than 5 MB, anything is believed that the leader has not said, or the leader is
not heard afterwards.
"""

import asyncio
import socket
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random
from typing import TypeVar

import aiomqtt

from vfguide.lab.studies.programs import broker
from vfguide.link.address import MqttAddress, UdpAddress, parse_link
from vfguide.link.envelope import Kind
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Member
from vfguide.link.opening import Link, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust, new_session

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.unit.link.wire import FORMATION, KEYS, LEADER, trust_of

T = TypeVar("T")

BATCH = 200

GROUP = "udp://239.255.78.1:{port}?interface=127.0.0.1"


def resident_mb() -> float:
    """Memory of this process, 10^6 bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Hostile:
    """Makes datagrams that no member of the formation has said, or not now."""

    def __init__(self, leader: Trust) -> None:
        self._random = Random(1)
        self._real = [
            leader.seal(Kind.STATE, b"old %d" % number, time_s=1.0) for number in range(64)
        ]
        elsewhere = Roster(formation="line", vehicles={LEADER: public_bytes(KEYS[LEADER])})
        other = Trust(
            formation="line",
            name=LEADER,
            leader=LEADER,
            session=new_session(),
            roster=elsewhere,
            key=KEYS[LEADER],
        )
        self._other = other.seal(Kind.STATE, b"of the line", time_s=1.0)
        self._unsigned = trust_of(LEADER, 5, signed=False)
        self._yesterday = trust_of(LEADER, 6).seal(Kind.STATE, b"of yesterday", time_s=1.0)
        self._kinds = (
            self._noise,
            self._cut,
            self._changed,
            self._forged,
            lambda: random_one(self._random, self._real),
            lambda: self._other,
            lambda: self._yesterday,
            lambda: self._unsigned.seal(Kind.STATE, b"unsigned", time_s=1.0),
        )

    def __call__(self) -> bytes:
        return random_one(self._random, self._kinds)()

    def _noise(self) -> bytes:
        return self._random.randbytes(self._random.randrange(1500))

    def _cut(self) -> bytes:
        data = random_one(self._random, self._real)
        return data[: self._random.randrange(len(data))]

    def _changed(self) -> bytes:
        data = bytearray(random_one(self._random, self._real))
        for _ in range(self._random.randrange(1, 4)):
            data[self._random.randrange(len(data))] = self._random.randrange(256)
        return bytes(data)

    def _forged(self) -> bytes:
        """Newer than anything that the leader has said, with every number right but the signature."""
        data = bytearray(random_one(self._random, self._real))
        data[32:36] = (2**31 + self._random.randrange(2**30)).to_bytes(4, "little")
        return bytes(data)


def random_one(random: Random, choices: Sequence[T]) -> T:
    """One of several, quickly."""
    return choices[int(random.random() * len(choices))]


async def attack(count: int, way: str, stack: AsyncExitStack) -> dict[str, float]:
    """Send them all, and see that the true leader is heard before, during and after it."""
    if way == "udp":
        address = parse_link(GROUP.format(port=free_port()))
    else:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        _, port = await stack.enter_async_context(broker(directory))
        address = parse_link(f"mqtt://127.0.0.1:{port}")
    heard: list[bytes] = []
    leader_trust = trust_of(LEADER, new_session())
    leader = Member(leader_trust, clock=time.monotonic)
    follower = Member(
        trust_of("f1", new_session()),
        clock=time.monotonic,
        receive=heard.append,
        peer_clock=PeerClock(),
    )
    links = [
        await stack.enter_async_context(
            open_link((address,), formation=FORMATION, member=member, random=Random(1))
        )
        for member in (leader, follower)
    ]
    await until_heard(links[0], heard)
    hostile = Hostile(leader_trust)
    send = await sender(address, stack)
    before_mb, began_s, during = resident_mb(), time.monotonic(), 0
    for number in range(0, count, BATCH):
        for _ in range(BATCH):
            await send(hostile())
        links[0].publish(b"true %d" % number)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        during += len(heard)
        heard.clear()
    seconds = time.monotonic() - began_s
    await until_heard(links[0], heard)
    assert not [data for data in heard if not data.startswith(b"true")], heard[:3]
    counters = links[1].counters
    assert counters["failed to use"] == 0
    refused = {reason: n for reason, n in counters.items() if reason.startswith("refused")}
    for reason, number in sorted(refused.items(), key=lambda one: -one[1]):
        sys.stdout.write(f"{number:9d}  {reason}\n")
    growth_mb = resident_mb() - before_mb
    assert growth_mb < 5.0, growth_mb
    return {
        "sent": count,
        "refused": sum(refused.values()),
        "true states heard meanwhile": during,
        "seconds": round(seconds, 1),
        "growth_mb": round(growth_mb, 2),
    }


async def until_heard(link: Link, heard: list[bytes]) -> None:
    """Publish until a state is heard."""
    async with asyncio.timeout(60.0):
        while not heard:
            link.publish(b"true")
            await asyncio.sleep(0.02)


async def sender(
    address: MqttAddress | UdpAddress, stack: AsyncExitStack
) -> Callable[[bytes], Awaitable[None]]:
    """Something that sends a datagram to everybody, or publishes it as the leader's state."""
    if isinstance(address, UdpAddress):
        opened = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))

        async def send(data: bytes) -> None:
            opened.sendto(data, address.destinations[0])

        return send
    client = await stack.enter_async_context(aiomqtt.Client(address.host, address.port))

    async def publish(data: bytes) -> None:
        await client.publish(f"vfguide/{FORMATION}/{LEADER}/state", data)

    return publish


async def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    way = sys.argv[2] if len(sys.argv) > 2 else "udp"
    async with AsyncExitStack() as stack:
        found = await attack(count, way, stack)
    sys.stdout.write(f"{way}: {found}\n")


if __name__ == "__main__":
    asyncio.run(main())
