"""Leader states, and questions for the time of another clock, as bytes and back.

Leader states are compact, versioned and checked. Layout, little-endian: "VFLS", version (u8), flags (u8),
course setpoint (u16), sequence number (u32), then as f64 the time of validity (s), latitude and longitude
(degrees), altitude above mean sea level (m), course (rad), ground speed (m/s), acceleration (m/s²), turn
rate (rad/s), turn acceleration (rad/s²) and climb rate (m/s), then the term and the arrangement (u32
each), and the CRC-32 of all that (u32). 104 bytes at least. Position is geodetic, so that no two vehicles
have to agree on an origin.

A follower's state also tells where its leader was by the newest leader state that it has heard. Before the
CRC-32 stand four i16: how much older that state is (ms), and how far north, east and up of the sender the
leader was (0.1 m). Whoever knows its altitude by satellites tells in another i16 by how much that is above
the altitude that it holds (cm). A flag says of each whether it is there.

The course setpoint counts from 1 in steps of 2 pi / 65535; 0, which older senders write there, tells none.

The lowest flag says that the sender is not under guidance. Senders that know no flags write 0 there, and
receivers that know none skip it: both directions take such a sender for one that its companion steers.
The next flag says that the state is not the sender's own, but that of the leader it leads the formation by.

Questions for the time and their answers: layout, little-endian: "VFCA" (ask) or "VFCT" (tell), version
(u8), three bytes of zero, number of the exchange (u64), then as f64 when the question left (s, clock of
who asks), in an answer also when it arrived and when the answer left (s, clock of who answers), then the
CRC-32 of all that (u32). 28 and 44 bytes.

The number is random: an answer with it shows that the question was heard.
"""

import math
import struct
import zlib
from typing import NamedTuple

import msgspec

MAGIC = b"VFLS"
VERSION = 2
LAYOUT = struct.Struct("<4sBBHI10dII")
CHECKSUM = struct.Struct("<I")
NOT_STEERED = 0x01
"""Flag: a pilot or the autopilot itself flies the sender."""

LEADS = 0x02
"""Flag: the state is that of the leader by which the sender leads, in a term above 0."""

TELLS_LEADER = 0x04
"""Flag: the state tells where the sender's leader was."""

TELLS_SATELLITE = 0x08
"""Flag: the state tells the sender's altitude by satellites."""

COURSES = 65535
"""Course setpoints that are told apart, 0.1 mrad each."""

FLAGS_AT = 5
SIZE = LAYOUT.size + CHECKSUM.size

TAIL = (
    (TELLS_LEADER, struct.Struct("<4h"), (1e-3, 0.1, 0.1, 0.1)),
    (TELLS_SATELLITE, struct.Struct("<h"), (0.01,)),
)
"""Flag, layout and units (s, m) of what not every state tells."""

LONGEST = SIZE + sum(layout.size for _, layout, _ in TAIL)

GREATEST_STEPS = 32767
"""Of each: half a minute, 3 km, and 327 m."""

GREATEST = (math.inf, 90.0, 180.0, 50e3, 10.0, 500.0, 100.0, 10.0, 100.0, 200.0)
"""Greatest magnitude of each value: beyond them it is no aircraft's state."""

CLOCK_VERSION = 2

ASK, TELL = b"VFCA", b"VFCT"

ASK_LAYOUT = struct.Struct("<4sB3xQd")

TELL_LAYOUT = struct.Struct("<4sB3xQ3d")

GREATEST_TIME_S = 1e10
"""Three hundred years: beyond that it is no clock's, and differences lose their microseconds."""


class LinkDataError(ValueError):
    """Bytes from the link that are no leader state; the text says why."""


class LeaderSighting(NamedTuple):
    """Where a follower's leader was, by the newest leader state that the follower has heard."""

    age_s: float
    """How much older that state is than the follower's own, s; below 0 where it is newer."""
    north: float
    """From the follower, m."""
    east: float
    """From the follower, m."""
    up: float
    """From the follower, m."""


