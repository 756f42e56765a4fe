"""Other people's programs, as they are, against the emulator as a process."""

import asyncio
import json
import os
import subprocess
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from tests.kit.programs import running
from tests.kit.sockets import PATIENCE_S, free_port
from tests.wheels import PIP

MAVPROXY = "1.8.75"


HOME = Path(__file__).parents[3] / f".mavproxy-{MAVPROXY}"


@pytest.fixture(scope="session")
def mavproxy() -> Path:
    """The MAVProxy program, installed on first use, without 200 MB for maps that nobody looks at here."""
    program = HOME / "bin" / "mavproxy.py"
    if not program.exists():
        # Another process may be at it too: whoever is the first to have it whole puts it there.
        with TemporaryDirectory(dir=HOME.parent, prefix=HOME.name) as made:
            install = (*PIP, "install", "--no-deps", "--no-compile")
            finished = subprocess.run(
                (*install, "--target", f"{made}/home", f"MAVProxy=={MAVPROXY}"),
                capture_output=True,
                text=True,
                check=False,
            )
            if finished.returncode != 0:
                said = finished.stderr.strip().splitlines()[-1:]
                # Without a package registry there is no MAVProxy; where tests are judged, there has to be.
                if os.environ.get("CI"):
                    pytest.fail(f"MAVProxy cannot be installed: {said}")
                pytest.skip(f"MAVProxy cannot be installed: {said}")
            with suppress(OSError):
                Path(made, "home").rename(HOME)
    return program


@dataclass(frozen=True, slots=True)
class Emulation:
    """A running emulator."""

    port: int
    truth: Path

    def latest(self) -> dict[str, Any]:
        """The true state now."""
        with self.truth.open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - 4096))
            line = file.read().splitlines(keepends=True)[-2]
        state: dict[str, Any] = json.loads(line)
        return state

    async def until(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first true state from now on, seen some times a second, of which something holds."""
        state: dict[str, Any] = {}
        try:
            async with asyncio.timeout(PATIENCE_S):
                while True:
                    state = self.latest()
                    if holds(state):
                        return state
                    await asyncio.sleep(0.05)
        except TimeoutError:
            pytest.fail(f"it has not come to that, but to: {state}")


Emulate = Callable[..., AbstractAsyncContextManager[Emulation]]


@pytest.fixture
def emulate(tmp_path: Path) -> Emulate:
    """Runs `sitl-stub` with some options, speaking to a free port, as long as its context lasts."""

    @asynccontextmanager
    async def emulated(*options: str, port: int | None = None) -> AsyncIterator[Emulation]:
        emulation = Emulation(port or free_port(), tmp_path / "truth.jsonl")
        options = ("--mavlink", f"udpout://127.0.0.1:{emulation.port}", *options)
        told = ("--system-id", 1, "--truth", emulation.truth, *options)
        async with running("sitl_stub.cli", *told, stderr=asyncio.subprocess.DEVNULL) as process:
            yield emulation
            assert process.returncode is None

    return emulated
