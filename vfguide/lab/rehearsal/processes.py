"""Programs that a live flight starts and ends, and what they take of the computer.

The broker is a process of its own, which nobody else's work keeps waiting.
"""

import asyncio
import ctypes
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

from vfguide.errors import VfguideError
from vfguide.extras import require
from vfguide.record.latency import Usage

PROGRAM = "vfguide.link.broker"
"""What runs as the broker."""

PATIENCE_S = 10.0
"""Real time that a process gets to end cleanly before it is killed."""

PR_SET_PDEATHSIG = 1
"""Linux's prctl option for a signal to this process when the process that started it is gone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """What a process has taken so far."""

    at_s: float
    """When, s of the monotonic clock."""
    busy_s: float
    """Processor time, s."""
    rss_mb: float
    """Resident memory, 10^6 bytes."""

    def since(self, earlier: "Account") -> Usage:
        """What it took between the two."""
        share = (self.busy_s - earlier.busy_s) / max(self.at_s - earlier.at_s, 0.01)
        return Usage(cpu_share=round(share, 4), rss_mb=round(self.rss_mb, 1))


def account_of(pid: int) -> Account | None:
    """What a process has taken; None if it has ended."""
    try:
        process = psutil.Process(pid)
        with process.oneshot():
            times, memory = process.cpu_times(), process.memory_info()
    except psutil.Error:
        return None
    return Account(at_s=time.monotonic(), busy_s=times.user + times.system, rss_mb=memory.rss / 1e6)


def accounts_of(pids: dict[str, int]) -> dict[str, Account]:
    """What processes have taken, by name; those that have ended are left out."""
    found = {name: account_of(pid) for name, pid in pids.items()}
    return {name: account for name, account in found.items() if account is not None}


def load() -> list[float]:
    """How busy the computer is: processes that ran or wanted to, over 1, 5 and 15 minutes."""
    return [round(average, 2) for average in os.getloadavg()]


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
    require("amqtt")
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


class Process:
    """One program of a rehearsal, which can be started again."""

    def __init__(self, name: str, command: Sequence[str], log: Path) -> None:
        """Remember a program; nothing is started yet.

        Args:
            name: what it is called in messages.
            command: program and arguments.
            log: file that its output is added to.
        """
        self.name = name
        self._command = command
        self._log = log
        self._process: asyncio.subprocess.Process | None = None

    @property
    def running(self) -> bool:
        """Whether it runs now."""
        return self._process is not None and self._process.returncode is None

    @property
    def pid(self) -> int | None:
        """Number of the process; None while it does not run."""
        return self._process.pid if self._process is not None and self.running else None

    @property
    def exit_code(self) -> int | None:
        """How it ended; None while it runs."""
        return None if self._process is None else self._process.returncode

    async def start(self) -> None:
        """Start it, or start it again."""
        with self._log.open("ab") as output:
            self._process = await asyncio.create_subprocess_exec(
                *self._command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
                # Ctrl-C is for the rehearsal alone; it then tells its processes to stop.
                start_new_session=True,
                preexec_fn=ends_with(os.getpid()),
            )

    async def kill(self) -> None:
        """End it as `kill -9` does."""
        if self._process is not None and self.running:
            self._process.kill()
            await self._process.wait()

    def signal(self, number: signal.Signals) -> None:
        """Send it a signal."""
        if self._process is not None and self.running:
            self._process.send_signal(number)

    async def stop(self) -> None:
        """Ask it to end, and end it if it does not."""
        self.signal(signal.SIGTERM)
        if self._process is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(PATIENCE_S):
                    await self._process.wait()
            await self.kill()

    def last_words(self) -> str:
        """The last line that it wrote."""
        lines = self._log.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""


def ends_with(parent: int) -> Callable[[], None] | None:
    """What a child runs before its program, to be told to stop when its parent is gone, even by `kill -9`.

    Args:
        parent: number of the process that starts it.
    """
    if sys.platform != "linux":
        return None
    prctl = ctypes.CDLL(None).prctl

    def ask() -> None:
        prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:
            # It was gone before this was asked for.
            os._exit(1)

    return ask


def python_module(module: str, *arguments: str) -> list[str]:
    """A command that runs a module of this installation."""
    return [sys.executable, "-m", module, *arguments]


def free_port(kind: socket.SocketKind) -> int:
    """A port of the loopback interface that nobody uses at the moment."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
