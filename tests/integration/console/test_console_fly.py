"""`vfguide fly --live --console`, as a user starts it: the address that it prints shows all aircraft."""

import asyncio
import re
import signal
from asyncio.subprocess import PIPE, Process

from tests.integration.console.streamed import aircraft_heard, logged_in
from tests.kit.missions import shipped
from tests.kit.programs import running
from tests.kit.sockets import PATIENCE_S

PRINTED = re.compile(r"console: (http://127\.0\.0\.1:\d+/)\?token=\S+")


async def printed_address(flight: Process) -> re.Match[str]:
    """What it says of the console, among the rest."""
    assert flight.stderr is not None
    said = []
    while line := (await flight.stderr.readline()).decode():
        said.append(line)
        if found := PRINTED.search(line):
            return found
    raise AssertionError(said)


async def test_a_rehearsal_is_seen_at_the_address_that_it_prints(tmp_path):
    words = ("fly", "circle-wind", "--live", "--console")
    async with (
        running("vfguide", *words, cwd=tmp_path, stdout=PIPE, stderr=PIPE) as flight,
        asyncio.timeout(PATIENCE_S),
    ):
        found = await printed_address(flight)
        visitor = await asyncio.to_thread(logged_in, found[0].removeprefix("console: "))
        names, heard = await asyncio.to_thread(aircraft_heard, visitor, found[1])
        flight.send_signal(signal.SIGINT)
        _, said = await flight.communicate()
    status, said = flight.returncode, said.decode()
    assert heard == names == set(shipped("circle-wind").companions)
    # Stopped before its end.
    assert status == 3, said
    assert "Traceback" not in said
