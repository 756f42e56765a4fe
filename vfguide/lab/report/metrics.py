"""Summary of a flight record, and its form in `summary.json`.

Errors are measured on true states over the window, the last half of the flight. A recorded flight has the
autopilots' estimates instead; moments that were not recorded are left out. A follower does not count while it
is ordered out of the formation. None means not measured.

The summary also tells whether a flight met its mission's acceptance limits, and which it missed.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import msgspec
import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.lab.report.figures import (
    Spread,
    at_bank_limit,
    at_speed_limit,
    errors_that_count,
    excess_variation_rate,
    in_formation,
    in_window,
    intended_leader,
    least_separation,
    pair_separations,
    roll_rate_rms,
    settling_time,
    share,
    slot_error,
    speed_variation_rate,
    spread,
    variation_rate,
    window_s,
)
from vfguide.record.flight import FlightRecord, RecordAcceptance, Role, VehicleRecord
from vfguide.record.latency import Latency, describe_latency
from vfguide.record.response import VehicleResponse


@dataclass(frozen=True, slots=True, kw_only=True)
class FormationSummary:
    """Formation errors and separation of all followers; None where nothing was measured."""

    window_s: tuple[float, float]
    """Start and end of the last half of the flight, s."""
    mean_error_m: float | None
    """Mean distance from the slot over the window and all followers in the formation."""
    p95_error_m: float | None
    max_error_m: float | None
    mean_error_3d_m: float | None
    """Mean three-dimensional distance from the slot over the window and all followers in the formation."""
    intended_error_m: float | None
    """Mean distance from the slot in the frame of the path's course at the leader: gusts that turn the leader
    do not swing it. Times at which the leader is off its path do not count."""
    settle_10m_s: float | None
    """Last time any follower was 10 m or more from its slot; None: still out at the end."""
    settle_1m_s: float | None
    """Last time any follower was 1 m or more from its slot; None: still out at the end."""
    min_separation_m: float | None
    """Smallest distance between any two vehicles during the whole flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Handling:
    """Control activity of a vehicle over the window."""

    role: Role
    course_setpoint_variation_rad_s: float | None
    """Total variation of the course setpoint per second."""
    course_setpoint_excess_variation_rad_s: float | None
    """Total variation less net turning, per second: chatter, and the path's bends to both sides."""
    speed_setpoint_variation_m_s2: float | None
    roll_rate_rad_s: float | None
    limited_fraction: float | None
    """Share of setpoints cut by a limit of the vehicle."""
    bank_limited_fraction: float | None
    """Share of the time at the bank limit; None where the record holds no limits."""
    speed_limited_fraction: float | None
    """Share of the time with the lowest or highest airspeed as setpoint; None where unknown."""
    response: VehicleResponse | None
    """Response by which the vehicle was flown at the end; None where no companion reported it."""
    declared: VehicleResponse | None
    """Response that the mission declares."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaderSummary(Handling):
    """Path following of the leader over the window, m."""

    cross_track_error_m: Spread | None
    """Distance from the path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerSummary(Handling):
    """Slot keeping of one follower over the window, m."""

    formation_error_m: Spread | None
    """Distance from the slot."""
    along_track_error_m: Spread | None
    """Absolute error along the leader's course."""
    cross_track_error_m: Spread | None
    """Absolute error across the leader's course."""
    height_error_m: Spread | None
    """Absolute height difference from the slot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Figures of a flight."""

    mission: str
    controller: str
    """Name of the followers' law."""
    plant: str
    """`course-hold`, `heading-hold` or `bank`."""
    wind: str
    """Type of wind."""
    mode: str
    """`lockstep`, `live` or `recorded`."""
    rate_hz: float
    """Guidance steps per second."""
    seed: int
    duration_s: float
    wall_s: float | None
    """Real time that the flight took."""
    real_time_factor: float | None
    """Duration over wall time."""
    accepted: bool | None
    """Whether the flight met all limits of its mission; None if there were none."""
    rejections: tuple[str, ...]
    """Reasons for rejection, each a phrase with figures; empty if there are none."""
    acceptance: RecordAcceptance
    formation: FormationSummary
    vehicles: dict[str, LeaderSummary | FollowerSummary]
    """Figures of each vehicle by name, leader first."""
    latency: Latency | None
    """Latencies of the programs of a live flight; None in virtual time."""


IN_PLACE_M = 10.0
"""A follower within this distance has reached its slot: see `vfguide.companion.supervisor`."""


