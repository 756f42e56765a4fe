"""Formations in containers: built, flown, disturbed and judged by the very files that users have."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from tests.docker.flights import AllFlights, Flights, Removals, Scenario, Settings, fly
from tests.docker.programs import PROJECT, run

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
    assert compose
    run(str(PROJECT / "tests/docker/make-image"))
    described: dict[str, Any] = json.loads(run("docker", "image", "inspect", "vfguide:local"))[0]
    tell(f"image of {described['Size'] / 1e6:.0f} MB")
    return described


@pytest.fixture(scope="session")
def all_flights(
    request: pytest.FixtureRequest,
    compose: tuple[str, ...],
    image: dict[str, Any],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[AllFlights]:
    """All that the collected modules have to be flown."""
    assert image
    items = (item for item in request.session.items if isinstance(item, pytest.Function))
    scenarios: dict[str, tuple[Scenario, Settings]] = {}
    for module in dict.fromkeys(item.module for item in items):
        if "docker_flights" in vars(module):
            scenarios |= module.docker_flights()
    with ThreadPoolExecutor(max_workers=1) as pool:
        removals = Removals(pool)
        yield AllFlights(
            lambda name, attempt: fly(
                compose, name, tmp_path_factory.mktemp(name), scenarios[name], removals, attempt
            )
        )
        removals.finish_all()


@pytest.fixture
def flights(request: pytest.FixtureRequest, all_flights: AllFlights) -> Flights:
    """Looks at flights; a test that has failed, and is run again, at newer ones."""
    return Flights(all_flights, getattr(request.node, "execution_count", 1))
