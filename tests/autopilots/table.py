"""Flies the rows of docs/accuracy.md on real autopilots, several flights each, of which the worst counts.

    python -m tests.autopilots.table px4-circle px4-line --flights 2

The programs are named by the variables ARDUPLANE and PX4. Every flight is appended to a file as a line of
JSON as soon as it is over; `--print` makes the table of what is there. Exit status: 0 all flown, 1 not.
"""

import argparse
import json
import math
import os
import shlex
import signal
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from operator import attrgetter
from pathlib import Path

from tests.autopilots.fly_sitl import arguments, flown
from tests.autopilots.programs import FlightError
from tests.autopilots.verdict import MOST_LOST_S, heading_of
from vfguide.errors import VfguideError
from vfguide.lab.report.figures import Spread

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


ROWS: Mapping[str, str] = {
    "arduplane-circle": f"{ARDUPLANE} --wind 5,270",
    "arduplane-line": f"{ARDUPLANE} --wind 5,270 {LINE}",
    "arduplane-tight": f"{ARDUPLANE} --wind 5,270 {TIGHT.format('clockwise')}",
    "arduplane-tight-left": f"{ARDUPLANE} --wind 5,270 {TIGHT.format('counterclockwise')}",
    "arduplane-auto": f"{ARDUPLANE} --wind 5,270 --factory {NOTHING_DECLARED}",
    "arduplane-gusts": f"{ARDUPLANE} --wind 5,270 --turbulence 1",
    "arduplane-gale": f"{ARDUPLANE} --wind 8,270 --turbulence 2",
    "arduplane-gale-wide": f"{ARDUPLANE} --wind 8,270 --turbulence 2 {with_slots('wide')}",
    "arduplane-gale-abreast": f"{ARDUPLANE} --wind 8,270 --turbulence 2 {with_slots('abreast')}",
    "px4-circle": PX4,
    "px4-line": f"{PX4} {LINE}",
    "px4-position": f"{PX4} --guided OFFBOARD {EVERY_VEHICLE.format('px4_steering: position')}",
    "px4-auto": f"{PX4} --factory --wind 4,270 {EVERY_VEHICLE.format('response: auto')}",
    "px4-mavsdk": f"{PX4} {EVERY_VEHICLE.format('autopilot: mavsdk')}",
    "px4-mavsdk-position": f"{PX4} --guided OFFBOARD"
    f" {EVERY_VEHICLE.format('autopilot: mavsdk, px4_steering: position')}",
}
"""By name: what `python -m tests.autopilots.fly_sitl` is told for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """One flight of a row; distances in m."""

    row: str
    options: str
    began: str
    """UTC."""
    duration_s: float
    intended: Spread
    """Distances from the slots as meant."""
    as_it_is: Spread
    """In the leader's own frame."""
    roll: float
    """How fast the follower that rolls most rolls (rms), in parts of how fast the leader does."""
    roll_deg_s: float
    """The same, degrees a second: in calm air a leader hardly rolls at all."""
    limited: float
    """The greatest share of a follower's setpoints that a limit cut."""
    lost_s: float
    """What the clock of the slowest simulator fell behind."""
    load: float
    """Of the computer, over the last five minutes of the flight."""

    def line(self) -> str:
        """For the terminal."""
        lost = "" if self.kept_time else ": it tells of the computer"
        return (
            f"{self.row}, {self.began}: {words(self.intended)} m as meant, {words(self.as_it_is)} in the"
            f" leader's frame, roll {self.roll_deg_s:.1f} deg/s ({self.roll:.2f} of the leader's),"
            f" limited {self.limited:.1%}, lost {self.lost_s:.2f} s{lost}, load {self.load:.1f}"
        )

    @property
    def kept_time(self) -> bool:
        """Whether it counts."""
        return self.lost_s < MOST_LOST_S


