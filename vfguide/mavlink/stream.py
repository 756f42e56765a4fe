"""Streams of MAVLink bytes over TCP and serial ports: whole frames, reconnected for ever.

A stream has no boundaries and may begin anywhere. No more bytes wait in it than are fresh.

A byte that looks like a beginning counts only once the checksum proves the frame. Messages outside this
message set cannot be proved, and are left out: nobody here uses them.

Certainty costs waiting. In step, what looks like the next frame is awaited until it is whole. If its length
was damaged on the way, up to 280 bytes are held back until the checksum tells, and then delivered late but
complete. Out of step, a proved frame inside what looks like a longer one is delivered at once. In step that
would be wrong: a log downloaded over MAVLink contains old frames.
"""

import asyncio
import selectors
import termios
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from serial_asyncio_fast import create_serial_connection

from vfguide.mavlink.address import NetworkAddress, SerialAddress, Status, reason_of
from vfguide.mavlink.framing import (
    CHECKSUM,
    HEADER_1,
    HEADER_2,
    MAGIC_1,
    MAGIC_2,
    SIGNATURE,
    SIGNED,
    checksum_of,
    end_of_frame,
    frame_at,
    holds_whole_frames,
    next_magic,
)
from vfguide.system import URGENT_TCP, SocketSelector

LARGEST_FRAME = HEADER_2 + 255 + CHECKSUM + SIGNATURE
"""Maximum size of a frame, bytes."""

SLICE = 4096 - LARGEST_FRAME
"""Bytes cut at a time, so that the buffer stays below 4096 however much arrives at once."""

LARGEST_BACKLOG = 2048
"""Maximum backlog for a slow peer, bytes. More would only age the setpoints: at 57600 baud this is 0.36 s."""

LONGEST_DIAL = 5.0
"""Timeout of one attempt, s: a host that is switched off never answers."""


class FrameVerdict(Enum):
    """Verdict on the bytes at a place; the values are names of counters."""

    NONE = "out of step"
    """No frame begins here."""
    PARTIAL = "partial"
    """A frame may begin here, and is not whole yet."""
    UNKNOWN = "unknown message"
    """Possibly a frame, of a message outside this message set."""
    PROVED = "proved"
    """A frame with a valid checksum."""


class StreamFramer:
    """Splitter of one stream into frames, which regains step after noise."""

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        """Numbers of losses of step by reason, and of bytes left out."""
        self._buffer = b""
        self._in_step = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; return the frames that they complete, in order."""
        frames: list[bytes] = []
        for start in range(0, len(data), SLICE):
            self._buffer += data[start : start + SLICE]
            frames += self._cut()
        return frames

    def _cut(self) -> list[bytes]:
        """Return all frames that are certain; less than one frame's length stays in the buffer."""
        buffer, size = self._buffer, len(self._buffer)
        frames: list[bytes] = []
        done = place = 0
        waiting: int | None = None
        while place < size:
            verdict, end = judge(buffer, place)
            if verdict is FrameVerdict.PROVED:
                frames.append(buffer[place:end])
                self.counters["bytes left out"] += place - done
                done = place = end
                self._in_step, waiting = True, None
                continue
            if verdict is FrameVerdict.PARTIAL:
                waiting = place if waiting is None else waiting
                if self._in_step:
                    break
            elif self._in_step:
                self._in_step = False
                self.counters[verdict.value] += 1
            place = next_magic(buffer, place + 1)
        kept = size if waiting is None else waiting
        self.counters["bytes left out"] += kept - done
        self._buffer = buffer[kept:]
        return frames


class DatagramFramer:
    """Assembler of one sender's frames, however its datagrams cut them."""

    def __init__(self, counters: Counter[str]) -> None:
        """Create it; the connection's counters count bytes outside frames."""
        self._counters = counters
        self._framer = StreamFramer()
        self._cuts = False

    def feed(self, datagram: bytes) -> bytes:
        """Take the next datagram, and return the frames that it completes."""
        # A datagram that begins with a frame continues none: earlier incomplete bytes are dropped.
        if holds_whole_frames(datagram) and not (self._cuts and not begins_frame(datagram)):
            if self._cuts:
                self._framer, self._cuts = StreamFramer(), False
            return datagram
        self._cuts = True
        before = self._framer.counters.copy()
        frames = self._framer.feed(datagram)
        self._counters.update(self._framer.counters - before)
        return b"".join(frames)


def begins_frame(datagram: bytes) -> bool:
    """Check whether a datagram begins with a frame whose checksum is right."""
    return judge(datagram, 0)[0] is FrameVerdict.PROVED


