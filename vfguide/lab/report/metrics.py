"""From a flight record to its summary, and from that to `summary.json`.

Errors are measured on true states, in the window that is the last half of the flight. Of a recorded flight
there are the autopilots' estimates instead, and moments that nobody recorded, which are left out. So is a
follower while it was ordered out of the formation. None stands for what was not measured.

Whether a flight reached what its mission asks for, and in words what it did not reach.
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
    """How well the followers held their slots; None where nothing was measured."""

    window_s: tuple[float, float]
    """The last half of the flight, s."""
    mean_error_m: float | None
    """Mean distance from the slot, over all samples of the window and all followers that an order had not
    sent out of the formation."""
    p95_error_m: float | None
    """95th percentile of the formation error, m."""
    max_error_m: float | None
    """The greatest."""
    mean_error_3d_m: float | None
    """Mean distance from the slot in space, over all followers and all samples of the window."""
    intended_error_m: float | None
    """Mean distance from the slot as it is meant, in the course of the path where the leader is: it does not
    swing with a leader that gusts turn. Without the times at which the leader is not on its path."""
    settle_10m_s: float | None
    """Last time any follower was 10 m or more from its slot; None: still out at the end."""
    settle_1m_s: float | None
    """Last time any follower was 1 m or more from its slot; None: still out at the end."""
    min_separation_m: float | None
    """Least distance of any two vehicles on the whole flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Handling:
    """How hard a vehicle was flown, over the window."""

    role: Role
    """`leader` or `follower`."""
    course_setpoint_variation_rad_s: float | None
    """Total variation of the course setpoint per second."""
    course_setpoint_excess_variation_rad_s: float | None
    """What of that is not net turning: chatter, and the path's own bends one way and the other."""
    speed_setpoint_variation_m_s2: float | None
    """Total variation of the speed setpoint per second."""
    roll_rate_rad_s: float | None
    """Root mean square of the roll rate."""
    limited_fraction: float | None
    """Share of setpoints that a limit of the vehicle cut."""
    bank_limited_fraction: float | None
    """Share of the time at the greatest bank; None where the record does not hold limits."""
    speed_limited_fraction: float | None
    """Share of the time with the lowest or highest airspeed as setpoint; None where that is not known."""
    response: VehicleResponse | None
    """How it was finally flown; None where no companion told."""
    declared: VehicleResponse | None
    """What the mission declares of that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaderSummary(Handling):
    """How well the leader held the path, over the window."""

    cross_track_error_m: Spread | None
    """Distance from the path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerSummary(Handling):
    """How well one follower held its slot, over the window."""

    formation_error_m: Spread | None
    """Distance from the slot."""
    along_track_error_m: Spread | None
    """Size of its component along the leader's course."""
    cross_track_error_m: Spread | None
    """Size of its component across the leader's course."""
    height_error_m: Spread | None
    """Height between it and its slot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A flight in figures."""

    mission: str
    """Name of the mission."""
    controller: str
    """Name of the law by which followers kept their slots."""
    plant: str
    """`course-hold`, `heading-hold` or `bank`."""
    wind: str
    """Type of wind."""
    mode: str
    """`lockstep` or `live`."""
    rate_hz: float
    """Guidance steps per second."""
    seed: int
    """Seed of everything random in the flight."""
    duration_s: float
    """Length of the flight."""
    wall_s: float | None
    """What it took."""
    real_time_factor: float | None
    """Duration over wall time."""
    accepted: bool | None
    """Whether the flight reached all that its mission asks for; None where that is nothing."""
    rejections: tuple[str, ...]
    """Why it was not accepted, in words with figures; empty if it was."""
    acceptance: RecordAcceptance
    """What the mission asks for."""
    formation: FormationSummary
    """All followers together."""
    vehicles: dict[str, LeaderSummary | FollowerSummary]
    """Each vehicle by name, the leader first."""
    latency: Latency | None
    """How quick the programs of a live flight were; None of one in virtual time."""


IN_PLACE_M = 10.0
"""Within this distance of its slot a follower has come to it: see `vfguide.companion.supervisor`."""


def find_rejections(acceptance: RecordAcceptance, formation: FormationSummary) -> tuple[str, ...]:
    """What the flight did not reach, one phrase with figures for each; empty if it reached all."""
    found = (
        reject_error("mean formation error", formation.mean_error_m, acceptance.mean_error_m),
        reject_error(
            "mean formation error in space",
            formation.mean_error_3d_m,
            acceptance.mean_error_3d_m,
        ),
        reject_error("greatest formation error", formation.max_error_m, acceptance.max_error_m),
        reject_settling(10, formation.settle_10m_s, acceptance.settle_10m_s),
        reject_settling(1, formation.settle_1m_s, acceptance.settle_1m_s),
        reject_separation(formation.min_separation_m, acceptance.min_separation_m),
    )
    return tuple(reason for reason in found if reason is not None)


