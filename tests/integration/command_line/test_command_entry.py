"""`vfguide` before any command has begun."""

import asyncio
import signal
import sys
from importlib.metadata import version

from tests.kit.sockets import PATIENCE_S


def test_the_version_is_told(command):
    outcome = command("--version")
    assert (outcome.status, outcome.out) == (0, f"vfguide {version('vfguide')}\n")


async def test_ctrl_c_while_the_program_loads_is_no_fault():
    # Tells of each module as soon as it is loaded; pydantic comes half way.
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-X", "importtime", "-m", "vfguide", "check", "none.yaml"),
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )
    assert process.stderr is not None
    async with asyncio.timeout(PATIENCE_S):
        while b"pydantic" not in (line := await process.stderr.readline()):
            assert line, "ended before it had loaded"
        process.send_signal(signal.SIGINT)
        _, err = await process.communicate()
    status, err = process.returncode, err.decode()
    assert status == 3
    assert "Traceback" not in err
    assert "KeyboardInterrupt" not in err
