"""What each version of PX4 makes of the setpoint messages of offboard, for a fixed wing.

| what the message uses | up to 1.14 | 1.15, 1.16 | 1.17, 1.18 |
|---|---|---|---|
| velocity alone | its course | the attitude of the moment | course and height of the moment |
| position, or position and acceleration | flies to it, at its height | the same | the same |
| position and velocity | the velocity's course, at the autopilot's own airspeed | the same | the same |

1.18.0-beta1 was flown in software, the others are read in the source. Every setpoint sets the airspeed back
to the autopilot's own. A course to a position is taken anew with each message, not between them.
"""

import math
from typing import Literal

import msgspec
import pymap3d
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import NonFiniteError, finite, height_target
from sitl_stub.flight import EmulatedFlight
from sitl_stub.targets import AltitudeTarget, TurnTarget

LOCAL_FRAMES = frozenset({1})
"""MAV_FRAME_LOCAL_NED."""

GLOBAL_FRAMES = frozenset({5, 6})
"""MAV_FRAME_GLOBAL_INT and GLOBAL_RELATIVE_ALT_INT: 0 and 3, which mean the same elsewhere, are not taken."""

IGNORE_X, IGNORE_Y, IGNORE_Z = 1, 2, 4
IGNORE_VX, IGNORE_VY = 8, 16
IGNORE_ACCELERATION = 64 | 128 | 256
"""POSITION_TARGET_TYPEMASK: a set bit means that the field is not to be used."""

STEERS_BY_VELOCITY = (1, 14)
"""The last version that does."""

KEEPS_COURSE = (1, 17)
"""The first version that keeps course and height where it is not steered, and not the attitude."""

Steers = Literal["velocity", "position", "path"]


class Px4Setpoint(msgspec.Struct, frozen=True):
    """What a setpoint message asks for."""

    steers: Steers
    """By which of its fields; `path` by position and velocity."""

    turn: TurnTarget | None
    """The course; None leaves it as it is."""

    height: AltitudeTarget | None
    """None leaves it as it is."""


def setpoint_of(flight: EmulatedFlight, message: MAVLink_message) -> Px4Setpoint | str:
    """What a message asks for, or why it is not taken."""
    mask = message.type_mask
    steers = steered_by(mask)
    local = message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    frames = LOCAL_FRAMES if local else GLOBAL_FRAMES
    if steers is None or message.coordinate_frame not in frames:
        return "unsupported setpoint"
    try:
        height = None if mask & IGNORE_Z else height_of(flight, message)
        if steers == "position":
            turn: TurnTarget | None = TurnTarget("course", bearing_rad(flight, message))
        else:
            turn = course_of(*finite(message.vx, message.vy))
    except NonFiniteError:
        return "non-finite field"
    return Px4Setpoint(steers, turn, height)


def steered_by(type_mask: int) -> Steers | None:
    """Which fields of a message with this mask decide the course; None for none that is understood."""
    if type_mask & IGNORE_ACCELERATION != IGNORE_ACCELERATION:
        return None
    position = not type_mask & (IGNORE_X | IGNORE_Y)
    velocity = not type_mask & (IGNORE_VX | IGNORE_VY)
    if position:
        return "path" if velocity else "position"
    return "velocity" if velocity and type_mask & IGNORE_X and type_mask & IGNORE_Y else None


def height_of(flight: EmulatedFlight, message: MAVLink_message) -> AltitudeTarget | None:
    """The height in a setpoint: z is down from home, alt is up in its frame's own meaning.

    Raises:
        NonFiniteError: it is no number.
    """
    if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        return AltitudeTarget(flight.home.altitude_amsl_m - finite(message.z)[0])
    return height_target(flight, message.coordinate_frame, finite(message.alt)[0])


def bearing_rad(flight: EmulatedFlight, message: MAVLink_message) -> float:
    """Course from where the aircraft is to the position in a setpoint.

    Raises:
        NonFiniteError: it is no number.
    """
    state, home = flight.state, flight.home
    if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        east_m, north_m, _ = pymap3d.geodetic2enu(
            state.latitude_rad,
            state.longitude_rad,
            home.altitude_amsl_m,
            home.latitude_rad,
            home.longitude_rad,
            home.altitude_amsl_m,
            deg=False,
        )
        x, y = finite(message.x, message.y)
        return math.atan2(y - east_m, x - north_m)
    east_m, north_m, _ = pymap3d.geodetic2enu(
        math.radians(message.lat_int * 1e-7),
        math.radians(message.lon_int * 1e-7),
        0.0,
        state.latitude_rad,
        state.longitude_rad,
        0.0,
        deg=False,
    )
    return math.atan2(east_m, north_m)


def course_of(north_m_s: float, east_m_s: float) -> TurnTarget | None:
    """The course of a velocity vector; its length is ignored. None for the zero vector."""
    if north_m_s == 0.0 and east_m_s == 0.0:
        return None
    return TurnTarget("course", math.atan2(east_m_s, north_m_s))
