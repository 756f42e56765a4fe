"""What the slots of a flight were fixed to, where others than its leader have led."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.record.vehicle import VehicleRecord

LONGEST_GAP_S = 6.0
"""From the last state of a leader to the first of its deputy: a longer time without either is not bridged."""


def slot_reference(time_s: FloatArray, vehicles: Sequence[VehicleRecord]) -> VehicleRecord:
    """The leader, with place, height and course of whoever led in the highest term at each time.

    While none led, between a leader that was lost and its deputy, slots were fixed to what every follower
    carried on by itself: a cubic between both, by their places and velocities. What the leader's aircraft
    did meanwhile, with its companion dead, is nobody's slot.

    Args:
        time_s: of the samples, s.
        vehicles: the leader first.
    """
    leader = vehicles[0]
    if leader.lead_term is None:
        return leader
    terms = np.array([_series(one, "lead_term") for one in vehicles])
    led = np.isfinite(terms).any(axis=0)
    if not led.any():
        return leader
    row = np.where(np.isfinite(terms), terms, -1.0).argmax(axis=0)
    # In term 0 it is the leader itself, which is known better from its own record.
    own = ~led | (np.where(led, terms[row, np.arange(time_s.size)], 0.0) == 0.0)
    found = {
        to: np.where(
            own,
            getattr(leader, to),
            np.array([_series(one, of) for one in vehicles])[row, np.arange(time_s.size)],
        )
        for to, of in (
            ("north_m", "lead_north_m"),
            ("east_m", "lead_east_m"),
            ("course_rad", "lead_course_rad"),
            ("altitude_amsl_m", "lead_altitude_amsl_m"),
        )
    }
    # It is carried on along its path.
    found["path_course_rad"] = np.where(own, leader.path_course_rad, found["course_rad"])
    found["path_cross_track_error_m"] = np.where(own, leader.path_cross_track_error_m, 0.0)
    for first, last in _gaps(led):
        if time_s[last] - time_s[first] <= LONGEST_GAP_S:
            _bridge(time_s, found, first, last)
    return replace(leader, **found)


def _series(vehicle: VehicleRecord, name: str) -> FloatArray:
    values: FloatArray | None = getattr(vehicle, name)
    return np.full_like(vehicle.north_m, np.nan) if values is None else values


def _gaps(led: np.ndarray) -> list[tuple[int, int]]:
    """(last sample before, first sample after) each time in which none led, between two in which one did."""
    samples = np.flatnonzero(led)
    ends = np.flatnonzero(np.diff(samples) > 1)
    return [(int(samples[one]), int(samples[one + 1])) for one in ends]


def _bridge(time_s: FloatArray, found: dict[str, FloatArray], first: int, last: int) -> None:
    """Fill the samples between two with a cubic of the same places and velocities at its ends."""
    span = time_s[last] - time_s[first]
    share = (time_s[first + 1 : last] - time_s[first]) / span
    before, after = max(first - 1, 0), min(last + 1, time_s.size - 1)
    for name in ("north_m", "east_m", "altitude_amsl_m"):
        values = found[name]
        begin, end = values[first], values[last]
        slopes = [
            span * (values[b] - values[a]) / max(time_s[b] - time_s[a], 1e-9)
            for a, b in ((before, first), (last, after))
        ]
        values[first + 1 : last] = (
            (1.0 + 2.0 * share) * (1.0 - share) ** 2 * begin
            + share * (1.0 - share) ** 2 * slopes[0]
            + share**2 * (3.0 - 2.0 * share) * end
            + share**2 * (share - 1.0) * slopes[1]
        )
    course = found["course_rad"]
    turn = np.remainder(course[last] - course[first] + np.pi, 2.0 * np.pi) - np.pi
    course[first + 1 : last] = course[first] + share * turn
