"""`vfguide fly`: the whole formation on this computer."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from types import FrameType

from vfguide.commands.output import RECORD_NAME, SUMMARY_NAME, flown_before, kept_in
from vfguide.commands.terminal import Terminal, flight_progress
from vfguide.errors import VfguideError
from vfguide.extras import PLOTTING, require
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.metrics import summarise, summary_json
from vfguide.lab.report.summary import Summary
from vfguide.lab.report.table import summary_table
from vfguide.mission.model import Mission

EPOCH_S = 1_767_225_600.0
"""Time 0 of a flight in virtual time, in its logs: the same seed gives the same files. 1 January 2026."""

ACCEPTED, NOT_ACCEPTED, BROKEN = 0, 1, 3


def fly(mission: Mission, *, out: Path | None, force: bool, as_json: bool) -> int:
    """Fly a mission, report, and return the exit status.

    Raises:
        InputError: the directory cannot be written to, or holds something else.
        VfguideError: the flight was stopped, and an earlier one stays.
    """
    if out is not None:
        require(*PLOTTING)
    errors = Terminal(stderr=True)
    title = f"flying {mission.name}"
    with output_of(mission, out, force=force) as directory:
        flight = flown(mission, errors, title, logged=out is not None)
        return conclude(flight, directory, out=out, force=force, as_json=as_json)


def output_of(
    mission: Mission, out: Path | None, *, force: bool
) -> AbstractContextManager[Path | None]:
    """The directory to write a flight into, if it is to be kept."""
    if out is None:
        return nullcontext()
    vehicles = [mission.leader.vehicle, *mission.followers_by_name]
    return kept_in(out, mission=mission.name, vehicles=vehicles, force=force)


def flown(mission: Mission, errors: Terminal, title: str, *, logged: bool) -> LockstepFlight:
    """The flight in virtual time, to its end or to Ctrl-C."""
    with (
        stopped_by_signals() as stop,
        flight_progress(errors, title, mission.rehearsal.duration_s) as progress,
    ):
        return fly_rehearsal(
            mission,
            processes=os.cpu_count() or 1,
            epoch_s=EPOCH_S if logged else None,
            progress=progress,
            stop=stop,
        )


def conclude(
    flight: LockstepFlight, directory: Path | None, *, out: Path | None, force: bool, as_json: bool
) -> int:
    """Keep and print what a flight came to, and return the exit status.

    Args:
        flight: as flown.
        directory: to write into; None keeps nothing.
        out: where that will be moved to.
        force: whether a flight that was stopped may take the place of an earlier one.
        as_json: whether standard output is the summary alone.

    Raises:
        VfguideError: the flight was stopped, and the earlier one in `out` stays.
    """
    if flight.interrupted:
        then = "" if directory is None else "; the report is being written"
        Terminal(stderr=True).tell(
            f"stopped after {flight.record.duration_s:.1f} s of flight{then}"
        )
    record = replace(flight.record, interrupted=flight.interrupted, latency=flight.latency)
    flight = replace(flight, record=record)
    summary = summarise(record)
    if directory is not None:
        keep(flight, summary, directory)
    earlier_stays = (
        flight.interrupted and out is not None and flown_before(out) is not None and not force
    )
    show(summary, flight, directory if earlier_stays else out, as_json=as_json)
    if earlier_stays:
        raise VfguideError(f"{out}: the earlier flight stays; --force would have replaced it")
    if flight.interrupted:
        return BROKEN
    return ACCEPTED if summary.accepted else NOT_ACCEPTED


def keep(flight: LockstepFlight, summary: Summary, out: Path) -> None:
    """Write everything about a flight into its directory."""
    # Here, because it brings the plotting library: a daemon on an aircraft has no use for 30 MB of it.
    from vfguide.lab.report.page import write_report

    flight.record.save(out / RECORD_NAME)
    for name, log in flight.logs.items():
        log.write(out / f"{name}.tlog")
    text = json.dumps(summary_json(summary), indent=2)
    (out / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
    write_report(flight.record, out)


def show(summary: Summary, flight: LockstepFlight, out: Path | None, *, as_json: bool) -> None:
    """Print the summary: JSON alone, or a table with what the companions had to say."""
    output = Terminal()
    if as_json:
        output.tell(json.dumps(summary_json(summary), indent=2))
        return
    for name, events in flight.events.items():
        for event in events:
            if event.warning:
                output.tell(f"{event.time_s:7.2f} s  {name}: {event.text}")
    output.print(summary_table(summary))
    if out is not None:
        output.tell(f"report: {out / 'report.html'}")


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
