"""Binary codecs of the link: leader states, clock questions and answers, and the envelope around all of them.

Everything but the envelope begins with a mark of four letters and a version (u8), and ends with a CRC-32
(u32) of all before it. All integers and floats are little-endian.

A leader state ("VFLS") continues with flags (u8), course setpoint (u16) and sequence number (u32). As f64
follow time of validity (s), latitude, longitude (degrees), altitude above mean sea level (m), course (rad),
ground speed (m/s), acceleration (m/s²), turn rate (rad/s), turn acceleration (rad/s²) and climb rate (m/s).
Then come term and arrangement (u32 each). The minimum size is 104 bytes. Position is geodetic, so that no two
vehicles have to agree on an origin.

Two optional parts, each with a flag, stand before the CRC-32. A follower tells where its leader was by the
newest leader state heard, in four i16. They are how much older that state is (ms), and how far north, east
and up of the sender the leader was (0.1 m). A sender that knows its altitude by satellites tells in one i16
(cm) how much that is above the altitude it holds.

The course setpoint counts from 1 in steps of 2 pi / 65535; 0, which older senders write there, means none.

The lowest flag says that the sender is not under guidance. Senders that know no flags write 0 there, and
receivers that know none skip it: both take such a sender as steered by its companion. The next flag says that
the state is that of the leader by which the sender leads the formation, not its own. Two flags say which way
the sender leaves its height: up or down; receivers that do not know them skip them.

A clock question ("VFCA") or answer ("VFCT") continues with three bytes of zero and the number of the exchange
(u64). As f64 follows when the question left (s, asker's clock). An answer adds when the question arrived and
when the answer left (s, answerer's clock). The sizes are 28 and 44 bytes. The number is random: an answer
with it shows that the question was heard.

The envelope of every message tells who says what, in which run, under which leader. It begins with "VFE1",
scheme (u8), kind (u8), length of the sender's name (u8) and a byte of zero. Then come formation (u64: the
first bytes of the SHA-256 of its name), session (u64), epoch (u64), sequence (u32) and time (f64, s). After
these 44 bytes follow the sender's name (UTF-8), the body and the tag over all that. The tag is 64 bytes of
Ed25519, or the CRC-32 (u32) of an unsigned message.
"""

import hashlib
import math
import struct
import zlib
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import astuple

MAGIC = b"VFLS"
VERSION = 2
LAYOUT = struct.Struct("<4sBBHI10dII")
CHECKSUM = struct.Struct("<I")
NOT_STEERED = 0x01
"""Flag: a pilot or the autopilot itself flies the sender."""

LEADS = 0x02
"""Flag: the state is that of the leader by which the sender leads, in a term above 0."""

TELLS_LEADER = 0x04
"""Flag: the state has a `LeaderSighting`."""

TELLS_SATELLITE = 0x08
"""Flag: the state has the sender's altitude by satellites."""

CLIMBS, DESCENDS = 0x10, 0x20
"""Flags: the sender is climbing or descending to a height of its own."""

COURSES = 65535
"""Number of course setpoint steps in a turn, 0.1 mrad each."""

FLAGS_AT = 5
SIZE = LAYOUT.size + CHECKSUM.size

TAIL = (
    (TELLS_LEADER, struct.Struct("<4h"), (1e-3, 0.1, 0.1, 0.1)),
    (TELLS_SATELLITE, struct.Struct("<h"), (0.01,)),
)
"""Flag, layout and units (s, m) of each optional part of a state."""

LONGEST = SIZE + sum(layout.size for _, layout, _ in TAIL)

GREATEST_STEPS = 32767
"""Greatest magnitude of each optional value, in steps: half a minute, 3 km and 327 m."""

GREATEST = (math.inf, 90.0, 180.0, 50e3, 10.0, 500.0, 100.0, 10.0, 100.0, 200.0)
"""Greatest magnitude of each value from the time to the climb rate: no aircraft's state is beyond."""

CLOCK_VERSION = 2

ASK, TELL = b"VFCA", b"VFCT"

ASK_LAYOUT = struct.Struct("<4sB3xQd")

TELL_LAYOUT = struct.Struct("<4sB3xQ3d")

GREATEST_TIME_S = 1e10
"""Greatest magnitude of a time, s: three hundred years, beyond which differences lose their microseconds."""


