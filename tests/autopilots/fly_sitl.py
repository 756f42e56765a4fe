"""Flies a mission on real autopilots in software, and judges it by their true positions.

    python -m tests.autopilots.fly_sitl missions/ardupilot-sitl.yaml --program arduplane --wind 5,270

The program is named by --binary, or by the variables ARDUPLANE and PX4. Exit status: 0 flown, 1 not.
"""

import argparse
import json
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import reduce
from pathlib import Path
from typing import Any

import yaml

from tests.autopilots.faults import Fault, Occurrence, faults, ordered
from tests.autopilots.formation import Plan, flight_directory, fly, load, merged
from tests.autopilots.programs import FlightError, find_mosquitto
from tests.autopilots.simulators import PROGRAMS, Conditions, find_program
from tests.autopilots.verdict import AFTERMATH_HEADING, HEADING, Verdict
from vfguide.companion.clock import Clock
from vfguide.errors import VfguideError


def arguments() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(description=__doc__, prog="fly_sitl")
    default = "(default: %(default)s)"
    several: dict[str, Any] = {"action": "append", "default": []}
    add = parser.add_argument
    add("mission", type=Path, help="mission file")
    add("--program", choices=list(PROGRAMS), default="arduplane", help=default)
    add("--binary", help="the autopilot's program (default: $ARDUPLANE or $PX4)")
    add("--wind", default="0,270", metavar="M_S,FROM_DEG", help="mean wind")
    add("--factory", action="store_true", help="leave the autopilot's parameters as they come")
    add("--turbulence", type=float, default=0.0, help=f"ArduPlane's SIM_WIND_TURB {default}")
    add("--set", **several, metavar="NAME=VALUE", help="a parameter, in flight too")
    add("--with", **several, dest="changes", metavar="YAML", help="changed fields")
    add("--duration", type=float, default=240.0, metavar="S", help=f"of the flight {default}")
    what = f"what goes wrong, and when; may be repeated: {', '.join(faults('', ''))}"
    add("--fault", **several, metavar="NAME@S", help=what)
    given = 'given by `vfguide order`, such as "60:line-abreast,100:vee --spacing 30"'
    add("--orders", default="", metavar="S:WORDS,...", help=given)
    add("--kill-leader-at", type=float, metavar="S", help="the same as --fault leader-lost@S")
    add("--vehicle", help="follower that faults meet (default: the second)")
    add("--first-instance", type=int, help="of the simulators (default: the first that is free)")
    add("--guided", default="GUIDED", help=f"pilots select it; PX4 before 1.18: OFFBOARD {default}")
    add("--engage", action="store_true", help="start companions with --engage")
    add("--pace", type=float, default=1.0, help=f"flight's time in parts of real time {default}")
    add("--keep", type=Path, metavar="DIR", help="keep there what all said, heard and flew")
    add("--json", action="store_true", help="print everything as JSON")
    return parser


def main() -> int:
    """Fly, and print the row of the table."""
    options = arguments().parse_args()
    # Told to end, it ends what it has started, too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    try:
        mission, verdict = flown(options)
    except (FlightError, VfguideError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    if options.json:
        sys.stdout.write(json.dumps(asdict(verdict), indent=2) + "\n")
        return 0
    sys.stdout.write(f"{HEADING}\n{verdict.row(mission)}\n")
    if verdict.faults:
        rows = "\n".join(one.row() for one in verdict.faults)
        sys.stdout.write(f"\n{AFTERMATH_HEADING}\n{rows}\n\n")
    for name, lost_s in verdict.lost_s.items():
        late_ms = verdict.late_s[name] * 1e3
        sys.stdout.write(
            f"{name}: clock lost {lost_s:.2f} s; 95 % of reports within {late_ms:.0f} ms\n"
        )
    return 0


def flown(options: argparse.Namespace, *, record: bool = False) -> tuple[str, Verdict]:
    """Fly what the options say, recorded where that is asked for or needed: (mission's name, verdict)."""
    mission = load(options.mission, changes_of(options.changes))
    followers = list(mission.followers_by_name)
    vehicle = options.vehicle or followers[min(1, len(followers) - 1)]
    known = faults(mission.leader.vehicle, vehicle)
    occurrences = [occurrence(text, known) for text in options.fault]
    occurrences += [order(text) for text in options.orders.split(",") if text]
    if options.kill_leader_at is not None:
        occurrences.append(Occurrence(known["leader-lost"], options.kill_leader_at))
    wind_m_s, wind_from_deg = map(float, options.wind.split(","))
    binary = find_program(options.program, options.binary)
    with flight_directory(options.keep and options.keep.resolve()) as directory:
        plan = Plan(
            mission=mission,
            kind=PROGRAMS[options.program],
            binary=binary,
            conditions=Conditions(
                wind_m_s=wind_m_s,
                wind_from_deg=wind_from_deg,
                turbulence=options.turbulence,
                factory=options.factory,
                parameters=dict(parameter(text) for text in options.set),
                clock=Clock(epoch_s=time.monotonic(), rate=options.pace),
            ),
            directory=directory,
            mosquitto=find_mosquitto(),
            first_instance=options.first_instance,
            guided=options.guided,
            engage=options.engage,
            # Slots that were ordered, and who leads, are in what companions record.
            record=bool(record or options.keep or options.orders or mission.deputies),
        )
        verdict, _ = fly(plan, options.duration, sorted(occurrences, key=lambda one: one.began_s))
    return mission.name, verdict


def changes_of(texts: Sequence[str]) -> dict[str, Any]:
    """What all of --with change."""
    return reduce(merged, map(yaml.safe_load, texts), {})


def occurrence(text: str, known: Mapping[str, Fault]) -> Occurrence:
    """Read NAME@S."""
    name, _, at = text.partition("@")
    if name not in known:
        raise FlightError(f"no fault {name}; there are {', '.join(known)}")
    return Occurrence(known[name], number(at, f"--fault {text}: write NAME@S, as in {name}@70"))


def order(text: str) -> Occurrence:
    """Read S:WORDS."""
    at, _, words = text.partition(":")
    at_s = number(at, f"--orders {text}: write S:WORDS, as in 60:vee")
    return Occurrence(ordered(words), at_s)


def parameter(text: str) -> tuple[str, float]:
    """Read NAME=VALUE."""
    name, _, value = text.partition("=")
    return name.upper(), number(value, f"--set {text}: write NAME=VALUE")


def number(text: str, complaint: str) -> float:
    """Read a number."""
    try:
        return float(text)
    except ValueError:
        raise FlightError(complaint) from None


if __name__ == "__main__":
    sys.exit(main())
