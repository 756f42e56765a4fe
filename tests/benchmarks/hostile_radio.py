"""A million hostile packets into a companion's radio: what becomes of them, and what that takes.

    python -m tests.benchmarks.hostile_radio [COUNT]

They are noise, cut and changed packets, repeated ones, and packets of another formation and of another
session, written to a pseudo terminal as fast as its reader takes them. Between them a true leader has its
turns. The program fails if anything is raised, memory grows by more than 5 MB, anything is believed that the
leader has not said, or the leader is not heard afterwards.
"""

import asyncio
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random

from tests.benchmarks.hostile_datagrams import Measured, opened, random_one, refusals
from tests.kit.figures import tell
from tests.kit.link import FORMATION, LEADER, trust_of
from tests.kit.radio import SharedAir, state_at
from tests.kit.sockets import until
from vfguide.link.carrier import parse_link
from vfguide.link.codec import decode
from vfguide.link.member import Member
from vfguide.link.packed import TAG_SIZE, formation_key, tag_of
from vfguide.link.peer_clock import PeerClock
from vfguide.link.radio_schedule import Framer, encode_frame
from vfguide.link.trust import new_session

NAMES = (LEADER, "f1", "f2")

BATCH = 20

Make = Callable[[], bytes]


class Hostile:
    """Makes bytes that no member of the formation has said, or not now."""

    def __init__(self, real: list[bytes], key: bytes) -> None:
        """Begin with packets that were recorded in this session, and the key of this formation's tags."""
        self._random = Random(1)
        self._real = real
        self._key = key
        self._kinds: tuple[Make, ...] = (
            lambda: self._random.randbytes(self._random.randrange(100)),
            lambda: encode_frame(self._one())[: self._random.randrange(1, 40)],
            lambda: encode_frame(self._changed()),
            lambda: encode_frame(self._one()),
            lambda: encode_frame(self._elsewhere()),
            lambda: encode_frame(self._yesterday()),
        )

    def __call__(self) -> bytes:
        return random_one(self._random, self._kinds)()

    def _one(self) -> bytes:
        return random_one(self._random, self._real)

    def _changed(self) -> bytes:
        data = bytearray(self._one())
        data[self._random.randrange(len(data))] ^= self._random.randrange(1, 256)
        return bytes(data)

    def _elsewhere(self) -> bytes:
        packet = self._one()
        return packet[:1] + b"\xee\xee" + packet[3:]

    def _yesterday(self) -> bytes:
        """Right in everything, under another session of the leader."""
        tagged = self._one()[:-TAG_SIZE]
        return tagged + tag_of(self._key, 5, tagged)


async def attack(count: int, stack: AsyncExitStack) -> dict[str, float]:
    """Write them all, and see that the true leader is heard before and after it."""
    directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    air = SharedAir(directory)
    stack.callback(air.close)
    recorded: list[bytes] = []
    send = air.send

    def record(sender: object, data: bytes) -> None:
        recorded.append(data)
        send(sender, data)  # type: ignore[arg-type]

    air.send = record  # type: ignore[method-assign]
    plugs = [air.plug(name) for name in (LEADER, "f1")]
    heard: list[float] = []
    leader = Member(trust_of(LEADER, new_session()), clock=time.monotonic, neighbours=("f1", "f2"))
    follower = Member(
        trust_of("f1", new_session()),
        clock=time.monotonic,
        receive=lambda data: heard.append(decode(data).time_s),
        neighbours=("f2",),
        peer_clock=PeerClock(),
    )
    _, hears = [
        await opened(stack, member, parse_link(air.address(member.name)))
        for member in (leader, follower)
    ]
    publishing = asyncio.create_task(publish(leader))
    stack.callback(publishing.cancel)
    await until(lambda: len(heard) >= 10)
    await asyncio.sleep(0.5)
    key = formation_key(bytes.fromhex(air.key.read_text()), FORMATION, NAMES)
    framer = Framer(Counter())
    hostile = Hostile(framer.feed(b"".join(recorded[:-5])), key)
    measured, during, newest = Measured(), 0, max(heard)
    heard.clear()
    near = plugs[1].near
    assert near is not None
    for _ in range(0, count, BATCH):
        data = b"".join(hostile() for _ in range(BATCH))
        while data:
            try:
                data = data[os.write(near, data) :]
            except BlockingIOError:
                await asyncio.sleep(0)
        await asyncio.sleep(0)
        during += len(heard)
        # Each state once, and in their order.
        assert heard == sorted(time_s for time_s in set(heard) if time_s > newest)
        newest = max([newest, *heard])
        heard.clear()
    measured.end()
    await until(lambda: len(heard) >= 5)
    counters = hears.counters
    refused = refusals(counters)
    sums = {"sent": count, "refused": sum(refused.values()), "copies": counters["copies"]}
    return measured.told(refused, **sums, **{"true states heard meanwhile": during})


async def publish(leader: Member) -> None:
    """20 states a second, for ever."""
    while True:
        leader.publish(state_at(time.monotonic()))
        await asyncio.sleep(0.05)


async def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    async with AsyncExitStack() as stack:
        found = await attack(count, stack)
    tell(f"radio: {found}")


if __name__ == "__main__":
    asyncio.run(main())
