"""The motion of a leader in MAVLink: as an aircraft without a companion tells it, and FOLLOW_TARGET.

Such an aircraft is heard by four MAVLink messages and ADS-B, in SI units here. All that an aircraft may
send is looked at; which of it is followed is for others to decide. Nothing here is true because it is
well-formed: every number is checked against what its field can mean, no more.

FOLLOW_TARGET is also sent, for followers that have no companion, such as ArduPlane's and PX4's own. What
they read of it, by their sources: ArduPilot (AP_Follow) wants the bit of the position; takes velocity,
acceleration, and attitude with rates where their bits are set; turns offsets with the yaw and refuses the
message without attitude if they are relative; and goes by the time stamp's differences only. From the
first one on it ignores the sender's GLOBAL_POSITION_INT. PX4 takes place and velocity, and stamps them on
arrival. Neither reads `position_cov` and `custom_state`: 0 here, as of a sender that does not tell.
"""

import math
from collections import Counter
from collections.abc import Callable
from typing import Literal

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.codec import (
    GREATEST_M_S,
    Pair,
    altitude_of,
    climb_of,
    is_on_earth,
    pair_of,
    time_report,
    traffic_report,
)
from vfguide.mavlink.framing import frames_of, message_in
from vfguide.mavlink.reports import TimeReport
from vfguide.state import LeaderState

Kind = Literal[
    "FOLLOW_TARGET",
    "GLOBAL_POSITION_INT_COV",
    "GLOBAL_POSITION_INT",
    "HIGH_LATENCY2",
    "ADSB_VEHICLE",
]

KINDS: tuple[Kind, ...] = (
    "FOLLOW_TARGET",
    "GLOBAL_POSITION_INT_COV",
    "GLOBAL_POSITION_INT",
    "HIGH_LATENCY2",
    "ADSB_VEHICLE",
)
"""The best first: of an aircraft that sends several, the first that comes is followed."""

HAS_POSITION, HAS_VELOCITY, HAS_ACCELERATION, HAS_ATTITUDE = 1, 2, 4, 8
"""Bits of FOLLOW_TARGET.est_capabilities; the fourth is attitude and rates."""

INTERVAL_S = 0.1
"""Interval of the messages."""


class LeaderReport(msgspec.Struct, frozen=True, kw_only=True):
    """What one message says of where an aircraft is and how it flies."""

    kind: Kind
    """Which message."""
    stamp_s: float | None
    """When it was true, s on a clock that the sender alone knows; None where it does not say."""
    latitude_deg: float
    """degrees, north positive."""
    longitude_deg: float
    """degrees, east positive."""
    altitude_amsl: float
    """m above mean sea level; NaN where it does not say."""
    velocity: Pair | None = None
    """Over ground (north, east), m/s; None where it does not say."""
    age_s: float = 0.0
    """How old it was when it was sent, as far as the message says, s."""
    climb_rate: float = 0.0
    """m/s, positive up; 0 where it does not say."""


def global_position(message: MAVLink_message) -> LeaderReport | None:
    """GLOBAL_POSITION_INT: ms, cm/s."""
    return report(
        "GLOBAL_POSITION_INT",
        message.time_boot_ms * 1e-3,
        message.lat,
        message.lon,
        message.alt * 1e-3,
        velocity=pair_of(message.vx * 1e-2, message.vy * 1e-2, greatest=GREATEST_M_S),
        needs_velocity=True,
        climb_rate=climb_of(message.vz * 1e-2),
    )


def global_position_cov(message: MAVLink_message) -> LeaderReport | None:
    """GLOBAL_POSITION_INT_COV: microseconds since boot or since 1970, whichever, and m/s."""
    return report(
        "GLOBAL_POSITION_INT_COV",
        message.time_usec * 1e-6,
        message.lat,
        message.lon,
        message.alt * 1e-3,
        velocity=pair_of(message.vx, message.vy, greatest=GREATEST_M_S),
        needs_velocity=True,
        climb_rate=climb_of(message.vz),
    )


def follow_target(message: MAVLink_message) -> LeaderReport | None:
    """FOLLOW_TARGET: ms since boot; velocity (north, east, down) where its bits say so.

    Its acceleration is not used: what senders put there is late, or that of the air, or 0; followers find the
    rates by themselves.
    """
    bits = message.est_capabilities
    if not bits & HAS_POSITION:
        return None
    velocity = pair_of(message.vel[0], message.vel[1], greatest=GREATEST_M_S)
    moves = bool(bits & HAS_VELOCITY)
    return report(
        "FOLLOW_TARGET",
        message.timestamp * 1e-3,
        message.lat,
        message.lon,
        message.alt,
        velocity=velocity if moves else None,
        needs_velocity=moves,
        climb_rate=climb_of(message.vel[2]) if moves else 0.0,
    )


