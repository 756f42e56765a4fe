"""The envelope that every message of a formation goes in: who says what, in which run, under which leader.

Layout, little-endian: "VFE1", scheme (u8), kind (u8), length of the sender's name (u8), a byte of zero,
formation (u64: the first bytes of the SHA-256 of its name), session (u64), epoch (u64), sequence (u32), time
(f64, s), the sender's name (UTF-8), the body, and the tag over all that: 64 bytes of Ed25519, or the CRC-32
(u32) of a message that nobody has signed. 44 bytes and the name before a body.
"""

import hashlib
import math
import struct
import zlib
from enum import IntEnum

import msgspec

from vfguide.link.codec import LinkDataError

MAGIC = b"VFE1"
LAYOUT = struct.Struct("<4sBBBxQQQId")
CHECKSUM = struct.Struct("<I")
SIGNATURE_SIZE = 64

LARGEST = 4096
"""Bytes of a whole message: nothing that a formation shares is longer."""

LONGEST_NAME = 200
"""Bytes of a name."""

GREATEST_TIME_S = 1e10
"""Three hundred years: beyond that it is no clock's."""


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
    size = LAYOUT.size + len(name) + len(body) + TAG_SIZES[scheme]
    if not 0 < len(name) <= LONGEST_NAME or size > LARGEST:
        raise ValueError(f"a name of {len(name)} bytes or a message of {size} is too long")
    header = LAYOUT.pack(
        MAGIC, scheme, kind, len(name), formation, session, epoch, sequence, time_s
    )
    return header + name + body


def decode_envelope(data: bytes) -> Envelope:
    """The envelope of these bytes; its tag is not looked at.

    Raises:
        LinkDataError: they are none.
    """
    if not LAYOUT.size < len(data) <= LARGEST:
        raise LinkDataError("its length is no message's")
    magic, scheme, kind, length, formation, session, epoch, sequence, time_s = LAYOUT.unpack_from(
        data
    )
    if magic != MAGIC:
        raise LinkDataError("it is no message of a formation")
    try:
        scheme, kind = Scheme(scheme), Kind(kind)
        end = len(data) - TAG_SIZES[scheme]
        sender = data[LAYOUT.size : LAYOUT.size + length].decode()
    except ValueError:
        raise LinkDataError("its scheme, kind or sender is none") from None
    if not 0 < length <= LONGEST_NAME or LAYOUT.size + length > end:
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
        body=data[LAYOUT.size + length : end],
        signed=data[:end],
        tag=data[end:],
    )


def checksum(signed: bytes) -> bytes:
    """The tag of a message that nobody signs."""
    return CHECKSUM.pack(zlib.crc32(signed))