def reject_error(name: str, error_m: float | None, limit_m: float | None) -> str | None:
    """Why an error is not accepted; None if it is, or if no limit was set."""
    if limit_m is None:
        return None
    if error_m is None:
        return f"{name} could not be measured"
    if error_m <= limit_m:
        return None
    error, limit = tell_apart(error_m, limit_m)
    return f"{name} {error} m is above {limit} m"


def reject_settling(distance_m: int, settled_s: float | None, limit_s: float | None) -> str | None:
    """Why a settling time is not accepted; None if it is, or if no limit was set."""
    if limit_s is None:
        return None
    if settled_s is None:
        return f"a follower was still {distance_m} m or more from its slot at the end"
    if settled_s <= limit_s:
        return None
    settled, limit = tell_apart(settled_s, limit_s)
    return f"all within {distance_m} m of their slots only after {settled} s, not {limit} s"


def reject_separation(least_m: float | None, limit_m: float) -> str | None:
    """Why the least separation is not accepted; None if it is."""
    if least_m is None:
        return "separation could not be measured"
    if least_m >= limit_m:
        return None
    least, limit = tell_apart(least_m, limit_m)
    return f"two vehicles came within {least} m of each other, closer than {limit} m"


def reject_absence(name: str, error: Spread | None, acceptance: RecordAcceptance) -> str | None:
    """Why a follower was not in its slot, whatever the mission asks for; None if it was.

    A mission whose own limit is wider accepts that.
    """
    limits = (IN_PLACE_M, acceptance.mean_error_m, acceptance.max_error_m)
    if error is None or error.mean <= max(limit for limit in limits if limit is not None):
        return None
    return f"{name} was {error.mean:.0f} m from its slot in the last half"


def reject_unseen(record: FlightRecord, follower: VehicleRecord, window: BoolArray) -> str | None:
    """Why nobody knows whether a follower was in its slot; None where it is known, or it had none."""
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
    """Two figures in as few digits, three at least, as show which is the greater."""
    for digits in range(3, 17):
        texts = f"{first:.{digits}g}", f"{second:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts


def summarise(record: FlightRecord) -> Summary:
    """All figures of a flight, and the verdict."""
    window = in_window(record)
    formation = _summarise_formation(record, window)
    # Without followers there is no formation to ask anything of.
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
    # None where nothing was asked for that the flight could have missed.
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
    """The summary as plain data for `summary.json`; null for what is not known or not finite."""
    plain = {name: plain_json(value) for name, value in asdict(summary).items()}
    if summary.latency is None:
        del plain["latency"]
    else:
        plain["latency"] = plain_json(describe_latency(summary.latency))
    return plain


def plain_json(value: object) -> object:
    """Return a value as JSON has it: lists for tuples, None for NaN and infinities."""
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
    """The values that count: all, but of a recorded flight those that were recorded.

    Args:
        record: of the flight.
        values: of some samples.
        counts: which of them there is anything to measure of; all of them if absent.
    """
    if record.mode == "recorded":
        return values[np.isfinite(values)]
    # As they stand where all count: a sum in another order differs in its last digits.
    return values if counts is None or bool(counts.all()) else values[counts]


def _summarise_formation(record: FlightRecord, window: BoolArray) -> FormationSummary:
    """All followers together."""
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
    """Distances of all followers from their slots behind a leader, m; one row for each follower."""
    distances = [slot_error(leader, follower).distance_m for follower in record.followers]
    return np.array(distances).reshape(len(distances), record.time_s.size)


def _summarise_follower(
    record: FlightRecord, follower: VehicleRecord, window: BoolArray
) -> FollowerSummary:
    """A follower against its slot."""
    error, counts = slot_error(record.reference, follower), follower.in_formation[window]
    return FollowerSummary(
        formation_error_m=spread(measured(record, error.distance_m[window], counts)),
        along_track_error_m=spread(measured(record, error.along_track_m[window], counts)),
        cross_track_error_m=spread(measured(record, error.cross_track_m[window], counts)),
        height_error_m=spread(measured(record, error.up_m[window], counts)),
        **_handling(record, follower, window),
    )


def _handling(record: FlightRecord, vehicle: VehicleRecord, window: BoolArray) -> dict[str, Any]:
    """How hard a vehicle was flown: the fields of `Handling`."""
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
