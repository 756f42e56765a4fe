"""`vfguide analyse`: a flight from the logs that its autopilots wrote."""

from collections.abc import Sequence
from pathlib import Path

from vfguide.commands.output import RECORD_NAME, REPORT_NAMES, refuse_foreign, whole_file
from vfguide.commands.report import write_report_of
from vfguide.commands.terminal import Terminal
from vfguide.companion.plan import flight_plan
from vfguide.companion.supervisor import Mode
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord


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
    record = logged_flight(mission, [log for path in paths for log in read_log(path, mission)])
    write_report_of(record, out)
    with whole_file(out / RECORD_NAME) as partial:
        record.save(partial)
    tell_responses(mission, record)


def tell_responses(mission: Mission, record: FlightRecord) -> None:
    """Print how each autopilot answered, how sure that is, and lines for the mission file."""
    from vfguide.identification.flown import (
        Answer,
        answer_sentence,
        flown_profile,
        flown_responses,
    )
    from vfguide.lab.debrief.logged_flight import LOGGED_MODES

    output = Terminal()
    answers: list[Answer] = []
    guided = record.mode_names.index(LOGGED_MODES[Mode.TRACKING.value])
    for vehicle in record.vehicles:
        airframe = flight_plan(mission, vehicle.name).airframe
        answers += flown_responses(record.time_s, vehicle, vehicle.mode == guided, airframe)
    for answer in answers:
        output.tell(answer_sentence(answer))
    if profile := flown_profile(answers):
        output.tell(f"to be put under `vehicles` in the mission:\n{profile}")
