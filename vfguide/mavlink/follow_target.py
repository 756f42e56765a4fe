"""FOLLOW_TARGET: a leader's motion for followers that have no companion, such as ArduPlane's and PX4's own.

What they read of it, by their sources: ArduPilot (AP_Follow) wants the bit of the position; takes velocity,
acceleration, and attitude with rates where their bits are set; turns offsets with the yaw and refuses the
message without attitude if they are relative; and goes by the time stamp's differences only. From the first
one on it ignores the sender's GLOBAL_POSITION_INT. PX4 takes place and velocity, and stamps them on arrival.
Neither reads `position_cov` and `custom_state`: 0 here, as of a sender that does not tell.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.leader_messages import (
    HAS_ACCELERATION,
    HAS_ATTITUDE,
    HAS_POSITION,
    HAS_VELOCITY,
)
from vfguide.state import LeaderState

INTERVAL_S = 0.1
"""Between two of them."""


def follow_target(
    motion: LeaderState[float],
    *,
    latitude_deg: float,
    longitude_deg: float,
    altitude_amsl: float,
    heading: float,
) -> MAVLink_message:
    """The message of a motion.

    Velocity and acceleration are those over ground: (V cos chi, V sin chi) and its derivative. Roll and pitch
    are left out of the attitude, which then turns with the course: its yaw rate is the turn rate.

    Args:
        motion: at its time, s on the sender's clock.
        latitude_deg: of its place.
        longitude_deg: of its place.
        altitude_amsl: m above mean sea level.
        heading: of the nose, rad.
    """
    ahead_north, ahead_east = math.cos(motion.course), math.sin(motion.course)
    turning = motion.ground_speed * motion.turn_rate
    return mavlink.MAVLink_follow_target_message(
        round(motion.time_s * 1e3) % 2**64,
        HAS_POSITION | HAS_VELOCITY | HAS_ACCELERATION | HAS_ATTITUDE,
        round(latitude_deg * 1e7),
        round(longitude_deg * 1e7),
        altitude_amsl,
        [motion.ground_speed * ahead_north, motion.ground_speed * ahead_east, 0.0],
        [
            motion.acceleration * ahead_north - turning * ahead_east,
            motion.acceleration * ahead_east + turning * ahead_north,
            0.0,
        ],
        [math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)],
        [0.0, 0.0, motion.turn_rate],
        [0.0, 0.0, 0.0],
        0,
    )
