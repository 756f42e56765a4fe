"""Packets of a formation on a shared radio: at most 51 bytes, each with a short tag.

Layout, little-endian: kind (u8, with the flags of a state), formation (u16: the first bytes of the SHA-256 of
its name), sender (u8: 0 the leader, 1 the first follower, 255 an operator), time (u48, 0.1 ms, on the
formation's clock), body, and tag (8 bytes of keyed BLAKE2b).

| body of | holds |
|---|---|
| a beat | beat (u8) of how many (u8), vehicles (u8), period (u16, ms); alone with 13 zeros, since a slot has to be longer the shorter its shortest packet is |
| a state | the leader's: a beat; latitude, longitude (i32, 1e-7 degrees), altitude (i24, cm), course (u16, 2 pi / 65536), speed (u16, cm/s), acceleration (i16, mm/s²), turn rate (i16, 1e-4 rad/s), its rate (i16, 1e-3 rad/s²), climb rate (i16, cm/s), term (u8), arrangement (u32) |
| a question | number (u64), and zeros: it is as long as an answer, and so takes as long |
| an answer | recipient (u8), number (u64), the leader's session (u64), when the question arrived (u48) |
| a presence | the leader's session (u64), flags (u8), mode (10 characters), version (8 characters) |
| a piece of an order, a reply, a repeated order or a revocation | mark (u16: the first bytes of the BLAKE2b of the whole), number of the piece (u8, from 0), bytes of the whole (u16), 28 bytes of it, zeros behind its end |

The tag covers the packet *and the session of the leader under which it is sent*: 64 random bits that the
packet does not carry. To believe a state a member must know that session from an answer to its own question.
A recorded packet of another session has another tag.

The tag's key is derived from the formation's radio key, its name and the names of its vehicles. A member that
disagrees about the formation therefore hears nothing of it. Questions and pieces of revocations are sent
under session 0, so that everybody can hear them.

This promises less than a signature: the holder of the radio key can speak as anybody, and one forgery in 2^64
is believed.
"""  # noqa: E501 - a table

import hashlib
import math
import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import msgspec
from msgspec.structs import replace

from vfguide.link.codec import LeaderMessage, LinkDataError
from vfguide.link.presence import LINKS_LOST, REVOKED_KEY, Presence
from vfguide.link.radio_schedule import LEADER, Timetable

TAG_SIZE = 8
KEY_SIZE = 32
"""Sizes of a tag and of its key, bytes."""

TICK_S = 1e-4
"""Unit of times, s."""

LARGEST_TIME = 2**48 - 1

HEADER = struct.Struct("<BHB6s")
BEAT = struct.Struct("<BBBH")
BEAT_ALONE = struct.Struct("<BBBH13x")
MOTION = struct.Struct("<ii3sHHhhhhBI")
QUESTION = struct.Struct("<Q15x")
ANSWER = struct.Struct("<BQQ6s")
PRESENCE = struct.Struct("<QB10s8s")
PIECE_SIZE = 28
"""Bytes of a message in one piece."""

PIECE = struct.Struct(f"<HBH{PIECE_SIZE}s")
EPOCH = struct.Struct("<Q")

REVISION = "3"
"""Revision of these packets and of their turns, which enters every tag."""

NOT_STEERED, CLIMBS, DESCENDS = 0x80, 0x40, 0x20
"""Flags beside the kind of a state: not steered; climbing or descending by `height_sense`."""

FLAGS = NOT_STEERED | CLIMBS | DESCENDS

ONLINE, SIGNED, OBSTACLE, LINK_LOST, FINDING, KEYS_OUT = (1 << bit for bit in range(6))
"""Flags of a presence."""

OBSTACLE_TEXT = "it could not steer now: its log says why, for which a radio has no room"
"""Text in place of an obstacle's."""

FINDING_TEXT = (
    "its autopilot's parameters speak against it: its log says which, for which a radio has no room"
)
"""Text in place of findings."""

