"""PX4's setpoint messages for a fixed wing: of a velocity it flies the course."""

import math

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import NonFiniteError, finite, height_target
from sitl_stub.flight import Flight
from sitl_stub.targets import HeightTarget, TurnTarget

LOCAL_NED_FRAME = 1
"""MAV_FRAME_LOCAL_NED."""

IGNORE_X, IGNORE_Y, IGNORE_Z = 1, 2, 4
IGNORE_VX, IGNORE_VY = 8, 16
IGNORE_ACCELERATION = 64 | 128 | 256
"""POSITION_TARGET_TYPEMASK: a set bit means that the field is not to be used."""

Setpoint = tuple[TurnTarget | None, HeightTarget | None]
"""What a setpoint message asks for; None leaves a loop alone."""


def setpoint_of(flight: Flight, message: MAVLink_message) -> Setpoint | str:
    """What a message asks for, or why it is not taken."""
    mask = message.type_mask
    if not is_velocity_only(mask):
        return "unsupported setpoint"
    try:
        turn = course_of(*finite(message.vx, message.vy))
        height = None if mask & IGNORE_Z else height_of(flight, message)
    except NonFiniteError:
        return "non-finite field"
    local = message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    if local and message.coordinate_frame != LOCAL_NED_FRAME:
        return "unsupported setpoint"
    if height is None and not mask & IGNORE_Z:
        return "unsupported setpoint"
    return turn, height


def height_of(flight: Flight, message: MAVLink_message) -> HeightTarget | None:
    """The height in a setpoint: z is down from home, alt is up in its frame's own meaning.

    Raises:
        NonFiniteError: it is no number.
    """
    if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        return HeightTarget(flight.home.altitude_amsl_m - finite(message.z)[0])
    return height_target(flight, message.coordinate_frame, finite(message.alt)[0])


def is_velocity_only(type_mask: int) -> bool:
    """Whether horizontal velocity is used and neither position nor acceleration is.

    Height may be used or not; yaw means nothing to a fixed wing.
    """
    ignored = IGNORE_X | IGNORE_Y | IGNORE_ACCELERATION
    return type_mask & ignored == ignored and not type_mask & (IGNORE_VX | IGNORE_VY)


def course_of(north_m_s: float, east_m_s: float) -> TurnTarget | None:
    """The course of a velocity vector; its length is ignored. None for the zero vector."""
    if north_m_s == 0.0 and east_m_s == 0.0:
        return None
    return TurnTarget("course", math.atan2(east_m_s, north_m_s))
