"""Which tests fly in real time, and what that means for how they are run: docs/architecture.md, Tests."""

import asyncio
import fcntl
import inspect
import os
import re
import shutil
import sysconfig
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

from tests.kit.flight import FLIGHTS
from tests.wheels import packages_of, python_with

# A busy machine takes long over a single example, which is no fault.
settings.register_profile("unhurried", settings(), deadline=None)
settings.load_profile("unhurried")

TESTS = Path(__file__).parent

LINKS = ("mqtt", "radio", "transports", "udp")
PROGRAMS = ("bench", "console", "foreign", "live", "sitl_stub")
COMMANDS = ("command_line/test_command_entry.py", "command_line/test_command_writes.py")
RERUNS = {f"integration/{place}": 2 for place in (*LINKS, *PROGRAMS, *COMMANDS)}
REAL_TIME = {"autopilots": 1, "docker": 2} | RERUNS
"""Tests whose verdict depends on several programs getting the processor in time, and how often one that has
failed is tried again: it may have been the machine.
"""

LIVE = ("autopilots", "docker", "integration/console", "integration/live")
"""Those of them that fly whole formations, or show one in a browser: each takes about one processor."""

LIGHT = (
    "integration/live/test_live_abandoned.py",
    "integration/live/test_live_follow_target.py",
    "integration/live/test_live_from_python.py",
    "integration/live/test_live_ground_orders.py",
    "integration/live/test_live_own_parts.py",
)
"""Of the live ones those that fly for seconds, or ask for little processor: they may fly beside any other."""

FLYING = (
    "unit/report",
    "unit/identification",
    "unit/bench",
    "unit/autopilots/test_recorded_answers.py",
    "unit/autopilots/test_recorded_flights.py",
    "unit/autopilots/test_recorded_responses.py",
    "unit/basics/test_api_pages.py",
    "unit/formation/test_formation_order_desk.py",
    "unit/guidance/test_guidance_racetrack.py",
    "unit/guidance/test_guidance_routes.py",
    "unit/link/test_link_radio.py",
    "unit/mission/test_mission_file_fuzz.py",
    "unit/mission/test_mission_hold_heights.py",
    *(
        f"unit/sitl_stub/test_stub_{name}.py"
        for name in ("ground_start", "measurements", "parameters", "plant", "px4", "receive_fuzz")
    ),
    *(
        f"unit/companion/test_companion_{name}.py"
        for name in ("avoidance", "consent", "engaging", "fail_safe", "fuzz", "roles", "steering")
    ),
)
"""Unit tests that fly a closed loop, draw, or try thousands of inputs: `make test-fast` leaves them out."""

LONGEST = (
    "autopilots/test_formations.py",
    "integration/live",
    "autopilots",
    "closed_loop/formation/test_crews_missions.py",
    "closed_loop/formation/test_article_missions.py",
    "closed_loop",
    "unit/report",
    "unit/identification",
    "unit/bench",
    "integration",
)
"""What comes first, so that no process is left with a long test when the others have no more.

A process that has two tests left is given the next ones at once: of the live tests one takes the autopilots'
formations, the other the formations that fly live, and what is short goes to whichever is free.
"""

TOGETHER = (
    "integration/live",
    "closed_loop/formation/test_impossible_positions.py",
    "closed_loop/formation/test_turbulence.py",
    "unit/report",
)
"""What one process runs, a test after the other, like each file of tests in real time: two formations that
fly live want more than two processors, and a flight or page that many tests look at takes long to make."""

PAUSE_S = 5.0
"""What kept the processor may have ended by then."""


def is_below(item: pytest.Item, place: str) -> bool:
    """Whether a test stands in this file or directory."""
    return item.path.is_relative_to(TESTS / place)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that fly in real time, and put the longest first."""
    for item in items:
        for place, reruns in REAL_TIME.items():
            if is_below(item, place):
                item.add_marker("real_time")
                item.add_marker(pytest.mark.flaky(reruns=reruns, reruns_delay=PAUSE_S))
        if any(is_below(item, place) for place in LIVE):
            item.add_marker("live")
        if any(is_below(item, place) for place in FLYING):
            item.add_marker("flies")
    items.sort(key=rank)


class Sharing(LoadScopeScheduling):  # type: ignore[misc]
    """Gives tests that belong together to one process."""

    def _split_scope(self, nodeid: str) -> str:
        file = Path(nodeid.split("::", 1)[0]).relative_to(TESTS.name)
        places = (place for place in TOGETHER if file.is_relative_to(place))
        alone = str(file) if any(map(file.is_relative_to, REAL_TIME)) else nodeid
        return alone if str(file) in LIGHT else next(places, alone)


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine in an event loop of its own; its module may name another kind."""
    test = pyfuncitem.obj
    if not inspect.iscoroutinefunction(test):
        return None
    given = {name: pyfuncitem.funcargs[name] for name in inspect.signature(test).parameters}
    with asyncio.Runner(loop_factory=getattr(pyfuncitem.module, "EVENT_LOOP", None)) as runner:
        runner.run(test(**given))
    return True


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Sharing | None:
    """Share tests out with `--dist loadscope`, as `make test` does."""
    return Sharing(config, log) if config.getoption("dist") == "loadscope" else None


def rank(item: pytest.Item) -> int:
    """The less, the earlier a test comes; those of equal rank stay in their order."""
    if any(is_below(item, place) for place in LIGHT):
        return len(LONGEST)
    places = (n for n, place in enumerate(LONGEST) if is_below(item, place))
    return next(places, len(LONGEST))


STARTED = pytest.StashKey[tuple[float, float, float]]()


def processor_s() -> tuple[float, float, float]:
    """Seconds by the clock, for which some task waited for the processor, and that another machine had it."""
    pressure, stat = Path("/proc/pressure/cpu"), Path("/proc/stat")
    waited = re.search(r"^some .*total=(\d+)", pressure.read_text()) if pressure.exists() else None
    stolen = stat.read_text().split("\n", 1)[0].split()[8] if stat.exists() else 0
    return (
        time.monotonic(),
        int(waited[1]) * 1e-6 if waited else 0.0,
        int(stolen) / os.sysconf("SC_CLK_TCK"),
    )


def pytest_configure(config: pytest.Config) -> None:
    """Look at the clocks, and make a place for flights that several tests look at."""
    config.stash[STARTED] = processor_s()
    if not hasattr(config, "workerinput"):
        os.environ[FLIGHTS] = tempfile.mkdtemp(prefix="vfguide-flights-")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the flights with the session."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(FLIGHTS), ignore_errors=True)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Tell how much processor there was: what flies in real time needs it."""
    passed, waited, stolen = (
        now - then for now, then in zip(processor_s(), config.stash[STARTED], strict=True)
    )
    terminalreporter.write_line(
        f"processor: waited for {waited / passed:.0%} of the time, {stolen:.0f} s of it had by other machines"
    )


@pytest.fixture(scope="session")
def installed() -> Path:
    """A Python that has vfguide from its wheel, and of this environment the libraries alone.

    One for all processes of the session.
    """
    place = Path(os.environ[FLIGHTS], "installed")
    python = place / "venv" / "bin" / "python"
    with place.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not place.exists():
            place.mkdir()
            assert python_with(TESTS.parent, place) == python
            libraries = sysconfig.get_path("purelib")
            (packages_of(python) / "libraries.pth").write_text(f"{libraries}\n")
    return python
