"""Flies the rows of docs/accuracy.md on real autopilots, several flights each.

    python -m tests.autopilots.table px4-circle px4-line --flights 2

The programs are named by the variables ARDUPLANE and PX4. Every flight whose simulators kept time is
appended to docs/results as soon as it is over; `make tables` makes the table. Exit status: 1 if one failed.
"""

import argparse
import shlex
import signal
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from tests.autopilots.fly_sitl import arguments, flown
from tests.autopilots.programs import FlightError
from tests.autopilots.verdict import MOST_LOST_S
from tests.benchmarks.results import Figures, append, row
from vfguide.errors import VfguideError

ARDUPLANE = "missions/ardupilot-sitl.yaml"
PX4 = "missions/px4-sitl.yaml --program px4"

EVERY_VEHICLE = "--with '{{vehicles: {{defaults: {{{}}}}}}}'"
"""Fields of all vehicles."""

LINE = "--with '{path: {type: line, point: {north_m: 0, east_m: 0}, course_deg: 45, gain: 0.01}}'"
TIGHT = "--with '{{path: {{radius_m: 150, centre: {{north_m: 200, east_m: 0}}, direction: {}}}}}'"

NOTHING_DECLARED = EVERY_VEHICLE.format(
    "response: auto, slips: auto, alpha_1_s: null, beta_1_s: null, course_dead_time_s: null,"
    " course_lag_s: null, speed_dead_time_s: null"
)
"""What a mission need not say of a vehicle whose autopilot tells it."""

SLOTS = {"wide": ((-20, -40), (-20, 40), (-60, 0)), "abreast": ((0, -30), (0, 30), (-40, 0))}
"""Other slots than the mission's, (forward, right) m."""


def with_slots(name: str) -> str:
    """The option that puts the three followers into other slots."""
    slots = ", ".join(
        f"{{vehicle: f{n}, slot: {{forward_m: {forward}, right_m: {right}}}}}"
        for n, (forward, right) in enumerate(SLOTS[name], 1)
    )
    return f"--with '{{followers: [{slots}]}}'"


@dataclass(frozen=True, slots=True)
class FlownRow:
    """A row of the tables of real autopilots."""

    what: str
    """What is flown, for who reads the table."""
    options: str
    """What `python -m tests.autopilots.fly_sitl` is told."""


ROWS: Mapping[str, FlownRow] = {
    "arduplane-circle": FlownRow("circle of 250 m, 5 m/s of wind", f"{ARDUPLANE} --wind 5,270"),
    "arduplane-line": FlownRow("line, 5 m/s", f"{ARDUPLANE} --wind 5,270 {LINE}"),
    "arduplane-tight": FlownRow(
        "circle of 150 m", f"{ARDUPLANE} --wind 5,270 {TIGHT.format('clockwise')}"
    ),
    "arduplane-tight-left": FlownRow(
        "circle of 150 m, left turns",
        f"{ARDUPLANE} --wind 5,270 {TIGHT.format('counterclockwise')}",
    ),
    "arduplane-auto": FlownRow(
        "factory parameters, nothing declared",
        f"{ARDUPLANE} --wind 5,270 --factory {NOTHING_DECLARED}",
    ),
    "arduplane-gusts": FlownRow(
        "circle, SIM_WIND_TURB 1", f"{ARDUPLANE} --wind 5,270 --turbulence 1"
    ),
    "arduplane-gale": FlownRow(
        "8 m/s, SIM_WIND_TURB 2", f"{ARDUPLANE} --wind 8,270 --turbulence 2"
    ),
    "arduplane-gale-wide": FlownRow(
        "8 m/s, SIM_WIND_TURB 2, wide slots",
        f"{ARDUPLANE} --wind 8,270 --turbulence 2 {with_slots('wide')}",
    ),
    "arduplane-gale-abreast": FlownRow(
        "8 m/s, SIM_WIND_TURB 2, abreast",
        f"{ARDUPLANE} --wind 8,270 --turbulence 2 {with_slots('abreast')}",
    ),
    "px4-circle": FlownRow("circle of 200 m, calm", PX4),
    "px4-line": FlownRow("line, calm", f"{PX4} {LINE}"),
    "px4-position": FlownRow(
        "steered by positions",
        f"{PX4} --guided OFFBOARD {EVERY_VEHICLE.format('px4_steering: position')}",
    ),
    "px4-auto": FlownRow(
        "4 m/s of wind, factory parameters, nothing declared",
        f"{PX4} --factory --wind 4,270 {EVERY_VEHICLE.format('response: auto')}",
    ),
    "px4-mavsdk": FlownRow("by MAVSDK", f"{PX4} {EVERY_VEHICLE.format('autopilot: mavsdk')}"),
    "px4-mavsdk-position": FlownRow(
        "by MAVSDK, positions",
        f"{PX4} --guided OFFBOARD"
        f" {EVERY_VEHICLE.format('autopilot: mavsdk, px4_steering: position')}",
    ),
}


def main() -> int:
    """Fly the rows, and append what each flight came to."""
    parser = argparse.ArgumentParser(description=__doc__, prog="table")
    add = parser.add_argument
    add("rows", nargs="*", metavar="ROW", help=f"all if none: {', '.join(ROWS)}")
    add("--flights", type=int, default=2, help="of each row (default: %(default)s)")
    add("--duration", type=float, default=240.0, metavar="S", help="(default: %(default)s)")
    add("--keep", type=Path, metavar="DIR", help="keep there what all said, by row and time")
    options = parser.parse_args()
    names = options.rows or list(ROWS)
    if unknown := set(names) - set(ROWS):
        parser.error(f"no row {', '.join(unknown)}; there are {', '.join(ROWS)}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    failed = False
    for name in [each for each in names for _ in range(options.flights)]:
        try:
            figures, lost_s = fly_row(name, options.duration, options.keep)
        except (FlightError, VfguideError) as error:
            failed = True
            sys.stdout.write(f"{name}: {error}\n")
            continue
        if lost_s >= MOST_LOST_S:
            sys.stdout.write(f"{name}: {lost_s:.2f} s lost, it tells of the computer: {figures}\n")
            continue
        command = f"python -m tests.autopilots.table {name} --duration {options.duration:g}"
        append(name.partition("-")[0], [row(name, figures, command)])
    return int(failed)


def fly_row(name: str, duration_s: float, keep: Path | None) -> tuple[Figures, float]:
    """Fly a row once; return its figures, and the s that the slowest simulator's clock fell behind.

    Distances are from the slots as meant, "leaders" those in the leader's own frame. Roll is how fast the
    follower that rolls most rolls (rms), limited the greatest share of a follower's setpoints that a limit
    cut. What all said is kept below a directory.
    """
    began = f"{datetime.now(UTC):%Y-%m-%dT%H%M%SZ}"
    told = [*shlex.split(ROWS[name].options), "--duration", f"{duration_s:g}"]
    told += ["--keep", str(keep / f"{name}-{began}")] if keep else []
    _, verdict = flown(arguments().parse_args(told), record=True)
    figures = {
        "what": ROWS[name].what,
        "mean_m": verdict.intended.mean,
        "p95_m": verdict.intended.p95,
        "max_m": verdict.intended.max,
        "leaders_m": verdict.as_it_is.mean,
        "roll_deg_s": max(verdict.bank_rate_rms_deg_s[one] for one in verdict.followers),
        "limited_percent": 100.0 * max(verdict.limited[one] for one in verdict.followers),
    }
    return figures, max(verdict.lost_s.values())


if __name__ == "__main__":
    sys.exit(main())