class LinkDataError(ValueError):
    """Error: bytes from the link that cannot be decoded; the text says why."""


class LeaderSighting(NamedTuple):
    """Position of a follower's leader by the newest leader state that the follower has heard."""

    age_s: float
    """Age of that leader state relative to the follower's own, s; negative where it is newer."""
    north: float
    """North of the follower, m."""
    east: float
    """East of the follower, m."""
    up: float
    """Above the follower, m."""


class LeaderMessage(msgspec.Struct, frozen=True, kw_only=True):
    """Leader state as sent over the link; its first fields are in the order of the layout."""

    sequence: int
    """Sequence number, incremented with each message of a leader, modulo 2^32."""
    time_s: float
    """Time of validity on the clock that the formation shares, s."""
    latitude_deg: float
    """Latitude, degrees."""
    longitude_deg: float
    """Longitude, degrees."""
    altitude_amsl: float
    """Altitude, m above mean sea level."""
    course: float
    """Course chi_l, rad."""
    ground_speed: float
    """Ground speed V_l, m/s."""
    acceleration: float
    """Acceleration dV_l/dt, m/s²."""
    turn_rate: float
    """Turn rate omega, rad/s."""
    turn_acceleration: float
    """Turn acceleration domega/dt, rad/s²."""
    climb_rate: float = 0.0
    """Climb rate, m/s, positive up."""
    term: int = 0
    """Term of the leader that the sender obeys or is; it rises by one with each succession."""
    arrangement: int = 0
    """Number of the newest order that the sender flies by or is about to; 0 before the first."""
    steered: bool = True
    """Whether the sender's companion steers it, and thereby keeps it clear of the others."""
    course_setpoint: float = math.nan
    """Course that the sender's autopilot was told to hold and keeps without its companion, rad in 0 to 2 pi.
    NaN where the companion does not steer or did not tell."""
    height_sense: int = 0
    """Way to a height of its own: 1 climbing, -1 descending, 0 neither."""
    leads: bool = False
    """Whether this is the state of the leader by which the sender leads, not the sender's own."""
    satellite_m: float = math.nan
    """Altitude by satellites minus `altitude_amsl`, m; NaN where unknown."""
    sighting: LeaderSighting | None = None
    """Position of the sender's leader; None where it follows none, or one too far away to be told."""


LAID_OUT = LeaderMessage.__struct_fields__[:13]
"""Names of the fields from the sequence number to the arrangement."""


def encode(message: LeaderMessage) -> bytes:
    """Encode a leader state."""
    tail_flags, tail = encoded_tail(message)
    flags = NOT_STEERED * (not message.steered) | LEADS * message.leads | tail_flags
    flags |= CLIMBS * (message.height_sense > 0) | DESCENDS * (message.height_sense < 0)
    setpoint, values = course_in_steps(message.course_setpoint), astuple(message)[: len(LAID_OUT)]
    return sealed(LAYOUT.pack(MAGIC, VERSION, flags, setpoint, *values) + tail)


def encoded_tail(message: LeaderMessage) -> tuple[int, bytes]:
    """Return (flags, bytes) of the optional parts; unknown or out-of-range parts are left out."""
    flags, tail = 0, b""
    told = (message.sighting or (math.nan,) * 4, (message.satellite_m,))
    for (flag, layout, units), values in zip(TAIL, told, strict=True):
        steps = [value / unit for value, unit in zip(values, units, strict=True)]
        # Not written with "above", so that NaN is left out, too.
        if all(abs(step) <= GREATEST_STEPS for step in steps):
            flags, tail = flags | flag, tail + layout.pack(*map(round, steps))
    return flags, tail


