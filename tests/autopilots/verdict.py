"""How well a formation of real autopilots was kept, by the geometry and figures that reports have."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np

from tests.autopilots.faults import Occurrence
from tests.autopilots.true_tracks import TrueTrack
from vfguide.elementwise import BoolArray, FloatArray
from vfguide.lab.report.figures import Spread, in_window, intended_leader, roll_rate_rms, slot_error
from vfguide.lab.report.figures import spread as known_spread
from vfguide.mission import Mission
from vfguide.mission.flight_path import path_of
from vfguide.record.flight import FlightRecord, RecordAcceptance, VehicleRecord
from vfguide.record.guidance_log import GuidanceTrack, lead_series, slot_series
from vfguide.record.vehicle import SERIES

END_S = 5.0
"""At the end of a flight, to see where everybody was then."""

MOST_LOST_S = 0.3
"""A flight in which a simulator's clock fell further behind says more of the computer than of the law."""

NEAR_M = 1.0
"""Within this of the slots is what an order is to come to."""

STILL_M = 0.002
"""A slot that moves by less from one sample to the next is at rest: 5 cm/s."""

BEFORE_S = 10.0
"""Over which distances before and after a fault are averaged."""

BACK_M = 3.0
"""Within this of the slots counts as back; calm flights stay within 1.1 m, gusty ones within 2 m."""


def heading_of(*columns: str) -> str:
    """The first two lines of a table."""
    return f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|"


@dataclass(frozen=True, slots=True)
class Nearest:
    """How near two aircraft came."""

    distance_m: float
    first: str
    second: str
    time_s: float
    """After the pilots had selected the guided mode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aftermath:
    """What came of a fault, until the next one or the end."""

    what: str
    nearest_horizontal: Nearest
    nearest: Nearest
    """In three dimensions."""
    back_s: float | None
    """From its end until every follower that is steered was back and stayed; None: not by then."""
    near_s: float | None
    """The same, until all were within `NEAR_M` of their slots."""
    before_m: float
    """Mean distance from the slots in the `BEFORE_S` before."""
    after_m: float
    """The same, in as long a time before the next fault or the end."""
    greatest_m: float
    """The greatest distance from the slots from the fault on."""
    moved_s: tuple[float, float] | None
    """When ordered slots began to move and came to rest, s after the fault; None: none moved."""
    led_s: float | None
    """After so long another vehicle led; None: none did."""

    def row(self) -> str:
        """The line of a table."""
        seconds = (*(self.moved_s or (None, None)), self.near_s, self.back_s, self.led_s)
        columns = (
            self.what,
            *(f"{one.distance_m:.1f}" for one in (self.nearest_horizontal, self.nearest)),
            *("-" if one is None else f"{one:.1f}" for one in seconds),
            *(f"{error:.2f}" for error in (self.before_m, self.after_m, self.greatest_m)),
        )
        return f"| {' | '.join(columns)} |"


AFTERMATH_HEADING = heading_of(
    *("fault or order", "nearest two, level, m", "in space, m", "slots move from, s", "to, s"),
    *(f"within {NEAR_M:g} m after, s", f"within {BACK_M:g} m after, s", "another leads after, s"),
    *("error before, m", "after", "greatest"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One flight; distances over its second half, m."""

    as_it_is: Spread
    """From the slots at the leader as it truly was, in its true course."""
    intended: Spread
    """From the slots at the leader's true place, in the course of the path there."""
    in_space: Spread
    """From the same slots, heights included."""
    height: Spread
    """Of the heights alone."""
    followers: dict[str, float]
    """Mean distance of each follower from its slot at the leader as it was."""
    at_end: dict[str, float]
    """The same, over the last seconds of the flight."""
    nearest_horizontal: Nearest
    nearest: Nearest
    """In three dimensions."""
    faults: tuple[Aftermath, ...]
    """In the order of time."""
    bank_rate_rms_deg_s: dict[str, float]
    """Of each aircraft."""
    limited: dict[str, float]
    """Share of each companion's setpoints that a limit cut, of those that recorded."""
    lost_s: dict[str, float]
    """By how much each simulator's clock fell behind in the flight."""
    late_s: dict[str, float]
    """How late 95 % of each one's reports at most were."""

    @property
    def kept_time(self) -> bool:
        """Whether all simulators kept time."""
        return max(self.lost_s.values()) < MOST_LOST_S

    def row(self, title: str) -> str:
        """The line of a table."""
        kept = "" if self.kept_time else f" (a simulator lost {max(self.lost_s.values()):.1f} s)"
        spreads = (self.intended, self.as_it_is, self.in_space)
        cells = [
            title + kept,
            *(f"{value:.2f}" for one in spreads for value in asdict(one).values()),
            *(f"{one.distance_m:.1f}" for one in (self.nearest_horizontal, self.nearest)),
        ]
        return f"| {' | '.join(cells)} |"


