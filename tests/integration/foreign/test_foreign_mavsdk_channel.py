"""MAVSDK as the channel of a connection, between the emulator with PX4's manners and a companion's codec."""

import asyncio
import subprocess
import sys
from collections.abc import Callable
from random import Random
from typing import Any

from vfguide.mavlink.adapter import Vehicle
from vfguide.mavlink.address import parse_address
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.connection import open_connection
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.reports import CommandReport, Report

Emulate = Callable[..., Any]

PATIENCE_S = 60.0

VEHICLE = Vehicle(system_id=3, component_id=1, hold="heading-hold", lateral_acceleration=9.8)


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():
            await asyncio.sleep(0.02)


def test_answers_to_what_mavsdk_has_passed_on_are_answers_to_the_companion(
    emulate: Emulate,
) -> None:
    async def test() -> None:
        codec, plane = Codec(3, 1), Px4(VEHICLE)
        reports: list[Report] = []

        def take(data: bytes) -> None:
            reports.extend(codec.decode(data))

        def answered(command: int) -> bool:
            return any(isinstance(one, CommandReport) and one.command == command for one in reports)

        async with emulate("--autopilot", "px4", "--airborne", "--system-id", "3") as emulation:
            address = parse_address(f"udpin://127.0.0.1:{emulation.port}")
            async with open_connection(address, take, random=Random(1), by_mavsdk=True) as made:
                await until(lambda: made.connected)
                _, speed = plane.fly(1.0, 20.0)
                made.send(codec.encode([speed]))  # as it is
                await until(lambda: answered(178))
                made.send(codec.encode(plane.hand_back()))  # by MAVSDK's own call
                await until(lambda: answered(176))

    asyncio.run(test())


STOPPED_WHILE_SEARCHING = """
import asyncio, contextlib, sys
from random import Random
from vfguide.mavlink.address import parse_address
from vfguide.mavlink.connection import open_connection

async def begin_and_stop(address):
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(0.1):
            async with open_connection(address, print, random=Random(1), by_mavsdk=True):
                await asyncio.Event().wait()

for _ in range(20):
    asyncio.run(begin_and_stop(parse_address(sys.argv[1])))
"""


def test_it_can_be_stopped_while_no_autopilot_is_found(port: int) -> None:
    # In a process of its own: what could go wrong ends it by SIGABRT or SIGSEGV.
    command = [sys.executable, "-c", STOPPED_WHILE_SEARCHING, f"udpin://127.0.0.1:{port}"]
    ended = subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE_S)
    assert ended.returncode == 0, ended.stderr.decode()
