"""How well a formation of real autopilots was kept, by the geometry that reports have."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np

from tests.autopilots.faults import Occurrence
from tests.autopilots.true_tracks import TrueTrack
from vfguide.elementwise import BoolArray, FloatArray
from vfguide.formation.arrangement import Point
from vfguide.lab.report.geometry import intended_leader, slot_error
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


@dataclass(frozen=True, slots=True)
class Spread:
    """Distances from the slots, all followers; m."""

    mean: float
    p95: float
    greatest: float


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
        seconds = [
            "-" if one is None else f"{one:.1f}"
            for one in (*(self.moved_s or (None, None)), self.near_s, self.back_s, self.led_s)
        ]
        cells = (self.nearest_horizontal.distance_m, self.nearest.distance_m)
        errors = (self.before_m, self.after_m, self.greatest_m)
        columns = (
            self.what,
            *(f"{cell:.1f}" for cell in cells),
            *seconds,
            *(f"{error:.2f}" for error in errors),
        )
        return f"| {' | '.join(columns)} |"


AFTERMATH_COLUMNS = (
    *("fault or order", "nearest two, level, m", "in space, m", "slots move from, s", "to, s"),
    *(f"within {NEAR_M:g} m after, s", f"within {BACK_M:g} m after, s", "another leads after, s"),
    *("error before, m", "after", "greatest"),
)
AFTERMATH_HEADING = f"| {' | '.join(AFTERMATH_COLUMNS)} |\n{'|---' * len(AFTERMATH_COLUMNS)}|"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One flight."""

    window_s: tuple[float, float]
    """In which the distances were taken, s after the pilots had selected the guided mode."""
    as_it_is: Spread
    """From the slots at the leader as it truly was, in its true course."""
    intended: Spread
    """From the slots at the leader's true place, in the course of the path there."""
    in_space: Spread
    """From the same slots, heights included."""
    height: Spread
    """Of the heights alone."""
    followers: dict[str, float]
    """Mean distance of each follower from its slot at the leader as it was, m."""
    at_end: dict[str, float]
    """The same, over the last seconds of the flight."""
    nearest_horizontal: Nearest
    nearest: Nearest
    """In three dimensions."""
    faults: tuple[Aftermath, ...]
    """In the order of time."""
    bank_rate_rms_deg_s: dict[str, float]
    """Of each aircraft in the window."""
    limited: dict[str, float]
    """Share of each companion's setpoints in the window that a limit cut, of those that recorded."""
    lost_s: dict[str, float]
    """By how much each simulator's clock fell behind in the flight."""
    late_s: dict[str, float]
    """How late 95 % of each one's reports at most were."""

    @property
    def kept_time(self) -> bool:
        """Whether all simulators kept time."""
        return max(self.lost_s.values()) < MOST_LOST_S

    def roll_against(self, leader: str) -> float:
        """How fast the follower that rolls most rolls (rms), in parts of how fast the leader does."""
        rates = self.bank_rate_rms_deg_s
        return max(rates[name] for name in self.followers) / rates[leader]

    def row(self, title: str) -> str:
        """The line of a table."""
        kept = "" if self.kept_time else f" (a simulator lost {max(self.lost_s.values()):.1f} s)"
        cells = [
            title + kept,
            *(
                f"{value:.2f}"
                for one in (self.intended, self.as_it_is, self.in_space)
                for value in asdict(one).values()
            ),
            f"{self.nearest_horizontal.distance_m:.1f}",
            f"{self.nearest.distance_m:.1f}",
        ]
        return f"| {' | '.join(cells)} |"


COLUMNS = (
    *("flight", "intended: mean, m", "95 %", "greatest", "as it is: mean, m", "95 %", "greatest"),
    *("intended, in space: mean, m", "95 %", "greatest", "nearest two, level, m", "in space, m"),
)
HEADING = f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|"


