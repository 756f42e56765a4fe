"""MAVSDK as the channel of a connection, between the emulator with PX4's manners and a companion's codec."""

import asyncio
import os
import socket
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from random import Random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import vfguide.mavlink.mavsdk
from tests.kit.sockets import PATIENCE_S, free_port, until
from tests.kit.terminal import Plug
from tests.kit.wire import framed
from vfguide.errors import InputError
from vfguide.mavlink.adapter import AutopilotSetpoint, Vehicle
from vfguide.mavlink.address import parse_address
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.connection import open_connection
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.reports import CommandReport, Report

VEHICLE = Vehicle(
    system_id=3,
    component_id=1,
    hold="heading-hold",
    lateral_acceleration=9.8,
    px4_steering="guided-course",
)

SETPOINT = AutopilotSetpoint(
    course=1.0, speed=22.0, altitude_amsl=588.0, latitude_deg=47.4, longitude_deg=8.5
)


async def test_answers_to_what_mavsdk_has_passed_on_are_answers_to_the_companion(emulate):
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
            # As they are: MAVSDK has no call for Guided Course.
            made.send(codec.encode(plane.engage()))
            await emulation.until(lambda state: state["mode"] == "AUTO.COURSE")
            made.send(codec.encode(plane.fly(SETPOINT)))
            await until(lambda: answered(43_002) and answered(178))
            await emulation.until(lambda state: abs(state["course_rad"] - 1.0) < 0.01)
            made.send(codec.encode(plane.hand_back()))  # by MAVSDK's own call
            await emulation.until(lambda state: state["mode"] == "AUTO.LOITER")
            await until(lambda: answered(176))


@asynccontextmanager
async def beating(plug: Plug) -> AsyncIterator[None]:
    """A serial port with an autopilot, as long as the context lasts: a heartbeat ten times a second."""

    async def beat() -> None:
        heartbeat = mavlink.MAVLink_heartbeat_message(1, 12, 129, 0, 4, 3)
        while True:
            os.write(plug.near, framed(heartbeat, system_id=3))
            await asyncio.sleep(0.1)

    plug.put_in()
    task = asyncio.create_task(beat())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])
        plug.pull_out()


async def test_a_serial_port_that_comes_late_and_is_unplugged_is_opened_again(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(vfguide.mavlink.mavsdk, "DEAF_S", 1.0)
    heard: list[bytes] = []
    plug = Plug(tmp_path / "tty")
    address = parse_address(plug.address)
    async with open_connection(address, heard.append, random=Random(1), by_mavsdk=True) as made:
        assert not made.connected
        await until(lambda: made.counters["tries"] >= 3)
        for _ in range(2):
            heard.clear()
            async with beating(plug):
                await until(lambda: made.connected and heard)
            await until(lambda: not made.connected)


async def test_a_port_that_another_program_has_is_told_before_anything_flies():
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        address = parse_address(f"udpin://127.0.0.1:{other.getsockname()[1]}")
        with pytest.raises(InputError, match="BIND_ERROR"):
            async with open_connection(address, print, random=Random(1), by_mavsdk=True):
                pytest.fail("it was opened")


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


def test_it_can_be_stopped_while_no_autopilot_is_found():
    # In a process of its own: what could go wrong ends it by SIGABRT or SIGSEGV.
    address = f"udpin://127.0.0.1:{free_port()}"
    command = [sys.executable, "-c", STOPPED_WHILE_SEARCHING, address]
    ended = subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE_S)
    assert ended.returncode == 0, ended.stderr.decode()
