"""No command touches a file outside the place it was given, by Python's audit events and by what is there."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from threading import Timer
from types import SimpleNamespace

import pytest

from tests.integration.command_line.conftest import PAIR
from tests.integration.surroundings import PATIENCE_S, Surroundings
from vfguide.companion.consent import begin_flight
from vfguide.lab.rehearsal.processes import free_port

SPEEDUP = 10.0
"""Of the emulator, and of who flies it."""


@pytest.fixture
def around(tmp_path: Path) -> Surroundings:
    return Surroundings(tmp_path)


Words = Callable[[SimpleNamespace, Path], Sequence[str | Path]]

COMMANDS: dict[str, Words] = {
    "fly": lambda flown, out: (
        *("fly", flown.directory.parent / "pair.yaml", "--rate", "10", "--out", out),
    ),
    "fly live": lambda flown, out: (
        *("fly", flown.directory.parent / "pair.yaml", "--live", "--duration", "5"),
        *("--out", out, "--set", "acceptance.mean_error_m=100"),
        *("--set", "acceptance.settle_10m_s=100"),
    ),
    "report": lambda flown, out: ("report", flown.directory, "--out", out),
    "animate": lambda flown, out: (
        *("report", flown.directory, "--animate", out.with_name("out.webp")),
    ),
    "analyse": lambda flown, out: (
        *("analyse", flown.directory.parent / "pair.yaml"),
        *(*sorted(flown.directory.glob("*.tlog")), "--out", out),
    ),
    **{
        f"export {ending}": lambda flown, out, ending=ending: (  # type: ignore[misc]
            *("export", flown.directory, "--out", out.with_name(f"out.{ending}")),
        )
        for ending in ("mcap", "kml", "kmz", "csv", "parquet", "plan")
    },
    "bench": lambda _, out: (
        *("bench", "monte-carlo", "--formations", "1", "--processes", "1"),
        *("--json", out / "figures.json"),
    ),
    "check": lambda flown, _: (
        *("check", flown.directory.parent / "pair.yaml"),
        *("--set", "rehearsal.rate_hz=10"),
    ),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_writes_where_it_was_told_to_and_nowhere_else(name, flown, around):
    before = {path: path.stat().st_mtime_ns for path in flown.directory.parent.rglob("*")}
    around.run(*COMMANDS[name](flown, around.out))
    around.see_that_nothing_else_was_written()
    after = {path: path.stat().st_mtime_ns for path in flown.directory.parent.rglob("*")}
    assert after == before


def test_a_console_of_a_recorded_flight_writes_nothing(flown, around):
    around.see_a_console_and_stop_it(
        around.start("console", "--replay", flown.directory, "--port", "0")
    )
    around.see_that_nothing_else_was_written()


def test_keys_are_made_beside_their_mission_and_nowhere_else(around):
    around.out.mkdir()
    mission = around.out / "pair.yaml"
    mission.write_text(PAIR, encoding="utf-8")
    around.run("keys", "make", mission)
    around.run("keys", "rotate", mission, "wing")
    around.run("keys", "show", mission)
    around.see_that_nothing_else_was_written()
    assert sorted(one.name for one in around.out.iterdir()) == [
        "pair.keys",
        "pair.roster",
        "pair.yaml",
    ]


@pytest.fixture
def aircraft() -> Iterator[str]:
    """The address of an emulated one in the air, whose time is ten times as fast."""
    place = f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    stub = (sys.executable, "-m", "sitl_stub", "--system-id", "1", "--airborne")
    process = subprocess.Popen((*stub, "--mavlink", f"udpin://{place}", "--speedup", str(SPEEDUP)))
    yield f"udpout://{place}"
    process.terminate()
    process.wait(PATIENCE_S)


def test_identify_writes_where_it_was_told_to_and_nowhere_else(aircraft, around):
    # The aircraft flies long before a busy machine has started the program that steers it.
    begin_flight(around.out / "state", "leader")
    said = around.run(
        *("identify", "leader", "--mission", "line-calm", "--mavlink", aircraft, "--engage"),
        *("--speedup", str(SPEEDUP), "--out", around.out, "--state", around.out / "state"),
    )
    assert "alpha_1_s" in said
    around.see_that_nothing_else_was_written()


def test_a_companion_writes_its_state_and_its_recording_and_nothing_else(aircraft, around):
    begin_flight(around.out / "state", "leader")
    process = around.start(
        *("companion", "leader", "--mission", "line-calm", "--mavlink", aircraft, "--engage"),
        *("--link", f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}", "--insecure"),
        *("--record", around.out / "recordings", "--state", around.out / "state"),
        *("--log-format", "text", "--clock", f"{time.monotonic()},{SPEEDUP}"),
    )
    last_resort = Timer(PATIENCE_S, process.kill)
    last_resort.start()
    assert process.stderr is not None
    assert any("joining -> tracking" in line for line in process.stderr)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=PATIENCE_S)
    last_resort.cancel()
    assert process.returncode == 0
    around.see_that_nothing_else_was_written()
    assert sorted(one.name for one in around.out.iterdir()) == ["recordings", "state"]
