"""`vfguide bench trust`: what signed messages cost, beside unsigned ones in the same run.

Two formations of one size fly at one broker at the same time: one signs, one does not. Of each, one process
is a follower that hears all others as a companion does, and one process is all those others.

As a program, `python -m vfguide.lab.studies.trust_cost PART LINK MODE COUNT SECONDS FILE KEYS`, this is one
of these processes.
"""

import asyncio
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random
from typing import Any

from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.processes import load, python_module
from vfguide.lab.studies.figures import figures_of
from vfguide.lab.studies.latency import aligned, shown
from vfguide.lab.studies.link_age import FORMATION, LEADER, publish, trust_of
from vfguide.lab.studies.programs import broker, last_words, program
from vfguide.link.address import parse_link
from vfguide.link.codec import SIZE, decode
from vfguide.link.envelope import Kind
from vfguide.link.keys import key_places, make_keys
from vfguide.link.member import Member
from vfguide.link.opening import open_link
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust, new_session

AIRCRAFT = (4, 30, 100)

LEADER_HZ, FOLLOWER_HZ = 20.0, 5.0
"""States per second, as companions publish them."""

SIGNED, UNSIGNED = "signed", "unsigned"

LISTENER = "f1"

READY_S = 60.0
"""s that a listener gets until it hears its leader."""

SETTLING_S = 3.0
"""s after that which do not count."""


def member_trust(name: str, mode: str, keys: Path) -> Trust:
    """What a member of the formation of this mode signs with, if it signs."""
    if mode == SIGNED:
        return trust_of(name, keys)
    return Trust(formation=FORMATION, name=name, leader=LEADER, session=new_session(), roster=None)


async def talk(link: str, mode: str, count: int, seconds: float, keys: Path) -> None:
    """Be all of a formation but one follower: publish until the listener is done."""
    async with AsyncExitStack() as stack:
        tasks = []
        for name in [LEADER, *(f"f{number}" for number in range(2, count))]:
            follows = name != LEADER
            member = Member(
                member_trust(name, mode, keys),
                clock=time.monotonic,
                peer_clock=PeerClock() if follows else None,
            )
            opened = await stack.enter_async_context(
                open_link(
                    (parse_link(f"{link}/{mode}"),),
                    formation=FORMATION,
                    member=member,
                    random=Random(name),
                )
            )
            rate_hz = FOLLOWER_HZ if follows else LEADER_HZ
            tasks.append(asyncio.create_task(publish(opened, 1.0 / rate_hz)))
        await asyncio.sleep(seconds)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def listen(link: str, mode: str, count: int, seconds: float, keys: Path) -> dict[str, Any]:
    """Be one follower that hears all others, and tell what that takes.

    Raises:
        VfguideError: the leader is not heard.
    """
    ages: dict[str, list[float]] = {"leader": [], "neighbours": []}

    def take(data: bytes) -> None:
        ages["leader"].append(time.monotonic() - decode(data).time_s)

    def take_neighbour(vehicle: str, data: bytes) -> None:
        del vehicle
        ages["neighbours"].append(time.monotonic() - decode(data).time_s)

    member = Member(
        member_trust(LISTENER, mode, keys),
        clock=time.monotonic,
        receive=take,
        neighbours=[f"f{number}" for number in range(2, count)],
        receive_neighbour=take_neighbour,
        peer_clock=PeerClock(),
    )
    async with open_link(
        (parse_link(f"{link}/{mode}"),), formation=FORMATION, member=member, random=Random(0)
    ) as opened:
        publishing = asyncio.create_task(publish(opened, 1.0 / FOLLOWER_HZ))
        ends = time.monotonic() + READY_S
        while not ages["leader"]:
            if time.monotonic() > ends:
                raise VfguideError(f"the leader is not heard: {dict(opened.counters)}")
            await asyncio.sleep(0.05)
        await asyncio.sleep(SETTLING_S)
        for series in ages.values():
            series.clear()
        began_s, began_cpu_s = time.monotonic(), time.process_time()
        await asyncio.sleep(seconds)
        took_s, cpu_s = time.monotonic() - began_s, time.process_time() - began_cpu_s
        publishing.cancel()
        await asyncio.gather(publishing, return_exceptions=True)
        heard = sum(len(series) for series in ages.values())
        sealed = member.trust.seal(Kind.STATE, bytes(SIZE), time_s=0.0)
        return {
            "leader_age": figures_of(ages["leader"]),
            "neighbours_age": figures_of(ages["neighbours"]),
            "states_per_s": round(heard / took_s, 1),
            "cpu_percent": round(100.0 * cpu_s / took_s, 2),
            "cpu_us_per_state": round(1e6 * cpu_s / max(heard, 1), 1),
            "state_bytes": len(sealed),
            "refused": {
                reason: number
                for reason, number in opened.counters.items()
                if reason.startswith("refused")
            },
        }


