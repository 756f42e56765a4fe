"""What one vehicle did on a flight: its true states and the setpoints it was sent.

Frame: local, metres north and east of the mission's origin; angles in radians clockwise from north; wind is
the vector the air moves toward.
"""

from dataclasses import asdict, dataclass, fields
from typing import Literal

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.record.archive import Figure, IntegerArray
from vfguide.record.response import VehicleResponse

Role = Literal["leader", "follower"]

SLOT_SERIES = ("slot_forward_series_m", "slot_right_series_m", "slot_up_series_m")
"""Those that only a vehicle has whose slot was changed in flight."""
LEAD_SERIES = (
    "lead_term",
    "lead_north_m",
    "lead_east_m",
    "lead_course_rad",
    "lead_altitude_amsl_m",
)
"""More of them, of a mission with deputies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """What a vehicle's mission allows it."""

    least_airspeed_m_s: Figure
    """Airspeed that it must not fall below."""
    greatest_airspeed_m_s: Figure
    """Airspeed that it must not exceed."""
    greatest_bank_deg: Figure
    """To either side."""

    def describe(self) -> dict[str, float]:
        """By name, ready for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VehicleRecord:
    """One vehicle on one flight: N samples of where it truly was, and what it was asked for."""

    name: str
    """The vehicle's name in the mission file."""
    role: Role
    """`leader` or `follower`."""
    system_id: int
    """MAVLink system."""
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
    """True wind at the vehicle, toward."""
    wind_east_m_s: FloatArray
    """True wind at the vehicle, toward."""
    path_cross_track_error_m: FloatArray
    """True signed distance of the leader from its path, positive right of track; NaN for followers."""
    path_course_rad: FloatArray
    """Course of the path where it is nearest to the leader; NaN for followers."""
    course_setpoint_rad: FloatArray
    """Last course setpoint sent; NaN before the first."""
    airspeed_setpoint_m_s: FloatArray
    """Last airspeed setpoint sent; NaN where none was sent."""
    ground_speed_setpoint_m_s: FloatArray
    """Last ground speed setpoint sent; NaN where none was sent."""
    mode: IntegerArray
    """Mode of the supervisor, an index into the record's `mode_names`."""
    limited: BoolArray
    """Whether a limit of the vehicle cut the setpoint."""
    lyapunov: FloatArray
    """The follower's Lyapunov function W, m²; NaN for the leader."""
    slot_up_m: Figure = 0.0
    """Slot above the leader, m; 0 for the leader."""
    limits: FlightLimits | None = None
    """Limits of its airspeed and bank; None where the record does not hold them."""
    response: VehicleResponse | None = None
    """How it was finally flown; None where no companion told, and in records of earlier versions."""
    declared: VehicleResponse | None = None
    """What its mission declares of that; None in records of earlier versions."""
    slot_forward_series_m: FloatArray | None = None
    """Where the slot was at each sample, where it was changed in flight; None of one that was not.

    NaN while the vehicle was ordered out of the formation and had none."""
    slot_right_series_m: FloatArray | None = None
    """The slot at each time, m right of the leader."""
    slot_up_series_m: FloatArray | None = None
    """The slot at each time, m above the leader."""
    lead_term: FloatArray | None = None
    """Term in which the vehicle led, NaN where it did not; None where the mission names no deputies."""
    lead_north_m: FloatArray | None = None
    """Place of the leader by which it led (itself, or a lost one extrapolated), m north; with `lead_term`."""
    lead_east_m: FloatArray | None = None
    """Place of the leader by which it led, m east; with `lead_term`."""
    lead_course_rad: FloatArray | None = None
    """Course over ground of the leader by which it led, rad clockwise from north; with `lead_term`."""
    lead_altitude_amsl_m: FloatArray | None = None
    """Altitude of the leader by which it led, m above mean sea level; with `lead_term`."""

    leader_age_s: FloatArray | None = None
    """Age of the leader's state that a follower flew by, s, NaN where it had none; None where not told."""
    path_number: FloatArray | None = None
    """Path by which the vehicle's companion went: 0 the record's, 1 the first of its outlines of kind `path`
    and so on, NaN none, as in a hold; None where it was the record's all the time."""

    @property
    def slot_m(self) -> tuple[float | FloatArray, float | FloatArray]:
        """(forward, right) of the slot, over time where it was changed in flight."""
        forward, right = self.slot_forward_series_m, self.slot_right_series_m
        if forward is None or right is None:
            return self.slot_forward_m, self.slot_right_m
        return forward, right

    @property
    def in_formation(self) -> BoolArray:
        """Whether the vehicle belonged to the formation at each sample: not while an order had it leave."""
        forward = self.slot_forward_series_m
        if forward is None:
            return np.ones(self.north_m.shape, dtype=np.bool_)
        return np.isfinite(forward)

    @property
    def slot_height_m(self) -> float | FloatArray:
        """Height of the slot above the leader, over time where it was changed in flight."""
        return self.slot_up_m if self.slot_up_series_m is None else self.slot_up_series_m


SERIES = tuple(field.name for field in fields(VehicleRecord) if field.type is FloatArray)
"""The arrays of floats that every vehicle's record has."""
