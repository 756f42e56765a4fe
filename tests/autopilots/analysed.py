"""Holds what `vfguide analyse` finds in the logs of a flight in software against what was truly flown.

    python -m tests.autopilots.fly_sitl missions/ardupilot-sitl.yaml --wind 5,270 --keep DIR
    python -m tests.autopilots.analysed DIR

DIR is what `fly_sitl --keep` left: the autopilots' own logs, their companions' telemetry logs, and where
everybody truly was. Exit status: 0 everything agrees or the logs do not allow more, 1 it does not.
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.autopilots.formation import RECORDED, TRUE_TRACKS
from vfguide.commands.analyse import answers_of, slips_of
from vfguide.elementwise import FloatArray
from vfguide.errors import VfguideError
from vfguide.identification.flown import answer_sentence, slip_sentence
from vfguide.lab.debrief.logged_flight import LoggedFlight, logged_flight, read_log
from vfguide.lab.report.figures import slot_error
from vfguide.mission import Mission, load_mission
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

KINDS = {
    "ArduPlane's .BIN": "*/logs/*.BIN",
    "PX4's .ulg": "*/log/*/*.ulg",
    "companions' .tlog": f"{RECORDED}/*/*.tlog",
}
"""Where each kind of log lies in the directory."""

KNOWN = {
    ("ardupilot", "course"): (0.72, 0.84),
    ("ardupilot", "speed"): (1.0, 1.0),
    ("px4", "course"): (0.9, 0.9),
}
"""Bandwidths, 1/s, from the least to the greatest that is known otherwise: ArduPlane's course by long steps
and by steady turns with GUIDED_P 12000, the others as the missions say. PX4 holds no speed by a loop of
first order."""

KNOWN_SLIP = {"ardupilot": 0.745}
"""What each turns of g tan(bank) / V, as its mission says."""

AGREES_M = 0.1
"""Mean slot errors by a log and by the truth may be so far apart, as far as the estimates are right."""

SEARCH_S, STEP_S, FINEST_S = 20.0, 0.2, 1e-3
"""How far a log's time may be from the judge's, and how finely that is looked for at first and at last."""

PIECES = 8
"""Of a flight, in which that is looked for."""

JOINED_S = 70.0
"""Of a flight is not looked at where slots are compared: followers were on their way."""

TABLE = (
    "| log | vehicle | slot error by the log | true | apart | along, across: apart, rms | place off, rms |",
    "|---|---|---|---|---|---|---|",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """One vehicle by a log and in truth; m. A leader has no slot."""

    vehicle: str
    place_m: float
    logged_m: float = math.nan
    true_m: float = math.nan
    along_m: float = math.nan
    cross_m: float = math.nan

    @property
    def agrees(self) -> bool:
        """Whether the log says what is true, or as much as its estimates allow."""
        leads = math.isnan(self.logged_m)
        return leads or abs(self.logged_m - self.true_m) <= max(AGREES_M, self.place_m)

    def row(self, title: str) -> str:
        """The line of a table."""
        cells = ["", "", "", ""]
        if np.isfinite(self.logged_m):
            apart = self.logged_m - self.true_m
            cells = [f"{self.logged_m:.2f} m", f"{self.true_m:.2f} m", f"{apart:+.2f} m"]
            cells.append(f"{self.along_m:.2f}, {self.cross_m:.2f} m")
        return f"| {title} | {self.vehicle} | {' | '.join(cells)} | {self.place_m:.2f} m |"


def places_at(vehicle: VehicleRecord, own_s: FloatArray, at_s: FloatArray) -> FloatArray:
    """Complex places, north and east in m, at other times; NaN outside the record."""
    places: FloatArray = np.interp(
        at_s, own_s, vehicle.north_m + 1j * vehicle.east_m, left=np.nan, right=np.nan
    )
    return places


@dataclass(frozen=True, slots=True)
class Clocks:
    """How a log's clock runs against the judge's: PX4's in software runs 1 % slow."""

    ahead_s: float
    rate: float

    def logged(self, true_s: FloatArray) -> FloatArray:
        """The log's times of some of the judge's."""
        return true_s * self.rate + self.ahead_s


def clocks_of(logged: FlightRecord, true: FlightRecord) -> Clocks:
    """Where all places fit best, found in pieces of the flight, and the line through them."""
    pieces = np.array_split(true.time_s, PIECES)[1:-1]
    middles = [float(np.mean(piece)) for piece in pieces]
    rate, first = np.polyfit(middles, [shift_of(logged, true, piece) for piece in pieces], 1)
    return Clocks(float(first), 1.0 + float(rate))


