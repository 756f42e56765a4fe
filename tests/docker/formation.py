"""One formation in containers: started, disturbed, waited for and removed by way of Docker Compose."""

import json
import os
import subprocess
import sys
import time
from itertools import count
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.docker.flown import Flown
from tests.docker.programs import COMPOSE_FILE, PROJECT, log_of, run

IMPAIR = Path(__file__).with_name("impair_link.py")

VEHICLES = ("leader", "f1", "f2", "f3")
EMULATORS = tuple(f"emulator-{name}" for name in VEHICLES)
SERVICES = ("broker", "keys", *EMULATORS, *VEHICLES, "judge")

DIRECT_SERVICES = ("keys", *EMULATORS, *(f"direct-{name}" for name in VEHICLES), "direct-judge")

NUMBERS = count(1)
"""Of formations, in the order in which they start."""

SIGNAL = "/var/lib/vfguide/start/signal"
FLIGHT = "/var/lib/vfguide/flight"

PATIENCE_S = 180.0
"""Real time for everything that is waited for, beyond the flight itself."""


class Formation:
    """One formation in containers of its own."""

    def __init__(
        self, compose: tuple[str, ...], name: str, directory: Path, settings: dict[str, str]
    ) -> None:
        # A flight that is flown again starts while the containers of the first are removed.
        self._name = f"vfguide-test-{name}-{os.getpid()}-{next(NUMBERS)}"
        self.directory = directory
        self._files = [str(COMPOSE_FILE)]
        self._compose = compose
        self._environment = {**os.environ, "COMPOSE_PROFILES": "demo", **settings}
        self.speedup = float(settings["SPEEDUP"])
        """Seconds of the flight for each real one."""
        direct = self._environment["COMPOSE_PROFILES"] == "direct"
        self.services = DIRECT_SERVICES if direct else SERVICES
        """Names of its containers."""
        self._judge = self.services[-1]
        self._epoch_s = 0.0
        self._containers: dict[str, str] = {}
        self._foreground: subprocess.Popen[bytes] | None = None

    def compose(self, *arguments: str, check: bool = True) -> str:
        """A command of Docker Compose for this formation."""
        return run(*self._command(*arguments), check=check, env=self._environment)

    def _command(self, *arguments: str) -> list[str]:
        files = [option for file in self._files for option in ("--file", file)]
        return [*self._compose, "--project-name", self._name, *files, *arguments]

    def overrule(self, content: dict[str, Any]) -> None:
        """Put something into the place of what docker-compose.yml says."""
        file = self.directory / "overrule.yml"
        file.write_text(yaml.safe_dump(content))
        self._files.append(str(file))

    def container(self, service: str) -> str:
        """Identifier of a service's container; empty before there is one."""
        if not self._containers.get(service):
            labels = {"project": self._name, "service": service}
            filters = (f"--filter=label=com.docker.compose.{key}={labels[key]}" for key in labels)
            self._containers[service] = run("docker", "ps", "--all", "--quiet", *filters).strip()
        return self._containers[service]

    def inspect(self, service: str) -> dict[str, Any]:
        """A service's container as Docker describes it."""
        described: dict[str, Any] = json.loads(run("docker", "inspect", self.container(service)))[0]
        return described

    def inside(self, service: str, *command: str, check: bool = True) -> str:
        """Run a command in a container, as its user."""
        return run("docker", "exec", self.container(service), *command, check=check)

    def cut_off(self, service: str) -> None:
        """Take the link away from a companion, as when its radio fails."""
        run("docker", "network", "disconnect", f"{self._name}_link", self.container(service))

    def let_back(self, service: str) -> None:
        """Give the link back, and the name on it."""
        alias = ("--alias", service)
        run("docker", "network", "connect", *alias, f"{self._name}_link", self.container(service))

    def start(self) -> None:
        """Start all containers, and wait until the judge lets the aircraft begin."""
        self.compose("up", "--detach")
        self.await_signal()

    def begin_in_foreground(self) -> None:
        """Start as a user does who wants a verdict, and wait until the aircraft begin."""
        verdict = ("up", "--abort-on-container-exit", "--exit-code-from", self._judge)
        with (self.directory / "up.log").open("w") as output:
            self._foreground = subprocess.Popen(
                self._command(*verdict),
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=PROJECT,
                env=self._environment,
            )
        self.await_signal()

    def finish_in_foreground(self, seen: object = None) -> Flown:
        """Wait for Docker Compose to end with the verdict."""
        assert self._foreground is not None
        return self.keep(self._foreground.wait(PATIENCE_S), seen)

    def await_signal(self) -> None:
        """Wait for the judge's word."""
        ends = time.time() + PATIENCE_S
        while time.time() < ends:
            judge = self.container(self._judge)
            if judge and (text := run("docker", "exec", judge, "cat", SIGNAL, check=False)):
                self._epoch_s = float(text)
                return
            # What Docker shows while it is being made may not stay.
            self._containers.clear()
            if self._foreground is not None and self._foreground.poll() is not None:
                break
            if judge and "exited" in run(
                "docker", "inspect", "--format", "{{.State.Status}}", judge, check=False
            ):
                break
            time.sleep(1.0)
        output = self.directory / "up.log"
        text = output.read_text() if output.exists() else ""
        text += self.compose("logs", "--no-color", check=False)
        pytest.fail(f"no flight has begun: {text}")

    @property
    def time_s(self) -> float:
        """Time of the flight now, s."""
        return (time.time() - self._epoch_s) * self.speedup

    def reach(self, time_s: float) -> None:
        """Wait for a time of the flight."""
        time.sleep(max(time_s - self.time_s, 0.0) / self.speedup)

    def await_word(self, service: str, text: str, *, times: int = 1) -> None:
        """Wait until a container's log has a text that often: a busy machine starts programs slowly."""
        ends = time.time() + PATIENCE_S
        while (log := log_of(self.container(service))).count(text) < times:
            assert time.time() < ends, f"{service} never said {text!r} {times} times: {log}"
            time.sleep(0.5)

    def impair(self, service: str, until_s: float, *, delay_s: float, loss: float) -> str:
        """Delay and drop what a container sends to a time of the flight: by netem where the kernel has it."""
        into = ["nsenter", "--target", str(self.inspect(service)["State"]["Pid"]), "--net"]
        shape = ["netem", "delay", f"{delay_s * 1e3:g}ms", "loss", f"{loss:.0%}"]
        queue = ["dev", "eth0", "root"]
        netem = subprocess.run(
            [*into, "tc", "qdisc", "add", *queue, *shape], capture_output=True, check=False
        )
        if netem.returncode == 0:
            self.reach(until_s)
            run(*into, "tc", "qdisc", "del", *queue)
            return "by netem"
        seconds = (until_s - self.time_s) / self.speedup
        figures = (str(seconds), str(delay_s), str(loss))
        return run(*into, sys.executable, str(IMPAIR), *figures).strip()

    def finish(self, seen: object) -> Flown:
        """End the flight, wait for the verdict, and keep what is needed to judge the judge."""
        judge = self.container(self._judge)
        run("docker", "kill", "--signal", "INT", judge)
        return self.keep(int(run("docker", "wait", judge)), seen)

    def keep(self, status: int, seen: object) -> Flown:
        """Copy the judge's files and all logs."""
        target = self.directory / "flight"
        run("docker", "cp", f"{self.container(self._judge)}:{FLIGHT}", str(target))
        logs = {service: log_of(self.container(service)) for service in self.services}
        return Flown(status=status, directory=target, logs=logs, seen=seen)

    def unjudged(self, services: tuple[str, ...], seen: object) -> Flown:
        """End without a judge, and keep the logs of some services."""
        logs = {service: log_of(self.container(service)) for service in services}
        return Flown(status=0, directory=self.directory, logs=logs, seen=seen)

    def remove(self) -> None:
        """Leave nothing behind."""
        self.compose("down", "--volumes", "--timeout", "5", check=False)
        if self._foreground is not None:
            self._foreground.kill()
            self._foreground.wait()