def find_rejections(acceptance: RecordAcceptance, formation: FormationSummary) -> tuple[str, ...]:
    """Return a phrase with figures for each limit that the flight missed."""
    found = (
        reject_error("mean formation error", formation.mean_error_m, acceptance.mean_error_m),
        reject_error(
            "mean formation error in space", formation.mean_error_3d_m, acceptance.mean_error_3d_m
        ),
        reject_error("greatest formation error", formation.max_error_m, acceptance.max_error_m),
        reject_settling(10, formation.settle_10m_s, acceptance.settle_10m_s),
        reject_settling(1, formation.settle_1m_s, acceptance.settle_1m_s),
        reject_separation(formation.min_separation_m, acceptance.min_separation_m),
    )
    return tuple(reason for reason in found if reason is not None)


def reject_error(name: str, error_m: float | None, limit_m: float | None) -> str | None:
    """Return why an error is rejected; None if it is accepted, or without a limit."""
    if limit_m is None:
        return None
    if error_m is None:
        return f"{name} could not be measured"
    if error_m <= limit_m:
        return None
    error, limit = tell_apart(error_m, limit_m)
    return f"{name} {error} m is above {limit} m"


def reject_settling(distance_m: int, settled_s: float | None, limit_s: float | None) -> str | None:
    """Return why a settling time is rejected; None if it is accepted, or without a limit."""
    if limit_s is None:
        return None
    if settled_s is None:
        return f"a follower was still {distance_m} m or more from its slot at the end"
    if settled_s <= limit_s:
        return None
    settled, limit = tell_apart(settled_s, limit_s)
    return f"all within {distance_m} m of their slots only after {settled} s, not {limit} s"


def reject_separation(least_m: float | None, limit_m: float) -> str | None:
    """Return why the smallest separation is rejected; None if it is accepted."""
    if least_m is None:
        return "separation could not be measured"
    if least_m >= limit_m:
        return None
    least, limit = tell_apart(least_m, limit_m)
    return f"two vehicles came within {least} m of each other, closer than {limit} m"


def reject_absence(name: str, error: Spread | None, acceptance: RecordAcceptance) -> str | None:
    """Return why a follower counts as absent from its slot; None if it was there.

    The check applies to every mission; a mission's own wider limit takes precedence.
    """
    limits = (IN_PLACE_M, acceptance.mean_error_m, acceptance.max_error_m)
    if error is None or error.mean <= max(limit for limit in limits if limit is not None):
        return None
    return f"{name} was {error.mean:.0f} m from its slot in the last half"


def reject_unseen(record: FlightRecord, follower: VehicleRecord, window: BoolArray) -> str | None:
    """Return why a follower's place is unknown over the window; None if it is known, or had no slot."""
    places = [np.isfinite(one.north_m[window]) for one in (record.leader, follower)]
    if (places[0] & places[1]).any() or not follower.in_formation[window].any():
        return None
    names = (record.leader.name, follower.name)
    unknown = [name for name, known in zip(names, places, strict=True) if not known.any()]
    whose = " or ".join(unknown or [f"{' and '.join(names)} at the same time"])
    return (
        f"{follower.name} was not seen in its slot: no place of {whose} is known in the last half"
    )


def tell_apart(first: float, second: float) -> tuple[str, str]:
    """Format two numbers with as few digits as tell them apart, but at least three."""
    for digits in range(3, 17):
        texts = f"{first:.{digits}g}", f"{second:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts


def summarise(record: FlightRecord) -> Summary:
    """Return all figures of a flight, and the verdict."""
    window = in_window(record)
    formation = _summarise_formation(record, window)
    # Formation limits apply only with followers.
    rejections = find_rejections(record.acceptance, formation) if record.followers else ()
    leader, on_a_path = record.leader, np.isfinite(record.leader.path_course_rad)
    vehicles: dict[str, LeaderSummary | FollowerSummary] = {
        leader.name: LeaderSummary(
            cross_track_error_m=spread(
                measured(record, leader.path_cross_track_error_m[window], on_a_path[window])
            ),
            **_handling(record, leader, window),
        )
    }
    for follower in record.followers:
        own = _summarise_follower(record, follower, window)
        vehicles[follower.name] = own
        absent = reject_absence(follower.name, own.formation_error_m, record.acceptance)
        absent = absent or reject_unseen(record, follower, window)
        rejections += () if absent is None else (absent,)
    if record.interrupted:
        rejections = (f"stopped after {record.duration_s:.1f} s, before its end", *rejections)
    # None if there was nothing to miss.
    judged = bool(record.followers) and record.acceptance.asks_for_slots
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
        accepted=False if rejections else True if judged else None,
        rejections=rejections,
        acceptance=record.acceptance,
        formation=formation,
        vehicles=vehicles,
        latency=record.latency,
    )


