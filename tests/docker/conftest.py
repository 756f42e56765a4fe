"""Formations in containers: built, flown, disturbed and judged by the very files that users have."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from vfguide.elementwise import FloatArray
from vfguide.mission import load_mission
from vfguide.record.flight import FlightRecord
from vfguide.report.geometry import pair_separations, slot_error

PROJECT = Path(__file__).parents[2]
COMPOSE_FILE = PROJECT / "docker-compose.yml"
IMPAIR = Path(__file__).with_name("impair_link.py")

VEHICLES = ("leader", "f1", "f2", "f3")
EMULATORS = tuple(f"emulator-{name}" for name in VEHICLES)
SERVICES = ("broker", *EMULATORS, *VEHICLES, "judge")

SIGNAL = "/var/lib/vfguide/start/signal"
FLIGHT = "/var/lib/vfguide/flight"

AT_ONCE = 3 if os.getloadavg()[0] < 2.0 * (os.cpu_count() or 1) else 1
"""Formations: Docker has addresses for thirty networks, and each takes seven. One, where others wait for
the cores already."""

PATIENCE_S = 180.0
"""Real time for everything that is waited for, beyond the flight itself."""


TOLD = pytest.StashKey[list[str]]()
"""What tests have measured."""


@pytest.fixture(scope="session")
def tell(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Tells a measurement at the end of all tests, whether they pass or not."""
    return request.config.stash.setdefault(TOLD, []).append


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    for line in config.stash.get(TOLD, []):
        terminalreporter.write_line(line)


def run(*command: str, check: bool = True, env: dict[str, str] | None = None) -> str:
    """What a command says; what it complains of, if it fails."""
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=1800, cwd=PROJECT, env=env
    )
    assert not check or done.returncode == 0, f"{' '.join(command)}: {done.stdout}{done.stderr}"
    return done.stdout


def missing(what: str) -> None:
    """Fail where CI runs; elsewhere a machine may do without containers."""
    if os.environ.get("CI"):
        pytest.fail(what)
    pytest.skip(what)


@pytest.fixture(scope="session")
def compose() -> tuple[str, ...]:
    """How Docker Compose is called here."""
    if shutil.which("docker") is None or not run(
        "docker", "info", "--format", "{{.ServerVersion}}", check=False
    ):
        missing("no Docker engine answers")
    if run("docker", "compose", "version", check=False):
        return ("docker", "compose")
    if shutil.which("docker-compose") is None:
        missing("Docker Compose is not installed")
    return ("docker-compose",)


@pytest.fixture(scope="session")
def image(compose: tuple[str, ...], tell: Callable[[str], None]) -> dict[str, Any]:
    """The image as Docker describes it, built from the Dockerfile on the base that there is."""
    base = next(
        line.removeprefix("ARG BASE_IMAGE=")
        for line in (PROJECT / "Dockerfile").read_text().splitlines()
        if line.startswith("ARG BASE_IMAGE=")
    )
    if not run("docker", "image", "ls", "--quiet", base) and not run(
        "docker", "pull", "--quiet", base, check=False
    ):
        run(str(PROJECT / "tests/docker/make-base-image"), base)
    began = time.monotonic()
    run(*compose, "--file", str(COMPOSE_FILE), "build", "broker")
    described: dict[str, Any] = json.loads(run("docker", "image", "inspect", "vfguide:local"))[0]
    size_mb = described["Size"] / 1e6
    tell(f"image of {size_mb:.0f} MB, built within {time.monotonic() - began:.0f} s")
    return described