MOST_VEHICLES = 255
"""Maximum number of vehicles: their numbers and their count fit into a byte."""

TURN = 2.0 * math.pi


class PackedKind(IntEnum):
    """Content of a packet."""

    STATE = 1
    """Motion of the sender; the leader's state is a beat, too."""
    BEAT = 2
    """Beat alone, where the leader has no new state."""
    QUESTION = 3
    """Question for the time that the recipient's clock shows."""
    ANSWER = 4
    """Answer with the time that the leader's clock shows."""
    PRESENCE = 5
    """Status of the sender's companion."""
    ORDER = 6
    """Piece of an operator's order."""
    REPLY = 7
    """Piece of a reply to an order."""
    REPEAT = 8
    """Piece of an order that the sender repeats."""
    REVOCATION = 9
    """Piece of an operator's revocation of a vehicle's key."""


class BeatInfo(msgspec.Struct, frozen=True):
    """The leader's beat, from which the turns of all others count."""

    beat: int
    """Number of the beat in its cycle, from 0."""
    table: Timetable
    """Turns that follow the beat."""


class Piece(msgspec.Struct, frozen=True):
    """Piece of a message that is too long for one packet."""

    mark: int
    """First bytes of a hash of the whole message, which tell that pieces belong together."""
    index: int
    """Number of the piece, from 0."""
    size: int
    """Size of the whole message, bytes."""
    data: bytes
    """Content of the piece, PIECE_SIZE bytes; the last piece is padded with zeros."""


class Packet(msgspec.Struct, frozen=True, kw_only=True):
    """Decoded packet that is not verified yet."""

    kind: PackedKind
    formation: int
    """Number of the formation by `formation_mark`."""
    sender: int
    """Number of the vehicle, 0 for the leader, or `OPERATOR`."""
    ticks: int
    """Time of validity or of sending, 0.1 ms on the formation's clock; 0 in a question."""
    beat: BeatInfo | None = None
    state: LeaderMessage | None = None
    to: int = 0
    """Number of the vehicle that an answer is for."""
    number: int = 0
    """Number of a question and its answer."""
    session: int = 0
    """The leader's session, in an answer and in a presence."""
    received: int = 0
    """Arrival of the answered question, 0.1 ms on the leader's clock."""
    presence: Presence | None = None
    piece: Piece | None = None
    """Piece of an order, a reply, a repeated order or a revocation."""
    tagged: bytes
    """All bytes that the tag covers."""
    tag: bytes
    """Tag of the packet."""


def formation_mark(formation: str) -> int:
    """Return a formation's name as 16 bits, which tell another formation's packet from a forged one."""
    return int.from_bytes(hashlib.sha256(formation.encode()).digest()[:2], "little")


def formation_key(radio_key: bytes, formation: str, vehicles: Sequence[str]) -> bytes:
    """Derive the key of a formation's tags.

    Args:
        radio_key: 32 random bytes that all members share; empty where nothing is authenticated.
        formation: name of the formation.
        vehicles: names of its vehicles by their numbers.
    """
    names = "\n".join([REVISION, formation, *vehicles]).encode()
    return hashlib.blake2b(
        names, key=radio_key, digest_size=KEY_SIZE, person=b"vfguide key"
    ).digest()


def tag_of(key: bytes, epoch: int, tagged: bytes) -> bytes:
    """Return the tag of a packet under a leader's session, or 0 for a question or a revocation."""
    text = EPOCH.pack(epoch) + tagged
    return hashlib.blake2b(text, key=key, digest_size=TAG_SIZE, person=b"vfguide radio").digest()


def ticks_of(time_s: float) -> int:
    """Convert a time (s) to units of 0.1 ms, rounded down; raise ValueError if no packet can hold it."""
    ticks = math.floor(time_s / TICK_S) if math.isfinite(time_s) else -1
    if not 0 <= ticks <= LARGEST_TIME:
        raise ValueError(f"{time_s} s is no time that a packet can tell")
    return ticks


