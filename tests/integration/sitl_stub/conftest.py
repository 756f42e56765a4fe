"""Ground stations on real sockets, and an emulator served in the test's own event loop."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any, cast

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot
from sitl_stub.links import Address
from tests.kit.autopilot import new_autopilot, serve
from tests.kit.sockets import PATIENCE_S
from tests.kit.wire import command_long, packed


class Dialogue:
    """Encodes what a ground station says, and hands out what it hears, one message at a time."""

    def __init__(self) -> None:
        self._parser = mavlink.MAVLink(None)
        self._heard: asyncio.Queue[MAVLink_message] = asyncio.Queue()

    def hear(self, data: bytes) -> None:
        for message in self._parser.parse_buffer(data) or ():
            self._heard.put_nowait(message)

    async def listen(self, reader: asyncio.StreamReader) -> None:
        """Hear a stream to its end."""
        while data := await reader.read(4096):
            self.hear(data)

    def heartbeat(self) -> bytes:
        return packed(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def command(self, number: int, *parameters: float) -> bytes:
        return packed(command_long(number, *parameters, system_id=7))

    async def message(self, name: str) -> MAVLink_message:
        """The next message of a type; whatever comes before it is dropped."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                message = await self._heard.get()
                if message.get_type() == name:
                    return message

    def heard_already(self) -> list[MAVLink_message]:
        return [self._heard.get_nowait() for _ in range(self._heard.qsize())]


class UdpStation(asyncio.DatagramProtocol, Dialogue):
    def __init__(self) -> None:
        super().__init__()
        self.datagrams: list[bytes] = []
        self.emulator: tuple[Any, ...] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
        self.emulator = addr
        self.datagrams.append(data)
        self.hear(data)

    @property
    def port(self) -> int:
        return int(self.transport.get_extra_info("sockname")[1])

    def send(self, data: bytes) -> None:
        self.transport.sendto(data, self.emulator)


@pytest.fixture
def autopilot() -> Autopilot:
    """20 m/s, northbound, over 47 N 8 E."""
    return new_autopilot()


@pytest.fixture
def station() -> Callable[..., AbstractAsyncContextManager[UdpStation]]:
    """Opens a UDP socket that speaks to an emulator's address, if it is given one."""

    @asynccontextmanager
    async def opened(emulator: Address | None = None) -> AsyncIterator[UdpStation]:
        transport, station = await asyncio.get_running_loop().create_datagram_endpoint(
            UdpStation, local_addr=("127.0.0.1", 0)
        )
        if emulator is not None:
            station.emulator = (emulator.host, emulator.port)
        yield station
        transport.close()

    return opened


@pytest.fixture
def client() -> Callable[..., AbstractAsyncContextManager[asyncio.StreamWriter]]:
    """Connects to a TCP address; what comes goes to a dialogue."""

    @asynccontextmanager
    async def connected(address: Address, ground: Dialogue) -> AsyncIterator[asyncio.StreamWriter]:
        reader, writer = await asyncio.open_connection(address.host, address.port)
        listening = asyncio.create_task(ground.listen(reader))
        yield writer
        writer.close()
        await writer.wait_closed()
        await listening

    return connected


@pytest.fixture
def served(autopilot: Autopilot) -> Callable[..., AbstractAsyncContextManager[Address]]:
    """Serves the autopilot while its context lasts, which is handed the address."""

    @asynccontextmanager
    async def service(
        url: str = "udpin://127.0.0.1:0", *, speedup: float = 1.0, **options: object
    ) -> AsyncIterator[Address]:
        opened: asyncio.Future[Address] = asyncio.get_running_loop().create_future()
        task = asyncio.create_task(
            serve(autopilot, url, speedup=speedup, on_open=opened.set_result, **options)
        )
        await asyncio.wait({task, opened}, return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        yield opened.result()
        task.cancel()
        await asyncio.wait({task})
        if not task.cancelled():
            task.result()

    return service