async def measure(link: str, count: int, seconds: float, directory: Path) -> list[dict[str, Any]]:
    """Both formations of one size, side by side.

    Raises:
        VfguideError: one of the programs has failed.
    """
    keys = directory / f"formation-{count}.yaml"
    make_keys(key_places(keys), FORMATION, [LEADER, *(f"f{number}" for number in range(1, count))])
    rows = []
    async with AsyncExitStack() as stack:
        running = []
        for mode in (SIGNED, UNSIGNED):
            for part in ("talk", "listen"):
                file = directory / f"{part}-{mode}-{count}.json"
                log = file.with_suffix(".log")
                length_s = seconds if part == "listen" else seconds + READY_S + SETTLING_S
                arguments = (part, link, mode, count, length_s, file, keys)
                command = python_module("vfguide.lab.studies.trust_cost", *map(str, arguments))
                process = await stack.enter_async_context(program(command, log))
                if part == "listen":
                    running.append((mode, process, file, log))
        for mode, process, file, log in running:
            if await process.wait() != 0:
                raise VfguideError(f"a listener has failed: {last_words(log)}")
            found = json.loads(file.read_text(encoding="utf-8"))
            rows.append({"aircraft": count, "messages": mode, **found})
    return rows


def run_trust_cost(*, seconds: float, aircraft: Sequence[int] = AIRCRAFT) -> dict[str, Any]:
    """Measure all sizes; takes their number of times the seconds, and some more for starting.

    Args:
        seconds: length of each measurement.
        aircraft: sizes of formations.

    Raises:
        VfguideError: the broker or one of the programs does not do its part.
    """

    async def run(directory: Path) -> dict[str, Any]:
        before = load()
        async with broker(directory) as (name, port):
            rows = [
                row
                for count in aircraft
                for row in await measure(f"mqtt://127.0.0.1:{port}", count, seconds, directory)
            ]
        return {
            "seconds": seconds,
            "broker": name,
            "load_before": before,
            "load_after": load(),
            "rows": rows,
        }

    with tempfile.TemporaryDirectory() as scratch:
        return asyncio.run(run(Path(scratch)))


def render_trust_cost(result: dict[str, Any]) -> str:
    """The result as a plain table."""
    rows = [
        [
            "aircraft",
            "messages",
            "leader's age p50 ms",
            "p99 ms",
            "others' p50 ms",
            "p99 ms",
            "states/s",
            "core %",
            "µs/state",
            "bytes",
        ]
    ]
    rows += [
        [
            str(row["aircraft"]),
            row["messages"],
            *(shown(row["leader_age"].get(key)) for key in ("p50_ms", "p99_ms")),
            *(shown(row["neighbours_age"].get(key)) for key in ("p50_ms", "p99_ms")),
            *(shown(row[key]) for key in ("states_per_s", "cpu_percent", "cpu_us_per_state")),
            str(row["state_bytes"]),
        ]
        for row in result["rows"]
    ]
    before = " ".join(f"{one:.2f}" for one in result["load_before"])
    heading = f"{result['seconds']:g} s each, broker {result['broker']}, load before {before}"
    return "\n".join([heading, "", *aligned(rows)])


def main() -> None:
    """Entry point of one of the processes."""
    part, link, mode, count, seconds, file, keys = sys.argv[1:]
    if part == "talk":
        asyncio.run(talk(link, mode, int(count), float(seconds), Path(keys)))
        return
    found = asyncio.run(listen(link, mode, int(count), float(seconds), Path(keys)))
    Path(file).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
