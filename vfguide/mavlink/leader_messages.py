"""Motion of a leader in MAVLink: messages of an aircraft without a companion, and FOLLOW_TARGET.

Such an aircraft is heard by four MAVLink messages and ADS-B, decoded to SI units here; other modules choose
which one is followed. Every number is checked against the range of its field, but a well-formed message need
not be true.

FOLLOW_TARGET is also sent, for followers without a companion, such as ArduPlane's and PX4's own. By their
sources, ArduPilot (AP_Follow) needs the position bit. It takes velocity, acceleration, and attitude with
rates where their bits are set. It turns offsets with the yaw, refuses relative ones without attitude, and
uses only differences of the time stamp. From the first message on it ignores the sender's
GLOBAL_POSITION_INT. PX4 takes position and velocity, and stamps them on arrival. Neither reads `position_cov`
and `custom_state`: both are 0 here, as of a sender that does not tell.
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
"""Kinds of messages, the best first: the first kind that an aircraft sends is followed."""

HAS_POSITION, HAS_VELOCITY, HAS_ACCELERATION, HAS_ATTITUDE = 1, 2, 4, 8
"""Bits of FOLLOW_TARGET.est_capabilities; the fourth is attitude and rates."""

INTERVAL_S = 0.1
"""Interval of FOLLOW_TARGET messages, s."""


class LeaderReport(msgspec.Struct, frozen=True, kw_only=True):
    """Position and motion of an aircraft by one message."""

    kind: Kind
    """Kind of the message."""
    stamp_s: float | None
    """Time of validity, s on a clock known only to the sender; None if not sent."""
    latitude_deg: float
    """Latitude, degrees, north positive."""
    longitude_deg: float
    """Longitude, degrees, east positive."""
    altitude_amsl: float
    """Altitude, m above mean sea level; NaN if not sent."""
    velocity: Pair | None = None
    """Velocity over ground (north, east), m/s; None if not sent."""
    age_s: float = 0.0
    """Age when it was sent, as far as the message tells, s."""
    climb_rate: float = 0.0
    """Climb rate, m/s, positive up; 0 if not sent."""


def global_position(message: MAVLink_message) -> LeaderReport | None:
    """Decode GLOBAL_POSITION_INT: ms, cm/s."""
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
    """Decode GLOBAL_POSITION_INT_COV: microseconds since boot or 1970, whichever, and m/s."""
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
    """Decode FOLLOW_TARGET: ms since boot, and velocity (north, east, down) if its bits say so.

    Senders' accelerations are late, those of the air, or 0: followers find the rates by themselves.
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
    """Decode HIGH_LATENCY2 without its speed (0.2 m/s) and its heading (2°), which is the nose's."""
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
    """Decode ADSB_VEHICLE."""
    found = traffic_report(message)
    if found is None:
        return None
    return LeaderReport(
        kind="ADSB_VEHICLE",
        stamp_s=None,
        latitude_deg=found.latitude_deg,
        longitude_deg=found.longitude_deg,
        # Followers hold altitudes by it: a pressure altitude is too rough for that.
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
    """Make a report; None without a needed velocity or at 0, 0, which autopilots without a fix report."""
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
"""Decoders of the aircraft's own messages."""

ADSB_READERS: dict[int, Reader] = {mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: adsb_vehicle}
"""Decoder of an aircraft that only an ADS-B receiver hears."""


class LeaderCodec:
    """Decoder of datagrams about one aircraft."""

    def __init__(self, *, system_id: int | None = None, icao_address: int | None = None) -> None:
        """Listen for one aircraft.

        Args:
            system_id: MAVLink system of the aircraft; any of its components may send.
            icao_address: ICAO address instead, for an aircraft heard by ADS-B; any system may relay it.
        """
        self.counters: Counter[str] = Counter()
        """Numbers of frames that were received and ignored, by reason."""
        self.others: Counter[int] = Counter()
        """Numbers of reports of other systems, by system."""
        self._system_id = system_id
        self._icao_address = icao_address
        self._readers = READERS if icao_address is None else ADSB_READERS

    def decode(self, datagram: bytes) -> list[LeaderReport | TimeReport]:
        """Return the reports in a datagram; never raises, whatever the bytes are."""
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
    """Return the FOLLOW_TARGET message of a motion, whose time is s on the sender's clock.

    Velocity and acceleration are those over ground: (V cos chi, V sin chi) and its derivative. The attitude
    has no roll and pitch and turns with the course: its yaw rate is the turn rate. `heading` is the nose's,
    rad.
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
