"""From a flight record to its summary, and from that to `summary.json`.

Errors are measured on true states, in the window that is the last half of the flight. Of a recorded flight
there are the autopilots' estimates instead, and moments that nobody recorded, which are left out.
"""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.record.flight import FlightRecord, VehicleRecord
from vfguide.record.latency import describe_latency
from vfguide.report.figures import (
    errors_that_count,
    excess_variation_rate,
    in_window,
    least_separation,
    settling_time,
    share,
    spread,
    variation_rate,
    window_s,
)
from vfguide.report.geometry import intended_leader, pair_separations, slot_error
from vfguide.report.summary import FollowerSummary, FormationSummary, LeaderSummary, Summary
from vfguide.report.verdict import find_rejections

__all__ = ["Summary", "summarise", "summary_json"]


def summarise(record: FlightRecord) -> Summary:
    """All figures of a flight, and the verdict."""
    window = in_window(record)
    formation = _summarise_formation(record, window)
    # Without followers there is no formation to ask anything of.
    rejections = find_rejections(record.acceptance, formation) if record.followers else ()
    if record.interrupted:
        rejections = (f"stopped after {record.duration_s:.1f} s, before its end", *rejections)
    vehicles: dict[str, LeaderSummary | FollowerSummary] = {
        record.leader.name: _summarise_leader(record, window)
    }
    for follower in record.followers:
        vehicles[follower.name] = _summarise_follower(record, follower, window)
    return Summary(
        mission=record.mission,
        controller=record.controller,
        plant=record.plant,
        wind=record.wind,
        mode=record.mode,
        rate_hz=record.rate_hz,
        seed=record.seed,
        duration_s=record.duration_s,
        wall_s=record.wall_s,
        real_time_factor=record.duration_s / record.wall_s if record.wall_s else None,
        accepted=not rejections,
        rejections=rejections,
        acceptance=record.acceptance,
        formation=formation,
        vehicles=vehicles,
        latency=record.latency,
    )


def summary_json(summary: Summary) -> dict[str, Any]:
    """The summary as plain data for `summary.json`; null for what is not known or not finite."""
    plain = {name: _plain(value) for name, value in asdict(summary).items()}
    if summary.latency is None:
        del plain["latency"]
    else:
        plain["latency"] = _plain(describe_latency(summary.latency))
    return plain


def _plain(value: object) -> object:
    """The same with lists for tuples, and None for NaN and infinities, which JSON has no words for."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def measured(record: FlightRecord, values: FloatArray) -> FloatArray:
    """The values that count: all, but of a recorded flight those that were recorded."""
    return values[np.isfinite(values)] if record.mode == "recorded" else values


def measured_separations(record: FlightRecord) -> FloatArray:
    """Distances of all pairs at all times that count, m."""
    distances = [pair.distance_m for pair in pair_separations(record)]
    return measured(record, np.concatenate(distances)) if distances else np.empty(0)


def _summarise_formation(record: FlightRecord, window: BoolArray) -> FormationSummary:
    """All followers together."""
    errors = slot_distances(record, record.leader)
    sizes = spread(measured(record, errors[:, window]))
    meant = slot_distances(record, intended_leader(record.leader))
    meant_sizes = spread(measured(record, meant[:, window]))
    settling = errors_that_count(record, errors)
    return FormationSummary(
        window_s=window_s(record),
        mean_error_m=sizes.mean if sizes else None,
        p95_error_m=sizes.p95 if sizes else None,
        max_error_m=sizes.max if sizes else None,
        intended_error_m=meant_sizes.mean if meant_sizes else None,
        settle_10m_s=settling_time(record.time_s, settling, 10.0),
        settle_1m_s=settling_time(record.time_s, settling, 1.0),
        min_separation_m=least_separation(
            [pairs] if (pairs := measured_separations(record)).size else []
        ),
    )


def slot_distances(record: FlightRecord, leader: VehicleRecord) -> FloatArray:
    """Distances of all followers from their slots behind a leader, m; one row for each follower."""
    distances = [slot_error(leader, follower).distance_m for follower in record.followers]
    return np.array(distances).reshape(len(distances), record.time_s.size)


def _summarise_leader(record: FlightRecord, window: BoolArray) -> LeaderSummary:
    """The leader against its path."""
    leader = record.leader
    time_s, setpoint = record.time_s[window], leader.course_setpoint_rad[window]
    return LeaderSummary(
        role="leader",
        cross_track_error_m=spread(measured(record, leader.path_cross_track_error_m[window])),
        course_setpoint_variation_rad_s=variation_rate(time_s, setpoint),
        course_setpoint_excess_variation_rad_s=excess_variation_rate(time_s, setpoint),
        limited_fraction=share(leader.limited[window]),
    )


def _summarise_follower(
    record: FlightRecord, follower: VehicleRecord, window: BoolArray
) -> FollowerSummary:
    """A follower against its slot."""
    error = slot_error(record.leader, follower)
    time_s, setpoint = record.time_s[window], follower.course_setpoint_rad[window]
    return FollowerSummary(
        role="follower",
        formation_error_m=spread(measured(record, error.distance_m[window])),
        along_track_error_m=spread(measured(record, error.along_track_m[window])),
        cross_track_error_m=spread(measured(record, error.cross_track_m[window])),
        course_setpoint_variation_rad_s=variation_rate(time_s, setpoint),
        course_setpoint_excess_variation_rad_s=excess_variation_rate(time_s, setpoint),
        limited_fraction=share(follower.limited[window]),
    )
