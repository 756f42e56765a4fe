"""Slot errors, separations and other figures of a flight, as pure functions of its record.

They share no code with the guidance laws on purpose, and so no sign error. Frame: metres north and east;
courses in radians clockwise from north.

A figure that does not exist, such as a formation error without followers, is None. Errors are those of true
states, in a window: the last half of the flight.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray, wrap_angle
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import FlightLimits, VehicleRecord

ON_PATH_M = 20.0
"""Cross-track error above which a leader is still on its way onto the path, on another course, m."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlotError:
    """Position of a follower's slot relative to the follower, in the leader's course frame, m.

    NaN while the follower was ordered out of the formation.
    """

    along_track_m: FloatArray
    """Along-track error, positive where the slot was ahead."""
    cross_track_m: FloatArray
    """Cross-track error, positive where the slot was to the right."""
    distance_m: FloatArray
    """Formation error: horizontal distance of the follower from its slot."""
    up_m: FloatArray
    """Height error, positive where the slot was above."""

    @property
    def distance_3d_m(self) -> FloatArray:
        """Distance of the follower from its slot in three dimensions, m."""
        return np.hypot(self.distance_m, self.up_m)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairSeparation:
    """Distance between two vehicles at each sample."""

    first: str
    second: str
    distance_m: FloatArray


