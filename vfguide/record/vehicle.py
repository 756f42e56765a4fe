"""Record of one vehicle on a flight: its true states and the setpoints sent to it.

Frame: local, metres north and east of the mission's origin; angles in radians clockwise from north; wind is
the velocity vector of the air.
"""

from dataclasses import asdict, dataclass, fields
from typing import Literal

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.record.archive import Figure, IntegerArray
from vfguide.record.response import VehicleResponse

Role = Literal["leader", "follower"]

SLOT_SERIES = ("slot_forward_series_m", "slot_right_series_m", "slot_up_series_m")
"""Arrays of vehicles whose slot was changed in flight."""
LEAD_SERIES = (
    "lead_term",
    "lead_north_m",
    "lead_east_m",
    "lead_course_rad",
    "lead_altitude_amsl_m",
)
"""Arrays of vehicles in a mission with deputies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """Limits of a vehicle in its mission."""

    least_airspeed_m_s: Figure
    """Minimum airspeed, m/s."""
    greatest_airspeed_m_s: Figure
    """Maximum airspeed, m/s."""
    greatest_bank_deg: Figure
    """Maximum bank angle to either side, degrees."""

    def describe(self) -> dict[str, float]:
        """Return the limits by name as JSON data."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VehicleRecord:
    """Record of one vehicle on one flight: N samples of its true states and its setpoints."""

    name: str
    """Name in the mission file."""
    role: Role
    system_id: int
    """MAVLink system ID."""
    slot_forward_m: Figure
    """Slot ahead of the leader, m; 0 for the leader."""
    slot_right_m: Figure
    """Slot right of the leader, m; 0 for the leader."""
    north_m: FloatArray
    """True position, m."""
    east_m: FloatArray
    """True position, m."""
    altitude_amsl_m: FloatArray
    """True altitude above mean sea level, m."""
    course_rad: FloatArray
    """True course chi; wrapped or not."""
    ground_speed_m_s: FloatArray
    """True ground speed V_g."""
    heading_rad: FloatArray
    """True heading psi; wrapped or not."""
    airspeed_m_s: FloatArray
    """True airspeed V_a."""
    bank_rad: FloatArray
    """True bank angle, positive with the right wing down."""
    wind_north_m_s: FloatArray
    """True wind at the vehicle, positive if the air moves north."""
    wind_east_m_s: FloatArray
    """True wind at the vehicle, positive if the air moves east."""
    path_cross_track_error_m: FloatArray
    """True cross-track error of the leader, positive right of track; NaN for followers."""
    path_course_rad: FloatArray
    """Course of the path at its point closest to the leader; NaN for followers."""
    course_setpoint_rad: FloatArray
    """Last course setpoint sent; NaN before the first."""
    airspeed_setpoint_m_s: FloatArray
    """Last airspeed setpoint sent; NaN if none was sent."""
    ground_speed_setpoint_m_s: FloatArray
    """Last ground speed setpoint sent; NaN if none was sent."""
    mode: IntegerArray
    """Mode of the supervisor, an index into the record's `mode_names`."""
    limited: BoolArray
    """Whether a limit of the vehicle cut the setpoint."""
    lyapunov: FloatArray
    """The follower's Lyapunov function W, m²; NaN for the leader."""
    slot_up_m: Figure = 0.0
    """Slot above the leader, m; 0 for the leader."""
    limits: FlightLimits | None = None
    """Limits of airspeed and bank; None if unknown."""
    response: VehicleResponse | None = None
    """Final response assumed by the companion; None if not recorded, and in records of earlier versions."""
    declared: VehicleResponse | None = None
    """Response declared by the mission; None in records of earlier versions."""
    slot_forward_series_m: FloatArray | None = None
    """Slot ahead of the leader over time, m; None if it was not changed in flight. NaN while the vehicle was
    ordered out of the formation."""
    slot_right_series_m: FloatArray | None = None
    """Slot right of the leader over time, m."""
    slot_up_series_m: FloatArray | None = None
    """Slot above the leader over time, m."""
    lead_term: FloatArray | None = None
    """Term in which the vehicle led, NaN while it did not; None without deputies in the mission."""
    lead_north_m: FloatArray | None = None
    """Position of the leader by which it led (itself, or a lost one extrapolated), m north; with
    `lead_term`."""
    lead_east_m: FloatArray | None = None
    """Position of the leader by which it led, m east; with `lead_term`."""
    lead_course_rad: FloatArray | None = None
    """Course over ground of the leader by which it led, rad clockwise from north; with `lead_term`."""
    lead_altitude_amsl_m: FloatArray | None = None
    """Altitude of the leader by which it led, m above mean sea level; with `lead_term`."""

    leader_age_s: FloatArray | None = None
    """Age of the leader state that a follower used, s, NaN without one; None if not recorded."""
    path_number: FloatArray | None = None
    """Path that the companion used: 0 the record's, 1 the first outline of kind `path` and so on, NaN for
    none, as in a hold. None if it was always the record's."""

    @property
    def slot_m(self) -> tuple[float | FloatArray, float | FloatArray]:
        """(forward, right) of the slot, m; arrays if it was changed in flight."""
        forward, right = self.slot_forward_series_m, self.slot_right_series_m
        if forward is None or right is None:
            return self.slot_forward_m, self.slot_right_m
        return forward, right

    @property
    def in_formation(self) -> BoolArray:
        """Whether the vehicle belonged to the formation at each sample; not while ordered to leave."""
        forward = self.slot_forward_series_m
        if forward is None:
            return np.ones(self.north_m.shape, dtype=np.bool_)
        return np.isfinite(forward)

    @property
    def slot_height_m(self) -> float | FloatArray:
        """Height of the slot above the leader, m; an array if it was changed in flight."""
        return self.slot_up_m if self.slot_up_series_m is None else self.slot_up_series_m


SERIES = tuple(field.name for field in fields(VehicleRecord) if field.type is FloatArray)
"""Names of the float arrays that every vehicle's record has."""