def decoded_tail(tail: bytes, flags: int) -> list[tuple[float, ...] | None]:
    """Decode the optional parts, None for absent ones.

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
    """Decode a leader state.

    Raises:
        LinkDataError: wrong size, mark, version or checksum, or a value that no aircraft has.
    """
    body = opened(data, MAGIC, VERSION, what="a leader state", least=SIZE, most=LONGEST)
    _, _, flags, setpoint, *laid_out = LAYOUT.unpack_from(body)
    sighting, satellite = decoded_tail(body[LAYOUT.size :], flags)
    values = laid_out[1 : 1 + len(GREATEST)]
    if not (within(values, GREATEST) and math.isfinite(values[0])):
        raise LinkDataError("a value is out of range")
    return LeaderMessage(
        **dict(zip(LAID_OUT, laid_out, strict=True)),
        steered=not flags & NOT_STEERED,
        course_setpoint=(setpoint - 1) * math.tau / COURSES if setpoint else math.nan,
        height_sense=bool(flags & CLIMBS) - bool(flags & DESCENDS),
        leads=bool(flags & LEADS),
        sighting=None if sighting is None else LeaderSighting(*sighting),
        satellite_m=math.nan if satellite is None else satellite[0],
    )


def course_in_steps(course: float) -> int:
    """Return a course setpoint (rad, any turn) in steps counted from 1; 0 for an unknown one."""
    return 1 + round(course / math.tau * COURSES) % COURSES if math.isfinite(course) else 0


def is_leaders(data: bytes) -> bool:
    """Check whether undecoded bytes are flagged as the state by which their sender leads."""
    return len(data) >= SIZE and data.startswith(MAGIC) and bool(data[FLAGS_AT] & LEADS)


class Ask(msgspec.Struct, frozen=True):
    """Question for the time that a member's clock shows."""

    number: int
    """Random number of the exchange, 64 bits."""
    originate_s: float
    """Time at which the question left, s on the asker's clock."""


class Tell(msgspec.Struct, frozen=True):
    """Answer with the time that a member's clock shows."""

    number: int
    """Number of the exchange, as in the question."""
    originate_s: float
    """Time at which the question left, copied from it, s on the asker's clock."""
    receive_s: float
    """Time at which the question arrived, s on the answerer's clock."""
    transmit_s: float
    """Time at which the answer left, s on the answerer's clock."""


def encode_ask(ask: Ask) -> bytes:
    """Encode a question."""
    return sealed(ASK_LAYOUT.pack(ASK, CLOCK_VERSION, *astuple(ask)))


def encode_tell(tell: Tell) -> bytes:
    """Encode an answer."""
    return sealed(TELL_LAYOUT.pack(TELL, CLOCK_VERSION, *astuple(tell)))


def decode_ask(data: bytes) -> Ask:
    """Decode a question; raise LinkDataError if the bytes are none."""
    return Ask(*_about_clocks(data, ASK, ASK_LAYOUT))


def decode_tell(data: bytes) -> Tell:
    """Decode an answer; raise LinkDataError if the bytes are none."""
    return Tell(*_about_clocks(data, TELL, TELL_LAYOUT))


def _about_clocks(data: bytes, mark: bytes, layout: struct.Struct) -> list[Any]:
    size = layout.size + CHECKSUM.size
    body = opened(data, mark, CLOCK_VERSION, what="a message about clocks", least=size, most=size)
    _, _, *values = layout.unpack(body)
    if not within(values[1:], [GREATEST_TIME_S] * (len(values) - 1)):
        raise LinkDataError("a time is out of range")
    return values


def sealed(body: bytes) -> bytes:
    """Return a body with its checksum."""
    return body + checksum(body)


def checksum(signed: bytes) -> bytes:
    """Return the checksum of some bytes, which is the tag of an unsigned message."""
    return CHECKSUM.pack(zlib.crc32(signed))


def opened(data: bytes, mark: bytes, version: int, *, what: str, least: int, most: int) -> bytes:
    """Check bytes and return them without their checksum.

    Raises:
        LinkDataError: size, mark, version or checksum is wrong.
    """
    if not least <= len(data) <= most:
        raise LinkDataError(f"{len(data)} bytes where {what} has {least} to {most}")
    if data[:4] != mark:
        raise LinkDataError(f"not {what}")
    if data[4] != version:
        raise LinkDataError(f"version {data[4]} where this companion speaks {version}")
    body = data[: -CHECKSUM.size]
    if checksum(body) != data[-CHECKSUM.size :]:
        raise LinkDataError("damaged: the checksum does not match")
    return body


def within(values: Sequence[float], greatest: Sequence[float]) -> bool:
    """Check whether no magnitude exceeds its limit; NaN does."""
    # Not written with "above": a comparison with NaN is always false.
    return all(abs(value) <= most for value, most in zip(values, greatest, strict=True))


ENVELOPE_MAGIC = b"VFE1"
ENVELOPE = struct.Struct("<4sBBBxQQQId")
SIGNATURE_SIZE = 64

