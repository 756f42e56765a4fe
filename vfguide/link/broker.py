"""A broker inside this program, or beside it, so that a first flight needs no other.

As a program of its own it tells its port, and runs until its standard input ends. So it shares no
processor with the program that starts it, and never outlives it. Run with `python -m
vfguide.link.broker`.
"""

import asyncio
import importlib
import logging
import signal
import sys
from collections import UserDict
from collections.abc import AsyncIterator, ItemsView, Iterator
from contextlib import asynccontextmanager, suppress

from vfguide.errors import VfguideError

HOST = "127.0.0.1"
"""Everybody is let in, hence nobody from other computers."""

QUIET = ("amqtt", "transitions")
"""Loggers that tell of every message."""

LISTENER = "default"

CLOSING_S = 3.0
"""s that connections get to end."""

logger = logging.getLogger(__name__)


@asynccontextmanager
async def embedded_broker(port: int = 0) -> AsyncIterator[int]:
    """Run a broker on this computer's loopback interface, for as long as the context lasts.

    Args:
        port: where it listens; 0 for any that is free.

    Yields:
        Its port.

    Raises:
        VfguideError: it cannot listen there.
    """
    broker = Broker()
    await broker.start()
    try:
        server = await asyncio.start_server(broker.serve, HOST, port)
    except OSError as error:
        await broker.stop()
        raise VfguideError(f"embedded broker: port {port}: {error.strerror}") from None
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        await broker.stop()
        await server.wait_closed()


class Subscriptions(UserDict[str, list[object]]):
    """What amqtt keeps its subscriptions in.

    While it goes through them it awaits other things. A plain dictionary fails if it has grown meanwhile,
    and the connection of a client that comes at the same time as another is gone.
    """

    def __iter__(self) -> Iterator[str]:
        return iter(list(self.data))

    def items(self) -> ItemsView[str, list[object]]:
        """As they are at this moment."""
        return dict(self.data).items()


class Broker:
    """The broker of amqtt with connections from elsewhere: its own listeners do not tell their ports."""

    def __init__(self) -> None:
        # Takes a third of a second to load, which only those who need it should wait for.
        amqtt = importlib.import_module("amqtt.broker")
        self._adapters = importlib.import_module("amqtt.adapters")
        for name in QUIET:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        plugins = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
        listeners = {LISTENER: {"type": "external", "bind": "unused:0"}}
        self._broker = amqtt.Broker({"listeners": listeners, "plugins": plugins})
        vars(self._broker)["_subscriptions"] = Subscriptions()
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    async def start(self) -> None:
        """Be ready for connections."""
        await self._broker.start()

    def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve a connection until it ends. Its socket sends without delay: asyncio sees to that."""
        task = asyncio.get_running_loop().create_task(self._serve(reader, writer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def stop(self) -> None:
        """End every connection."""
        # What shutting down leaves of a connection in the middle of something is cut off below.
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSING_S):
                await self._broker.shutdown()
        for writer in self._writers:
            writer.transport.abort()
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=CLOSING_S)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        try:
            await self._broker.external_connected(
                self._adapters.StreamReaderAdapter(reader),
                self._adapters.StreamWriterAdapter(writer),
                LISTENER,
            )
        except Exception:
            # Whatever one client sends, the others stay.
            logger.exception("embedded broker: a connection has failed")
        finally:
            self._writers.discard(writer)
            writer.transport.abort()


async def serve() -> None:
    """Run a broker until the program that started it is gone."""
    async with embedded_broker() as port:
        sys.stdout.write(f"{port}\n")
        sys.stdout.flush()
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(None, sys.stdin.buffer.read)


if __name__ == "__main__":
    # Ctrl-C is for the rehearsal alone.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asyncio.run(serve())
