"""What crosses the link as bytes and back: leader states, questions for the time, and the envelope of it all.

Everything but envelopes begins with a mark of four letters and a version, and ends with its CRC-32.

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
Two flags say which way the sender leaves its height: up or down; receivers that do not know them skip them.

Questions for the time and their answers: layout, little-endian: "VFCA" (ask) or "VFCT" (tell), version
(u8), three bytes of zero, number of the exchange (u64), then as f64 when the question left (s, clock of
who asks), in an answer also when it arrived and when the answer left (s, clock of who answers), then the
CRC-32 of all that (u32). 28 and 44 bytes.

The number is random: an answer with it shows that the question was heard.

Every message of a formation goes in an envelope: who says what, in which run, under which leader.
Layout, little-endian: "VFE1", scheme (u8), kind (u8), length of the sender's name (u8), a byte of zero,
formation (u64: the first bytes of the SHA-256 of its name), session (u64), epoch (u64), sequence (u32), time
(f64, s), the sender's name (UTF-8), the body, and the tag over all that: 64 bytes of Ed25519, or the CRC-32
(u32) of a message that nobody has signed. 44 bytes and the name before a body.
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
"""Flag: the state tells where the sender's leader was."""

TELLS_SATELLITE = 0x08
"""Flag: the state tells the sender's altitude by satellites."""

CLIMBS, DESCENDS = 0x10, 0x20
"""Flags: the sender is on its way up or down to a height of its own."""

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
    """A leader state as it crosses the link; the first fields stand in the order of the layout."""

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
    height_sense: int = 0
    """1: the sender is on its way up to a height of its own, -1: on its way down, 0: neither."""
    leads: bool = False
    """Whether this is the leader by which the sender leads, and not the sender itself."""
    satellite_m: float = math.nan
    """By how much its altitude by satellites is above `altitude_amsl`, m; NaN where it does not tell."""
    sighting: LeaderSighting | None = None
    """Where the sender's leader was; None where it follows none, or one that is too far away to be told."""


LAID_OUT = LeaderMessage.__struct_fields__[:13]
"""Fields of a leader state from the sequence number to the arrangement."""


def encode(message: LeaderMessage) -> bytes:
    """Bytes of a leader state."""
    tail_flags, tail = encoded_tail(message)
    flags = NOT_STEERED * (not message.steered) | LEADS * message.leads | tail_flags
    flags |= CLIMBS * (message.height_sense > 0) | DESCENDS * (message.height_sense < 0)
    setpoint, values = course_in_steps(message.course_setpoint), astuple(message)[: len(LAID_OUT)]
    return sealed(LAYOUT.pack(MAGIC, VERSION, flags, setpoint, *values) + tail)


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
    """A course setpoint (rad, any turn) as it crosses the link; 0 for one that is not known."""
    return 1 + round(course / math.tau * COURSES) % COURSES if math.isfinite(course) else 0


def is_leaders(data: bytes) -> bool:
    """Whether these bytes say of themselves that they are the state by which their sender leads."""
    return len(data) >= SIZE and data.startswith(MAGIC) and bool(data[FLAGS_AT] & LEADS)


class Ask(msgspec.Struct, frozen=True):
    """What does your clock show?"""

    number: int
    """Number of the exchange: 64 random bits."""
    originate_s: float
    """When the question left, s on the clock of who asks."""


class Tell(msgspec.Struct, frozen=True):
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
    return sealed(ASK_LAYOUT.pack(ASK, CLOCK_VERSION, *astuple(ask)))


def encode_tell(tell: Tell) -> bytes:
    """Bytes of an answer."""
    return sealed(TELL_LAYOUT.pack(TELL, CLOCK_VERSION, *astuple(tell)))


def decode_ask(data: bytes) -> Ask:
    """Question of these bytes.

    Raises:
        LinkDataError: they are none.
    """
    return Ask(*_about_clocks(data, ASK, ASK_LAYOUT))


def decode_tell(data: bytes) -> Tell:
    """Answer of these bytes.

    Raises:
        LinkDataError: they are none.
    """
    return Tell(*_about_clocks(data, TELL, TELL_LAYOUT))