def main() -> int:
    """Fly the rows, and print their table."""
    parser = argparse.ArgumentParser(description=__doc__, prog="table")
    add = parser.add_argument
    add("rows", nargs="*", metavar="ROW", help=f"all if none: {', '.join(ROWS)}")
    add("--flights", type=int, default=2, help="of each row (default: %(default)s)")
    add("--duration", type=float, default=240.0, metavar="S", help="(default: %(default)s)")
    add("--results", type=Path, default=Path("sitl-flights.jsonl"), help="(default: %(default)s)")
    add("--keep", type=Path, metavar="DIR", help="keep there what all said, by row and time")
    add("--print", action="store_true", dest="only_print", help="fly nothing")
    options = parser.parse_args()
    names = options.rows or list(ROWS)
    if unknown := set(names) - set(ROWS):
        parser.error(f"no row {', '.join(unknown)}; there are {', '.join(ROWS)}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    failed = False
    flights = 0 if options.only_print else options.flights
    for name in [each for each in names for _ in range(flights)]:
        try:
            flight = fly_row(name, options.duration, options.keep)
        except (FlightError, VfguideError) as error:
            failed = True
            sys.stdout.write(f"{name}: {error}\n")
            continue
        append(options.results, flight)
        sys.stdout.write(f"{flight.line()}\n")
        sys.stdout.flush()
    sys.stdout.write(table(flight for flight in read(options.results) if flight.row in names))
    return int(failed)


def fly_row(name: str, duration_s: float, keep: Path | None) -> Flight:
    """Fly a row once, and keep below a directory what all said."""
    began = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
    told = [*shlex.split(ROWS[name]), "--duration", f"{duration_s:g}"]
    # PX4 puts its directory into its PATH, where a colon would cut it in two.
    told += ["--keep", str(keep / f"{name}-{began.replace(':', '')}")] if keep else []
    _, verdict = flown(arguments().parse_args(told), record=True)
    return Flight(
        row=name,
        options=ROWS[name],
        began=began,
        duration_s=duration_s,
        intended=verdict.intended,
        as_it_is=verdict.as_it_is,
        roll=verdict.roll_against("leader"),
        roll_deg_s=max(verdict.bank_rate_rms_deg_s[name] for name in verdict.followers),
        limited=max(verdict.limited[follower] for follower in verdict.followers),
        lost_s=max(verdict.lost_s.values()),
        load=os.getloadavg()[1],
    )


def append(file: Path, flight: Flight) -> None:
    """Add a flight to those that are kept."""
    with file.open("a") as results:
        results.write(json.dumps(asdict(flight)) + "\n")


def read(file: Path) -> list[Flight]:
    """The flights that are kept."""
    lines = file.read_text().splitlines() if file.exists() else []
    spreads = {"intended", "as_it_is"}
    return [
        Flight(**{name: Spread(**one) if name in spreads else one for name, one in row.items()})
        for row in map(json.loads, lines)
    ]


HEADING = heading_of(
    *("row", "flights", "worst mean, m", "95 %", "greatest", "in the leader's frame, m"),
    *("roll, deg/s", "against the leader's", "setpoints at a limit", "all means, m"),
)


COLUMNS = {
    "intended.mean": ".2f",
    "intended.p95": ".2f",
    "intended.max": ".2f",
    "as_it_is.mean": ".2f",
    "roll_deg_s": ".1f",
    "roll": ".2f",
    "limited": ".1%",
}
"""Of which the worst of a row's flights counts, and how each is written."""


def table(flights: Iterable[Flight]) -> str:
    """The worst of each row, as in docs/accuracy.md; flights whose simulators lost time do not count."""
    by_row: dict[str, list[Flight]] = {}
    for flight in flights:
        by_row.setdefault(flight.row, []).append(flight)
    lines = [HEADING]
    for name, flown_so in by_row.items():
        kept = [flight for flight in flown_so if flight.kept_time]
        count = f"{len(kept)}" + (f" of {len(flown_so)}" if len(kept) < len(flown_so) else "")
        cells = [
            *(name, count),
            *(f"{worst(map(attrgetter(one), kept)):{form}}" for one, form in COLUMNS.items()),
            ", ".join(f"{flight.intended.mean:.2f}" for flight in kept),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def worst(values: Iterable[float]) -> float:
    """The greatest; no number where there are none."""
    return max(values, default=math.nan)


def words(spread: Spread) -> str:
    """As mean, 95 % and greatest."""
    return f"{spread.mean:.2f} ({spread.p95:.2f}, {spread.max:.2f})"


if __name__ == "__main__":
    sys.exit(main())
