"""Frames to send, somewhere to receive, and ports that nobody uses."""

import asyncio
import gc
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from random import Random

import pytest

from tests.kit.sockets import until
from vfguide.mavlink.address import parse_address
from vfguide.mavlink.connection import Connection, open_connection


class Inbox:
    """What a connection has handed on."""

    def __init__(self) -> None:
        self.datagrams: list[bytes] = []

    def receive(self, datagram: bytes) -> None:
        self.datagrams.append(datagram)

    @property
    def content(self) -> bytes:
        return b"".join(self.datagrams)

    async def ends_with(self, expected: bytes) -> None:
        """Wait until the last that has come is this."""
        await until(lambda: self.content.endswith(expected))

    async def holds(self, *expected: bytes) -> None:
        """Wait until exactly these frames have come."""
        await until(lambda: self.content == b"".join(expected))


Opened = AbstractAsyncContextManager[tuple[Connection, Inbox]]


@pytest.fixture(scope="session")
def opened() -> Callable[[str], Opened]:
    """Opens a connection with an inbox, and sees that nothing is left of it."""

    @asynccontextmanager
    async def make(address: str) -> AsyncIterator[tuple[Connection, Inbox]]:
        inbox, before = Inbox(), asyncio.all_tasks()
        async with open_connection(parse_address(address), inbox.receive, random=Random(1)) as made:
            yield made, inbox
        # Tasks that the test itself has started in the meantime have names of their own.
        left = [task for task in asyncio.all_tasks() - before if "MAVLink" in task.get_name()]
        assert not left
        assert not made.connected

    return make


@pytest.fixture
def voice() -> Iterator[Callable[[], socket.socket]]:
    """A UDP socket that does not block, as a simple peer."""
    made: list[socket.socket] = []

    def make(port: int = 0) -> socket.socket:
        one = socket.socket(type=socket.SOCK_DGRAM)
        made.append(one)
        one.bind(("127.0.0.1", port))
        one.settimeout(0.0)
        return one

    yield make
    for one in made:
        one.close()


@pytest.fixture(scope="session")
def nothing_old_is_looked_at() -> Iterator[None]:
    """Spare the collector what the tests of other places have left: there is much of it."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture(autouse=True)
def nothing_is_left_open(nothing_old_is_looked_at: None) -> Iterator[None]:
    """Whatever was not closed warns now, in the test that forgot it."""
    del nothing_old_is_looked_at
    yield
    gc.collect()
