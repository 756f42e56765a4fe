"""Where slots and vehicles truly were, and the figures of a flight: pure functions of its record.

Written apart from the guidance laws on purpose: what measures a flight must not share a sign error with
what flew it. Frame: metres north and east; courses in radians clockwise from north.

A figure that cannot be had, such as a formation error without followers, is None. Errors are measured on
true states, in the window that is the last half of the flight.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray, wrap_angle
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import FlightLimits, VehicleRecord

ON_PATH_M = 20.0
"""Farther beside its path a leader is on the way onto it, on another course than the path has there."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlotError:
    """Where a follower's slot was, seen from the follower, in the leader's course frame; m.

    NaN while the follower was ordered out of the formation.
    """

    along_track_m: FloatArray
    """Positive where the slot was ahead."""
    cross_track_m: FloatArray
    """Positive where the slot was to the right."""
    distance_m: FloatArray
    """The formation error: distance of the follower from its slot, seen from above."""
    up_m: FloatArray
    """Positive where the slot was above."""

    @property
    def distance_3d_m(self) -> FloatArray:
        """Distance of the follower from its slot in space."""
        return np.hypot(self.distance_m, self.up_m)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairSeparation:
    """How far two vehicles were from each other; m."""

    first: str
    """Name of one vehicle."""
    second: str
    """Name of the other."""
    distance_m: FloatArray
    """At each sample."""