LARGEST = 4096
"""Maximum size of a whole message, bytes: nothing that a formation shares is longer."""

LONGEST_NAME = 200
"""Maximum length of a name, bytes."""


class Scheme(IntEnum):
    """Authentication of a message."""

    UNSIGNED = 0
    """Checksum only: nobody vouches for the message."""
    ED25519 = 1
    """Signature by the sender's private key."""


class Kind(IntEnum):
    """Content of a message."""

    STATE = 1
    """Motion of the sender."""
    QUESTION = 2
    """Question for the time that the recipient's clock shows."""
    ANSWER = 3
    """Answer with the time that the leader's clock shows."""
    PRESENCE = 4
    """Status of the sender's companion."""
    WILL = 5
    """Last will: a broker publishes it once it has lost the sender."""
    ORDER = 6
    """Order of an operator."""
    LEADER = 7
    """Motion of the leader by which the sender leads in place of the mission's leader."""
    REPLY = 8
    """Reply of a vehicle to an order, or of an operator who asks for the order that is flown."""
    REPEAT = 9
    """Operator's order in its own envelope, repeated for members that missed it."""
    REVOCATION = 10
    """Revocation of a vehicle's key by an operator, passed on by all members as signed."""


TAG_SIZES = {Scheme.UNSIGNED: CHECKSUM.size, Scheme.ED25519: SIGNATURE_SIZE}


class Envelope(msgspec.Struct, frozen=True, kw_only=True):
    """Decoded message that is not verified yet."""

    scheme: Scheme
    """Authentication that the message claims."""
    kind: Kind
    formation: int
    """Number of the formation by `formation_number`."""
    sender: str
    session: int
    """Number of the sender's session, which is one run of its program."""
    epoch: int
    """The leader's session as the sender knows it; 0 while it knows none."""
    sequence: int
    """Sequence number, rising from 1 with each message of a session."""
    time_s: float
    """Time of sending, s on the formation's clock; NaN while the sender does not know that."""
    body: bytes
    signed: bytes
    """All bytes that the tag covers."""
    tag: bytes
    """Signature or checksum."""


def formation_number(name: str) -> int:
    """Return a number that differs from that of any other formation name."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")


def encode_signed(
    scheme: Scheme,
    kind: Kind,
    *,
    formation: int,
    sender: str,
    session: int,
    epoch: int,
    sequence: int,
    time_s: float,
    body: bytes,
) -> bytes:
    """Encode all of a message that its tag covers; raise ValueError if the name or the whole is too long."""
    name = sender.encode()
    size = ENVELOPE.size + len(name) + len(body) + TAG_SIZES[scheme]
    if not 0 < len(name) <= LONGEST_NAME or size > LARGEST:
        raise ValueError(f"a name of {len(name)} bytes or a message of {size} is too long")
    header = ENVELOPE.pack(
        ENVELOPE_MAGIC, scheme, kind, len(name), formation, session, epoch, sequence, time_s
    )
    return header + name + body


def decode_envelope(data: bytes) -> Envelope:
    """Decode an envelope without checking its tag; raise LinkDataError if the bytes are none."""
    if not ENVELOPE.size < len(data) <= LARGEST:
        raise LinkDataError("its length is no message's")
    magic, scheme, kind, length, formation, session, epoch, sequence, time_s = ENVELOPE.unpack_from(
        data
    )
    if magic != ENVELOPE_MAGIC:
        raise LinkDataError("it is no message of a formation")
    try:
        scheme, kind = Scheme(scheme), Kind(kind)
        end = len(data) - TAG_SIZES[scheme]
        sender = data[ENVELOPE.size : ENVELOPE.size + length].decode()
    except ValueError:
        raise LinkDataError("its scheme, kind or sender is none") from None
    if not 0 < length <= LONGEST_NAME or ENVELOPE.size + length > end:
        raise LinkDataError("the sender's name has no place in it")
    if not (math.isnan(time_s) or abs(time_s) <= GREATEST_TIME_S):
        raise LinkDataError("its time is out of range")
    return Envelope(
        scheme=scheme,
        kind=kind,
        formation=formation,
        sender=sender,
        session=session,
        epoch=epoch,
        sequence=sequence,
        time_s=time_s,
        body=data[ENVELOPE.size + length : end],
        signed=data[:end],
        tag=data[end:],
    )
