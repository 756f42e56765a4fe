"""ADSB_VEHICLE in SI units, and what numbers in reports of other aircraft can mean at all.

Nothing here is true because it is well-formed: whoever has a transmitter can send it.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.reports import TrafficReport

LOWEST_M, HIGHEST_M = -1000.0, 30_000.0
"""Altitudes that aircraft can have; another is one that is not known."""

PRESSURE_ALTITUDE_ERROR_M = 500.0
"""Of a pressure altitude: nobody says that the QNH was set, 1 hPa is 27 ft, and air pressures at sea
level lie within 60 hPa of the standard one."""

GREATEST_M_S = 1000.0
"""A velocity above this is no velocity."""

GREATEST_CLIMB_M_S = 30.0
"""Nor is a climb rate above this a climb rate."""

LONG_SILENT_S = 5.0
"""Not heard by an ADS-B receiver for longer: what it repeats then is no report."""

ALTITUDE_ERRORS_M = {
    mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC: 0.0,
    mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH: PRESSURE_ALTITUDE_ERROR_M,
}
"""Of the types of altitude that a report can carry; another is one that is not known."""

Pair = tuple[float, float]


def altitude_of(metres: float) -> float:
    """An altitude (m), NaN where it cannot be one."""
    return metres if LOWEST_M <= metres <= HIGHEST_M else math.nan


def climb_of(down: float) -> float:
    """A climb rate of a velocity downward (m/s), 0 where it cannot be one."""
    return -down if abs(down) <= GREATEST_CLIMB_M_S else 0.0


def pair_of(north: float, east: float, *, greatest: float) -> Pair | None:
    """A vector, or None where it is none or too long."""
    return (north, east) if math.hypot(north, east) <= greatest else None


def is_on_earth(latitude: int, longitude: int) -> bool:
    """Whether these 1e-7 degrees are a place where somebody flies: autopilots without a fix report 0, 0."""
    return abs(latitude) <= 90e7 and abs(longitude) <= 180e7 and (latitude, longitude) != (0, 0)


def traffic_report(message: MAVLink_message) -> TrafficReport | None:
    """ADSB_VEHICLE: course (not heading) in centidegrees, cm/s, and how many seconds ago it was heard."""
    flags = message.flags
    wanted = mavlink.ADSB_FLAGS_VALID_COORDS
    if flags & wanted != wanted or message.tslc > LONG_SILENT_S:
        return None
    if not is_on_earth(message.lat, message.lon):
        return None
    velocity = None
    if flags & mavlink.ADSB_FLAGS_VALID_HEADING and flags & mavlink.ADSB_FLAGS_VALID_VELOCITY:
        course, speed = math.radians(message.heading * 1e-2), message.hor_velocity * 1e-2
        velocity = speed * math.cos(course), speed * math.sin(course)
    error = ALTITUDE_ERRORS_M.get(message.altitude_type)
    known = error is not None and flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE
    climbs = flags & mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
    return TrafficReport(
        icao_address=message.ICAO_address,
        latitude_deg=message.lat * 1e-7,
        longitude_deg=message.lon * 1e-7,
        altitude_amsl=altitude_of(message.altitude * 1e-3) if known else math.nan,
        altitude_error=error or 0.0,
        velocity=velocity,
        # Unlike all other messages this one counts it upward.
        climb_rate=climb_of(-message.ver_velocity * 1e-2) if climbs else 0.0,
        age_s=float(message.tslc),
    )