def in_course_frame(
    north_m: FloatArray, east_m: FloatArray, course_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(forward, right) components of a horizontal vector in the frame of a course."""
    forward = north_m * np.cos(course_rad) + east_m * np.sin(course_rad)
    right = -north_m * np.sin(course_rad) + east_m * np.cos(course_rad)
    return forward, right


def slot_track(
    leader: VehicleRecord, forward_m: float | FloatArray, right_m: float | FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(north, east) of a slot: p_l + R(chi_l) (forward, right), from the leader's true state."""
    cosine, sine = np.cos(leader.course_rad), np.sin(leader.course_rad)
    return (
        leader.north_m + forward_m * cosine - right_m * sine,
        leader.east_m + forward_m * sine + right_m * cosine,
    )


def seen_from_leader(
    leader: VehicleRecord, vehicle: VehicleRecord
) -> tuple[FloatArray, FloatArray]:
    """(forward, right) of a vehicle in the leader's course frame, m."""
    return in_course_frame(
        vehicle.north_m - leader.north_m, vehicle.east_m - leader.east_m, leader.course_rad
    )


def slot_error(leader: VehicleRecord, follower: VehicleRecord) -> SlotError:
    """The slot as the follower had it before it: slot minus follower, along and right of the leader's course.

    The formation error is horizontal; the height counts from the leader's true one.
    """
    north, east = slot_track(leader, *follower.slot_m)
    north, east = north - follower.north_m, east - follower.east_m
    along, cross = in_course_frame(north, east, leader.course_rad)
    return SlotError(
        along_track_m=along,
        cross_track_m=cross,
        distance_m=np.hypot(north, east),
        up_m=leader.altitude_amsl_m + follower.slot_height_m - follower.altitude_amsl_m,
    )


def intended_leader(leader: VehicleRecord) -> VehicleRecord:
    """The leader as the formation means it to fly: where it is, on the course of its path there.

    NaN where it is not on its path: on the way onto another, and in a hold.
    """
    on_path = np.abs(leader.path_cross_track_error_m) <= ON_PATH_M
    return replace(leader, course_rad=np.where(on_path, leader.path_course_rad, np.nan))


def pair_separations(record: FlightRecord) -> tuple[PairSeparation, ...]:
    """Distance of every two vehicles, in three dimensions."""
    return tuple(
        PairSeparation(
            first=first.name,
            second=second.name,
            distance_m=np.sqrt(
                (first.north_m - second.north_m) ** 2
                + (first.east_m - second.east_m) ** 2
                + (first.altitude_amsl_m - second.altitude_amsl_m) ** 2
            ),
        )
        for first, second in combinations(record.vehicles, 2)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How large a figure was: of its absolute values, over the window."""

    mean: float
    """Mean."""
    p95: float
    """95th percentile."""
    max: float
    """Greatest."""


def spread(values: FloatArray) -> Spread | None:
    """Mean, 95th percentile and greatest of absolute values; None without a single one, or with a NaN."""
    if values.size == 0 or not bool(np.all(np.isfinite(values))):
        return None
    sizes = np.abs(values)
    return Spread(
        mean=float(np.mean(sizes)), p95=float(np.percentile(sizes, 95)), max=float(np.max(sizes))
    )


def window_s(record: FlightRecord) -> tuple[float, float]:
    """Beginning and end of the last half of the flight, s: where errors count."""
    return record.duration_s / 2.0, record.duration_s


def in_window(record: FlightRecord) -> BoolArray:
    """Which samples are in the window."""
    begin, end = window_s(record)
    # Times are sums of steps: a sample may be a rounding error outside the edge that it is on.
    slack = 1e-6
    return (record.time_s >= begin - slack) & (record.time_s <= end + slack)


def settling_time(time_s: FloatArray, errors_m: FloatArray, limit_m: float) -> float | None:
    """The last time any follower was `limit_m` or more from its slot, s.

    Args:
        time_s: N sample times.
        errors_m: Formation errors, followers by samples; a NaN counts as out.
        limit_m: Distance, m.

    Returns:
        0 if none ever was; None if one still is at the end, or nothing was measured.
    """
    if errors_m.size == 0:
        return None
    out = np.flatnonzero(np.any(~(errors_m < limit_m), axis=0))
    if out.size == 0:
        return 0.0
    if out[-1] == time_s.size - 1:
        return None
    return float(time_s[out[-1]])


def in_formation(record: FlightRecord) -> BoolArray:
    """Which followers belonged to the formation at which samples: (followers, samples).

    Who was ordered out of it has no slot, and is in no figure of errors meanwhile.
    """
    rows = [follower.in_formation for follower in record.followers]
    return np.array(rows, dtype=np.bool_).reshape(len(rows), record.time_s.size)


def errors_that_count(record: FlightRecord, errors_m: FloatArray) -> FloatArray:
    """Errors of which a NaN means that a follower was out; where nobody recorded, the last known one holds.

    Who was ordered out of the formation is not out of a slot: its error is 0.

    Args:
        record: of the flight.
        errors_m: followers by samples.
    """
    if record.mode == "recorded":
        numbers = np.where(np.isfinite(errors_m), np.arange(errors_m.shape[-1]), 0)
        latest = np.maximum.accumulate(numbers, axis=-1)
        errors_m = np.take_along_axis(errors_m, latest, axis=-1)
    return np.where(in_formation(record), errors_m, 0.0)


def turning(angles_rad: FloatArray) -> FloatArray:
    """Steps from each angle to the next, the short way round; samples that are NaN are left out."""
    known = angles_rad[np.isfinite(angles_rad)]
    return wrap_angle(np.diff(known))


def variation_rate(time_s: FloatArray, angles_rad: FloatArray) -> float | None:
    """Total variation of an angle per second, rad/s; None with fewer than two samples."""
    seconds = _span(time_s, angles_rad)
    return None if seconds is None else float(np.sum(np.abs(turning(angles_rad)))) / seconds


def excess_variation_rate(time_s: FloatArray, angles_rad: FloatArray) -> float | None:
    """What of the variation is back and forth: total variation less net turning, per second, rad/s.

    A steady turn has none, whatever its rate. Chatter is all excess.
    """
    seconds = _span(time_s, angles_rad)
    if seconds is None:
        return None
    steps = turning(angles_rad)
    # The difference of two equal sums may come out a rounding error below zero.
    return max(float(np.sum(np.abs(steps)) - abs(np.sum(steps))), 0.0) / seconds


def speed_variation_rate(time_s: FloatArray, speeds_m_s: FloatArray) -> float | None:
    """Total variation of a speed per second, m/s²; None with fewer than two samples that are numbers."""
    seconds = _span(time_s, speeds_m_s)
    if seconds is None:
        return None
    return float(np.nansum(np.abs(np.diff(speeds_m_s)))) / seconds


def roll_rate_rms(time_s: FloatArray, bank_rad: FloatArray) -> float | None:
    """Root mean square of the roll rate, rad/s; None with fewer than two samples that are numbers."""
    known = np.isfinite(bank_rad)
    if np.count_nonzero(known) < 2:
        return None
    rates = np.diff(bank_rad[known]) / np.diff(time_s[known])
    return float(np.sqrt(np.mean(rates**2)))


def _span(time_s: FloatArray, values: FloatArray) -> float | None:
    """Seconds from the first to the last sample that is a number; None if there is no such span."""
    known = time_s[np.isfinite(values)]
    if known.size < 2 or known[-1] <= known[0]:
        return None
    return float(known[-1] - known[0])


def share(flags: BoolArray) -> float | None:
    """Share of the samples for which something holds, 0 to 1; None without samples."""
    return float(np.mean(flags)) if flags.size else None


BANK_SLACK_DEG, SPEED_SLACK_M_S = 1.0, 0.05
"""A lagging roll comes near its limit only, and setpoints are rounded on the wire."""


def at_bank_limit(vehicle: VehicleRecord, limits: FlightLimits) -> BoolArray:
    """Which samples are at the greatest bank."""
    found: BoolArray = np.abs(np.degrees(vehicle.bank_rad)) >= (
        limits.greatest_bank_deg - BANK_SLACK_DEG
    )
    return found


def at_speed_limit(vehicle: VehicleRecord, limits: FlightLimits) -> BoolArray:
    """Which samples have the lowest or highest airspeed as setpoint."""
    setpoint = vehicle.airspeed_setpoint_m_s
    slowest = setpoint <= limits.least_airspeed_m_s + SPEED_SLACK_M_S
    fastest = setpoint >= limits.greatest_airspeed_m_s - SPEED_SLACK_M_S
    found: BoolArray = slowest | fastest
    return found


def least_separation(distances_m: list[FloatArray]) -> float | None:
    """Least distance of all pairs at all times, m; None without a pair, or where one is unknown."""
    if not distances_m or distances_m[0].size == 0:
        return None
    least = float(np.min(np.stack(distances_m)))
    return least if np.isfinite(least) else None