class LeaderMessage(msgspec.Struct, frozen=True, kw_only=True):
    """A leader state as it crosses the link."""

    sequence: int
    """Counts up by one with each message of a leader, modulo 2^32."""
    time_s: float
    """When it was true, on the clock that the formation shares, s."""
    latitude_deg: float
    """degrees."""
    longitude_deg: float
    """degrees."""
    altitude_amsl: float
    """m above mean sea level."""
    course: float
    """chi_l, rad."""
    ground_speed: float
    """V_l, m/s."""
    acceleration: float
    """dV_l/dt, m/s²."""
    turn_rate: float
    """omega, rad/s."""
    turn_acceleration: float
    """domega/dt, rad/s²."""
    climb_rate: float = 0.0
    """m/s, positive up."""
    term: int = 0
    """Term of the leader that the sender obeys, or is: it rises by one with each succession."""
    arrangement: int = 0
    """Number of the newest order that the sender flies by or is about to; 0 before the first."""
    steered: bool = True
    """Whether the sender's companion steers it, and with that keeps it clear of the others."""
    course_setpoint: float = math.nan
    """Course that the sender's autopilot was told to hold, rad in 0 to 2 pi: without its companion it flies
    on along it. NaN where its companion does not steer it, or did not tell."""
    leads: bool = False
    """Whether this is the leader by which the sender leads, and not the sender itself."""
    satellite_m: float = math.nan
    """By how much its altitude by satellites is above `altitude_amsl`, m; NaN where it does not tell."""
    sighting: LeaderSighting | None = None
    """Where the sender's leader was; None where it follows none, or one that is too far away to be told."""


def encode(message: LeaderMessage) -> bytes:
    """Bytes of a leader state."""
    tail_flags, tail = encoded_tail(message)
    body = LAYOUT.pack(
        MAGIC,
        VERSION,
        (NOT_STEERED * (not message.steered)) | (LEADS * message.leads) | tail_flags,
        course_in_steps(message.course_setpoint),
        message.sequence,
        message.time_s,
        message.latitude_deg,
        message.longitude_deg,
        message.altitude_amsl,
        message.course,
        message.ground_speed,
        message.acceleration,
        message.turn_rate,
        message.turn_acceleration,
        message.climb_rate,
        message.term,
        message.arrangement,
    )
    return _sealed(body + tail)


def encoded_tail(message: LeaderMessage) -> tuple[int, bytes]:
    """(flags, bytes) of what not every state tells; what is not known or out of range is not told."""
    flags, tail = 0, b""
    told = (message.sighting or (math.nan,) * 4, (message.satellite_m,))
    for (flag, layout, units), values in zip(TAIL, told, strict=True):
        steps = [value / unit for value, unit in zip(values, units, strict=True)]
        # Not "above": NaN is not told, either.
        if all(abs(step) <= GREATEST_STEPS for step in steps):
            flags, tail = flags | flag, tail + layout.pack(*map(round, steps))
    return flags, tail


def decoded_tail(tail: bytes, flags: int) -> list[tuple[float, ...] | None]:
    """What not every state tells, one entry for each that can be; None where it is not there.

    Raises:
        LinkDataError: the flags do not fit the bytes.
    """
    found: list[tuple[float, ...] | None] = []
    for flag, layout, units in TAIL:
        if not flags & flag:
            found.append(None)
            continue
        if len(tail) < layout.size:
            raise LinkDataError("shorter than its flags say")
        steps, tail = layout.unpack_from(tail), tail[layout.size :]
        found.append(tuple(step * unit for step, unit in zip(steps, units, strict=True)))
    if tail:
        raise LinkDataError("longer than its flags say")
    return found


