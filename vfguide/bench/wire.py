"""What a datagram holds, read without parsing it: a stopwatch must not be slow itself."""

import struct
from collections.abc import Iterator

MAGIC = 0xFD
"""First byte of a MAVLink 2 frame."""

HEADER, CHECKSUM, SIGNATURE = 10, 2, 13
"""Bytes of a frame before and after its payload; the last only if it is signed."""

SIGNED = 0x01
"""Incompatibility flag of a signed frame."""

POSITION = 33
"""GLOBAL_POSITION_INT."""

COMMAND_INT = 75
COMMAND_AT = 28
"""Where the command's number is in its payload."""

CHANGE_HEADING = 43002
"""MAV_CMD_GUIDED_CHANGE_HEADING, what ArduPlane is steered by."""

POSITION_TARGETS = frozenset({84, 86})
"""SET_POSITION_TARGET_LOCAL_NED and SET_POSITION_TARGET_GLOBAL_INT, what others are steered by."""


def frames(datagram: bytes) -> Iterator[tuple[int, bytes]]:
    """Message id and payload of each whole MAVLink 2 frame, up to the first byte that begins none."""
    at = 0
    while at + HEADER <= len(datagram) and datagram[at] == MAGIC:
        length, flags = datagram[at + 1], datagram[at + 2]
        message_id = int.from_bytes(datagram[at + 7 : at + 10], "little")
        end = at + HEADER + length
        yield message_id, datagram[at + HEADER : end]
        at = end + CHECKSUM + (SIGNATURE if flags & SIGNED else 0)


def has_position(datagram: bytes) -> bool:
    """Whether a client has reason to answer with a setpoint."""
    return any(message_id == POSITION for message_id, _ in frames(datagram))


def has_setpoint(datagram: bytes) -> bool:
    """Whether a course or a velocity is among what a client sends."""
    return any(
        message_id in POSITION_TARGETS
        or (message_id == COMMAND_INT and command_of(payload) == CHANGE_HEADING)
        for message_id, payload in frames(datagram)
    )


def command_of(payload: bytes) -> int:
    """Number of the command in a COMMAND_INT; trailing zeros are not sent."""
    number: int
    (number,) = struct.unpack_from("<H", payload.ljust(COMMAND_AT + 2, b"\0"), COMMAND_AT)
    return number
