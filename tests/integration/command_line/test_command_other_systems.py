"""Commands on a Python without what macOS or Windows lacks: tests/kit/other_system takes it away."""

import asyncio
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.integration.command_line.conftest import PAIR
from tests.kit.programs import Outcome, running
from tests.kit.sockets import PATIENCE_S, free_port

SYSTEM = Path(__file__).parents[2] / "kit" / "other_system"

Run = Callable[..., Outcome]


@pytest.fixture(scope="module")
def run(process: Run) -> Run:
    """Runs a command on such a system."""
    return lambda *words: process(*words, environment={"PYTHONPATH": str(SYSTEM)})


@pytest.fixture(scope="module")
def flown(run: Run, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A flight of 20 s on such a system, on as many processors as there are."""
    place = tmp_path_factory.mktemp("flown")
    mission = place / "pair.yaml"
    mission.write_text(PAIR, encoding="utf-8")
    outcome = run("fly", mission, "--duration", "20", "--out", place / "out")
    return SimpleNamespace(outcome=outcome, mission=mission, place=place, out=place / "out")


def test_missions_are_checked_and_flown(run, flown):
    checked = run("check", flown.mission)
    assert checked.status == 0, checked.err
    assert "ready to fly" in checked.out
    assert flown.outcome.status == 0, flown.outcome.err
    assert (flown.out / "report.html").is_file()


def test_flights_are_reported_exported_and_analysed(run, flown):
    (flown.out / "report.html").unlink()
    assert run("report", flown.out).status == 0
    assert (flown.out / "report.html").is_file()
    exported = run("export", flown.out, "--out", flown.place / "flight.kml")
    assert exported.status == 0, exported.err
    logs = (flown.out / "lead.tlog", flown.out / "wing.tlog")
    analysed = run("analyse", flown.mission, *logs, "--out", flown.place / "analysed")
    assert analysed.status in {0, 1}, analysed.err
    assert (flown.place / "analysed" / "report.html").is_file()


def test_a_formation_is_watched_by_broker_and_by_datagrams(run, flown, mosquitto):
    links = (mosquitto().url, f"udp://239.255.7.7:{free_port()}?interface=127.0.0.1")
    for link in links:
        seen = run("status", flown.mission, "--insecure", "--link", link)
        assert (seen.status, seen.err) == (1, ""), link
        assert "NO-GO" in seen.out


async def test_a_replay_is_served_until_it_is_stopped(flown, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(SYSTEM))
    words = ("console", "--replay", flown.out, "--port", free_port())
    pipe = asyncio.subprocess.PIPE
    async with running("vfguide", *words, stdout=pipe, stderr=pipe) as process:
        assert process.stdout is not None
        async with asyncio.timeout(PATIENCE_S):
            assert b"http://" in await process.stdout.readline()
            process.send_signal(signal.SIGTERM)
            _, err = await process.communicate()
        assert (process.returncode, err) == (0, b"")


@pytest.mark.parametrize(
    "words",
    [
        ("companion", "wing", "--mission", "pair.yaml", "--mavlink", "udpin://:14540"),
        ("identify", "--help"),
        ("fly", "circle-wind", "--live"),
        ("status", "circle-wind", "--insecure", "--link", "serial:///dev/ttyUSB0:57600"),
    ],
)
def test_what_needs_a_companion_says_so_in_one_line(run, words):
    refused = run(*words)
    said = "this needs termios, which only Linux and macOS have: run it there, or in a container"
    assert (refused.status, refused.err) == (3, said + "\n")


def test_what_needs_linux_says_so_in_one_line(run):
    refused = run("bench", "latency")
    said = "vfguide bench latency needs Linux; on this computer run it in a container\n"
    assert (refused.status, refused.err) == (3, said)


def test_benchmarks_know_their_memory(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(SYSTEM))
    program = "import vfguide.lab.studies.scale as scale; print(scale.resident_mb())"
    told = subprocess.check_output([sys.executable, "-c", program], text=True)
    assert 20.0 < float(told) < 2000.0
