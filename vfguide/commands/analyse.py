"""`vfguide analyse`: a flight's report from its autopilots' logs."""

from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.options import Force, MissionFile, in_directory
from vfguide.commands.output import RECORD_NAME, REPORT_NAMES, refuse_foreign, whole_file
from vfguide.commands.report import write_report_of
from vfguide.commands.terminal import Terminal
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import BoolArray
from vfguide.identification.flown import (
    Answer,
    SlipAnswer,
    answer_sentence,
    flown_profile,
    flown_responses,
    flown_slip,
    known_slips,
    slip_sentence,
    with_responses,
)
from vfguide.lab.debrief.logged_flight import LOGGED_MODES, LoggedFlight, logged_flight, read_log
from vfguide.mission import Mission, read_mission
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord


def analyse(
    mission: MissionFile,
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="ArduPilot's .BIN, PX4's .ulg or a .tlog, one for each vehicle; their system ids say whose. "
            "Or Paparazzi's exported .csv, named after the vehicles.",
        ),
    ],
    *,
    out: Annotated[Path, in_directory("Where record and report go.")],
    force: Force = False,
) -> None:
    """Write the report of a flight from the logs that its autopilots wrote.

    Exit status: 0 written, 2 a log cannot be read, they do not fit together, or the directory cannot be
    written to.
    """
    flown = read_mission(mission).mission
    refuse_foreign(out, flown.name, (*REPORT_NAMES, RECORD_NAME), force=force)
    flight = logged_flight(flown, [log for path in logs for log in read_log(path, flown)])
    answers, slips = answers_of(flown, flight), slips_of(flown, flight)
    record = with_responses(flight.record, answers, known_slips(slips))
    write_report_of(record, out)
    with whole_file(out / RECORD_NAME) as partial:
        record.save(partial)
    tell_responses(answers, slips)


def answers_of(mission: Mission, flight: LoggedFlight) -> list[Answer]:
    """Return the identified course and speed responses of all vehicles."""
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


def slips_of(mission: Mission, flight: LoggedFlight) -> list[SlipAnswer]:
    """Return the identified slip of each vehicle's turns."""
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


def guided(record: FlightRecord, vehicle: VehicleRecord) -> BoolArray:
    """Return a mask of the samples at which the autopilot's log shows guidance."""
    flown: BoolArray = vehicle.mode == record.mode_names.index(LOGGED_MODES[Mode.TRACKING.value])
    return flown


def tell_responses(answers: list[Answer], slips: list[SlipAnswer]) -> None:
    """Print each autopilot's responses with their uncertainty, and lines for the mission file."""
    output = Terminal()
    for answer in answers:
        output.tell(answer_sentence(answer))
    for slip in slips:
        output.tell(slip_sentence(slip))
    if profile := flown_profile(answers, known_slips(slips)):
        output.tell(f"to be put under `vehicles` in the mission:\n{profile}")