@dataclass(frozen=True, kw_only=True)
class Flown:
    """A flight in containers, after its end."""

    status: int
    """Exit status of the judge."""
    directory: Path
    """What the judge wrote."""
    logs: dict[str, str]
    """What each container had to say."""
    seen: Any
    """What the scenario came back with."""

    @property
    def summary(self) -> dict[str, Any]:
        content: dict[str, Any] = json.loads((self.directory / "summary.json").read_text())
        return content

    @property
    def record(self) -> FlightRecord:
        return FlightRecord.load(self.directory / "flight.npz")

    def errors(self, vehicle: str, from_s: float, to_s: float) -> FloatArray:
        """Distances of a follower from its slot, m."""
        record = self.record
        follower = next(one for one in record.followers if one.name == vehicle)
        during = (record.time_s >= from_s) & (record.time_s < to_s)
        return np.asarray(slot_error(record.leader, follower).distance_m[during])

    def greatest(self, from_s: float, to_s: float, *vehicles: str) -> float:
        """Greatest distance of any of these followers from its slot, m."""
        return max(float(self.errors(name, from_s, to_s).max()) for name in vehicles)

    def least_separation_m(self, *vehicles: str) -> float:
        """Of any two of these vehicles at any time, m."""
        return min(
            float(pair.distance_m.min())
            for pair in pair_separations(self.record)
            if {pair.first, pair.second} <= set(vehicles)
        )

    def modes(self, vehicle: str) -> list[str]:
        """Modes that a companion went into, in order."""
        messages = (
            json.loads(line[line.index("{") :])["message"]
            for line in self.logs[vehicle].splitlines()
            if "{" in line
        )
        return [text.split(" -> ")[1] for text in messages if " -> " in text]


class Formation:
    """One formation in containers of its own."""

    services = SERVICES

    def __init__(
        self, compose: tuple[str, ...], name: str, directory: Path, settings: dict[str, str]
    ) -> None:
        self.began_s = 0.0
        """Unix time at which it was told to start."""
        self._name = f"vfguide-test-{name}-{os.getpid()}"
        self.directory = directory
        self._files = [str(COMPOSE_FILE)]
        self._compose = compose
        self._environment = {**os.environ, "COMPOSE_PROFILES": "demo", **settings}
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

    def docker(self, *arguments: str) -> str:
        """A command of Docker."""
        return run("docker", *arguments)

    def inside(self, service: str, *command: str, check: bool = True) -> str:
        """Run a command in a container, as its user."""
        return run("docker", "exec", self.container(service), *command, check=check)

    def cut_off(self, service: str) -> None:
        """Take the link away from a companion, as when its radio fails."""
        run("docker", "network", "disconnect", f"{self._name}_link", self.container(service))

    def let_back(self, service: str) -> None:
        """Give the link back."""
        run("docker", "network", "connect", f"{self._name}_link", self.container(service))

    def start(self) -> None:
        """Start all containers, and wait until the judge lets the aircraft begin."""
        self.began_s = time.time()
        self.compose("up", "--detach")
        self.await_signal()

    def begin_in_foreground(self) -> None:
        """Start as a user does who wants a verdict, and wait until the aircraft begin."""
        self.began_s = time.time()
        verdict = ("up", "--abort-on-container-exit", "--exit-code-from", "judge")
        output = (self.directory / "up.log").open("w")
        self._foreground = subprocess.Popen(
            self._command(*verdict),
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd=PROJECT,
            env=self._environment,
        )
        output.close()
        self.await_signal()

    def finish_in_foreground(self, seen: object = None) -> Flown:
        """Wait for Docker Compose to end with the verdict."""
        assert self._foreground is not None
        return self.keep(self._foreground.wait(PATIENCE_S), seen)

    def await_signal(self) -> None:
        """Wait for the judge's word."""
        ends = time.time() + PATIENCE_S
        while time.time() < ends:
            judge = self.container("judge")
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

    def reach(self, time_s: float) -> None:
        """Wait for a time of the flight."""
        time.sleep(max(self._epoch_s + time_s - time.time(), 0.0))

    def impair(self, service: str, *, seconds: float, delay_s: float, loss: float) -> str:
        """Delay and drop what a container sends: by netem where the kernel has it."""
        into = ["nsenter", "--target", str(self.inspect(service)["State"]["Pid"]), "--net"]
        shape = ["netem", "delay", f"{delay_s * 1e3:g}ms", "loss", f"{loss:.0%}"]
        queue = ["dev", "eth0", "root"]
        netem = subprocess.run(
            [*into, "tc", "qdisc", "add", *queue, *shape], capture_output=True, check=False
        )
        if netem.returncode == 0:
            time.sleep(seconds)
            run(*into, "tc", "qdisc", "del", *queue)
            return "by netem"
        figures = (str(seconds), str(delay_s), str(loss))
        return run(*into, sys.executable, str(IMPAIR), *figures).strip()

    def finish(self, seen: object = None) -> Flown:
        """Wait for the verdict, and keep what is needed to judge the judge."""
        judge = self.container("judge")
        status = int(run("docker", "wait", judge))
        return self.keep(status, seen)

    def keep(self, status: int, seen: object) -> Flown:
        """Copy the judge's files and all logs."""
        target = self.directory / "flight"
        run("docker", "cp", f"{self.container('judge')}:{FLIGHT}", str(target))
        logs = {service: log_of(self.container(service)) for service in SERVICES}
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


