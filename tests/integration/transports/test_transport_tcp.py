import asyncio
import logging
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.kit.sockets import free_port, until
from tests.kit.wire import beat
from vfguide.mavlink.stream import LARGEST_BACKLOG


class Autopilot:
    """A plain TCP server, as an autopilot in software is."""

    def __init__(self) -> None:
        self.callers: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = []

    async def take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.callers.append((reader, writer))

    @asynccontextmanager
    async def up(self, port: int) -> AsyncIterator[None]:
        server = await asyncio.start_server(self.take, "127.0.0.1", port)
        try:
            yield
        finally:
            server.close()
            for _, writer in self.callers:
                writer.transport.abort()
            self.callers.clear()


async def test_a_call_is_answered_frame_by_frame(opened):
    port, autopilot = free_port(), Autopilot()
    async with autopilot.up(port), opened(f"tcpout://127.0.0.1:{port}") as (connection, inbox):
        assert connection.connected
        await until(lambda: autopilot.callers)
        ((reader, writer),) = autopilot.callers
        connection.send(beat(9))
        assert await asyncio.wait_for(reader.readexactly(len(beat(9))), 60.0) == beat(9)
        writer.write(beat(1) + beat(2)[:5])
        await inbox.holds(beat(1))
        writer.write(beat(2)[5:] + beat(3))
        await inbox.holds(beat(1), beat(2), beat(3))


async def test_a_server_that_restarts_is_called_again(opened, caplog):
    port, autopilot = free_port(), Autopilot()
    with caplog.at_level(logging.INFO, "vfguide"):
        async with opened(f"tcpout://127.0.0.1:{port}") as (connection, inbox):
            for system_id in (1, 2):
                assert not connection.connected
                connection.send(b"lost")
                async with autopilot.up(port):
                    await until(lambda: connection.connected and autopilot.callers)
                    autopilot.callers[-1][1].write(beat(system_id))
                    await inbox.ends_with(beat(system_id))
                await until(lambda: not connection.connected)
            assert connection.counters["dropped: not connected"] == 2
    assert sum("connected, called" in record.message for record in caplog.records) == 2


async def test_half_a_frame_of_a_lost_call_does_not_spoil_the_next(opened):
    port, autopilot = free_port(), Autopilot()
    async with opened(f"tcpout://127.0.0.1:{port}") as (connection, inbox):
        async with autopilot.up(port):
            await until(lambda: connection.connected and autopilot.callers)
            autopilot.callers[0][1].write(beat(1) + beat(2)[:8])
            await inbox.holds(beat(1))
        async with autopilot.up(port):
            await until(lambda: connection.connected and autopilot.callers)
            autopilot.callers[0][1].write(beat(3))
            await inbox.holds(beat(1), beat(3))


async def test_each_change_of_state_is_logged_once_and_not_each_try(opened, caplog):
    port = free_port()
    with caplog.at_level(logging.INFO, "vfguide"):
        async with opened(f"tcpout://127.0.0.1:{port}") as (connection, _):
            await until(lambda: connection.counters["tries"] == 4)
            connection.send(b"lost")
    tried, closed = caplog.records
    assert tried.levelno == logging.WARNING
    assert vars(tried)["mavlink_address"] == f"tcpout://127.0.0.1:{port}"
    assert vars(tried)["connected"] is False
    assert vars(tried)["detail"] == "Connection refused"
    assert "see that the autopilot is on, and that --mavlink names its end" in tried.getMessage()
    assert closed.levelno == logging.INFO


async def test_a_server_speaks_to_one_caller_at_a_time(opened):
    port = free_port()
    async with opened(f"tcpin://127.0.0.1:{port}") as (connection, inbox):
        connection.send(b"nobody hears this")
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(beat(1))
        await inbox.holds(beat(1))
        late_reader, late_writer = await asyncio.open_connection("127.0.0.1", port)
        assert await asyncio.wait_for(closed(late_reader), 60.0)
        late_writer.close()
        connection.send(beat(9))
        assert await asyncio.wait_for(reader.readexactly(len(beat(9))), 60.0) == beat(9)
        assert connection.counters["turned away"] == 1
        writer.close()
        await until(lambda: not connection.connected)
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(beat(2))
        await inbox.holds(beat(1), beat(2))
        assert connection.connected
    assert await asyncio.wait_for(closed(reader), 60.0)
    writer.close()


async def closed(reader: asyncio.StreamReader) -> bool:
    """Whether nothing more comes, however that is told."""
    try:
        return await reader.read() == b""
    except ConnectionError:
        return True


@pytest.mark.parametrize("kind", ["tcpin", "tcpout"])
async def test_a_peer_that_does_not_read_is_sent_little_and_stops_nobody(opened, kind):
    port = free_port()
    with socket.socket() as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        if kind == "tcpout":
            deaf.bind(("127.0.0.1", port))
            deaf.listen()
        async with opened(f"{kind}://127.0.0.1:{port}") as (connection, _):
            if kind == "tcpin":
                deaf.settimeout(0.0)
                await asyncio.get_running_loop().sock_connect(deaf, ("127.0.0.1", port))
            await until(lambda: connection.connected)
            for _ in range(20_000):
                connection.send(bytes(100))
            sent = 20_000 - connection.counters["dropped: slow peer"]
            assert sent * 100 < 200_000 + LARGEST_BACKLOG


async def test_leaving_does_not_wait_for_a_slow_peer(opened):
    port = free_port()
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", port))
        deaf.listen()
        async with asyncio.timeout(60.0):
            async with opened(f"tcpout://127.0.0.1:{port}") as (connection, _):
                for _ in range(5_000):
                    connection.send(bytes(1000))


async def test_after_leaving_sending_is_harmless(opened):
    for kind in ("udpin", "udpout", "tcpin", "tcpout"):
        async with opened(f"{kind}://127.0.0.1:{free_port()}") as (connection, _):
            pass
        connection.send(b"late")
        assert connection.counters["dropped: not connected"] == 1
