"""What an aircraft remembers from one integration step to the next."""

from dataclasses import dataclass

from sitl_stub.rigid_body import Body
from sitl_stub.targets import SpeedKind


@dataclass(frozen=True, slots=True)
class PlantState:
    """Position, motion, and the states of loops that have some."""

    direction_rad: float
    """Heading (all others) or course (course-hold), in [0, 2 pi)."""

    speed_m_s: float
    """The speed that `speed_kind` names."""

    speed_kind: SpeedKind
    """Always `airspeed` but on the course-hold plant."""

    latitude_rad: float
    """Geodetic latitude."""

    longitude_rad: float
    """Longitude, in (-pi, pi]."""

    altitude_amsl_m: float
    """Altitude, also taken as height above the ellipsoid (the geoid's 100 m at most are 2e-5)."""

    roll_rad: float = 0.0
    """Bank of the bank plant, positive right."""

    speed_integral_m_s2: float = 0.0
    """Integral of the `tecs` speed hold; of `px4`'s its acceleration."""

    speed_reference_m_s: float | None = None
    """What the `px4` speed hold holds now, on its way to what is commanded; None before its first step."""

    memory: tuple[float, ...] = ()
    """Of the loops of a plant of one's own; empty before its first step."""

    body: Body | None = None
    """Of the `six-dof` plant; None before its first step in the air."""

    climb_m_s: float = 0.0
    """Of the height hold, positive up; the `six-dof` plant has its own in its body."""
