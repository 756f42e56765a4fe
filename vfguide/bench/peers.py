"""Other clients of an autopilot, as a user would write them: `python -m vfguide.bench.peers KIND PORT`.

Each does what a companion does at the least: for each position report it sends one setpoint. None of them
computes anything, and none is joined to a formation.
"""

import asyncio
import socket
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from vfguide.bench.wire import has_position
from vfguide.errors import InputError

DISCOVERY_S = 30.0
"""s that an autopilot gets until it is seen."""

FIRST_MAVSDK = 4
"""Major version from which MAVSDK for Python works without a server process."""

VELOCITY_ONLY = 0b0000_1101_1100_0111
"""Type mask of SET_POSITION_TARGET_LOCAL_NED: all but the velocity is ignored."""

LONGEST_DATAGRAM = 65_536

NORTH_M_S, EAST_M_S = 15.0, 10.0
"""What they ask for; their aircraft need not like it."""

PYMAVLINK_ENVIRONMENT = {"MAVLINK20": "1"}
"""Without it mavutil speaks MAVLink 1."""


def installed_mavsdk() -> str | None:
    """Version of MAVSDK, if one that the loop below is written for is installed."""
    if find_spec("mavsdk") is None:
        return None
    try:
        found = version("mavsdk")
    except PackageNotFoundError:
        return None
    return found if int(found.partition(".")[0]) >= FIRST_MAVSDK else None


def bare_loop(port: int) -> None:
    """A socket, and bytes made beforehand: what the computer itself takes, below which no client gets."""
    mavlink = import_module("pymavlink.dialects.v20.ardupilotmega")
    numbers = (0.0, 0.0, 0.0, NORTH_M_S, EAST_M_S, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_ONLY, *numbers
    )
    setpoint = message.pack(mavlink.MAVLink(None, srcSystem=250))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", port))
        while True:
            datagram, sender = opened.recvfrom(LONGEST_DATAGRAM)
            if has_position(datagram):
                opened.sendto(setpoint, sender)


def pymavlink_loop(port: int) -> None:
    """The loop of pymavlink's examples: wait for a position, send a velocity."""
    mavutil = import_module("pymavlink.mavutil")
    connection = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=250)
    frame = mavutil.mavlink.MAV_FRAME_LOCAL_NED
    while True:
        report = connection.recv_match(type="GLOBAL_POSITION_INT", blocking=True)
        connection.mav.set_position_target_local_ned_send(
            report.time_boot_ms,
            report.get_srcSystem(),
            report.get_srcComponent(),
            frame,
            VELOCITY_ONLY,
            *(0.0, 0.0, 0.0),
            *(NORTH_M_S, EAST_M_S, 0.0),
            *(0.0, 0.0, 0.0),
            *(0.0, 0.0),
        )


async def mavsdk_loop(port: int) -> None:
    """The loop of MAVSDK's examples: for each position, a velocity for the offboard mode."""
    api = import_module("mavsdk.asyncio")
    offboard_plugin = import_module("mavsdk.asyncio.plugins.offboard")
    telemetry_plugin = import_module("mavsdk.asyncio.plugins.telemetry")
    kind = api.ComponentType.COMPANION_COMPUTER
    async with api.Mavsdk(api.Configuration.create_with_component_type(kind)) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = await mavsdk.first_autopilot(timeout_s=DISCOVERY_S)
        telemetry = telemetry_plugin.TelemetryAsync(system)
        offboard = offboard_plugin.OffboardAsync(system)
        velocity = offboard_plugin.VelocityNedYaw(NORTH_M_S, EAST_M_S, 0.0, 0.0)
        await offboard.set_velocity_ned(velocity)
        await offboard.start()
        async for _ in telemetry.subscribe_position():
            await offboard.set_velocity_ned(velocity)


def main() -> None:
    """Entry point."""
    kind, port = sys.argv[1], int(sys.argv[2])
    if kind == "bare":
        bare_loop(port)
    elif kind == "pymavlink":
        pymavlink_loop(port)
    elif kind == "mavsdk":
        asyncio.run(mavsdk_loop(port))
    else:
        raise InputError(f"no peer is called {kind!r}")


if __name__ == "__main__":
    main()
