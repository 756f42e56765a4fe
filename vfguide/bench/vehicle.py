"""The autopilot that a client under test speaks to, with a stopwatch at its socket.

Nothing stands between the two: the emulated aircraft is flown in this process, its telemetry goes out over
a socket of its own, and the kernel stamps what comes back as it arrives. When this process gets round to
reading is not in the measured time; how busy the computer is, is.
"""

import asyncio
import socket
import struct
import time
from collections import deque

import sitl_stub
from vfguide.bench.wire import has_position, has_setpoint

SO_TIMESTAMPNS = 35
"""Linux: the kernel notes when each datagram arrived, on the real-time clock. Python has no name for it."""

TIMESPEC = struct.Struct("@ll")

LONGEST_DATAGRAM = 65_536

OUTSTANDING = 50
"""Reports that may wait for an answer."""


class TimedVehicle:
    """One emulated vehicle, its client's port, and how long the client took."""

    def __init__(self, autopilot: sitl_stub.Autopilot, *, port: int, rate_hz: float) -> None:
        """Open a socket; nothing is sent yet.

        Args:
            autopilot: at simulation time zero.
            port: of this computer, where the client listens.
            rate_hz: telemetry datagrams per second.
        """
        self.responses: list[float] = []
        """From a position report out to the first setpoint back, s."""
        self.unanswered = 0
        """Position reports that no setpoint came back to."""
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
            first_s: time of the loop at which to begin.
            pace: simulation seconds for each real one; about 1.
        """
        interval_s = self._interval_s / pace
        loop = asyncio.get_running_loop()
        loop.add_reader(self._socket, self._take)
        try:
            due_s = first_s
            while True:
                await asyncio.sleep(due_s - loop.time())
                self._send()
                # A computer that stood still does not make up for it with a burst.
                due_s = max(due_s + interval_s, loop.time() - interval_s)
        finally:
            loop.remove_reader(self._socket)
            self._socket.close()

    def begin(self) -> None:
        """Forget what was measured so far: that was warming up."""
        self.responses.clear()
        self.unanswered = 0

    def _send(self) -> None:
        telemetry = self._autopilot.advance(self._steps * self._interval_s)
        self._steps += 1
        if has_position(telemetry):
            if self._answered and self._sent_ns:
                # Answers come, and none came for these.
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
                # The oldest: a client that is late by more than an interval is not made to look fast.
                self.responses.append((arrival_ns(notes) - self._sent_ns.popleft()) * 1e-9)
                self._answered = True
            answer = self._autopilot.receive(datagram)
            if answer:
                self._socket.sendto(answer, self._peer)


def arrival_ns(notes: list[tuple[int, int, bytes]]) -> int:
    """When a datagram arrived, ns of the real-time clock; now, if the kernel does not say."""
    for level, kind, data in notes:
        if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS) and len(data) >= TIMESPEC.size:
            seconds, nanoseconds = TIMESPEC.unpack_from(data)
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return time.time_ns()
