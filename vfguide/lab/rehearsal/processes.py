"""Programs that a live flight starts and stops, and the resources they use."""

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
"""Directory of Debian's daemons, which is not in users' search paths."""

MOSQUITTO_SETTINGS = """\
listener {port} 127.0.0.1
allow_anonymous true
set_tcp_nodelay true
persistence false
user root
"""
"""Settings of a broker on the loopback interface, which admits every local client."""

LISTENING_S = 10.0
"""Real time that the broker gets until it listens."""

PATIENCE_S = 10.0
"""Real time that a process gets to end cleanly before it is killed."""

PR_SET_PDEATHSIG = 1
"""Linux's prctl option for a signal to this process when its parent has ended."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """Resources that a process has used so far."""

    at_s: float
    """Time of the measurement on the monotonic clock."""
    busy_s: float
    """Processor time."""
    rss_mb: float
    """Resident memory, 10^6 bytes."""

    def since(self, earlier: "Account") -> Usage:
        """Return the usage between two accounts."""
        share = (self.busy_s - earlier.busy_s) / max(self.at_s - earlier.at_s, 0.01)
        return Usage(cpu_share=round(share, 4), rss_mb=round(self.rss_mb, 1))


def account_of(pid: int) -> Account | None:
    """Return the account of a process; None if it has ended."""
    # Imported here: emulators for a judge elsewhere do not need this library.
    psutil = import_extra("psutil")
    try:
        process = psutil.Process(pid)
        with process.oneshot():
            times, memory = process.cpu_times(), process.memory_info()
    except psutil.Error:
        return None
    return Account(at_s=time.monotonic(), busy_s=times.user + times.system, rss_mb=memory.rss / 1e6)


def accounts_of(pids: dict[str, int]) -> dict[str, Account]:
    """Return accounts by name, without processes that have ended."""
    found = {name: account_of(pid) for name, pid in pids.items()}
    return {name: account for name, account in found.items() if account is not None}


def load() -> list[float]:
    """Return the load averages of the computer over 1, 5 and 15 minutes."""
    return [round(average, 2) for average in os.getloadavg()]


class Process:
    """Program of a rehearsal, which can be restarted."""

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        log: Path,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Prepare a program; its output is appended to `log`, and `environment` adds variables."""
        self.name = name
        self._command = command
        self._log = log
        self._environment = dict(environment or {})
        self._process: asyncio.subprocess.Process | None = None

    @property
    def running(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.returncode is None

    @property
    def pid(self) -> int | None:
        """Process id; None while the process does not run."""
        return self._process.pid if self._process is not None and self.running else None

    @property
    def exit_code(self) -> int | None:
        """Exit code; None while the process runs, and after `kill`."""
        return None if self._process is None else self._process.returncode

    async def start(self) -> None:
        """Start or restart the process."""
        with self._log.open("ab") as output:
            self._process = await asyncio.create_subprocess_exec(
                *self._command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env={**os.environ, "PYTHONUNBUFFERED": "1", **self._environment},
                # Ctrl-C reaches the rehearsal alone, which then stops its processes.
                start_new_session=True,
                preexec_fn=ends_with(os.getpid()),
            )

    async def wait(self) -> int | None:
        """Wait until the process ends, and return its exit code; None if it was never started."""
        return None if self._process is None else await self._process.wait()

    async def kill(self) -> None:
        """Kill the process as `kill -9` does, and forget it."""
        if self._process is not None and self.running:
            self._process.kill()
            await self._process.wait()
            self._process = None

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the process."""
        if self._process is not None and self.running:
            self._process.send_signal(number)

    async def stop(self) -> None:
        """Ask the process to end, and kill it if it does not."""
        self.signal(signal.SIGTERM)
        if self._process is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(PATIENCE_S):
                    await self._process.wait()
            await self.kill()

    def last_words(self) -> str:
        """Return the last line of the log."""
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
    """Run mosquitto on the loopback interface for as long as the context lasts; yield its port.

    `directory` takes its settings and its log.

    Raises:
        VfguideError: mosquitto is not installed, or does not listen.
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
    """Check whether a program accepts connections on a port of the loopback interface."""
    try:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
    except OSError:
        return False
    writer.close()
    await writer.wait_closed()
    return True


def ends_with(parent: int) -> Callable[[], None] | None:
    """Return a function that a child runs first, so that it is told to stop when its parent has ended.

    This also works after `kill -9` of the parent, but on Linux alone; elsewhere the result is None.
    """
    if sys.platform != "linux":
        return None
    prctl = ctypes.CDLL(None).prctl

    def ask() -> None:
        prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:
            # The parent had ended before the request.
            os._exit(1)

    return ask


def python_module(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of this installation."""
    return [sys.executable, "-m", module, *arguments]


def free_port(kind: socket.SocketKind) -> int:
    """Return a port of the loopback interface that is free at the moment."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
