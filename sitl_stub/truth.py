"""What is really the case, for tests and for the record of a rehearsal."""

import math

import msgspec

from sitl_stub.flight import EmulatedFlight


class Truth(msgspec.Struct, frozen=True, kw_only=True):
    """The true, noise-free state of one aircraft."""

    time_s: float
    """Simulation time."""

    latitude_deg: float
    """Geodetic latitude."""

    longitude_deg: float
    """Longitude."""

    altitude_amsl_m: float
    """Altitude above mean sea level."""

    north_m_s: float
    """Ground velocity."""

    east_m_s: float
    """Ground velocity."""

    down_m_s: float
    """Ground velocity, positive down."""

    course_rad: float
    """Direction of the ground velocity, clockwise from north, [0, 2 pi)."""

    ground_speed_m_s: float
    """Horizontal speed over ground."""

    heading_rad: float
    """Direction of the nose, clockwise from north, [0, 2 pi)."""

    airspeed_m_s: float
    """Horizontal speed through the air."""

    bank_rad: float
    """Bank of the coordinated turn flown, positive right."""

    wind_north_m_s: float
    """Wind, toward."""

    wind_east_m_s: float
    """Wind, toward."""

    mode: str
    """Name of the flight mode, such as GUIDED or AUTO.LOITER."""

    armed: bool
    """Whether it reports to be armed."""


def truth_of(flight: EmulatedFlight) -> Truth:
    """The true state of a flight now."""
    motion, (wind_north_m_s, wind_east_m_s) = flight.motion(), flight.wind_m_s
    return Truth(
        time_s=flight.time_us * 1e-6,
        latitude_deg=math.degrees(flight.state.latitude_rad),
        longitude_deg=math.degrees(flight.state.longitude_rad),
        altitude_amsl_m=flight.state.altitude_amsl_m,
        north_m_s=motion.north_m_s,
        east_m_s=motion.east_m_s,
        down_m_s=motion.down_m_s,
        course_rad=motion.course_rad,
        ground_speed_m_s=motion.ground_speed_m_s,
        heading_rad=motion.heading_rad,
        airspeed_m_s=motion.airspeed_m_s,
        bank_rad=motion.bank_rad,
        wind_north_m_s=wind_north_m_s,
        wind_east_m_s=wind_east_m_s,
        mode=flight.mode.name,
        armed=flight.armed,
    )