def judge(buffer: bytes, start: int) -> tuple[FrameVerdict, int]:
    """Return what begins at a place, and the end of a whole frame."""
    magic, available = buffer[start], len(buffer) - start
    if magic not in {MAGIC_1, MAGIC_2}:
        return FrameVerdict.NONE, start
    if available < (HEADER_1 if magic == MAGIC_1 else HEADER_2):
        return FrameVerdict.PARTIAL, start
    end = end_of_frame(buffer, start)
    if end is None:
        return FrameVerdict.NONE, start
    if end > len(buffer):
        return FrameVerdict.PARTIAL, start
    return verdict_of_checksum(buffer, start, end), end


def verdict_of_checksum(buffer: bytes, start: int, end: int) -> FrameVerdict:
    """Verify the checksum of what looks like a whole frame."""
    kind = mavlink.mavlink_map.get(frame_at(buffer, start, end).message_id)
    if kind is None:
        return FrameVerdict.UNKNOWN
    signed = buffer[start] == MAGIC_2 and buffer[start + 2] & SIGNED
    behind = end - (SIGNATURE if signed else 0)
    checksum = checksum_of(buffer[start + 1 : behind - CHECKSUM], kind)
    right = buffer[behind - CHECKSUM : behind] == checksum
    return FrameVerdict.PROVED if right else FrameVerdict.NONE


class StreamPeer(asyncio.Protocol):
    """Peer of a stream, from its connection to its loss."""

    def __init__(self, receive: Callable[[bytes], None], counters: Counter[str]) -> None:
        """Create a peer that is not connected yet.

        Args:
            receive: called with all frames that arrived together, as one datagram.
            counters: counters of the connection, also for dropped datagrams.
        """
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        """Reason of the loss, once it is lost."""
        self.heard = False
        """Whether it has sent a frame."""
        self._receive = receive
        self._counters = counters
        self._framer = StreamFramer()
        self._transport: asyncio.Transport | None = None
        self._room = SocketSelector()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport of a socket or a serial port."""
        if isinstance(transport, asyncio.Transport):
            self._transport = transport
            self._room.register(file_number(transport), selectors.EVENT_WRITE)

    def data_received(self, data: bytes) -> None:
        """Hand on the frames that these bytes complete, at once."""
        before = self._framer.counters.copy()
        frames = self._framer.feed(data)
        self._counters.update(self._framer.counters - before)
        if frames:
            self.heard = True
            self._receive(b"".join(frames))

    def connection_lost(self, exc: Exception | None) -> None:
        """Note that the peer is gone and the transport closed."""
        self._transport = None
        if not self.lost.done():
            self.lost.set_result(reason_of(exc) if exc else "closed by the peer")

    def send(self, datagram: bytes) -> None:
        """Send a datagram, or drop it while the peer is slow."""
        if self._transport is None or self._transport.is_closing():
            self._counters["dropped: not connected"] += 1
        elif self._is_full(self._transport, len(datagram)):
            self._counters["dropped: slow peer"] += 1
        else:
            self._transport.write(datagram)

    async def close(self) -> None:
        """Close at once, and drop what waits."""
        self.abort()
        if self._transport is not None:
            await asyncio.shield(self.lost)

    def abort(self) -> None:
        """Begin to close at once, and drop what waits."""
        transport = self._transport
        # A serial port that is closing goes on sending what waits, perhaps for ever.
        if transport and not (transport.is_closing() and not transport.get_write_buffer_size()):
            discard_output(transport)
            transport.abort()

    def _is_full(self, transport: asyncio.Transport, size: int) -> bool:
        """Check whether so many more bytes have no room."""
        backlog = transport.get_write_buffer_size()
        if backlog:
            return backlog + size > LARGEST_BACKLOG
        # With nothing waiting the transport writes at once, and pyserial blocks in a write to a port that
        # takes nothing.
        return not self._room.select(0)


def file_number(transport: asyncio.Transport) -> int:
    """Return the file number of the socket or the serial port."""
    medium = transport.get_extra_info("socket") or transport.get_extra_info("serial")
    return int(medium.fileno())


def discard_output(transport: asyncio.Transport) -> None:
    """Discard the kernel's output for a serial port: closing would wait for it, up to 30 s."""
    port = transport.get_extra_info("serial")
    if port is not None:
        with suppress(OSError, termios.error):
            port.reset_output_buffer()


Dial = Callable[[StreamPeer], Awaitable[str]]
"""Function that connects a peer and returns its description; raises OSError or ValueError on failure."""


