"""Flies the rows of docs/accuracy.md on real autopilots, several flights each.

    python -m tests.autopilots.table px4-circle px4-line --flights 2

The programs are named by the variables ARDUPLANE and PX4. Every flight whose simulators kept time is
appended to docs/results as soon as it is over; `make tables` makes the table. Exit status: 1 if one failed.
"""

import argparse
import shlex
import signal
import sys
from datetime import UTC, datetime
from pathlib import Path

from tests.autopilots.fly_sitl import arguments, flown
from tests.autopilots.programs import FlightError
from tests.autopilots.verdict import MOST_LOST_S
from tests.benchmarks.results import Figures, append, row
from vfguide.errors import VfguideError

MISSIONS = {
    "arduplane": "missions/ardupilot-sitl.yaml",
    "px4": "missions/px4-sitl.yaml --program px4",
}


def every_vehicle(fields: str) -> str:
    """The option that changes fields of all vehicles."""
    return f"--with '{{vehicles: {{defaults: {{{fields}}}}}}}'"


LINE = "--with '{path: {type: line, point: {north_m: 0, east_m: 0}, course_deg: 45, gain: 0.01}}'"
TIGHT = "--with '{{path: {{radius_m: 150, centre: {{north_m: 200, east_m: 0}}, direction: {}}}}}'"

NOTHING_DECLARED = every_vehicle(
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


WIND, GALE = "--wind 5,270", "--wind 8,270 --turbulence 2"
MAVSDK = "autopilot: mavsdk"
BY_POSITIONS = "px4_steering: position"

ROWS = {
    "arduplane-circle": ("circle of 250 m, 5 m/s of wind", WIND),
    "arduplane-line": ("line, 5 m/s", f"{WIND} {LINE}"),
    "arduplane-tight": ("circle of 150 m", f"{WIND} {TIGHT.format('clockwise')}"),
    "arduplane-tight-left": (
        "circle of 150 m, left turns",
        f"{WIND} {TIGHT.format('counterclockwise')}",
    ),
    "arduplane-auto": (
        "factory parameters, nothing declared",
        f"{WIND} --factory {NOTHING_DECLARED}",
    ),
    "arduplane-gusts": ("circle, SIM_WIND_TURB 1", f"{WIND} --turbulence 1"),
    "arduplane-gale": ("8 m/s, SIM_WIND_TURB 2", GALE),
    "arduplane-gale-wide": ("8 m/s, SIM_WIND_TURB 2, wide slots", f"{GALE} {with_slots('wide')}"),
    "arduplane-gale-abreast": (
        "8 m/s, SIM_WIND_TURB 2, abreast",
        f"{GALE} {with_slots('abreast')}",
    ),
    "px4-circle": ("circle of 200 m, calm", ""),
    "px4-line": ("line, calm", LINE),
    "px4-position": ("steered by positions", f"--guided OFFBOARD {every_vehicle(BY_POSITIONS)}"),
    "px4-auto": (
        "4 m/s of wind, factory parameters, nothing declared",
        f"--factory --wind 4,270 {every_vehicle('response: auto')}",
    ),
    "px4-mavsdk": ("by MAVSDK", every_vehicle(MAVSDK)),
    "px4-mavsdk-position": (
        "by MAVSDK, positions",
        f"--guided OFFBOARD {every_vehicle(f'{MAVSDK}, {BY_POSITIONS}')}",
    ),
}
"""Rows of the tables: what is flown, for who reads them, and options of `fly_sitl` beside the mission."""


def told(name: str) -> list[str]:
    """Options of `python -m tests.autopilots.fly_sitl` for a row."""
    return shlex.split(f"{MISSIONS[name.partition('-')[0]]} {ROWS[name][1]}")


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
    options = [*told(name), "--duration", f"{duration_s:g}"]
    options += ["--keep", str(keep / f"{name}-{began}")] if keep else []
    _, verdict = flown(arguments().parse_args(options), record=True)
    figures = {
        "what": ROWS[name][0],
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
