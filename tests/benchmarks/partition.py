"""Two parts of a formation that cannot hear each other for a while, and then do again; in lockstep.

    python -m tests.benchmarks.partition [SECONDS ...]

The leader and f2 fly on; f1 leads f3. Nobody sees the other part meanwhile: how far apart both parts'
leaders are then is what they differ in what they know of wind and path. A line for each flight.
"""

import math
import sys
from collections.abc import Sequence

import numpy as np

from tests.kit.figures import heading, row
from tests.kit.missions import mission_with, replaced
from vfguide.lab.rehearsal.aircraft import Aircraft
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.geometry import pair_separations, slot_error
from vfguide.link.memory import Mail
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

NAMES = ("line-wind", "circle-wind")
WINDS = ("none", "moderate")
LENGTHS_S = (20.0, 60.0, 180.0)

APART = (frozenset({"leader", "f2"}), frozenset({"f1", "f3"}))
SPLIT_S = 40.0
"""Everybody has been in its slot for long."""
WATCHED_S = 60.0
"""After the merge."""
BACK_M = 2.0
"""Within this of the slots counts as back; in turbulence slots are kept to a metre or two."""


COLUMNS = (
    *("mission", "turbulence", "apart for, s", "leaders apart, m", "nearest two meanwhile, m"),
    *("nearest two at the merge and after, m", "one leader after, s", "it is"),
    *(f"all within {BACK_M:g} m after, s", "greatest error, m"),
)


def mission_of(name: str, turbulence: str) -> Mission:
    """A mission of the article with two deputies, everyone in place."""
    mission = mission_with(name, wind={"turbulence": turbulence}, rehearsal={"start": {}})
    return replaced(mission, deputies=["f1", "f2"])


def parted(sender: str, hearer: str) -> bool:
    """Whether one does not hear the other while the formation is in two parts."""
    return not any({sender, hearer} <= part for part in APART)


def flown(mission: Mission, apart_s: float) -> tuple[str, ...]:
    """What came of a flight in which the formation is in two parts for so long: `COLUMNS` from the 4th on."""
    names = [mission.leader.vehicle, *mission.followers_by_name]
    flying = [Aircraft(mission, name) for name in names]
    mail, rate_hz, merge_s = list[Mail](), mission.rehearsal.rate_hz, SPLIT_S + apart_s
    times = [step / rate_hz for step in range(round((merge_s + WATCHED_S) * rate_hz) + 1)]
    for now in times:
        is_split = SPLIT_S <= now < merge_s
        mail, heard = [], mail
        for one in flying:
            sent = [each for each in heard if not (is_split and parted(each[0], one.name))]
            mail += one.step(now, sent)
    records = [one.recorder.record() for one in flying]
    return merge_of(flight_record(mission, times, records, wall_s=0.0), merge_s)


def merge_of(record: FlightRecord, merge_s: float) -> tuple[str, ...]:
    """What came of a merge at a time; both leaders' distance is that of the last moment before it."""
    time_s = record.time_s
    split, after = (time_s >= SPLIT_S) & (time_s < merge_s), time_s >= merge_s
    separations = np.array([pair.distance_m for pair in pair_separations(record)])
    terms = np.array([one.lead_term for one in record.vehicles])
    led = np.isfinite(terms)
    last = int(np.flatnonzero(split & (led.sum(axis=0) == 2))[-1])
    places = [(one.lead_north_m[last], one.lead_east_m[last]) for one in record.vehicles]
    known = [place for place, leads in zip(places, led[:, last], strict=True) if leads]
    errors = np.array([slot_error(record.reference, one).distance_m for one in record.followers])
    alone = time_s[after & (led.sum(axis=0) == 1)]
    away = time_s[after & (errors > BACK_M).any(axis=0)]
    return (
        f"{math.dist(*known):.2f}",
        *(f"{separations[:, when].min():.1f}" for when in (split, after)),
        f"{float(alone[0]) - merge_s:.2f}",
        record.vehicles[int(led[:, -1].argmax())].name,
        f"{float(away[-1]) - merge_s if away.size else 0.0:.1f}",
        f"{errors[:, after].max():.2f}",
    )


def main(lengths_s: Sequence[float]) -> None:
    """Fly and print."""
    heading(*COLUMNS)
    for name in NAMES:
        for turbulence in WINDS:
            for apart_s in lengths_s:
                found = flown(mission_of(name, turbulence), apart_s)
                row(name, turbulence, f"{apart_s:g}", *found)


if __name__ == "__main__":
    main([float(one) for one in sys.argv[1:]] or LENGTHS_S)
