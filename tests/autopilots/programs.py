"""Programs of one flight: each in a session of its own, its output in a file, none left at the end."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.kit.programs import BASIS
from vfguide.lab.rehearsal.processes import free_port

PATIENCE_S = 8.0
"""That a program gets to end by itself."""

PRIORITY = -10
"""Simulators and companions must keep real time: before other work, where that is permitted. There they are
scheduled as real-time programs, too: a niceness alone leaves them waiting for milliseconds."""


class FlightError(Exception):
    """A flight that could not be flown, in one sentence."""


class Program:
    """One program, started as often as the flight wants it."""

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        directory: Path,
        *,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Remember a program; its output goes to NAME.txt in the directory where it runs."""
        self.name = name
        self.output = directory / f"{name}.txt"
        self._command = command
        self._directory = directory
        self._environment = {**os.environ, "PYTHONUNBUFFERED": "1", **(environment or {})}
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def running(self) -> bool:
        """Whether it runs now."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Start it, or start it again."""
        self._directory.mkdir(parents=True, exist_ok=True)
        with self.output.open("ab") as output:
            self._process = subprocess.Popen(
                self._command,
                cwd=self._directory,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env=self._environment,
                start_new_session=True,
            )
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, self._process.pid, PRIORITY)
        with suppress(OSError):
            os.sched_setscheduler(self._process.pid, os.SCHED_RR, os.sched_param(1))

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to it and to all that it has started."""
        if self._process is not None and self.running:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, number)

    def kill(self) -> None:
        """End it at once, as a loss of power does."""
        self.signal(signal.SIGKILL)
        if self._process is not None:
            self._process.wait()

    def stop(self) -> None:
        """Ask it to end, and end it if it does not."""
        self.signal(signal.SIGCONT)
        self.signal(signal.SIGTERM)
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(PATIENCE_S)
            self.kill()

    def check(self) -> None:
        """See that it runs."""
        if not self.running:
            raise FlightError(f"{self.name} has ended: {self.last_words()}; see {self.output}")

    def last_words(self) -> str:
        """The last line of its output."""
        text = self.output.read_text(errors="replace") if self.output.exists() else ""
        lines = text.strip().splitlines()
        return lines[-1] if lines else "without a word"


@contextmanager
def first_in_line() -> Iterator[None]:
    """Put this process, which notes when reports come, before other work for a while."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, PRIORITY)
    try:
        yield
    finally:
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, before)


def vfguide(*arguments: str) -> list[str]:
    """A command of this installation."""
    return [sys.executable, "-m", "vfguide", *arguments]


def find_mosquitto() -> str:
    """The broker's program."""
    found = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
    if found is None:
        raise FlightError("mosquitto is not installed; apt install mosquitto")
    return found


def broker(program: str, directory: Path) -> tuple[Program, str]:
    """(Mosquitto on a free port, its address)."""
    port = free_port(socket.SOCK_STREAM)
    directory.mkdir(parents=True, exist_ok=True)
    config = directory / "mosquitto.conf"
    config.write_text(f"listener {port} 127.0.0.1\n{BASIS}")
    return Program("mosquitto", [program, "-c", str(config)], directory), f"mqtt://127.0.0.1:{port}"


def is_free(port: int, kind: socket.SocketKind) -> bool:
    """Whether a port of the loopback interface is in no use."""
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind is socket.SOCK_STREAM:
            # What was closed a moment ago is free, as it is for the simulator.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def wait_for_port(port: int, program: Program, patience_s: float) -> None:
    """Wait until a program can be called."""
    gives_up = time.monotonic() + patience_s
    while time.monotonic() < gives_up:
        program.check()
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
            return
        time.sleep(0.1)
    raise FlightError(f"{program.name} does not listen at port {port}; see {program.output}")