HEADING = heading_of(
    *("flight", "intended: mean, m", "95 %", "greatest", "as it is: mean, m", "95 %", "greatest"),
    *("intended, in space: mean, m", "95 %", "greatest", "nearest two, level, m", "in space, m"),
)


def flight_record(
    mission: Mission,
    time_s: FloatArray,
    tracks: dict[str, TrueTrack],
    guidance: Mapping[str, GuidanceTrack],
) -> FlightRecord:
    """Return the record of a flight at `time_s` (s); NaN where the ground knows no value.

    Ordered slots and the leader come from the companions' records, whose times begin at the first sample.
    """
    since_s = time_s - time_s[0]
    names = [mission.leader.vehicle, *mission.followers_by_name]
    return FlightRecord(
        time_s=since_s,
        vehicles=tuple(
            vehicle_record(mission, name, tracks[name], guidance.get(name), since_s)
            for name in names
        ),
        mode_names=("unknown",),
        path_north_m=np.empty(0),
        path_east_m=np.empty(0),
        mission=mission.name,
        controller=mission.controller.type,
        plant="autopilot",
        wind=mission.wind.type,
        mode="live",
        rate_hz=mission.rehearsal.rate_hz,
        seed=0,
        duration_s=float(np.ptp(time_s)),
        wall_s=None,
        acceptance=RecordAcceptance(),
    )


def vehicle_record(
    mission: Mission,
    name: str,
    track: TrueTrack,
    guidance: GuidanceTrack | None,
    since_s: FloatArray,
) -> VehicleRecord:
    """One vehicle at times since the beginning, with the slots it was ordered to and by what it led."""
    follower = mission.followers_by_name.get(name)
    course = np.arctan2(track.east_m_s, track.north_m_s)
    series = dict.fromkeys(SERIES, np.full(since_s.size, np.nan)) | {
        "north_m": track.north_m,
        "east_m": track.east_m,
        "altitude_amsl_m": track.altitude_amsl_m,
        "course_rad": course,
        "ground_speed_m_s": np.hypot(track.east_m_s, track.north_m_s),
        "bank_rad": track.bank_rad,
    }
    slot = (0.0, 0.0, 0.0)
    if follower is None:
        nearest = path_of(mission.path).nearest(track.north_m, track.east_m, course)
        series["path_cross_track_error_m"] = nearest.cross_track_error
        series["path_course_rad"] = nearest.course
    else:
        point = follower.slot.point
        slot = (point.forward, point.right, point.up)
    recorded: dict[str, Any] = {}
    if guidance is not None and follower is not None:
        recorded |= slot_series(guidance, since_s, slot)
    if guidance is not None and mission.deputies:
        recorded |= lead_series(guidance, since_s, mission.origin.altitude_amsl_m)
    return VehicleRecord(
        name=name,
        role="leader" if follower is None else "follower",
        system_id=mission.vehicles[name].system_id,
        slot_forward_m=slot[0],
        slot_right_m=slot[1],
        slot_up_m=slot[2],
        mode=np.zeros(since_s.size, dtype=np.int64),
        limited=np.zeros(since_s.size, dtype=np.bool_),
        **series,
        **recorded,
    )


def judge(
    record: FlightRecord,
    tracks: dict[str, TrueTrack],
    faults: Sequence[Occurrence] = (),
    guidance: Mapping[str, GuidanceTrack] | None = None,
) -> Verdict:
    """Judge a flight by where everybody truly was, with faults in the order of time."""
    time_s, window = record.time_s, in_window(record)
    from_s, last_s = float(time_s[window][0]), float(time_s[-1])
    intended = intended_leader(record.reference)
    on_path = window & np.isfinite(intended.course_rad)
    gone = {name for one in faults for name in one.fault.without}
    kept = [one for one in record.followers if one.name not in gone]
    true = {one.name: slot_error(record.reference, one).distance_m for one in kept}
    meant = [slot_error(intended, one) for one in kept]
    level = np.array([one.distance_m for one in meant])
    ends_s = (*(one.began_s for one in faults[1:]), last_s)
    rolls = {
        one.name: roll_rate_rms(time_s[window], one.bank_rad[window]) for one in record.vehicles
    }
    return Verdict(
        as_it_is=spread(np.array([row[window] for row in true.values()])),
        intended=spread(level[:, on_path]),
        in_space=spread(np.array([one.distance_3d_m[on_path] for one in meant])),
        height=spread(np.array([one.up_m[window] for one in meant])),
        followers={name: float(row[window].mean()) for name, row in true.items()},
        at_end={name: float(row[time_s >= last_s - END_S].mean()) for name, row in true.items()},
        nearest_horizontal=nearest(record, time_s >= 0.0, with_height=False),
        nearest=nearest(record, time_s >= 0.0, with_height=True),
        faults=tuple(
            aftermath(record, one, level, until_s)
            for one, until_s in zip(faults, ends_s, strict=False)
        ),
        bank_rate_rms_deg_s={
            name: math.nan if rate is None else math.degrees(rate) for name, rate in rolls.items()
        },
        limited={
            name: limited_share(track, from_s, last_s) for name, track in (guidance or {}).items()
        },
        lost_s={name: track.lost_s for name, track in tracks.items()},
        late_s={name: track.late_s for name, track in tracks.items()},
    )


