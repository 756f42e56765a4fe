"""`vfguide fly` stopped by Ctrl-C or SIGTERM: what was flown is kept."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext, suppress
from itertools import count
from pathlib import Path

import pytest

from tests.kit.sockets import PATIENCE_S
from vfguide.record.flight import FlightRecord

LONG_S = 250
"""Virtual seconds: when the first progress line comes, four fifths are still to fly."""


@asynccontextmanager
async def under_way(
    mission: Path, *options: str | Path
) -> AsyncIterator[asyncio.subprocess.Process]:
    """A flight that has shown its first progress; whatever happens, nothing of it stays."""
    flight = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "vfguide", "fly", mission, "--duration", str(LONG_S), *options),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        start_new_session=True,
    )
    try:
        assert flight.stderr is not None
        async with asyncio.timeout(PATIENCE_S):
            while not (line := await flight.stderr.readline()).startswith(b"flying"):
                assert line, "ended before it flew"
            yield flight
    finally:
        with suppress(ProcessLookupError):
            os.killpg(flight.pid, signal.SIGKILL)
        await flight.wait()


@pytest.mark.usefixtures("one_plot")
async def test_a_stopped_flight_ends_with_3_and_is_kept(command, pair_with, tmp_path):
    directory = tmp_path / "out"
    async with under_way(pair_with(), "--json", "--out", directory) as flight:
        flight.send_signal(signal.SIGINT)
        out, err = await flight.communicate()
        status, err = flight.returncode, err.decode()
    assert status == 3
    assert "Traceback" not in err
    summary = json.loads(out)
    flown_s = summary["duration_s"]
    assert LONG_S / 5 <= flown_s < LONG_S
    told = f"stopped after {flown_s:.1f} s of flight; the report is being written"
    assert err.splitlines()[-1] == told
    assert json.loads((directory / "summary.json").read_text()) == summary
    assert FlightRecord.load(directory / "flight.npz").time_s[-1] == flown_s
    again = command("report", directory)
    assert again.status == 0
    assert f"{flown_s:g} s in" in again.out


async def stopped_twice(mission: Path, directory: Path) -> tuple[int | None, str]:
    """Stop a flight, and then its report; the status and the last line."""
    async with under_way(mission, "--out", directory) as flight:
        flight.send_signal(signal.SIGINT)
        async with asyncio.timeout(PATIENCE_S):
            while not list(directory.glob(".partial-*/flight.npz")) and flight.returncode is None:
                await asyncio.sleep(0.01)
        if flight.returncode is None:
            flight.send_signal(signal.SIGINT)
        _, err = await flight.communicate()
        return flight.returncode, err.decode().splitlines()[-1]


async def test_who_stops_the_report_too_is_told_what_is_left(pair_with, tmp_path):
    # On a busy computer a report may be done before the second signal: then it is tried again.
    for attempt in range(5):
        directory = tmp_path / f"out-{attempt}"
        status, said = await stopped_twice(pair_with(), directory)
        left = list(directory.glob(".partial-*"))
        if left:
            break
    assert status == 3
    assert said == f"{left[0]}: holds what was written so far"
    assert [*directory.iterdir()] == left
    assert FlightRecord.load(left[0] / "flight.npz").interrupted


@pytest.mark.usefixtures("unplotted")
def test_a_stopped_flight_takes_no_earlier_ones_place(command, alone_with, tmp_path, monkeypatch):
    directory = tmp_path / "out"
    fly = ("fly", alone_with(), "--duration", 2, "--out", directory)
    assert command(*fly).status == 0
    earlier = {path.name: path.read_bytes() for path in directory.iterdir()}
    looks = count()
    monkeypatch.setattr(
        "vfguide.commands.fly.stopped_by_signals", lambda: nullcontext(lambda: next(looks) > 0)
    )
    outcome = command(*fly)
    (left,) = directory.glob(".*")
    assert outcome.status == 3
    assert outcome.lines[-2:] == [
        f"{left}: holds what was written so far",
        f"{directory}: the earlier flight stays; --force would have replaced it",
    ]
    assert outcome.out.endswith(f"report: {left / 'report.html'}\n")
    assert {path.name: path.read_bytes() for path in directory.glob("[!.]*")} == earlier
    assert FlightRecord.load(left / "flight.npz").interrupted
    looks = count()
    assert command(*fly, "--force").status == 3
    assert FlightRecord.load(directory / "flight.npz").interrupted


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_a_signal_to_the_whole_group_stops_it_as_cleanly(pair_with, number):
    """As Ctrl-C in a terminal, `timeout` and a service manager do."""
    async with under_way(pair_with()) as flight:
        os.killpg(flight.pid, number)
        _, err = await flight.communicate()
        status, err = flight.returncode, err.decode()
    assert status == 3
    assert err.splitlines()[-1].startswith("stopped after ")
    assert "Traceback" not in err


@pytest.mark.skipif(os.cpu_count() == 1, reason="on one core all is flown in one process")
async def test_the_death_of_a_flight_process_ends_with_3_and_one_line(pair_with):
    async with under_way(pair_with()) as flight:
        (worker,) = [one for one in children_of(flight.pid) if b"spawn_main" in words_of(one)]
        os.kill(worker, signal.SIGKILL)
        _, err = await flight.communicate()
        status, err = flight.returncode, err.decode()
    assert status == 3
    assert err.splitlines()[-1] == "a flight process died (exit code -9)"
    assert "Traceback" not in err


def children_of(pid: int) -> list[int]:
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in listed.split()]


def words_of(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()
