"""How old a leader's state is when it reaches those who follow it: one publisher, many subscribers.

As a program, `python -m vfguide.lab.studies.link_age LINK COUNT FIRST SECONDS FILE KEYS`, this is some of the
subscribers: links as companions have them, each with a connection of its own.
"""

import asyncio
import json
import sys
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any

from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.processes import Process, python_module, running
from vfguide.lab.studies.figures import figures_of
from vfguide.link.address import parse_link
from vfguide.link.codec import LeaderMessage, decode, encode
from vfguide.link.keys import key_places, make_keys, read_private_key, read_roster
from vfguide.link.member import Member
from vfguide.link.opening import Link, open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust, new_session

FORMATION, LEADER = "bench-link", "leader"

READY_S = 60.0
"""s that subscribers get until each has heard a state."""

LINK_LOOK_S = 0.05
"""s between looks at whether they have."""

SETTLING_S = 2.0
"""s after that which do not count: clocks are being compared in a hurry then."""


class Subscriber:
    """One follower's end of the link."""

    def __init__(self) -> None:
        self.ages: list[float] = []
        """Age of each state when it arrived, s."""

    def take(self, data: bytes) -> None:
        """Note the age of a state; both ends read the same clock."""
        self.ages.append(time.monotonic() - decode(data).time_s)


def trust_of(name: str, keys: Path) -> Trust:
    """What a member of the formation that is measured signs with.

    Args:
        name: its name.
        keys: where the formation's keys are.
    """
    places = key_places(keys)
    return Trust(
        formation=FORMATION,
        name=name,
        leader=LEADER,
        session=new_session(),
        roster=read_roster(places.roster),
        key=read_private_key(places.private(name)),
    )


async def subscribe(link: str, count: int, first: int, seconds: float, keys: Path) -> list[float]:
    """Listen with some links and return the ages of what arrived, s.

    Args:
        link: address of the broker.
        count: of links.
        first: number of the first of them in the formation.
        seconds: how long ages are taken, once every link has heard a state.
        keys: where the formation's keys are.

    Raises:
        VfguideError: one hears nothing.
    """
    subscribers = [Subscriber() for _ in range(count)]
    async with AsyncExitStack() as stack:
        opening = [
            stack.enter_async_context(
                open_link(
                    (parse_link(link),),
                    formation=FORMATION,
                    member=Member(
                        trust_of(f"f{first + number}", keys),
                        clock=time.monotonic,
                        receive=subscriber.take,
                        peer_clock=PeerClock(),
                    ),
                    random=Random(first + number),
                )
            )
            for number, subscriber in enumerate(subscribers)
        ]
        for one in opening:
            await one
        with suppress(TimeoutError):
            async with asyncio.timeout(READY_S):
                while not all(subscriber.ages for subscriber in subscribers):
                    await asyncio.sleep(LINK_LOOK_S)
        if not all(subscriber.ages for subscriber in subscribers):
            raise VfguideError("a subscriber hears nothing")
        await asyncio.sleep(SETTLING_S)
        for subscriber in subscribers:
            subscriber.ages.clear()
        await asyncio.sleep(seconds)
        return [age for subscriber in subscribers for age in subscriber.ages]


async def measure_link_age(
    link: str, *, subscribers: int, processes: int, seconds: float, rate_hz: float, directory: Path
) -> dict[str, Any]:
    """Publish states, and let subscribers in processes of their own tell how old they were.

    Returns:
        How many there were, how many states each missed of those published, and ages.

    Raises:
        VfguideError: a process of subscribers has failed.
    """
    shares = [len(range(number, subscribers, processes)) for number in range(processes)]
    ages: list[float] = []
    keys = directory / "link"
    names = [LEADER, *(f"f{number}" for number in range(1, subscribers + 1))]
    make_keys(key_places(keys), FORMATION, names, operators=())
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(publishing(link, rate_hz, keys))
        started = []
        for number, share in enumerate(shares):
            file = directory / f"ages-{subscribers}-{number}.json"
            log = file.with_suffix(".log")
            arguments = (link, share, 1 + sum(shares[:number]), seconds, file, keys)
            command = python_module("vfguide.lab.studies.link_age", *map(str, arguments))
            process = Process(f"subscribers {number}", command, log)
            started.append((await stack.enter_async_context(running(process)), file))
        for process, file in started:
            if await process.wait() != 0:
                raise VfguideError(f"{process.name} have failed: {process.last_words()}")
            ages += json.loads(file.read_text(encoding="utf-8"))
    expected = subscribers * seconds * rate_hz
    return {
        "subscribers": subscribers,
        "processes": processes,
        "heard_percent": round(min(100.0, 100.0 * len(ages) / expected), 1),
        **figures_of(ages),
    }


@asynccontextmanager
async def publishing(link: str, rate_hz: float, keys: Path) -> AsyncIterator[None]:
    """A leader that publishes its state at a rate."""
    async with open_link(
        (parse_link(link),),
        formation=FORMATION,
        member=Member(trust_of(LEADER, keys), clock=time.monotonic),
        random=Random(0),
    ) as opened:
        task = asyncio.create_task(publish(opened, 1.0 / rate_hz))
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


async def publish(link: Link, interval_s: float) -> None:
    """Publish a state at each interval, true at the moment that it is handed over, until cancelled."""
    loop = asyncio.get_running_loop()
    due_s, sequence = loop.time(), 0
    while True:
        message = LeaderMessage(
            sequence=sequence,
            time_s=time.monotonic(),
            latitude_deg=47.397742,
            longitude_deg=8.545594,
            altitude_amsl=588.0,
            course=1.0,
            ground_speed=20.0,
            acceleration=0.0,
            turn_rate=0.13,
            turn_acceleration=0.0,
        )
        link.publish(encode(message))
        sequence += 1
        due_s = max(due_s + interval_s, loop.time() - interval_s)
        await asyncio.sleep(due_s - loop.time())


def main() -> None:
    """Entry point of a process of subscribers."""
    link, count, first, seconds, file, keys = sys.argv[1:]
    ages = asyncio.run(subscribe(link, int(count), int(first), float(seconds), Path(keys)))
    Path(file).write_text(json.dumps(ages), encoding="utf-8")


if __name__ == "__main__":
    main()