def summary_json(summary: Summary) -> dict[str, Any]:
    """Return the summary as data for `summary.json`; null for unknown or non-finite values."""
    plain = {name: plain_json(value) for name, value in asdict(summary).items()}
    if summary.latency is None:
        del plain["latency"]
    else:
        plain["latency"] = plain_json(describe_latency(summary.latency))
    return plain


def plain_json(value: object) -> object:
    """Convert a value for JSON: lists for tuples, None for NaN and infinities."""
    if isinstance(value, VehicleResponse):
        return msgspec.structs.asdict(value)
    if isinstance(value, dict):
        return {key: plain_json(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def measured(
    record: FlightRecord, values: FloatArray, counts: BoolArray | None = None
) -> FloatArray:
    """Select the values that count: all by default, but in a recorded flight only finite ones."""
    if record.mode == "recorded":
        return values[np.isfinite(values)]
    # Returned unchanged if all count: a sum in another order differs in its last digits.
    return values if counts is None or bool(counts.all()) else values[counts]


def _summarise_formation(record: FlightRecord, window: BoolArray) -> FormationSummary:
    errors, counts = slot_distances(record, record.reference), in_formation(record)[:, window]
    sizes = spread(measured(record, errors[:, window], counts))
    leader = intended_leader(record.reference)
    meant = slot_distances(record, leader)[:, window]
    on_path = np.isfinite(leader.course_rad[window])
    meant_sizes = spread(measured(record, meant, counts & on_path))
    settling = errors_that_count(record, errors)
    slots = [slot_error(record.reference, one).distance_3d_m[window] for one in record.followers]
    in_space = spread(measured(record, np.array(slots).reshape(counts.shape), counts))
    pairs = [pair.distance_m for pair in pair_separations(record)]
    apart = measured(record, np.concatenate(pairs)) if pairs else np.empty(0)
    return FormationSummary(
        window_s=window_s(record),
        mean_error_m=sizes.mean if sizes else None,
        p95_error_m=sizes.p95 if sizes else None,
        max_error_m=sizes.max if sizes else None,
        mean_error_3d_m=in_space.mean if in_space else None,
        intended_error_m=meant_sizes.mean if meant_sizes else None,
        settle_10m_s=settling_time(record.time_s, settling, 10.0),
        settle_1m_s=settling_time(record.time_s, settling, 1.0),
        min_separation_m=least_separation([apart] if apart.size else []),
    )


def slot_distances(record: FlightRecord, leader: VehicleRecord) -> FloatArray:
    """Return the followers' distances from their slots relative to a leader, m; one row per follower."""
    distances = [slot_error(leader, follower).distance_m for follower in record.followers]
    return np.array(distances).reshape(len(distances), record.time_s.size)


def _summarise_follower(
    record: FlightRecord, follower: VehicleRecord, window: BoolArray
) -> FollowerSummary:
    error, counts = slot_error(record.reference, follower), follower.in_formation[window]
    return FollowerSummary(
        formation_error_m=spread(measured(record, error.distance_m[window], counts)),
        along_track_error_m=spread(measured(record, error.along_track_m[window], counts)),
        cross_track_error_m=spread(measured(record, error.cross_track_m[window], counts)),
        height_error_m=spread(measured(record, error.up_m[window], counts)),
        **_handling(record, follower, window),
    )


def _handling(record: FlightRecord, vehicle: VehicleRecord, window: BoolArray) -> dict[str, Any]:
    """Return the fields of `Handling`."""
    time_s, course = record.time_s[window], vehicle.course_setpoint_rad[window]
    limits, airspeed = vehicle.limits, vehicle.airspeed_setpoint_m_s[window]
    told = np.isfinite(airspeed)
    speed = airspeed if told.any() else vehicle.ground_speed_setpoint_m_s[window]
    banked = np.isfinite(vehicle.bank_rad[window])
    return {
        "role": vehicle.role,
        "course_setpoint_variation_rad_s": variation_rate(time_s, course),
        "course_setpoint_excess_variation_rad_s": excess_variation_rate(time_s, course),
        "speed_setpoint_variation_m_s2": speed_variation_rate(time_s, speed),
        "roll_rate_rad_s": roll_rate_rms(time_s, vehicle.bank_rad[window]),
        "limited_fraction": share(vehicle.limited[window]),
        "bank_limited_fraction": (
            share(at_bank_limit(vehicle, limits)[window][banked]) if limits else None
        ),
        "speed_limited_fraction": (
            share(at_speed_limit(vehicle, limits)[window][told]) if limits else None
        ),
        "response": vehicle.response,
        "declared": vehicle.declared,
    }
