"""What one vehicle did on a flight: its true states and the setpoints it was sent.

Frame: local, metres north and east of the mission's origin; angles in radians clockwise from north; wind is
the vector the air moves toward.
"""

import math
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.record.archive import AnyArray
from vfguide.record.response import VehicleResponse, compose_response, describe_response

Role = Literal["leader", "follower"]
IntegerArray = NDArray[np.integer[Any]]

SERIES = (
    "north_m",
    "east_m",
    "altitude_amsl_m",
    "course_rad",
    "ground_speed_m_s",
    "heading_rad",
    "airspeed_m_s",
    "bank_rad",
    "wind_north_m_s",
    "wind_east_m_s",
    "path_cross_track_error_m",
    "path_course_rad",
    "course_setpoint_rad",
    "airspeed_setpoint_m_s",
    "ground_speed_setpoint_m_s",
    "lyapunov",
)
"""The arrays of floats in a `VehicleRecord`."""

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
AGE_SERIES = ("leader_age_s",)
"""Recorded by companions, and in live rehearsals."""
PATH_SERIES = ("path_number",)
"""Recorded where a mission flew another path than its first, or none for a while."""
OPTIONAL_SERIES = (*SLOT_SERIES, *LEAD_SERIES, *AGE_SERIES, *PATH_SERIES)
"""All that only some vehicles' records have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """What a vehicle's mission allows it."""

    least_airspeed_m_s: float
    """Airspeed that it must not fall below."""
    greatest_airspeed_m_s: float
    """Airspeed that it must not exceed."""
    greatest_bank_deg: float
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
    slot_forward_m: float
    """Slot ahead of the leader, m; 0 for the leader."""
    slot_right_m: float
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
    slot_up_m: float = 0.0
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


def describe_vehicle(vehicle: VehicleRecord) -> dict[str, object]:
    """All of a vehicle's record that is no array, ready for JSON."""
    return {
        "name": vehicle.name,
        "role": vehicle.role,
        "system_id": vehicle.system_id,
        "slot_forward_m": vehicle.slot_forward_m,
        "slot_right_m": vehicle.slot_right_m,
        "slot_up_m": vehicle.slot_up_m,
        "limits": None if vehicle.limits is None else vehicle.limits.describe(),
        "response": describe_response(vehicle.response),
        "declared": describe_response(vehicle.declared),
    }


def compose_vehicle(
    entry: dict[str, Any], arrays: dict[str, AnyArray], prefix: str
) -> VehicleRecord:
    """One vehicle from its description and the arrays whose names begin with the prefix."""
    role = entry["role"]
    if role not in get_args(Role):
        raise ValueError("role is neither leader nor follower")
    limited = arrays[prefix + "limited"]
    mode = arrays[prefix + "mode"]
    if limited.dtype != np.bool_ or not np.issubdtype(mode.dtype, np.integer):
        raise ValueError("limited or mode has the wrong type")
    return VehicleRecord(
        name=str(entry["name"]),
        role=role,
        system_id=int(entry["system_id"]),
        slot_forward_m=sound(entry["slot_forward_m"]),
        slot_right_m=sound(entry["slot_right_m"]),
        # Records of earlier versions do not tell.
        slot_up_m=sound(entry.get("slot_up_m", 0.0)),
        limits=compose_limits(entry.get("limits")),
        response=compose_response(entry.get("response")),
        declared=compose_response(entry.get("declared")),
        mode=mode.astype(np.int64),
        limited=limited.astype(np.bool_),
        **{name: floats(arrays, prefix + name) for name in SERIES},
        **{
            name: floats(arrays, prefix + name)
            for name in OPTIONAL_SERIES
            if prefix + name in arrays
        },
    )


def compose_limits(entry: Any) -> FlightLimits | None:  # noqa: ANN401
    """Limits from their description; LookupError, TypeError or ValueError where it is none."""
    if entry is None:
        return None
    found = FlightLimits(**{one.name: sound(entry[one.name]) for one in fields(FlightLimits)})
    if not all(math.isfinite(value) for value in found.describe().values()):
        raise ValueError("a limit is not finite")
    return found


GREATEST = 1e15
"""Nothing of a flight is as large, in whichever unit; its square can still be added up."""


def sound(value: object) -> float:
    """A number of a record's description; TypeError or ValueError where it is none of a flight."""
    number = float(value)  # type: ignore[arg-type]
    if not abs(number) <= GREATEST:
        raise ValueError(f"{number:g} is no number of a flight")
    return number


def floats(arrays: dict[str, AnyArray], name: str) -> FloatArray:
    """One array of floats."""
    array = arrays[name]
    if not np.issubdtype(array.dtype, np.floating):
        raise ValueError(f"{name} holds no numbers")
    values = array.astype(np.float64)
    if np.any(np.abs(values) > GREATEST):
        raise ValueError(f"{name} holds a number that nothing in a flight can be")
    return values