def encode_beat(info: BeatInfo, layout: struct.Struct = BEAT) -> bytes:
    """Encode a beat, by default as part of a packet; with BEAT_ALONE as the whole body of one."""
    table = info.table
    return layout.pack(info.beat, table.beats, table.members, table.period_ms)


def encode_motion(message: LeaderMessage) -> bytes:
    """Encode a vehicle's motion, with each value limited to the range of its field."""
    return MOTION.pack(
        limited(message.latitude_deg * 1e7, 31),
        limited(message.longitude_deg * 1e7, 31),
        limited(message.altitude_amsl * 1e2, 23).to_bytes(3, "little", signed=True),
        round(message.course % TURN / TURN * 65536) % 65536,
        max(limited(message.ground_speed * 1e2, 16), 0),
        limited(message.acceleration * 1e3, 15),
        limited(message.turn_rate * 1e4, 15),
        limited(message.turn_acceleration * 1e3, 15),
        limited(message.climb_rate * 1e2, 15),
        max(limited(message.term, 8), 0),
        message.arrangement,
    )


def state_flags(message: LeaderMessage) -> int:
    """Return the flags beside the kind of a state."""
    sense = CLIMBS * (message.height_sense > 0) | DESCENDS * (message.height_sense < 0)
    return NOT_STEERED * (not message.steered) | sense


def limited(value: float, bits: int) -> int:
    """Round a number and limit it to so many bits and a sign."""
    greatest: int = 2**bits - 1
    return min(max(round(value), -greatest), greatest)


def encode_packed_presence(presence: Presence, session: int) -> bytes:
    """Encode a presence without its figures, and with its texts cut to the room there is."""
    flags = ONLINE * (presence.status == "online") | SIGNED * presence.signed
    flags |= OBSTACLE * bool(presence.obstacle)
    flags |= FINDING * bool(presence.findings)
    flags |= LINK_LOST * (presence.figures.get(LINKS_LOST, 0.0) > 0.0)
    flags |= KEYS_OUT * any(name.startswith(REVOKED_KEY) for name in presence.figures)
    mode, version = (text.encode("ascii", "replace") for text in (presence.mode, presence.version))
    return PRESENCE.pack(session, flags, mode, version)


def encode_packet(
    kind: PackedKind, *, formation: int, sender: int, ticks: int, body: bytes, flags: int = 0
) -> bytes:
    """Encode a packet without its tag."""
    return HEADER.pack(kind | flags, formation, sender, ticks.to_bytes(6, "little")) + body


def decode_packet(data: bytes) -> Packet:
    """Decode a packet without checking its tag; raise LinkDataError if the bytes are none."""
    tagged, tag = data[:-TAG_SIZE], data[-TAG_SIZE:]
    if len(data) < HEADER.size + TAG_SIZE:
        raise LinkDataError("too short for a packet")
    number, formation, sender, ticks = HEADER.unpack_from(tagged)
    try:
        kind = PackedKind(number & ~FLAGS)
    except ValueError:
        raise LinkDataError("no kind of packet") from None
    if number & FLAGS and kind is not PackedKind.STATE:
        raise LinkDataError("only a state has flags")
    packet = Packet(
        kind=kind,
        formation=formation,
        sender=sender,
        ticks=int.from_bytes(ticks, "little"),
        tagged=tagged,
        tag=tag,
    )
    return DECODERS[kind](packet, tagged[HEADER.size :])


def _state(packet: Packet, body: bytes) -> Packet:
    beat = None
    if packet.sender == LEADER:
        beat, body = _beat_of(body[: BEAT.size]), body[BEAT.size :]
    state = _motion(body, packet.ticks, packet.tagged[0])
    return replace(packet, beat=beat, state=state)


