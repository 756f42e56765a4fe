"""Programs beside a test: run to their end, or for as long as a context lasts."""

import asyncio
import multiprocessing
import os
import runpy
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.kit.sockets import free_port

BASIS = """\
allow_anonymous true
set_tcp_nodelay true
user root
persistence false
"""
"""Of a broker that lets everybody in."""

PATIENCE_S = 900.0
"""For a program that hangs; no test waits for it."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a program ended."""

    status: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        return self.err.splitlines()


@asynccontextmanager
async def running(
    module: str, *words: object, **options: Any
) -> AsyncIterator[asyncio.subprocess.Process]:
    """A module of Python as a program, ended by SIGTERM with the context if it has not ended by then."""
    command = (sys.executable, "-m", module, *map(str, words))
    process = await asyncio.create_subprocess_exec(*command, **options)
    try:
        yield process
    finally:
        if process.returncode is None:
            process.terminate()
        with suppress(TimeoutError):
            await asyncio.wait_for(process.communicate(), 60.0)
        if process.returncode is None:
            process.kill()
            await process.communicate()


async def vfguide(*words: object, **options: Any) -> Outcome:
    """Run a command to its end, which leaves no traceback."""
    pipes = {"stdout": asyncio.subprocess.PIPE, "stderr": asyncio.subprocess.PIPE} | options
    async with running("vfguide", *words, **pipes) as process, asyncio.timeout(PATIENCE_S):
        out, err = ((said or b"").decode() for said in await process.communicate())
    assert "Traceback" not in err, err
    assert process.returncode is not None
    return Outcome(process.returncode, out, err)


def elsewhere(
    python: Path, directory: Path, *words: object, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a Python that has vfguide from its wheel in a directory, as its users do, to its end."""
    own = {key: value for key, value in os.environ.items() if key != "VFGUIDE_PLUGINS"}
    return subprocess.run(
        [python, *map(str, words)],
        cwd=directory,
        env=own | environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


LOADED = multiprocessing.get_context("forkserver")
"""Starts processes that have the command line loaded already, which takes a second."""
LOADED.set_forkserver_preload(["vfguide.commands.check", "vfguide.commands.fly", "sitl_stub.cli"])


def loaded(directory: Path, module: str, *words: object) -> subprocess.CompletedProcess[str]:
    """Run a module of these sources in a directory as `python -m` does, to its end; on one processor."""
    said = [directory.parent / f"{directory.name}.{name}" for name in ("out", "err")]
    arguments = [module, *map(str, words)]
    process = LOADED.Process(target=_run_module, args=(directory, arguments, said))
    process.start()
    process.join(PATIENCE_S)
    assert process.exitcode is not None
    out, err = (one.read_text(encoding="utf-8") for one in said)
    return subprocess.CompletedProcess(arguments, process.exitcode, out, err)


def _run_module(directory: Path, arguments: list[str], said: list[Path]) -> None:
    for number, place in enumerate(said, 1):
        with place.open("wb") as file:
            os.dup2(file.fileno(), number)
    os.chdir(directory)
    os.environ.pop("VFGUIDE_PLUGINS", None)
    os.cpu_count = lambda: 1
    sys.path.insert(0, str(directory))
    sys.argv = arguments
    runpy.run_module(arguments[0], run_name="__main__", alter_sys=True)


class Mosquitto:
    """A real broker on a port of its own."""

    def __init__(
        self, program: str, directory: Path, settings: str = "", basis: str = BASIS
    ) -> None:
        self._program = program
        self.port = free_port()
        self._directory = directory / f"broker-{self.port}"
        self._directory.mkdir()
        self._log = self._directory / "log"
        config = f"listener {self.port} 127.0.0.1\n{basis}{settings}"
        (self._directory / "mosquitto.conf").write_text(config)
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"mqtt://127.0.0.1:{self.port}"

    def start(self) -> None:
        with self._log.open("ab") as log:
            command = (self._program, "-c", "mosquitto.conf")
            self._process = subprocess.Popen(
                command, cwd=self._directory, stdout=log, stderr=log, start_new_session=True
            )
        end = time.monotonic() + PATIENCE_S
        while not self._listens():
            assert self._process.poll() is None, self._log.read_text()
            assert time.monotonic() < end, "mosquitto does not listen"
            time.sleep(0.01)

    def _listens(self) -> bool:
        try:
            socket.create_connection(("127.0.0.1", self.port), 1.0).close()
        except OSError:
            return False
        return True

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def freeze(self) -> None:
        """Hang: connections stand, nothing is read and nothing answered."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        assert self._process is not None
        self._process.send_signal(signal.SIGCONT)


@contextmanager
def brokers(program: str, directory: Path) -> Iterator[Callable[..., Mosquitto]]:
    """Starts brokers, with lines of configuration to add; kills them at the end."""
    started: list[Mosquitto] = []

    def make(settings: str = "", **options: str) -> Mosquitto:
        broker = Mosquitto(program, directory, settings, **options)
        started.append(broker)
        broker.start()
        return broker

    try:
        yield make
    finally:
        for broker in started:
            broker.kill()