def high_latency(message: MAVLink_message) -> LeaderReport | None:
    """HIGH_LATENCY2: its speed is in 0.2 m/s and its heading, in 2°, that of the nose; neither is used."""
    if message.failure_flags & mavlink.HL_FAILURE_FLAG_GPS:
        return None
    return report(
        "HIGH_LATENCY2",
        message.timestamp * 1e-3,
        message.latitude,
        message.longitude,
        float(message.altitude),
    )


def adsb_vehicle(message: MAVLink_message) -> LeaderReport | None:
    """ADSB_VEHICLE."""
    found = traffic_report(message)
    if found is None:
        return None
    return LeaderReport(
        kind="ADSB_VEHICLE",
        stamp_s=None,
        latitude_deg=found.latitude_deg,
        longitude_deg=found.longitude_deg,
        # Followers hold heights by it: a pressure altitude is too rough for that.
        altitude_amsl=found.altitude_amsl if found.altitude_error == 0.0 else math.nan,
        velocity=found.velocity,
        age_s=found.age_s,
        climb_rate=found.climb_rate,
    )


def report(
    kind: Kind,
    stamp_s: float | None,
    latitude: int,
    longitude: int,
    altitude: float,
    *,
    velocity: Pair | None = None,
    needs_velocity: bool = False,
    climb_rate: float = 0.0,
) -> LeaderReport | None:
    """The report that fields amount to; None where there is no place on earth, or no velocity.

    Autopilots without a fix report 0, 0: nobody flies there.
    """
    latitude_deg, longitude_deg = latitude * 1e-7, longitude * 1e-7
    if not is_on_earth(latitude, longitude):
        return None
    if needs_velocity and velocity is None:
        return None
    return LeaderReport(
        kind=kind,
        stamp_s=stamp_s,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_amsl=altitude_of(altitude),
        velocity=velocity,
        climb_rate=climb_rate,
    )


Reader = Callable[[MAVLink_message], LeaderReport | TimeReport | None]

READERS: dict[int, Reader] = {
    mavlink.MAVLINK_MSG_ID_FOLLOW_TARGET: follow_target,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT_COV: global_position_cov,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position,
    mavlink.MAVLINK_MSG_ID_HIGH_LATENCY2: high_latency,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: time_report,
}
"""What is read of the aircraft itself."""

ADSB_READERS: dict[int, Reader] = {mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: adsb_vehicle}
"""What is read of one that only an ADS-B receiver hears."""


class LeaderCodec:
    """Datagrams of a connection on which an aircraft is heard, to its reports."""

    def __init__(self, *, system_id: int | None = None, icao_address: int | None = None) -> None:
        """Listen for one aircraft.

        Args:
            system_id: of the aircraft, by its own messages; whichever of its components sends them.
            icao_address: of the aircraft instead, by what an ADS-B receiver hears; whichever system passes
                it on.
        """
        self.counters: Counter[str] = Counter()
        """What was received and passed over, by reason."""
        self.others: Counter[int] = Counter()
        """Reports of other systems, by their ids."""
        self._system_id = system_id
        self._icao_address = icao_address
        self._readers = READERS if icao_address is None else ADSB_READERS

    def decode(self, datagram: bytes) -> list[LeaderReport | TimeReport]:
        """Reports in one datagram; whatever the bytes are, this does not raise."""
        found: list[LeaderReport | TimeReport] = []
        for frame in frames_of(datagram):
            if frame is None:
                self.counters["not MAVLink"] += 1
            elif (reader := self._readers.get(frame.message_id)) is None:
                self.counters["not used"] += 1
            elif self._system_id is not None and frame.system_id != self._system_id:
                self.counters["of another system"] += 1
                self.others[frame.system_id] += 1
            elif (message := message_in(frame)) is None:
                self.counters["not MAVLink"] += 1
            elif self._icao_address is not None and message.ICAO_address != self._icao_address:
                self.counters["of another aircraft"] += 1
            elif (one := reader(message)) is None:
                self.counters["out of range"] += 1
            else:
                found.append(one)
        return found


def follow_target_message(
    motion: LeaderState,
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