def spread(distances_m: FloatArray) -> Spread:
    """Mean, 95th percentile and greatest; no numbers where one is unknown."""
    return known_spread(distances_m) or Spread(mean=math.nan, p95=math.nan, max=math.nan)


def limited_share(track: GuidanceTrack, from_s: float, to_s: float) -> float:
    """Of the steps in a time, those whose setpoint a limit cut; NaN where there are none."""
    steps = [step.limited for step in track.steps if from_s <= step.time_s <= to_s]
    return sum(steps) / len(steps) if steps else math.nan


def aftermath(
    record: FlightRecord, fault: Occurrence, distances_m: FloatArray, until_s: float
) -> Aftermath:
    """What came of a fault, by the distances from the slots (rows) up to a time."""
    time_s, began_s = record.time_s, fault.began_s
    during = (time_s >= began_s) & (time_s <= until_s)
    before = (time_s >= began_s - BEFORE_S) & (time_s < began_s)
    after = during & (time_s > until_s - BEFORE_S)
    moved_s = slots_move_s(record, during, began_s)
    back_s, near_s = (
        back_after(time_s[during], distances_m[:, during], fault.ended_s, within_m)
        for within_m in (BACK_M, NEAR_M)
    )
    if moved_s is not None and near_s is not None:
        near_s = max(near_s, moved_s[1])
    return Aftermath(
        what=fault.fault.what,
        nearest_horizontal=nearest(record, during, with_height=False),
        nearest=nearest(record, during, with_height=True),
        back_s=back_s,
        near_s=near_s,
        before_m=float(distances_m[:, before].mean()),
        after_m=float(distances_m[:, after].mean()),
        greatest_m=float(distances_m[:, during].max()),
        moved_s=moved_s,
        led_s=led_after(record, during, began_s),
    )


def slots_move_s(
    record: FlightRecord, when: BoolArray, began_s: float
) -> tuple[float, float] | None:
    """After how long (s) the first ordered slot moved and the last came to rest; None: none moved."""
    moving = np.zeros(record.time_s.size, dtype=bool)
    for one in record.followers:
        forward, right = (np.broadcast_to(slot, moving.shape) for slot in one.slot_m)
        moving[1:] |= np.hypot(np.diff(forward), np.diff(right)) > STILL_M
    moved = record.time_s[moving & when] - began_s
    return (float(moved[0]), float(moved[-1])) if moved.size else None


def led_after(record: FlightRecord, when: BoolArray, began_s: float) -> float | None:
    """After how long (s) a follower first led, in a time; None: none did."""
    led = [one.lead_term for one in record.followers if one.lead_term is not None]
    times = record.time_s[when & np.any(np.isfinite(led), axis=0)] if led else np.empty(0)
    return float(times[0]) - began_s if times.size else None


def nearest(record: FlightRecord, when: BoolArray, *, with_height: bool) -> Nearest:
    """The nearest that any two aircraft came at these times."""
    found = []
    for one, other in combinations(record.vehicles, 2):
        distance = np.hypot(one.north_m - other.north_m, one.east_m - other.east_m)
        if with_height:
            distance = np.hypot(distance, one.altitude_amsl_m - other.altitude_amsl_m)
        at = int(np.where(when, distance, np.inf).argmin())
        found.append(Nearest(float(distance[at]), one.name, other.name, float(record.time_s[at])))
    return min(found, key=lambda each: each.distance_m)


def back_after(
    time_s: FloatArray, distances_m: FloatArray, ended_s: float, within_m: float
) -> float | None:
    """Seconds from the end of a fault until all distances (rows) stay within some; None: they do not."""
    outside = time_s[(time_s >= ended_s) & (distances_m >= within_m).any(axis=0)]
    if not outside.size:
        return 0.0
    return None if outside[-1] >= time_s[-1] - 1.0 else float(outside[-1] - ended_s)