def log_of(container: str) -> str:
    """Standard output and standard error of a container, with Docker's times before each line."""
    command = ["docker", "logs", "--timestamps", container]
    return subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True
    ).stdout


@pytest.fixture(scope="session")
def missions() -> Callable[..., dict[str, Any]]:
    """A mission as a dictionary; with everyone in the slots from the beginning if so wished."""

    def content(name: str, *, in_slots: bool = False) -> dict[str, Any]:
        path = PROJECT / "missions" / f"{name}.yaml"
        mission: dict[str, Any] = load_mission(path).model_dump(mode="json", exclude_unset=True)
        if in_slots:
            leader = {"north_m": 0.0, "east_m": 0.0, "course_deg": 270.0}
            followers = [one["vehicle"] for one in mission["followers"]]
            mission["rehearsal"]["start"] = {"leader": leader, **{one: {} for one in followers}}
        return mission

    return content


Scenario = Callable[[Formation], Flown]

Settings = dict[str, Any]


def fly(
    compose: tuple[str, ...], name: str, directory: Path, flight: tuple[Scenario, Settings]
) -> Flown:
    """One scenario, with a mission and containers of its own; nothing of it stays, however it ends."""
    scenario, settings = flight
    mission = directory / "mission.yaml"
    mission.write_text(yaml.safe_dump(settings.pop("mission"), sort_keys=False))
    mission.chmod(0o644)
    formation = Formation(compose, name, directory, {"MISSION": str(mission), **settings})
    try:
        return scenario(formation)
    finally:
        formation.remove()


class Flights:
    """What became of each scenario, by name; whoever asks too early waits."""

    def __init__(self, flights: dict[str, Future[Flown]]) -> None:
        self._flights = flights

    def __getitem__(self, name: str) -> Flown:
        return self._flights[name].result()


@pytest.fixture(scope="session")
def flights(
    request: pytest.FixtureRequest,
    compose: tuple[str, ...],
    image: dict[str, Any],
    missions: Callable[..., dict[str, Any]],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Flights]:
    """All that the collected modules have to be flown, side by side: real time passes once."""
    assert image
    items = (item for item in request.session.items if isinstance(item, pytest.Function))
    scenarios: dict[str, tuple[Scenario, Settings]] = {}
    for module in dict.fromkeys(item.module for item in items):
        if "docker_flights" in vars(module):
            scenarios |= module.docker_flights(missions)
    # The longest first, so that the last ones do not wait for each other.
    names = sorted(scenarios, key=lambda name: -float(scenarios[name][1].get("DURATION", 0.0)))
    with ThreadPoolExecutor(max_workers=AT_ONCE) as pool:
        yield Flights(
            {
                name: pool.submit(
                    fly, compose, name, tmp_path_factory.mktemp(name), scenarios[name]
                )
                for name in names
            }
        )
        # After the first failure with --exitfirst, or Ctrl-C, no more of them begin.
        pool.shutdown(cancel_futures=True)
