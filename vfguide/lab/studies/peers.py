"""Peers of a companion in the latency study: `python -m vfguide.lab.studies.peers KIND PORT`.

A peer is another client of an autopilot, as a user would write it. It does the least that a companion does:
it sends one setpoint per position report. It computes nothing, and belongs to no formation.

`TimedVehicle` is the autopilot of a client under test, with a stopwatch at its socket. The aircraft is
emulated in this process, its telemetry leaves through a socket of its own, and the kernel stamps arriving
datagrams. So the measured time includes the load of the computer, but not this process's delay in reading.
Datagrams are examined without parsing, so that the stopwatch is not slow itself.
"""

import asyncio
import socket
import struct
import sys
import time
from collections import deque
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

import sitl_stub
from vfguide.errors import InputError

MAGIC = 0xFD
"""First byte of a MAVLink 2 frame."""

HEADER, CHECKSUM, SIGNATURE = 10, 2, 13
"""Bytes of a frame around its payload; the signature only if the frame is signed."""

SIGNED = 0x01
"""Incompatibility flag of a signed frame."""

POSITION = 33
"""GLOBAL_POSITION_INT."""

COMMAND_INT = 75
COMMAND_AT = 28
"""Offset of the command's number in the payload."""

CHANGE_HEADING = 43002
"""MAV_CMD_GUIDED_CHANGE_HEADING, ArduPlane's steering command."""

POSITION_TARGETS = frozenset({84, 86})
"""SET_POSITION_TARGET_LOCAL_NED and SET_POSITION_TARGET_GLOBAL_INT, setpoints of other autopilots."""

SO_TIMESTAMPNS = 35
"""Linux option to stamp each datagram's arrival on the real-time clock; Python has no name for it."""

TIMESPEC = struct.Struct("@ll")

LONGEST_DATAGRAM = 65_536

OUTSTANDING = 50
"""Largest number of reports that await an answer."""

DISCOVERY_S = 30.0
"""Time that a client waits for its autopilot."""

FIRST_MAVSDK = 4
"""First major version of MAVSDK for Python that needs no server process."""

VELOCITY_ONLY = 0b0000_1101_1100_0111
"""Type mask of SET_POSITION_TARGET_LOCAL_NED that ignores all but the velocity."""

NORTH_M_S, EAST_M_S = 15.0, 10.0
"""Velocity setpoint of the peers; their aircraft need not follow it."""

PYMAVLINK_ENVIRONMENT = {"MAVLINK20": "1"}
"""Without this variable mavutil speaks MAVLink 1."""


def frames(datagram: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield id and payload of each whole MAVLink 2 frame, up to the first byte that begins none."""
    at = 0
    while at + HEADER <= len(datagram) and datagram[at] == MAGIC:
        length, flags = datagram[at + 1], datagram[at + 2]
        message_id = int.from_bytes(datagram[at + 7 : at + 10], "little")
        end = at + HEADER + length
        yield message_id, datagram[at + HEADER : end]
        at = end + CHECKSUM + (SIGNATURE if flags & SIGNED else 0)


def has_position(datagram: bytes) -> bool:
    """Check whether a datagram holds a position report, which a client answers with a setpoint."""
    return any(message_id == POSITION for message_id, _ in frames(datagram))


def has_setpoint(datagram: bytes) -> bool:
    """Check whether a datagram holds a course or velocity setpoint."""
    return any(
        message_id in POSITION_TARGETS
        or (message_id == COMMAND_INT and command_of(payload) == CHANGE_HEADING)
        for message_id, payload in frames(datagram)
    )


def command_of(payload: bytes) -> int:
    """Return the command's number in a COMMAND_INT, whose trailing zeros are not sent."""
    number: int
    (number,) = struct.unpack_from("<H", payload.ljust(COMMAND_AT + 2, b"\0"), COMMAND_AT)
    return number


class TimedVehicle:
    """Emulated vehicle that times its client."""

    def __init__(self, autopilot: sitl_stub.Autopilot, *, port: int, rate_hz: float) -> None:
        """Open a socket for the client on a local `port`; `autopilot` is at simulation time zero."""
        self.responses: list[float] = []
        """Times from a position report to the first setpoint after it, s."""
        self.unanswered = 0
        """Number of position reports without a setpoint in return."""
        self._autopilot = autopilot
        self._peer = ("127.0.0.1", port)
        self._interval_s = 1.0 / rate_hz
        self._steps = 0
        self._sent_ns: deque[int] = deque(maxlen=OUTSTANDING)
        self._answered = False
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.settimeout(0.0)
        self._socket.bind(("127.0.0.1", 0))

    async def fly(self, first_s: float, *, pace: float) -> None:
        """Send telemetry until cancelled, and obey what comes back.

        Args:
            first_s: begin, s of the loop's clock.
            pace: simulation seconds per real second, about 1.
        """
        interval_s = self._interval_s / pace
        loop = asyncio.get_running_loop()
        loop.add_reader(self._socket, self._take)
        try:
            due_s = first_s
            while True:
                await asyncio.sleep(due_s - loop.time())
                self._send()
                # After a stall of the computer no burst catches up.
                due_s = max(due_s + interval_s, loop.time() - interval_s)
        finally:
            loop.remove_reader(self._socket)
            self._socket.close()

    def begin(self) -> None:
        """Discard the measurements of warming up."""
        self.responses.clear()
        self.unanswered = 0

    def _send(self) -> None:
        telemetry = self._autopilot.advance(self._steps * self._interval_s)
        self._steps += 1
        if has_position(telemetry):
            if self._answered and self._sent_ns:
                # The client answers, but left these reports unanswered.
                self.unanswered += len(self._sent_ns)
                self._sent_ns.clear()
            self._answered = False
            self._sent_ns.append(time.time_ns())
        if telemetry:
            self._socket.sendto(telemetry, self._peer)

    def _take(self) -> None:
        while True:
            try:
                datagram, notes, _, _ = self._socket.recvmsg(
                    LONGEST_DATAGRAM, socket.CMSG_SPACE(TIMESPEC.size)
                )
            except BlockingIOError:
                return
            if has_setpoint(datagram) and self._sent_ns:
                # The oldest report counts, so that a client late by more than an interval does not look fast.
                self.responses.append((arrival_ns(notes) - self._sent_ns.popleft()) * 1e-9)
                self._answered = True
            answer = self._autopilot.receive(datagram)
            if answer:
                self._socket.sendto(answer, self._peer)


def arrival_ns(notes: list[tuple[int, int, bytes]]) -> int:
    """Return a datagram's arrival, ns of the real-time clock; now, if the kernel does not tell."""
    for level, kind, data in notes:
        if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS) and len(data) >= TIMESPEC.size:
            seconds, nanoseconds = TIMESPEC.unpack_from(data)
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return time.time_ns()


def installed_mavsdk() -> str | None:
    """Return MAVSDK's version if it is installed and `mavsdk_loop` is written for it."""
    if find_spec("mavsdk") is None:
        return None
    try:
        found = version("mavsdk")
    except PackageNotFoundError:
        return None
    return found if int(found.partition(".")[0]) >= FIRST_MAVSDK else None


def bare_loop(port: int) -> None:
    """Answer with prepared bytes on a bare socket: the computer's own delay, a lower bound for clients."""
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
    """Run the loop of pymavlink's examples: wait for a position, send a velocity."""
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
    """Run the loop of MAVSDK's examples: for each position, send a velocity in offboard mode."""
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
    """Run a peer."""
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
