"""Where slots and vehicles truly were: the geometry behind every figure of a report.

Written apart from the guidance laws on purpose: what measures a flight must not share a sign error with
what flew it. Frame: metres north and east; courses in radians clockwise from north.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.record.flight import FlightRecord, VehicleRecord

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
