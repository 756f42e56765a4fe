"""The broker of a live rehearsal: a process of its own, which nobody else's work keeps waiting."""

import asyncio
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from vfguide.errors import VfguideError
from vfguide.rehearsal.processes import PATIENCE_S, python_module

PROGRAM = "vfguide.link.broker_program"


@asynccontextmanager
async def broker_process(log: Path) -> AsyncIterator[int]:
    """Run an embedded broker for as long as the context lasts.

    Args:
        log: file that its complaints are added to.

    Yields:
        Its port.

    Raises:
        VfguideError: it did not start.
    """
    with log.open("ab") as output:
        process = await asyncio.create_subprocess_exec(
            *python_module(PROGRAM),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=output,
            start_new_session=True,
        )
    if process.stdin is None or process.stdout is None:
        raise VfguideError("embedded broker: no way to speak to its process")
    try:
        port = (await process.stdout.readline()).strip()
        if not port.isdigit():
            raise VfguideError(f"embedded broker: it did not start; see {log}")
        yield int(port)
    finally:
        # It ends with its standard input.
        process.stdin.close()
        try:
            async with asyncio.timeout(PATIENCE_S):
                await process.wait()
        except TimeoutError:
            process.kill()
            await process.wait()
