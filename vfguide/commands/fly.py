"""`vfguide fly`: the whole formation on this computer."""

import json
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import NoReturn

from rich.console import Console

from vfguide.commands.terminal import flight_progress
from vfguide.errors import InputError
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.tlog import TelemetryLog
from vfguide.rehearsal.lockstep import Flight, fly_lockstep
from vfguide.report.metrics import summarise, summary_json
from vfguide.report.page import write_report
from vfguide.report.summary import Summary
from vfguide.report.table import summary_table

RECORD_NAME = "flight.npz"
SUMMARY_NAME = "summary.json"

ACCEPTED, NOT_ACCEPTED, BROKEN = 0, 1, 3


@dataclass(slots=True)
class LogBook:
    """The telemetry logs of a flight, one for each vehicle."""

    epoch_s: float
    """Time 0 of the flight, seconds since 1970."""
    logs: dict[str, TelemetryLog] = field(default_factory=dict)
    """By vehicle."""

    def note(self, name: str, now: float, datagram: bytes) -> None:
        """Note a datagram of a vehicle's connection."""
        if name not in self.logs:
            self.logs[name] = TelemetryLog(self.epoch_s)
        self.logs[name].add(now, datagram)


def fly(mission: Mission, *, out: Path | None, as_json: bool) -> int:
    """Fly a mission, report, and return the exit status.

    Raises:
        InputError: the directory cannot be written to.
    """
    errors = Console(stderr=True)
    if out is not None:
        prepare(out)
    book = LogBook(time.time()) if out is not None else None
    title = f"flying {mission.name}"
    with (
        stopped_by_termination(),
        flight_progress(errors, title, mission.rehearsal.duration_s) as progress,
    ):
        flight = fly_lockstep(mission, tap=book.note if book else None, progress=progress)
    summary = summarise(flight.record)
    if out is not None and book is not None:
        keep(flight.record, summary, book, out)
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


def keep(record: FlightRecord, summary: Summary, book: LogBook, out: Path) -> None:
    """Write everything about a flight into its directory."""
    record.save(out / RECORD_NAME)
    for name, log in book.logs.items():
        log.write(out / f"{name}.tlog")
    text = json.dumps(summary_json(summary), indent=2)
    (out / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
    write_report(record, out)


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
def stopped_by_termination() -> Iterator[None]:
    """SIGTERM stops as Ctrl-C does: the flight ends where it is and is kept."""

    def stop(_number: int, _frame: FrameType | None) -> NoReturn:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