def flight_record(
    mission: Mission,
    time_s: FloatArray,
    tracks: dict[str, TrueTrack],
    guidance: Mapping[str, GuidanceTrack],
) -> FlightRecord:
    """The flight as reports have it; what an observer on the ground does not know is no number.

    Args:
        mission: that was flown.
        time_s: samples (N) of the flight's clock.
        tracks: where everybody truly was.
        guidance: what companions recorded, at times from the first sample on: ordered slots, and who led.
    """
    since_s = time_s - time_s[0]
    names = [mission.leader.vehicle, *mission.followers_by_name]
    unknown, path = np.full(time_s.size, np.nan), path_of(mission.path)
    vehicles = []
    for name in names:
        track, follower = tracks[name], mission.followers_by_name.get(name)
        course = np.arctan2(track.east_m_s, track.north_m_s)
        nearest = path.nearest(track.north_m, track.east_m, course)
        series = dict.fromkeys(SERIES, unknown) | {
            "north_m": track.north_m,
            "east_m": track.east_m,
            "altitude_amsl_m": track.altitude_amsl_m,
            "course_rad": course,
            "ground_speed_m_s": np.hypot(track.east_m_s, track.north_m_s),
            "bank_rad": track.bank_rad,
        }
        if follower is None:
            series["path_cross_track_error_m"] = nearest.cross_track_error
            series["path_course_rad"] = nearest.course
        slot = Point(0.0, 0.0) if follower is None else follower.slot.point
        vehicles.append(
            VehicleRecord(
                name=name,
                role="leader" if follower is None else "follower",
                system_id=mission.vehicles[name].system_id,
                slot_forward_m=slot.forward,
                slot_right_m=slot.right,
                slot_up_m=slot.up,
                mode=np.zeros(time_s.size, dtype=np.int64),
                limited=np.zeros(time_s.size, dtype=np.bool_),
                **series,
                **recorded_series(mission, name, guidance.get(name), since_s),
            )
        )
    return FlightRecord(
        time_s=since_s,
        vehicles=tuple(vehicles),
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


def recorded_series(
    mission: Mission, name: str, track: GuidanceTrack | None, since_s: FloatArray
) -> dict[str, Any]:
    """The slots that a companion flew in, where they were ordered, and by what it led."""
    if track is None:
        return {}
    found: dict[str, Any] = {}
    if (follower := mission.followers_by_name.get(name)) is not None:
        point = follower.slot.point
        found |= slot_series(track, since_s, (point.forward, point.right, point.up))
    if mission.deputies:
        found |= lead_series(track, since_s, mission.origin.altitude_amsl_m)
    return found


def judge(
    record: FlightRecord,
    tracks: dict[str, TrueTrack],
    faults: Sequence[Occurrence] = (),
    guidance: Mapping[str, GuidanceTrack] | None = None,
) -> Verdict:
    """Judge a flight.

    Args:
        record: where everybody truly was.
        tracks: the same, with what is known of the simulators' clocks.
        faults: what went wrong, in the order of time.
        guidance: what companions recorded, at times of the record.
    """
    time_s, last = record.time_s, record.time_s[-1]
    window = time_s >= last / 2.0
    leader = record.reference
    intended = intended_leader(leader)
    on_path = window & np.isfinite(intended.course_rad)
    gone = {name for one in faults for name in one.fault.without}
    kept = [one for one in record.followers if one.name not in gone]
    true = np.array([slot_error(leader, one).distance_m for one in kept])
    meant_errors = [slot_error(intended, one) for one in kept]
    meant = np.array([one.distance_m for one in meant_errors])
    in_space = np.array([one.distance_3d_m for one in meant_errors])
    heights = np.abs([one.up_m for one in meant_errors])
    begins_s = [one.began_s for one in faults]

    def means(when: BoolArray) -> dict[str, float]:
        """Mean distance of each follower from its slot, m."""
        return {one.name: float(row[when].mean()) for one, row in zip(kept, true, strict=True)}

    return Verdict(
        window_s=(float(time_s[window][0]), float(last)),
        as_it_is=spread(true[:, window]),
        intended=spread(meant[:, on_path]),
        in_space=spread(in_space[:, on_path]),
        height=spread(heights[:, window]),
        followers=means(window),
        at_end=means(time_s >= last - END_S),
        nearest_horizontal=nearest(record, time_s >= 0.0, with_height=False),
        nearest=nearest(record, time_s >= 0.0, with_height=True),
        faults=tuple(
            aftermath(record, one, meant, until_s)
            for one, until_s in zip(faults, (*begins_s[1:], float(last)), strict=False)
        ),
        bank_rate_rms_deg_s={
            one.name: bank_rate_rms_deg_s(time_s[window], one.bank_rad[window])
            for one in record.vehicles
        },
        limited={
            name: limited_share(track, float(time_s[window][0]), float(last))
            for name, track in (guidance or {}).items()
        },
        lost_s={name: track.lost_s for name, track in tracks.items()},
        late_s={name: track.late_s for name, track in tracks.items()},
    )


def limited_share(track: GuidanceTrack, from_s: float, to_s: float) -> float:
    """Of the steps in a time, those whose setpoint a limit cut; NaN where there are none."""
    steps = [step.limited for step in track.steps if from_s <= step.time_s <= to_s]
    return sum(steps) / len(steps) if steps else math.nan


def spread(distances_m: FloatArray) -> Spread:
    """Mean, 95th percentile and greatest."""
    return Spread(
        float(distances_m.mean()), float(np.percentile(distances_m, 95.0)), float(distances_m.max())
    )


def aftermath(
    record: FlightRecord, fault: Occurrence, distances_m: FloatArray, until_s: float
) -> Aftermath:
    """What came of a fault, by the distances from the slots (rows) up to a time."""
    time_s, began_s = record.time_s, fault.began_s
    during = (time_s >= began_s) & (time_s <= until_s)
    before = (time_s >= began_s - BEFORE_S) & (time_s < began_s)
    after = during & (time_s > until_s - BEFORE_S)
    moved_s = slots_move_s(record, during)
    back_s, near_s = (
        back_after(time_s[during], distances_m[:, during], fault.ended_s, within_m)
        for within_m in (BACK_M, NEAR_M)
    )
    if moved_s is not None and near_s is not None:
        near_s = max(near_s, moved_s[1] - began_s)
    return Aftermath(
        what=fault.fault.what,
        nearest_horizontal=nearest(record, during, with_height=False),
        nearest=nearest(record, during, with_height=True),
        back_s=back_s,
        near_s=near_s,
        before_m=float(distances_m[:, before].mean()),
        after_m=float(distances_m[:, after].mean()),
        greatest_m=float(distances_m[:, during].max()),
        moved_s=None if moved_s is None else (moved_s[0] - began_s, moved_s[1] - began_s),
        led_s=led_after(record, during, began_s),
    )


def slots_move_s(record: FlightRecord, when: BoolArray) -> tuple[float, float] | None:
    """When the first ordered slot began to move and the last came to rest, in a time; None: none moved."""
    moving = np.zeros(record.time_s.size, dtype=bool)
    for one in record.followers:
        forward, right = (np.broadcast_to(slot, moving.shape) for slot in one.slot_m)
        step = np.hypot(np.diff(forward), np.diff(right))
        moving[1:] |= step > STILL_M
    moved = record.time_s[moving & when]
    return (float(moved[0]), float(moved[-1])) if moved.size else None


def led_after(record: FlightRecord, when: BoolArray, began_s: float) -> float | None:
    """After how long (s) a follower first led, in a time; None: none did."""
    led = [
        record.time_s[when & np.isfinite(one.lead_term)]
        for one in record.followers
        if one.lead_term is not None
    ]
    first = [float(times[0]) - began_s for times in led if times.size]
    return min(first, default=None)


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


def bank_rate_rms_deg_s(time_s: FloatArray, bank_rad: FloatArray) -> float:
    """Root mean square of the rate at which the bank changes."""
    rate = np.gradient(np.unwrap(bank_rad), time_s)
    return float(np.degrees(np.sqrt(np.mean(rate**2))))
