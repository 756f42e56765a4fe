"""What an aircraft without a companion says, passed on to those who follow it, and their questions to it."""

import socket
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import command_long, packed
from vfguide.mavlink.stream import StreamFramer

ASK_S = 2.0
"""Between requests for the stream: the first may come before anybody listens."""

WAIT_S = 0.02
"""Longest wait for bytes before what is late is looked at."""


@dataclass(slots=True, kw_only=True)
class Relay:
    """A router between one autopilot's TCP port and several UDP ports of this computer."""

    source_port: int
    targets: Sequence[int]
    system_id: int
    """Of the autopilot."""
    rate_hz: float
    """Of GLOBAL_POSITION_INT."""
    late_s: float
    """How long each message is held back, both ways."""
    _ends: threading.Event = field(default_factory=threading.Event)
    _thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to pass on."""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._ends.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        framer = StreamFramer()
        said, asked = deque[tuple[float, bytes]](), deque[tuple[float, bytes]]()
        asked_s = 0.0
        udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with socket.create_connection(("127.0.0.1", self.source_port)) as tcp, udp:
            udp.bind(("127.0.0.1", 0))
            udp.settimeout(0.0)
            tcp.settimeout(WAIT_S)
            while not self._ends.is_set():
                now = time.monotonic()
                if now - asked_s > ASK_S:
                    asked_s = now
                    tcp.sendall(self._request())
                try:
                    frames = framer.feed(tcp.recv(65536))
                except TimeoutError:
                    frames = []
                said.extend((now + self.late_s, frame) for frame in frames)
                asked.extend((now + self.late_s, question) for question in received(udp))
                for data in due(asked, now):
                    tcp.sendall(data)
                for data in due(said, now):
                    for port in self.targets:
                        udp.sendto(data, ("127.0.0.1", port))

    def _request(self) -> bytes:
        """SET_MESSAGE_INTERVAL for the position."""
        number = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        wanted = (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 1e6 / self.rate_hz)
        return packed(command_long(number, *wanted, system_id=self.system_id), system_id=254)


def due(held: deque[tuple[float, bytes]], now: float) -> Iterator[bytes]:
    """Take out what has been held back long enough."""
    while held and held[0][0] <= now:
        yield held.popleft()[1]


def received(udp: socket.socket) -> list[bytes]:
    """All datagrams that wait."""
    found = []
    while True:
        try:
            found.append(udp.recv(4096))
        except (BlockingIOError, ConnectionRefusedError):
            return found