class ReconnectingStream:
    """Channel to one peer, which `connection.running` reconnects whenever it is lost."""

    def __init__(self, dial: Dial, receive: Callable[[bytes], None], status: Status) -> None:
        self._dial = dial
        self._receive = receive
        self._status = status
        self._peer: StreamPeer | None = None

    def send(self, datagram: bytes) -> None:
        """Send to the peer, if there is one."""
        if self._peer is None:
            self._status.counters["dropped: not connected"] += 1
        else:
            self._peer.send(datagram)

    async def visit(self) -> tuple[str, bool]:
        """Hold one connection until it is lost; return the reason, and whether the peer has sent a frame."""
        self._status.counters["tries"] += 1
        peer = StreamPeer(self._receive, self._status.counters)
        try:
            async with asyncio.timeout(LONGEST_DIAL):
                name = await self._dial(peer)
            self._peer = peer
            self._status.up(name)
            reason = await asyncio.shield(peer.lost)
        except TimeoutError:
            reason = "no answer"
        except (OSError, ValueError) as error:
            reason = reason_of(error)
        finally:
            self._peer = None
            await peer.close()
        return reason, peer.heard


def dial_tcp(address: NetworkAddress) -> Dial:
    """Return a function that calls this address."""

    async def dial(peer: StreamPeer) -> str:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_connection(lambda: peer, address.host, address.port)
        tune(transport)
        return f"called {name_of(transport)}"

    return dial


def tune(transport: asyncio.BaseTransport) -> None:
    """Configure a connection for small, urgent messages."""
    peer = transport.get_extra_info("socket")
    # A peer that is already gone refuses settings; its loss is reported in a moment.
    with suppress(OSError):
        for option in URGENT_TCP:
            peer.setsockopt(*option)


def name_of(transport: asyncio.BaseTransport) -> str:
    """Return the name of the peer, for people."""
    name = transport.get_extra_info("peername")
    return f"{name[0]} port {name[1]}" if name else "a peer that is gone"


class Caller(StreamPeer):
    """Peer that has called, and may be turned away."""

    def __init__(self, server: "TcpServer") -> None:
        super().__init__(server.receive, server.status.counters)
        self._server = server

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Become the peer, or be closed."""
        super().connection_made(transport)
        tune(transport)
        self._server.arrived(self, name_of(transport))

    def connection_lost(self, exc: Exception | None) -> None:
        """Make room for the next caller."""
        super().connection_lost(exc)
        self._server.left(self)


class TcpServer:
    """Server that talks to one peer at a time.

    Further callers are closed at once, so that a stray program cannot take the setpoints away. A peer is gone
    when it closes, or acknowledges nothing for 5 s.
    """

    def __init__(self, receive: Callable[[bytes], None], status: Status) -> None:
        self.receive = receive
        self.status = status
        self._peer: Caller | None = None
        self._callers: set[Caller] = set()

    def send(self, datagram: bytes) -> None:
        """Send to the peer, if there is one."""
        if self._peer is None:
            self.status.counters["dropped: not connected"] += 1
        else:
            self._peer.send(datagram)

    def arrived(self, caller: Caller, name: str) -> None:
        """Accept a caller as the peer, or turn it away."""
        self._callers.add(caller)
        if self._peer is None:
            self._peer = caller
            self.status.up(f"called by {name}")
        else:
            self.status.counters["turned away"] += 1
            caller.abort()

    def left(self, caller: Caller) -> None:
        """Forget a caller that is gone."""
        self._callers.discard(caller)
        if self._peer is caller:
            self._peer = None
            self.status.down(caller.lost.result())

    async def close(self) -> None:
        """Close all connections, and wait until they are closed."""
        callers = list(self._callers)
        for caller in callers:
            caller.abort()
        for caller in callers:
            await caller.close()


@asynccontextmanager
async def open_tcp_server(
    address: NetworkAddress, receive: Callable[[bytes], None], status: Status
) -> AsyncIterator[TcpServer]:
    """Listen at an address; raise OSError if this computer does not allow it."""
    peers = TcpServer(receive, status)
    loop = asyncio.get_running_loop()
    # Serving is not started by the same call: cancelled on the way, that would leave the port open.
    server = await loop.create_server(
        lambda: Caller(peers), address.host, address.port, start_serving=False
    )
    try:
        await server.start_serving()
        status.down("nobody has called yet")
        yield peers
    finally:
        server.close()
        await peers.close()


def dial_serial(address: SerialAddress) -> Dial:
    """Return a function that opens this port for this process alone."""

    async def dial(peer: StreamPeer) -> str:
        loop = asyncio.get_running_loop()
        try:
            await create_serial_connection(
                loop, lambda: peer, address.device, baudrate=address.baud, exclusive=True
            )
        except termios.error as error:
            # pyserial lets this through when a port disappears while it is being opened.
            raise OSError(*error.args) from error
        return "the port is open"

    return dial
