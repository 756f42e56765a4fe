"""A million hostile datagrams into a companion's link: what becomes of them, and what that takes.

    python -m tests.benchmarks.hostile_datagrams [COUNT] [udp|mqtt|zenoh|leader]

They are noise, cut and changed messages, repeated ones, forgeries with a real header, and messages of another
formation, sent as fast as it goes. With `leader` they go into the port at which a leader without a companion
is heard: noise, real frames with some bits changed, and any message of the dialect with random content and a
right checksum, as if the leader had sent it. Between them a true leader publishes. The program fails if
anything is raised, memory grows by more than 5 MB after the first tenth, anything is believed that the leader
has not said, or the leader is not heard afterwards.
"""

import asyncio
import socket
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random
from typing import TypeVar

import aiomqtt
import zenoh

from tests.benchmarks.hostile_frames import Frames
from tests.kit.figures import resident_mb, tell
from tests.kit.link import FORMATION, KEYS, LEADER, trust_of
from tests.kit.sockets import free_port
from tests.unit.companion.test_companion_leader_telemetry import FRAME, packed, position
from tests.unit.companion.test_companion_leader_telemetry import LEADER as FOREIGN
from vfguide.companion.leader_telemetry import LeaderTelemetry
from vfguide.lab.rehearsal.processes import broker
from vfguide.link.carrier import LinkAddress, parse_link
from vfguide.link.client import MqttAddress
from vfguide.link.codec import Kind, formation_number
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Member
from vfguide.link.opening import Link, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust, new_session
from vfguide.link.udp import UdpAddress
from vfguide.link.zenoh import ZenohAddress
from vfguide.mavlink.address import parse_address
from vfguide.mavlink.connection import open_connection

T = TypeVar("T")

BATCH = 200

GROUP = "udp://239.255.78.1:{port}?interface=127.0.0.1"


class Measured:
    """What an attack takes: its time, and the memory that came on top after the first tenth."""

    def __init__(self) -> None:
        self.began_s = time.monotonic()
        self.before_mb = resident_mb()
        self.seconds = 0.0

    def end(self) -> None:
        """Stop the clock."""
        self.seconds = round(time.monotonic() - self.began_s, 1)

    def told(self, counters: Mapping[str, int], **found: int) -> dict[str, float]:
        """Tell counters, see that memory has not grown, and return the figures of the attack."""
        for reason, number in sorted(counters.items(), key=lambda one: -one[1]):
            tell(f"{number:9d}  {reason}")
        growth_mb = resident_mb() - self.before_mb
        assert growth_mb < 5.0, growth_mb
        return {**found, "seconds": self.seconds, "growth_mb": round(growth_mb, 2)}


def refusals(counters: Mapping[str, int]) -> dict[str, int]:
    """Those counters that tell of something refused."""
    assert counters["failed to use"] == 0
    return {reason: n for reason, n in counters.items() if reason.startswith("refused")}


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


async def opened(stack: AsyncExitStack, member: Member, address: LinkAddress) -> Link:
    """A member's link, open as long as the attack."""
    link = open_link((address,), formation=FORMATION, member=member, random=Random(1))
    return await stack.enter_async_context(link)


