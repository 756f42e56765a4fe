"""The formation's local frame: north and east of the mission's origin on the WGS-84 ellipsoid."""

import math

import pymap3d
from pymap3d import rcurve

EARTH_RADIUS = 6371008.8
"""Mean radius of the earth, m."""

WGS84 = pymap3d.Ellipsoid.from_name("wgs84")
"""Ellipsoid of satellite navigation."""

SEMIMAJOR_M, SEMIMINOR_M = float(WGS84.semimajor_axis), float(WGS84.semiminor_axis)
AXIS_RATIO = SEMIMINOR_M / SEMIMAJOR_M


class LocalFrame:
    """North-east plane tangent to the ellipsoid at the origin.

    Heights are ignored on purpose: a position is first moved to the origin's height, so that a climb does
    not move a vehicle sideways in the plane.
    """

    def __init__(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> None:
        self.altitude_m = altitude_m
        """Altitude of the origin, m above mean sea level."""
        self.origin = latitude_deg, longitude_deg
        """Latitude and longitude of the origin, degrees."""
        self._latitude_deg = latitude_deg
        self._longitude_deg = longitude_deg
        self._north_radius_m = float(rcurve.meridian(latitude_deg)) + altitude_m
        self._east_radius_m = float(rcurve.transverse(latitude_deg)) + altitude_m
        # Computed once; the library would compute the origin and its axes at each call.
        self._origin = earth_centred(latitude_deg, longitude_deg, altitude_m)
        latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
        self._north_axis = (
            -math.sin(latitude) * math.cos(longitude),
            -math.sin(latitude) * math.sin(longitude),
            math.cos(latitude),
        )
        self._east_axis = (-math.sin(longitude), math.cos(longitude))

    def to_local(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Return (north, east) in metres of a geodetic position in degrees."""
        x, y, z = earth_centred(latitude_deg, longitude_deg, self.altitude_m)
        x, y, z = x - self._origin[0], y - self._origin[1], z - self._origin[2]
        north, east = self._north_axis, self._east_axis
        return north[0] * x + north[1] * y + north[2] * z, east[0] * x + east[1] * y

    def to_geodetic(self, north: float, east: float) -> tuple[float, float]:
        """Return (latitude, longitude) in degrees of a position in metres.

        The plane leaves the ellipsoid by d²/(2 R) at a distance d: 8 cm at one kilometre, 8 m at ten. The
        point is lowered by this amount first, so that `to_local` inverts this function.
        """
        drop = (north * north + east * east) / (2.0 * EARTH_RADIUS)
        latitude, longitude, _ = pymap3d.ned2geodetic(
            north, east, drop, self._latitude_deg, self._longitude_deg, self.altitude_m
        )
        return float(latitude), float(longitude)

    def shifted(
        self, latitude_deg: float, longitude_deg: float, north: float, east: float
    ) -> tuple[float, float]:
        """Return (latitude, longitude) in degrees of a position shifted by some metres.

        The radii of curvature are the origin's: within 60 km of it a shift by 10 m is right to 1 mm.
        """
        parallel = self._east_radius_m * math.cos(math.radians(latitude_deg))
        return (
            latitude_deg + math.degrees(north / self._north_radius_m),
            wrap_longitude(longitude_deg + math.degrees(east / parallel)),
        )


def earth_centred(
    latitude_deg: float, longitude_deg: float, altitude_m: float
) -> tuple[float, float, float]:
    """Return earth-centred coordinates of a geodetic position (degrees, m above the ellipsoid), m.

    The axes point toward 0°, 0°, toward 0°, 90° E, and toward the north pole. This is the formula of
    `pymap3d.geodetic2ecef` for one position. The library takes 20 times as long, and every received position
    is converted.
    """
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    cosine, sine = math.cos(latitude), math.sin(latitude)
    # Radius of curvature in the prime vertical. The absolute value of a complex number uses the C library's
    # hypot, as NumPy does, so that the result equals the library's to the last bit.
    radius = SEMIMAJOR_M**2 / abs(complex(SEMIMAJOR_M * cosine, SEMIMINOR_M * sine))
    from_axis = (radius + altitude_m) * cosine
    return (
        from_axis * math.cos(longitude),
        from_axis * math.sin(longitude),
        (radius * AXIS_RATIO**2 + altitude_m) * sine,
    )


def way_m(first: tuple[float, float], second: tuple[float, float]) -> float:
    """Return the distance over the earth between two (latitude, longitude) in degrees, m; to 0.5 %."""
    chord = math.dist(earth_centred(*first, 0.0), earth_centred(*second, 0.0))
    return 2.0 * EARTH_RADIUS * math.asin(min(chord / (2.0 * EARTH_RADIUS), 1.0))


def wrap_longitude(longitude_deg: float) -> float:
    """Return the same meridian in [-180, 180) degrees."""
    return (longitude_deg + 180.0) % 360.0 - 180.0