def _about_clocks(data: bytes, mark: bytes, layout: struct.Struct) -> list[Any]:
    """Number of the exchange and stamps, all finite."""
    size = layout.size + CHECKSUM.size
    body = opened(data, mark, CLOCK_VERSION, what="a message about clocks", least=size, most=size)
    _, _, *values = layout.unpack(body)
    if not within(values[1:], [GREATEST_TIME_S] * (len(values) - 1)):
        raise LinkDataError("a time is out of range")
    return values


def sealed(body: bytes) -> bytes:
    """A body with its checksum."""
    return body + checksum(body)


def checksum(signed: bytes) -> bytes:
    """The checksum of some bytes: the tag of a message that nobody signs."""
    return CHECKSUM.pack(zlib.crc32(signed))


def opened(data: bytes, mark: bytes, version: int, *, what: str, least: int, most: int) -> bytes:
    """All but the checksum of what is read.

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
    """Whether no magnitude is greater than it may be; NaN is."""
    # Not "above": a comparison with NaN is false whichever way it is put.
    return all(abs(value) <= most for value, most in zip(values, greatest, strict=True))


ENVELOPE_MAGIC = b"VFE1"
ENVELOPE = struct.Struct("<4sBBBxQQQId")
SIGNATURE_SIZE = 64

LARGEST = 4096
"""Bytes of a whole message: nothing that a formation shares is longer."""

LONGEST_NAME = 200
"""Bytes of a name."""


class Scheme(IntEnum):
    """What vouches for a message."""

    UNSIGNED = 0
    """A checksum: nobody."""
    ED25519 = 1
    """The sender's private key."""


class Kind(IntEnum):
    """What a message is about."""

    STATE = 1
    """How the sender moves."""
    QUESTION = 2
    """What does your clock show?"""
    ANSWER = 3
    """What the leader's clock shows."""
    PRESENCE = 4
    """How the sender's companion is."""
    WILL = 5
    """That the sender is gone, to be said by a broker that has lost it."""
    ORDER = 6
    """What an operator wants."""
    LEADER = 7
    """How the leader moves by which the sender leads, in the place of the mission's."""
    REPLY = 8
    """What a vehicle says to an order, or an operator who asks for the one that is flown."""
    REPEAT = 9
    """An operator's order in its own envelope, for members that have missed it."""
    REVOCATION = 10
    """That a vehicle's key is out: by an operator, and passed on by all as it was signed."""


TAG_SIZES = {Scheme.UNSIGNED: CHECKSUM.size, Scheme.ED25519: SIGNATURE_SIZE}


class Envelope(msgspec.Struct, frozen=True, kw_only=True):
    """A message as it was read; nothing of it is believed yet."""

    scheme: Scheme
    """What is to vouch for it."""
    kind: Kind
    """What it is about."""
    formation: int
    """Number of the formation, by `formation_number`."""
    sender: str
    """Name of who says it."""
    session: int
    """Number of the sender's session: one run of its program."""
    epoch: int
    """The leader's session as the sender knows it; 0 while it knows none."""
    sequence: int
    """Rises with each message of a session, from 1."""
    time_s: float
    """When it was said, s on the formation's clock; NaN while the sender does not know that."""
    body: bytes
    """What is said."""
    signed: bytes
    """All that the tag is about."""
    tag: bytes
    """What vouches for it."""


def formation_number(name: str) -> int:
    """A formation's name as a number, which differs from that of any other name."""
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
    """All of a message that its tag is about.

    Raises:
        ValueError: the name or the whole is too long.
    """
    name = sender.encode()
    size = ENVELOPE.size + len(name) + len(body) + TAG_SIZES[scheme]
    if not 0 < len(name) <= LONGEST_NAME or size > LARGEST:
        raise ValueError(f"a name of {len(name)} bytes or a message of {size} is too long")
    header = ENVELOPE.pack(
        ENVELOPE_MAGIC, scheme, kind, len(name), formation, session, epoch, sequence, time_s
    )
    return header + name + body


def decode_envelope(data: bytes) -> Envelope:
    """The envelope of these bytes; its tag is not looked at.

    Raises:
        LinkDataError: they are none.
    """
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