def shift_of(logged: FlightRecord, true: FlightRecord, at_s: FloatArray) -> float:
    """What the log's time is ahead of the judge's at some of his times, s."""
    truth = {one.name: places_at(one, true.time_s, at_s) for one in true.vehicles}

    def misfit(shift_s: float) -> float:
        places = [places_at(one, logged.time_s, at_s + shift_s) for one in logged.vehicles]
        apart = [
            place - truth[one.name] for place, one in zip(places, logged.vehicles, strict=True)
        ]
        return float(np.mean(np.nan_to_num(np.abs(apart), nan=1e6) ** 2))

    centre, width, step = 0.0, SEARCH_S, STEP_S
    while step >= FINEST_S:
        centre = float(min(np.arange(centre - width, centre + width, step), key=misfit))
        width, step = 2.0 * step, 0.1 * step
    return centre


def compared(logged: FlightRecord, true: FlightRecord) -> Iterator[Compared]:
    """Each vehicle of a log, on the judge's time."""
    clocks = clocks_of(logged, true)
    window = true.time_s >= min(JOINED_S, 0.5 * true.time_s[-1])
    at_s = clocks.logged(true.time_s[window])
    truth = {one.name: one for one in true.vehicles}
    for one in logged.vehicles:
        real = truth[one.name]
        off = np.abs(
            places_at(one, logged.time_s, at_s) - places_at(real, true.time_s, true.time_s[window])
        )
        place_m = root_mean_square(off)
        if one.role == "leader":
            yield Compared(vehicle=one.name, place_m=place_m)
            continue
        told = slot_error(logged.reference, one)
        flown = slot_error(true.reference, real)
        along = np.interp(at_s, logged.time_s, told.along_track_m)
        cross = np.interp(at_s, logged.time_s, told.cross_track_m)
        yield Compared(
            vehicle=one.name,
            logged_m=float(np.mean(np.hypot(along, cross))),
            true_m=float(np.mean(flown.distance_m[window])),
            along_m=root_mean_square(along - flown.along_track_m[window]),
            cross_m=root_mean_square(cross - flown.cross_track_m[window]),
            place_m=place_m,
        )


def root_mean_square(values: FloatArray) -> float:
    """Of what is known."""
    return float(np.sqrt(np.nanmean(values**2)))


def flights_of(mission: Mission, paths: Sequence[Path]) -> Iterator[LoggedFlight]:
    """One flight of all logs; of the leader's alone where their clocks cannot be compared."""
    logs = [log for path in paths for log in read_log(path, mission)]
    try:
        yield logged_flight(mission, logs)
    except VfguideError as error:
        sys.stdout.write(f"{error}\n")
        leads = mission.leader_vehicle.system_id
        yield logged_flight(mission, [log for log in logs if log.system_id == leads])


def known_otherwise(mission: Mission, flight: LoggedFlight) -> Iterator[tuple[str, str, bool]]:
    """(what a log is found to say, what is known otherwise, whether that is within its uncertainty)."""
    for answer in answers_of(mission, flight):
        known = KNOWN.get((mission.vehicles[answer.vehicle].autopilot, answer.loop))
        if known is not None:
            said = "-".join(f"{value:g}" for value in sorted(set(known)))
            one = answer.response
            within = one is None or (one.least <= known[1] and known[0] <= one.greatest)
            yield answer_sentence(answer), said, within
    for slip in slips_of(mission, flight):
        share = KNOWN_SLIP.get(mission.vehicles[slip.vehicle].autopilot)
        if share is not None:
            found = None if slip.slip is None else slip.slip.efficiency
            within = found is None or abs(found.value - share) <= found.half_width
            yield slip_sentence(slip), f"{share:g}", within


def compare(directory: Path) -> bool:
    """Print tables and sentences; whether everything agrees."""
    mission = load_mission(directory / "mission.yaml")
    true = FlightRecord.load(directory / TRUE_TRACKS)
    good, rows, sentences = True, [], []
    for title, pattern in KINDS.items():
        if not (paths := sorted(directory.glob(pattern))):
            continue
        for flight in flights_of(mission, paths):
            for one in compared(flight.record, true):
                rows.append(one.row(title))
                good &= one.agrees
            for sentence, known, within in known_otherwise(mission, flight):
                good &= within
                verdict = "within" if within else "NOT WITHIN"
                sentences.append(f"{title}: {sentence} [known otherwise: {known}: {verdict}]")
    sys.stdout.write("\n".join((*TABLE, *rows, "", *sentences)) + "\n")
    return good and bool(rows)


def main() -> int:
    """Compare."""
    parser = argparse.ArgumentParser(description=__doc__, prog="analysed")
    parser.add_argument("directory", type=Path, help="what `fly_sitl --keep` left")
    return 0 if compare(parser.parse_args().directory) else 1


if __name__ == "__main__":
    sys.exit(main())
