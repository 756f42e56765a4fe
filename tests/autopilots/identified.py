"""Flies `vfguide identify` on one real autopilot in software, and prints what it finds.

    python -m tests.autopilots.identified missions/ardupilot-sitl.yaml --program arduplane --wind 5,270

The program is named by --binary, or by the variables ARDUPLANE and PX4. Exit status: that of
`vfguide identify`.
"""

import argparse
import sys
import time
from pathlib import Path

from tests.autopilots.formation import BOOT_S, alone, flight_directory, load
from tests.autopilots.programs import FlightError, Program, vfguide
from tests.autopilots.simulators import Conditions, add_air, add_program, find_program, wind_of

LONGEST_S = 600.0
"""Of a flight of steps; two minutes are usual."""


def main() -> int:
    """Fly it, and print what it said."""
    parser = argparse.ArgumentParser(description=__doc__, prog="identified")
    add = parser.add_argument
    add("mission", type=Path)
    add_program(parser)
    add_air(parser)
    add("--keep", type=Path, metavar="DIR", help="keep there what all said")
    options = parser.parse_args()
    conditions = Conditions(**wind_of(options.wind), factory=options.factory)
    try:
        binary = find_program(options.program, options.binary)
        with flight_directory(options.keep and options.keep.resolve()) as directory:
            said, status = flown(options.mission, options.program, binary, directory, conditions)
    except FlightError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(f"{said}exit status {status}\n")
    return status


def flown(
    file: Path, kind: str, binary: Path, directory: Path, conditions: Conditions
) -> tuple[str, int]:
    """Fly the steps with one aircraft, the mission's leader: (what was said, exit status)."""
    mission = load(file, {})
    with alone(kind, binary, directory, mission, conditions) as simulator:
        identify = Program(
            "identify",
            vfguide(
                *("identify", mission.leader.vehicle, "--mission", str(file.resolve())),
                *("--out", str(directory / "out"), "--mavlink", simulator.companion_url),
                *("--state", str(directory / "state")),
            ),
            directory,
        )
        try:
            simulator.enter("LOITER")
            identify.start()
            simulator.station.wait(
                lambda: "waiting until the pilot" in identify.output.read_text(),
                "no program",
                BOOT_S,
            )
            simulator.enter("GUIDED")
            gives_up = time.monotonic() + LONGEST_S
            while identify.running and time.monotonic() < gives_up:
                simulator.program.check()
                time.sleep(0.1)
            status = identify.status
            if status is None:
                raise FlightError(f"the steps are not flown after {LONGEST_S:g} s")
            return identify.output.read_text(), status
        finally:
            identify.stop()


if __name__ == "__main__":
    sys.exit(main())