def decode(data: bytes) -> LeaderMessage:
    """Leader state of these bytes.

    Raises:
        LinkDataError: wrong size, mark, version or checksum, or a value that no aircraft has.
    """
    if not SIZE <= len(data) <= LONGEST:
        raise LinkDataError(f"{len(data)} bytes where a leader state has {SIZE} to {LONGEST}")
    magic, version, flags, setpoint, sequence, *values, term, arrangement = LAYOUT.unpack_from(data)
    if magic != MAGIC:
        raise LinkDataError("not a leader state")
    if version != VERSION:
        raise LinkDataError(f"version {version} where this companion speaks {VERSION}")
    if zlib.crc32(data[: -CHECKSUM.size]) != CHECKSUM.unpack(data[-CHECKSUM.size :])[0]:
        raise LinkDataError("damaged: the checksum does not match")
    sighting, satellite = decoded_tail(data[LAYOUT.size : -CHECKSUM.size], flags)
    # Not "above": a comparison with NaN is false whichever way it is put.
    sound = all(abs(value) <= greatest for value, greatest in zip(values, GREATEST, strict=True))
    if not sound or not math.isfinite(values[0]):
        raise LinkDataError("a value is out of range")
    time_s, latitude, longitude, altitude, course, ground_speed, *rates = values
    acceleration, turn_rate, turn_acceleration, climb_rate = rates
    return LeaderMessage(
        sequence=sequence,
        time_s=time_s,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl=altitude,
        course=course,
        ground_speed=ground_speed,
        acceleration=acceleration,
        turn_rate=turn_rate,
        turn_acceleration=turn_acceleration,
        climb_rate=climb_rate,
        term=term,
        arrangement=arrangement,
        steered=not flags & NOT_STEERED,
        course_setpoint=(setpoint - 1) * math.tau / COURSES if setpoint else math.nan,
        leads=bool(flags & LEADS),
        sighting=None if sighting is None else LeaderSighting(*sighting),
        satellite_m=math.nan if satellite is None else satellite[0],
    )


def course_in_steps(course: float) -> int:
    """A course setpoint (rad, any turn) as it crosses the link; 0 for one that is not known."""
    return 1 + round(course / math.tau * COURSES) % COURSES if math.isfinite(course) else 0


def is_leaders(data: bytes) -> bool:
    """Whether these bytes say of themselves that they are the state by which their sender leads."""
    return len(data) >= SIZE and data.startswith(MAGIC) and bool(data[FLAGS_AT] & LEADS)


class Ask(msgspec.Struct, frozen=True, kw_only=True):
    """What does your clock show?"""

    number: int
    """Number of the exchange: 64 random bits."""
    originate_s: float
    """When the question left, s on the clock of who asks."""


class Tell(msgspec.Struct, frozen=True, kw_only=True):
    """What the clock shows."""

    number: int
    """Number of the exchange, as in the question."""
    originate_s: float
    """When the question left, as it was asked, s."""
    receive_s: float
    """When the question arrived, s on the clock of who answers."""
    transmit_s: float
    """When the answer left, s on the clock of who answers."""


def encode_ask(ask: Ask) -> bytes:
    """Bytes of a question."""
    return _sealed(ASK_LAYOUT.pack(ASK, CLOCK_VERSION, ask.number, ask.originate_s))


def encode_tell(tell: Tell) -> bytes:
    """Bytes of an answer."""
    stamps = (tell.originate_s, tell.receive_s, tell.transmit_s)
    return _sealed(TELL_LAYOUT.pack(TELL, CLOCK_VERSION, tell.number, *stamps))


def decode_ask(data: bytes) -> Ask:
    """Question of these bytes.

    Raises:
        LinkDataError: they are none.
    """
    number, (originate_s,) = _opened(data, ASK, ASK_LAYOUT)
    return Ask(number=number, originate_s=originate_s)


def decode_tell(data: bytes) -> Tell:
    """Answer of these bytes.

    Raises:
        LinkDataError: they are none.
    """
    number, (originate_s, receive_s, transmit_s) = _opened(data, TELL, TELL_LAYOUT)
    return Tell(number=number, originate_s=originate_s, receive_s=receive_s, transmit_s=transmit_s)


def _sealed(body: bytes) -> bytes:
    return body + CHECKSUM.pack(zlib.crc32(body))


def _opened(data: bytes, mark: bytes, layout: struct.Struct) -> tuple[int, list[float]]:
    """Number of the exchange and stamps, all finite."""
    size = layout.size + CHECKSUM.size
    if len(data) != size:
        raise LinkDataError(f"{len(data)} bytes where {size} are due")
    found, version, number, *stamps = layout.unpack_from(data)
    if found != mark:
        raise LinkDataError("not about clocks")
    if version != CLOCK_VERSION:
        raise LinkDataError(f"version {version} where this companion speaks {CLOCK_VERSION}")
    if zlib.crc32(data[: layout.size]) != CHECKSUM.unpack_from(data, layout.size)[0]:
        raise LinkDataError("damaged: the checksum does not match")
    # Not "above": a comparison with NaN is false whichever way it is put.
    if not all(abs(stamp) <= GREATEST_TIME_S for stamp in stamps):
        raise LinkDataError("a time is out of range")
    return number, stamps