async def attack(count: int, way: str, stack: AsyncExitStack) -> dict[str, float]:
    """Send them all, and see that the true leader is heard before, during and after it."""
    own = None
    if way == "udp":
        address = parse_link(GROUP.format(port=free_port()))
    elif way == "zenoh":
        port = free_port()
        own = parse_link(f"zenoh://?listen=127.0.0.1:{port}")
        address = parse_link(f"zenoh://127.0.0.1:{port}")
    else:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        port = await stack.enter_async_context(broker(directory))
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
    # Who listens first is found at once.
    hears = await opened(stack, follower, address if own is None else own)
    speaks = await opened(stack, leader, address)
    await until_heard(speaks, heard)
    hostile = Hostile(leader_trust)
    send = await sender(address, stack)
    measured, during = Measured(), 0
    sizes_mb = list[float]()
    for number in range(0, count, BATCH):
        if number % (count // 10) == 0:
            sizes_mb.append(round(resident_mb(), 1))
            if len(sizes_mb) == 2:
                # Libraries make their buffers in the first tenth.
                measured.before_mb = resident_mb()
        for _ in range(BATCH):
            await send(hostile())
        speaks.publish(b"true %d" % number)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        during += len(heard)
        heard.clear()
    measured.end()
    await until_heard(speaks, heard)
    assert not [data for data in heard if not data.startswith(b"true")], heard[:3]
    counters = hears.counters
    refused = refusals(counters)
    tell(f"memory at each tenth, MB: {sizes_mb}")
    told = {**refused, **{one: counters[one] for one in ("copies", "dropped: too many at once")}}
    sums = {"sent": count, "refused": sum(refused.values()), "true states heard meanwhile": during}
    return measured.told(told, **sums)


async def until_heard(link: Link, heard: list[bytes]) -> None:
    """Publish until a state is heard."""
    async with asyncio.timeout(60.0):
        while not heard:
            link.publish(b"true")
            await asyncio.sleep(0.02)


async def sender(address: LinkAddress, stack: AsyncExitStack) -> Callable[[bytes], Awaitable[None]]:
    """Something that sends a datagram to everybody, or publishes it as the leader's state."""
    if isinstance(address, UdpAddress):
        opened = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))

        async def send(data: bytes) -> None:
            opened.sendto(data, address.destinations[0])

        return send
    if isinstance(address, ZenohAddress):
        config = zenoh.Config()
        config.insert_json5("mode", '"peer"')
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("connect/endpoints", f'["tcp/{address.peers[0]}"]')
        session = stack.enter_context(zenoh.open(config))
        key = f"vfguide/{formation_number(FORMATION):016x}"
        publisher = session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.BLOCK, express=True
        )
        await asyncio.sleep(1.0)

        async def put(data: bytes) -> None:
            publisher.put(data)

        return put
    assert isinstance(address, MqttAddress)
    client = await stack.enter_async_context(aiomqtt.Client(address.host, address.port))

    async def publish(data: bytes) -> None:
        await client.publish(f"vfguide/{FORMATION}/{LEADER}/state", data)

    return publish


class Heard:
    """A leader without a companion, and the companion that hears it."""

    def __init__(self) -> None:
        self.telemetry = LeaderTelemetry(FOREIGN, FRAME, moved_s=5.0, system_id=2)
        self._began_s = time.monotonic()

    @property
    def now(self) -> float:
        return time.monotonic() - self._began_s

    def take(self, datagram: bytes) -> None:
        """What a companion does with a datagram."""
        self.telemetry.take(datagram, self.now)
        self.telemetry.say(self.now)

    def true_report(self) -> bytes:
        """The leader now: 20 m/s north."""
        return packed(position(self.now, 20.0 * self.now, 0.0))

    @property
    def age_s(self) -> float:
        newest = self.telemetry.newest
        return 1e9 if newest is None else self.now - newest.time_s


async def attack_leader(count: int, stack: AsyncExitStack) -> dict[str, float]:
    """The same into the MAVLink port at which a leader without a companion is heard."""
    heard, port = Heard(), free_port()
    await stack.enter_async_context(
        open_connection(parse_address(f"udpin://127.0.0.1:{port}"), heard.take, random=Random(1))
    )
    opened = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))

    async def until_believed() -> None:
        async with asyncio.timeout(60.0):
            while heard.age_s > 1.0:
                opened.sendto(heard.true_report(), ("127.0.0.1", port))
                await asyncio.sleep(0.1)

    await until_believed()
    frames = iter(Frames(1, system_id=7, component_id=1, favourites=(0, 33, 63, 111, 144, 235)))
    measured = Measured()
    for _ in range(0, count, BATCH // 4):
        for _ in range(BATCH // 4):
            opened.sendto(next(frames), ("127.0.0.1", port))
        opened.sendto(heard.true_report(), ("127.0.0.1", port))
        # Each round of the loop reads one.
        for _ in range(BATCH // 4 + 1):
            await asyncio.sleep(0)
    measured.end()
    await until_believed()
    counters = heard.telemetry.counters
    sums = {"sent": count, "passed over": sum(counters.values())}
    return measured.told(counters, **sums)


async def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    way = sys.argv[2] if len(sys.argv) > 2 else "udp"
    async with AsyncExitStack() as stack:
        hostile = attack_leader(count, stack) if way == "leader" else attack(count, way, stack)
        found = await hostile
    tell(f"{way}: {found}")


if __name__ == "__main__":
    asyncio.run(main())
