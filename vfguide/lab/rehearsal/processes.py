"""Programs that a live flight starts and ends, and what they take of the computer."""

import asyncio
import ctypes
import os
import shutil
import signal
import socket
import sys
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from vfguide.errors import VfguideError, import_extra
from vfguide.record.latency import Usage

MOSQUITTO = "mosquitto"

OUTSIDE_PATH = "/usr/sbin"
"""Where Debian keeps daemons, and users' search paths do not look."""

MOSQUITTO_SETTINGS = """\
listener {port} 127.0.0.1
allow_anonymous true
set_tcp_nodelay true
persistence false
user root
"""
"""A broker for this computer alone: whoever reaches it is let in."""

LISTENING_S = 10.0
"""Real time that the broker gets until it listens."""

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
    # Here, because who emulates an aircraft for a judge elsewhere needs no such library.
    psutil = import_extra("psutil")
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


class Process:
    """One program of a rehearsal, which can be started again."""

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        log: Path,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Remember a program; nothing is started yet.

        Args:
            name: what it is called in messages.
            command: program and arguments.
            log: file that its output is added to.
            environment: variables that it has besides this program's.
        """
        self.name = name
        self._command = command
        self._log = log
        self._environment = dict(environment or {})
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
                env={**os.environ, "PYTHONUNBUFFERED": "1", **self._environment},
                # Ctrl-C is for the rehearsal alone; it then tells its processes to stop.
                start_new_session=True,
                preexec_fn=ends_with(os.getpid()),
            )

    async def wait(self) -> int | None:
        """Wait until it ends, and return how it did."""
        return None if self._process is None else await self._process.wait()

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


@asynccontextmanager
async def running(process: Process) -> AsyncIterator[Process]:
    """Run a program for as long as the context lasts."""
    await process.start()
    try:
        yield process
    finally:
        await process.stop()


@asynccontextmanager
async def broker(directory: Path) -> AsyncIterator[int]:
    """Run mosquitto on the loopback interface for as long as the context lasts.

    Args:
        directory: for its settings and its log.

    Yields:
        Its port.

    Raises:
        VfguideError: it is not installed, or does not listen.
    """
    found = shutil.which(MOSQUITTO) or shutil.which(MOSQUITTO, path=OUTSIDE_PATH)
    if found is None:
        raise VfguideError(
            "mosquitto: is not installed, and a flight over MQTT needs a broker; install it (Debian:"
            " apt install mosquitto), or fly by UDP: leave --link out"
        )
    port = free_port(socket.SOCK_STREAM)
    settings = directory / "mosquitto.conf"
    settings.write_text(MOSQUITTO_SETTINGS.format(port=port), encoding="utf-8")
    process = Process(MOSQUITTO, [found, "-c", str(settings)], directory / "mosquitto.log")
    async with running(process):
        try:
            async with asyncio.timeout(LISTENING_S):
                while not await is_listening(port):
                    await asyncio.sleep(0.02)
        except TimeoutError:
            raise VfguideError(f"mosquitto does not listen: {process.last_words()}") from None
        yield port


async def is_listening(port: int) -> bool:
    """Whether a program takes connections at a port of the loopback interface."""
    try:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
    except OSError:
        return False
    writer.close()
    await writer.wait_closed()
    return True


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
