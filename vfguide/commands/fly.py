"""`vfguide fly`: the whole formation on this computer."""

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from rich.console import Console

from vfguide.commands.terminal import flight_progress
from vfguide.errors import InputError
from vfguide.mission.model import Mission
from vfguide.rehearsal.lockstep import Flight, fly_lockstep
from vfguide.report.metrics import summarise, summary_json
from vfguide.report.page import write_report
from vfguide.report.summary import Summary
from vfguide.report.table import summary_table

RECORD_NAME = "flight.npz"
SUMMARY_NAME = "summary.json"

ACCEPTED, NOT_ACCEPTED, BROKEN = 0, 1, 3


def fly(mission: Mission, *, out: Path | None, as_json: bool) -> int:
    """Fly a mission, report, and return the exit status.

    Raises:
        InputError: the directory cannot be written to.
    """
    errors = Console(stderr=True)
    if out is not None:
        prepare(out)
    title = f"flying {mission.name}"
    with (
        stopped_by_signals() as stop,
        flight_progress(errors, title, mission.rehearsal.duration_s) as progress,
    ):
        flight = fly_lockstep(
            mission,
            processes=os.cpu_count() or 1,
            epoch_s=None if out is None else time.time(),
            progress=progress,
            stop=stop,
        )
    summary = summarise(flight.record)
    if out is not None:
        keep(flight, summary, out)
    show(summary, flight, out, as_json=as_json)
    if flight.interrupted:
        errors.print(f"stopped after {flight.record.duration_s:.1f} s of flight", highlight=False)
        return BROKEN
    return ACCEPTED if summary.accepted else NOT_ACCEPTED


def prepare(out: Path) -> None:
    """Make the directory, before the flight rather than after it."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / f".{SUMMARY_NAME}.probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"{out}: cannot be written to ({error.strerror}); give another directory with --out"
        ) from error


def keep(flight: Flight, summary: Summary, out: Path) -> None:
    """Write everything about a flight into its directory."""
    flight.record.save(out / RECORD_NAME)
    for name, log in flight.logs.items():
        log.write(out / f"{name}.tlog")
    text = json.dumps(summary_json(summary), indent=2)
    (out / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
    write_report(flight.record, out)


def show(summary: Summary, flight: Flight, out: Path | None, *, as_json: bool) -> None:
    """Print the summary: JSON alone, or a table with what the companions had to say."""
    console = Console()
    if as_json:
        console.print_json(json.dumps(summary_json(summary)))
        return
    for name, events in flight.events.items():
        for event in events:
            if event.warning:
                console.print(f"{event.time_s:7.2f} s  {name}: {event.text}", highlight=False)
    console.print(summary_table(summary))
    if out is not None:
        console.print(f"report: {out / 'report.html'}", highlight=False, soft_wrap=True)


@contextmanager
def stopped_by_signals() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C or SIGTERM has come: the flight ends where it is, between two steps, and is kept."""
    stopped = False

    def stop(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
