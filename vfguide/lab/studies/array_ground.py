"""Where vehicles are, for thousands at once: on the ellipsoid as the emulator flies, or on a plane.

Written apart from the emulator on purpose: that both come to the same is a test, not an import.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pymap3d
from pymap3d import rcurve

from vfguide.elementwise import FloatArray
from vfguide.frames import WGS84, LocalFrame
from vfguide.mission.model import Mission

SEMI_MAJOR_AXIS_M = 6_378_137.0
ECCENTRICITY_SQUARED = 6.694379990141316e-3
"""WGS-84."""

E7 = 1e7
"""MAVLink counts positions in steps of 1e-7 degrees: 11 mm."""

Place = tuple[FloatArray, FloatArray]
"""Two coordinates: (latitude, longitude) in rad on the ellipsoid, (north, east) in m on the plane."""

Report = tuple[FloatArray, FloatArray]
"""What a position report says: (latitude, longitude) in degrees, or (north, east) in m on the plane."""


class Ground(Protocol):
    """What a vehicle moves over."""

    def place(self, north: FloatArray, east: FloatArray) -> Place:
        """The place at a position in the local frame, m."""

    def advance(self, place: Place, north: FloatArray, east: FloatArray) -> Place:
        """A place some metres further."""

    def report(self, place: Place, *, rounded: bool) -> Report:
        """What a position report says of a place."""

    def local(self, report: Report) -> tuple[FloatArray, FloatArray]:
        """(north, east) of a report in the local frame, m."""

    def shifted(
        self, report: Report, north: FloatArray, east: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(north, east), m, of a report moved by some metres, after it has crossed the link."""


class Plane:
    """A plane, and reports without rounding: the fast one."""

    def place(self, north: FloatArray, east: FloatArray) -> Place:
        """The position itself."""
        return north, east

    def advance(self, place: Place, north: FloatArray, east: FloatArray) -> Place:
        """Metres are metres."""
        return place[0] + north, place[1] + east

    def report(self, place: Place, *, rounded: bool) -> Report:
        """The place itself; rounded to 11 mm where it is to be."""
        if not rounded:
            return place
        grid = math.radians(1.0 / E7) * SEMI_MAJOR_AXIS_M
        return np.rint(place[0] / grid) * grid, np.rint(place[1] / grid) * grid

    def local(self, report: Report) -> tuple[FloatArray, FloatArray]:
        """The report itself."""
        return report

    def shifted(
        self, report: Report, north: FloatArray, east: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Metres are metres."""
        return report[0] + north, report[1] + east


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipsoid:
    """WGS-84: what lockstep flies over.

    Every conversion is the one of `vfguide.frames`, in the same order of operations: what the companions of a
    lockstep flight see of their positions is seen here to the last bit.
    """

    latitude_deg: float
    """Of the local frame's origin."""
    longitude_deg: float
    """Of the local frame's origin."""
    origin_height_m: float
    """At which the local frame touches."""
    flying_height_m: float
    """Of every vehicle."""

    def place(self, north: FloatArray, east: FloatArray) -> Place:
        """Latitude and longitude of a position."""
        frame = LocalFrame(self.latitude_deg, self.longitude_deg, self.origin_height_m)
        latitude, longitude = np.vectorize(frame.to_geodetic)(north, east)
        return np.radians(latitude), np.radians(longitude)

    def advance(self, place: Place, north: FloatArray, east: FloatArray) -> Place:
        """Dlat = n / (M + h), dlon = e / ((N + h) cos lat)."""
        latitude, longitude = place
        meridian, transverse = radii(latitude)
        parallel = (transverse + self.flying_height_m) * np.cos(latitude)
        return latitude + north / (meridian + self.flying_height_m), longitude + east / parallel

    def report(self, place: Place, *, rounded: bool) -> Report:
        """Degrees; the nearest 1e-7 where they are to be rounded."""
        latitude, longitude = np.degrees(place[0]), np.degrees(place[1])
        if rounded:
            latitude, longitude = np.rint(latitude * E7) * 1e-7, np.rint(longitude * E7) * 1e-7
        return latitude, longitude

    def local(self, report: Report) -> tuple[FloatArray, FloatArray]:
        """Into the plane that touches at the origin, as if at its height."""
        height = self.origin_height_m
        x, y, z = pymap3d.geodetic2ecef(report[0], report[1], height, WGS84)
        origin = pymap3d.geodetic2ecef(self.latitude_deg, self.longitude_deg, height, WGS84)
        x, y, z = x - origin[0], y - origin[1], z - origin[2]
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        north = (
            -math.sin(latitude) * math.cos(longitude),
            -math.sin(latitude) * math.sin(longitude),
            math.cos(latitude),
        )
        east = (-math.sin(longitude), math.cos(longitude))
        return north[0] * x + north[1] * y + north[2] * z, east[0] * x + east[1] * y

    def shifted(
        self, report: Report, north: FloatArray, east: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """By the origin's radii of curvature, and back into the plane."""
        meridian = float(rcurve.meridian(self.latitude_deg)) + self.origin_height_m
        transverse = float(rcurve.transverse(self.latitude_deg)) + self.origin_height_m
        parallel = transverse * np.cos(np.radians(report[0]))
        longitude = report[1] + np.degrees(east / parallel)
        return self.local(
            (
                report[0] + np.degrees(north / meridian),
                (longitude + 180.0) % 360.0 - 180.0,
            )
        )


def radii(latitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radii of curvature at a geodetic latitude (rad), m: meridian M, prime vertical N."""
    shrink = 1.0 - ECCENTRICITY_SQUARED * np.sin(latitude) ** 2
    transverse = SEMI_MAJOR_AXIS_M / np.sqrt(shrink)
    return transverse * (1.0 - ECCENTRICITY_SQUARED) / shrink, transverse


def ellipsoid_of(mission: Mission) -> Ellipsoid:
    """The ground under a mission, flown at the leader's height."""
    origin = mission.origin
    return Ellipsoid(
        latitude_deg=origin.latitude_deg,
        longitude_deg=origin.longitude_deg,
        origin_height_m=origin.altitude_amsl_m,
        flying_height_m=origin.altitude_amsl_m + mission.height_above_origin_m,
    )
