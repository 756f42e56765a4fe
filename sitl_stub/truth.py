"""What is really the case, for tests and for the record of a rehearsal."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
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
