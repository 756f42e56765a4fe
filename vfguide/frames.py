"""The formation's local frame: north and east of the mission's origin on the WGS-84 ellipsoid."""

import math

import pymap3d
from pymap3d import rcurve

EARTH_RADIUS = 6371008.8
"""Mean radius, m."""


class LocalFrame:
    """North-east plane tangent to the ellipsoid at the origin.

    Heights are left out on purpose: a position is taken to the origin's own height first, so that a climb
    does not move a vehicle sideways in the plane.
    """

    __slots__ = (
        "_altitude_m",
        "_east_radius_m",
        "_latitude_deg",
        "_longitude_deg",
        "_north_radius_m",
    )

    def __init__(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> None:
        self._latitude_deg = latitude_deg
        self._longitude_deg = longitude_deg
        self._altitude_m = altitude_m
        self._north_radius_m = float(rcurve.meridian(latitude_deg)) + altitude_m
        self._east_radius_m = float(rcurve.transverse(latitude_deg)) + altitude_m

    def to_local(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """(north, east) in metres of a geodetic position in degrees."""
        north, east, _ = pymap3d.geodetic2ned(
            latitude_deg,
            longitude_deg,
            self._altitude_m,
            self._latitude_deg,
            self._longitude_deg,
            self._altitude_m,
        )
        return float(north), float(east)

    def to_geodetic(self, north: float, east: float) -> tuple[float, float]:
        """(latitude, longitude) in degrees of a position in metres.

        The plane leaves the ellipsoid by d²/(2 R) at a distance d: 8 cm at one kilometre, 8 m at ten. The
        point is put that much lower first, so that `to_local` brings back what went in.
        """
        drop = (north * north + east * east) / (2.0 * EARTH_RADIUS)
        latitude, longitude, _ = pymap3d.ned2geodetic(
            north, east, drop, self._latitude_deg, self._longitude_deg, self._altitude_m
        )
        return float(latitude), float(longitude)

    def shifted(
        self, latitude_deg: float, longitude_deg: float, north: float, east: float
    ) -> tuple[float, float]:
        """(latitude, longitude) in degrees of a position moved by some metres.

        The radii of curvature are the origin's: within 100 km of it a shift by 10 m is right to 1 mm.
        """
        parallel = self._east_radius_m * math.cos(math.radians(latitude_deg))
        return (
            latitude_deg + math.degrees(north / self._north_radius_m),
            longitude_deg + math.degrees(east / parallel),
        )
