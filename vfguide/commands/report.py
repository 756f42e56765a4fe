"""`vfguide report` and `analyse`: a flight's report from its record, recordings, or autopilots' logs."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from vfguide.commands.output import (
    LONGEST_SUMMARY,
    PAGE_NAME,
    PARTIAL,
    RECORD_NAME,
    REPORT_NAMES,
    SUMMARY_NAME,
    refuse_file,
    refuse_foreign,
    whole_file,
    written_beside,
)
from vfguide.commands.terminal import Terminal
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.supervisor import Mode
from vfguide.errors import InputError
from vfguide.lab.report.metrics import summarise, summary_json
from vfguide.lab.report.table import summary_table
from vfguide.mission.model import Mission
from vfguide.record.archive import WRITE_REMEDY
from vfguide.record.flight import FlightRecord
from vfguide.record.recording import find_recordings
from vfguide.record.vehicle import VehicleRecord
from vfguide.regular_file import open_regular

if TYPE_CHECKING:
    from vfguide.elementwise import BoolArray
    from vfguide.identification.flown import Answer
    from vfguide.identification.flown_slip import SlipAnswer
    from vfguide.lab.debrief.logged_flight import LoggedFlight


def write_reports(directories: Sequence[Path], out: Path | None, *, force: bool) -> None:
    """Write summary, plots and page of the flight that some directories hold.

    Args:
        directories: one that `fly --out` wrote; or recordings, or directories that hold them.
        out: where to; into the only directory if absent.
        force: whether files of another flight, or of something else, may be replaced.

    Raises:
        InputError: there is no flight in them, it is damaged, or nothing can be written there.
    """
    record = read_flight(directories)
    if out is None and len(directories) > 1:
        raise InputError("say with --out where the report of several directories goes")
    where = directories[0] if out is None else out
    # The report beside a rehearsal's own record is that rehearsal's, whatever became of its summary.
    if out is not None or not (where / RECORD_NAME).exists():
        refuse_foreign(where, record.mission, REPORT_NAMES, force=force)
    elif where.is_symlink():
        raise InputError(f"{where}: is a symbolic link; give the directory that it leads to")
    write_report_of(record, where)


def animate_flight(
    directories: Sequence[Path],
    file: Path,
    *,
    begin_s: float | None,
    end_s: float | None,
    force: bool,
) -> None:
    """Write a moving picture of the flight that some directories hold.

    Args:
        directories: as of a report.
        file: where to.
        begin_s: from when, s of the flight.
        end_s: until when.
        force: whether a file that is there may be replaced.

    Raises:
        InputError: there is no flight in them, nothing to show, or the file cannot be written.
    """
    # Here, for the same reason as below.
    from vfguide.lab.report.animation import format_of, write_animation

    format_of(file)
    refuse_file(file, force=force)
    record = read_flight(directories)
    with whole_file(file) as partial:
        span = write_animation(record, partial, begin_s=begin_s, end_s=end_s)
    Terminal().tell(f"{file}: {span.begin_s:g} to {span.end_s:g} s of the flight")


def read_flight(directories: Sequence[Path]) -> FlightRecord:
    """The flight in some directories.

    Raises:
        InputError: there is none, or a damaged one.
    """
    for directory in directories:
        if directory.is_file():
            raise InputError(f"{directory}: is a file; give its directory, {directory.parent}")
        if not directory.is_dir():
            raise InputError(
                f"{directory}: no such directory; give one that `vfguide fly --out` wrote, "
                "or companions recorded into"
            )
    first = directories[0]
    if len(directories) == 1 and (first / RECORD_NAME).exists():
        record = FlightRecord.load(first / RECORD_NAME)
        return replace(record, wall_s=recorded_wall_s(first / SUMMARY_NAME))
    for rehearsal in directories:
        if (rehearsal / RECORD_NAME).exists():
            raise InputError(
                f"{rehearsal}: is a rehearsal, and the report is of one at a time; give it alone"
            )
    if not find_recordings(directories):
        for left in sorted(first.glob(f"{PARTIAL}*")):
            if find_recordings([left]):
                raise InputError(
                    f"{first}: holds no flight that ended; give {left}, where companions recorded"
                )
        raise InputError(
            f"{first}: holds neither {RECORD_NAME} nor recordings; give a directory that "
            "`vfguide fly --out` wrote, or companions recorded into"
        )
    from vfguide.lab.debrief.flight import flight_of
    from vfguide.lab.debrief.recordings import collect

    return flight_of(collect(directories))


def write_report_of(record: FlightRecord, where: Path) -> None:
    """Write everything into a directory, which is made if need be, and print the summary.

    Raises:
        InputError: it cannot be written to.
    """
    # Here, because it brings the plotting library, which no other command needs.
    from vfguide.lab.report.page import write_report

    summary = summarise(record)
    text = json.dumps(summary_json(summary), indent=2)
    try:
        where.mkdir(parents=True, exist_ok=True)
        with written_beside(where) as partial:
            (partial / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
            write_report(record, partial)
    except OSError as error:
        if isinstance(error, FileExistsError | NotADirectoryError):
            raise InputError(f"{where}: is a file; give a directory with --out") from error
        raise InputError(
            f"{where}: cannot be written to ({error.strerror}); {WRITE_REMEDY}"
        ) from error
    output = Terminal()
    output.print(summary_table(summary))
    for note in record.notes:
        output.tell(note)
    output.tell(f"report: {where / PAGE_NAME}")


def recorded_wall_s(path: Path) -> float | None:
    """How long the flight took, s, as its first summary tells; the record does not."""
    try:
        with open_regular(path) as file:
            wall_s = float(json.loads(file.read(LONGEST_SUMMARY))["wall_s"])
    # Whatever became of the file: it is about to be written anew.
    except (OSError, ValueError, TypeError, LookupError, RecursionError, OverflowError):
        return None
    return wall_s if math.isfinite(wall_s) and wall_s > 0.0 else None


def analyse_logs(mission: Mission, paths: Sequence[Path], out: Path, *, force: bool) -> None:
    """Write record, summary, plots and page of the flight that some logs tell of, and print the summary.

    Args:
        mission: that was flown; its system ids say whose each log is.
        paths: of the logs.
        out: directory to write into.
        force: whether files of another flight, or of something else, may be replaced.

    Raises:
        InputError: a log cannot be read, they do not fit together, or nothing can be written there.
    """
    from vfguide.lab.debrief.logged_flight import logged_flight, read_log

    refuse_foreign(out, mission.name, (*REPORT_NAMES, RECORD_NAME), force=force)
    from vfguide.identification.flown import with_responses
    from vfguide.identification.flown_slip import known_slips

    flight = logged_flight(mission, [log for path in paths for log in read_log(path, mission)])
    answers, slips = answers_of(mission, flight), slips_of(mission, flight)
    record = with_responses(flight.record, answers, known_slips(slips))
    write_report_of(record, out)
    with whole_file(out / RECORD_NAME) as partial:
        record.save(partial)
    tell_responses(answers, slips)


def answers_of(mission: Mission, flight: "LoggedFlight") -> list["Answer"]:
    """How course and speed of each vehicle answered."""
    from vfguide.identification.flown import flown_responses

    record = flight.record
    return [
        answer
        for vehicle in record.vehicles
        for answer in flown_responses(
            record.time_s,
            vehicle,
            guided(record, vehicle),
            flight_plan(mission, vehicle.name).airframe,
            flight.setpoints[vehicle.name],
        )
    ]


def slips_of(mission: Mission, flight: "LoggedFlight") -> list["SlipAnswer"]:
    """How each vehicle turned by its bank."""
    from vfguide.identification.flown_slip import flown_slip

    record = flight.record
    return [
        flown_slip(
            record.time_s,
            vehicle,
            guided(record, vehicle),
            flight_plan(mission, vehicle.name).airframe,
            mission.vehicles[vehicle.name].slips or "auto",
        )
        for vehicle in record.vehicles
    ]


def guided(record: FlightRecord, vehicle: VehicleRecord) -> "BoolArray":
    """At which samples setpoints were flown, as a log tells it."""
    from vfguide.lab.debrief.logged_flight import LOGGED_MODES

    flown: BoolArray = vehicle.mode == record.mode_names.index(LOGGED_MODES[Mode.TRACKING.value])
    return flown


def tell_responses(answers: list["Answer"], slips: list["SlipAnswer"]) -> None:
    """Print how each autopilot answered, how sure that is, and lines for the mission file."""
    from vfguide.identification.flown import answer_sentence, flown_profile
    from vfguide.identification.flown_slip import known_slips, slip_sentence

    output = Terminal()
    for answer in answers:
        output.tell(answer_sentence(answer))
    for slip in slips:
        output.tell(slip_sentence(slip))
    if profile := flown_profile(answers, known_slips(slips)):
        output.tell(f"to be put under `vehicles` in the mission:\n{profile}")
