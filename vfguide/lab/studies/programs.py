"""The programs under test, and how they are started and ended."""

import asyncio
import os
import shutil
import socket
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.processes import PATIENCE_S, free_port
from vfguide.link.broker import embedded_broker

OUTSIDE_PATH = "/usr/sbin"
"""Where Debian keeps daemons, and users' search paths do not look."""

LISTENING_S = 10.0
"""s that a broker gets until it listens."""

MOSQUITTO_SETTINGS = """\
listener {port} 127.0.0.1
allow_anonymous true
set_tcp_nodelay true
persistence false
user root
"""


@asynccontextmanager
async def program(
    command: Sequence[str], log: Path, environment: Mapping[str, str] | None = None
) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run a program for as long as the context lasts; what it says goes to a file."""
    with log.open("ab") as output:
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            env={**os.environ, "PYTHONUNBUFFERED": "1", **(environment or {})},
            start_new_session=True,
        )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.terminate()
        try:
            async with asyncio.timeout(PATIENCE_S):
                await process.wait()
        except TimeoutError:
            process.kill()
            await process.wait()


def last_words(log: Path) -> str:
    """The last line that a program wrote."""
    lines = log.read_text(errors="replace").strip().splitlines()
    return lines[-1] if lines else "it says nothing"


@asynccontextmanager
async def broker(directory: Path) -> AsyncIterator[tuple[str, int]]:
    """Run a broker: mosquitto if there is one, the embedded one else.

    Yields:
        Its name and port.

    Raises:
        VfguideError: it does not listen.
    """
    mosquitto = shutil.which("mosquitto") or shutil.which("mosquitto", path=OUTSIDE_PATH)
    if mosquitto is None:
        async with embedded_broker() as port:
            yield "amqtt, embedded", port
        return
    port = free_port(socket.SOCK_STREAM)
    settings, log = directory / "mosquitto.conf", directory / "mosquitto.log"
    settings.write_text(MOSQUITTO_SETTINGS.format(port=port), encoding="utf-8")
    async with program([mosquitto, "-c", str(settings)], log):
        await listening(port, log)
        yield "mosquitto", port


async def listening(port: int, log: Path) -> None:
    """Wait until a program listens at a port of the loopback interface.

    Raises:
        VfguideError: nobody does.
    """
    try:
        async with asyncio.timeout(LISTENING_S):
            while True:
                with suppress(OSError):
                    _, writer = await asyncio.open_connection("127.0.0.1", port)
                    writer.close()
                    await writer.wait_closed()
                    return
                await asyncio.sleep(0.02)
    except TimeoutError:
        raise VfguideError(f"the broker does not listen: {last_words(log)}") from None