def _motion(body: bytes, ticks: int, flags: int) -> LeaderMessage:
    latitude, longitude, altitude, course, speed, *others = _fields(MOTION, body)
    acceleration, turn_rate, turn_acceleration, climb_rate, term, arrangement = others
    if abs(latitude) > 90e7 or abs(longitude) > 180e7:
        raise LinkDataError("no place on the earth")
    return LeaderMessage(
        sequence=ticks % 2**32,
        time_s=ticks * TICK_S,
        latitude_deg=latitude * 1e-7,
        longitude_deg=longitude * 1e-7,
        altitude_amsl=int.from_bytes(altitude, "little", signed=True) * 1e-2,
        course=course * TURN / 65536,
        ground_speed=speed * 1e-2,
        acceleration=acceleration * 1e-3,
        turn_rate=turn_rate * 1e-4,
        turn_acceleration=turn_acceleration * 1e-3,
        climb_rate=climb_rate * 1e-2,
        term=term,
        arrangement=arrangement,
        steered=not flags & NOT_STEERED,
        height_sense=bool(flags & CLIMBS) - bool(flags & DESCENDS),
    )


def _beat(packet: Packet, body: bytes) -> Packet:
    return replace(packet, beat=_beat_of(body, BEAT_ALONE))


def _beat_of(body: bytes, layout: struct.Struct = BEAT) -> BeatInfo:
    beat, beats, members, period_ms = _fields(layout, body)
    if not (beat < beats and members > 0 and period_ms > 0):
        raise LinkDataError("no beat")
    return BeatInfo(beat, Timetable(members=members, beats=beats, period_ms=period_ms))


def _question(packet: Packet, body: bytes) -> Packet:
    (number,) = _fields(QUESTION, body)
    return replace(packet, number=number)


def _answer(packet: Packet, body: bytes) -> Packet:
    to, number, session, received = _fields(ANSWER, body)
    return replace(
        packet, to=to, number=number, session=session, received=int.from_bytes(received, "little")
    )


def _presence(packet: Packet, body: bytes) -> Packet:
    session, flags, *texts = _fields(PRESENCE, body)
    try:
        mode, version = (text.rstrip(b"\0").decode("ascii") for text in texts)
    except UnicodeDecodeError:
        raise LinkDataError("no text") from None
    if not (mode + version).isprintable():
        raise LinkDataError("a text that cannot be printed")
    presence = Presence(
        status="online" if flags & ONLINE else "offline",
        mode=mode,
        time_s=packet.ticks * TICK_S,
        version=version,
        signed=bool(flags & SIGNED),
        obstacle=OBSTACLE_TEXT if flags & OBSTACLE else "",
        findings=(FINDING_TEXT,) if flags & FINDING else (),
        figures={
            figure: 1.0
            for figure, flag in ((LINKS_LOST, LINK_LOST), (REVOKED_KEY, KEYS_OUT))
            if flags & flag
        },
    )
    return replace(packet, session=session, presence=presence)


def _piece(packet: Packet, body: bytes) -> Packet:
    mark, index, size, data = _fields(PIECE, body)
    if index * PIECE_SIZE >= size:
        raise LinkDataError("a piece behind the end")
    return replace(packet, piece=Piece(mark, index, size, data))


def _fields(layout: struct.Struct, body: bytes) -> tuple[Any, ...]:
    if len(body) != layout.size:
        raise LinkDataError(f"{len(body)} bytes where {layout.size} are due")
    return layout.unpack(body)


DECODERS = {
    PackedKind.STATE: _state,
    PackedKind.BEAT: _beat,
    PackedKind.QUESTION: _question,
    PackedKind.ANSWER: _answer,
    PackedKind.PRESENCE: _presence,
    PackedKind.ORDER: _piece,
    PackedKind.REPLY: _piece,
    PackedKind.REPEAT: _piece,
    PackedKind.REVOCATION: _piece,
}