def in_course_frame(
    north_m: FloatArray, east_m: FloatArray, course_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the (forward, right) components of a horizontal vector in the frame of a course."""
    forward = north_m * np.cos(course_rad) + east_m * np.sin(course_rad)
    right = -north_m * np.sin(course_rad) + east_m * np.cos(course_rad)
    return forward, right


def slot_track(
    leader: VehicleRecord, forward_m: float | FloatArray, right_m: float | FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) of a slot, m: p_l + R(chi_l) (forward, right), from the leader's true state."""
    cosine, sine = np.cos(leader.course_rad), np.sin(leader.course_rad)
    return (
        leader.north_m + forward_m * cosine - right_m * sine,
        leader.east_m + forward_m * sine + right_m * cosine,
    )


def seen_from_leader(
    leader: VehicleRecord, vehicle: VehicleRecord
) -> tuple[FloatArray, FloatArray]:
    """Return (forward, right) of a vehicle in the leader's course frame, m."""
    return in_course_frame(
        vehicle.north_m - leader.north_m, vehicle.east_m - leader.east_m, leader.course_rad
    )


def slot_error(leader: VehicleRecord, follower: VehicleRecord) -> SlotError:
    """Return slot minus follower in the leader's course frame; slot heights count from its true height."""
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
    """Return the leader with its path's course; NaN off the path: on the way onto another, and in a hold."""
    on_path = np.abs(leader.path_cross_track_error_m) <= ON_PATH_M
    return replace(leader, course_rad=np.where(on_path, leader.path_course_rad, np.nan))


def pair_separations(record: FlightRecord) -> tuple[PairSeparation, ...]:
    """Return the distance of every pair of vehicles, in three dimensions."""
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
    """Mean, 95th percentile and maximum of a figure's absolute values over the window."""

    mean: float
    p95: float
    max: float


def spread(values: FloatArray) -> Spread | None:
    """Return the spread of values; None where there is none, or a NaN."""
    if values.size == 0 or not bool(np.all(np.isfinite(values))):
        return None
    sizes = np.abs(values)
    return Spread(
        mean=float(np.mean(sizes)), p95=float(np.percentile(sizes, 95)), max=float(np.max(sizes))
    )


def window_s(record: FlightRecord) -> tuple[float, float]:
    """Return begin and end of the last half of the flight, s, in which errors count."""
    return record.duration_s / 2.0, record.duration_s


def in_window(record: FlightRecord) -> BoolArray:
    """Return which samples are in the window."""
    begin, end = window_s(record)
    # Times are sums of steps: rounding may put a sample outside the edge.
    slack = 1e-6
    return (record.time_s >= begin - slack) & (record.time_s <= end + slack)


def settling_time(time_s: FloatArray, errors_m: FloatArray, limit_m: float) -> float | None:
    """Return the last time at which any follower was `limit_m` or more from its slot, s.

    Errors have shape (followers, samples); a NaN counts as out. The result is 0 if no follower ever was out,
    and None if one still is at the end or nothing was measured.
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
    """Return which followers had a slot at which samples, shape (followers, samples).

    A follower that was ordered out has none, and is in no figure of errors meanwhile.
    """
    rows = [follower.in_formation for follower in record.followers]
    return np.array(rows, dtype=np.bool_).reshape(len(rows), record.time_s.size)


def errors_that_count(record: FlightRecord, errors_m: FloatArray) -> FloatArray:
    """Return errors, shape (followers, samples), prepared for `settling_time`.

    In records made of recordings, unknown errors take the last known value. The error is 0 while a follower
    was ordered out of the formation.
    """
    if record.mode == "recorded":
        numbers = np.where(np.isfinite(errors_m), np.arange(errors_m.shape[-1]), 0)
        latest = np.maximum.accumulate(numbers, axis=-1)
        errors_m = np.take_along_axis(errors_m, latest, axis=-1)
    return np.where(in_formation(record), errors_m, 0.0)


def turning(angles_rad: FloatArray) -> FloatArray:
    """Return the steps from each angle to the next, rad, the short way round; NaN samples are left out."""
    known = angles_rad[np.isfinite(angles_rad)]
    return wrap_angle(np.diff(known))


def variation_rate(time_s: FloatArray, angles_rad: FloatArray) -> float | None:
    """Return the total variation of an angle per second, rad/s; None with fewer than two samples."""
    seconds = _span(time_s, angles_rad)
    return None if seconds is None else float(np.sum(np.abs(turning(angles_rad)))) / seconds


def excess_variation_rate(time_s: FloatArray, angles_rad: FloatArray) -> float | None:
    """Return total variation less net turning, per second, rad/s: the back-and-forth part.

    It is zero in a steady turn of any rate; chatter is all excess.
    """
    seconds = _span(time_s, angles_rad)
    if seconds is None:
        return None
    steps = turning(angles_rad)
    # Rounding may put the difference of equal sums below zero.
    return max(float(np.sum(np.abs(steps)) - abs(np.sum(steps))), 0.0) / seconds


def speed_variation_rate(time_s: FloatArray, speeds_m_s: FloatArray) -> float | None:
    """Return the total variation of a speed per second, m/s²; None with fewer than two finite samples."""
    seconds = _span(time_s, speeds_m_s)
    if seconds is None:
        return None
    return float(np.nansum(np.abs(np.diff(speeds_m_s)))) / seconds


def roll_rate_rms(time_s: FloatArray, bank_rad: FloatArray) -> float | None:
    """Return the root mean square of the roll rate, rad/s; None with fewer than two finite samples."""
    known = np.isfinite(bank_rad)
    if np.count_nonzero(known) < 2:
        return None
    rates = np.diff(bank_rad[known]) / np.diff(time_s[known])
    return float(np.sqrt(np.mean(rates**2)))


def _span(time_s: FloatArray, values: FloatArray) -> float | None:
    """Return the time from the first to the last finite sample, s; None if there is no such span."""
    known = time_s[np.isfinite(values)]
    if known.size < 2 or known[-1] <= known[0]:
        return None
    return float(known[-1] - known[0])


def share(flags: BoolArray) -> float | None:
    """Return the share of true flags, 0 to 1; None without samples."""
    return float(np.mean(flags)) if flags.size else None


BANK_SLACK_DEG, SPEED_SLACK_M_S = 1.0, 0.05
"""Margins at limits: a lagging roll only comes near its limit, and setpoints are rounded on the wire."""


def at_bank_limit(vehicle: VehicleRecord, limits: FlightLimits) -> BoolArray:
    """Return which samples are at the greatest bank angle."""
    found: BoolArray = np.abs(np.degrees(vehicle.bank_rad)) >= (
        limits.greatest_bank_deg - BANK_SLACK_DEG
    )
    return found


def at_speed_limit(vehicle: VehicleRecord, limits: FlightLimits) -> BoolArray:
    """Return which samples have the lowest or highest airspeed as setpoint."""
    setpoint = vehicle.airspeed_setpoint_m_s
    slowest = setpoint <= limits.least_airspeed_m_s + SPEED_SLACK_M_S
    fastest = setpoint >= limits.greatest_airspeed_m_s - SPEED_SLACK_M_S
    found: BoolArray = slowest | fastest
    return found


def least_separation(distances_m: list[FloatArray]) -> float | None:
    """Return the least distance of all pairs at all times, m; None without a pair, or with an unknown one."""
    if not distances_m or distances_m[0].size == 0:
        return None
    least = float(np.min(np.stack(distances_m)))
    return least if np.isfinite(least) else None
