"""MAVLink framing, encoding and message signing, without a socket.

Signing: messages without a valid signature are dropped and have no effect on accepted senders.

Time stamps count 10 microseconds from the beginning of 2015. They must increase in each stream (system,
component, link), which prevents replay. Only a frame with a valid signature advances them, so a forged one
from the far future locks nobody out.
"""

import hashlib
import hmac
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
"""First byte of a MAVLink 1 and of a MAVLink 2 frame."""

MAGIC = re.compile(b"[\xfd\xfe]")

HEADER_1, HEADER_2 = 6, 10
"""Bytes before the payload of a MAVLink 1 and of a MAVLink 2 frame."""

CHECKSUM = 2
"""Length of the checksum after the payload, bytes."""

SIGNED, SIGNATURE = 0x01, 13
"""MAVLink 2's flag of a signed frame, and the length of its signature, bytes."""

KEY_BYTES = 32

EPOCH_UNIX_S = 1_420_070_400

TICKS_PER_S = 100_000

NEW_STREAM_MAY_LAG_TICKS = 60 * TICKS_PER_S
"""Greatest lag of a new stream, by the specification."""

LONGEST_TIMESTAMP = 2**48 - 1

COMPONENT_ID = 1
"""MAV_COMP_ID_AUTOPILOT1."""


class EmulatorFramer:
    """Splits the bytes of one connection into frames.

    Only frames of known messages with a right checksum come out. A garbage byte that looks like the start of
    a frame therefore costs no good frame behind it. At most one incomplete frame (280 bytes) is held back.
    """

    def __init__(self) -> None:
        self._pending = b""

    def feed(self, data: bytes) -> bytes:
        """Take received bytes; return the frames that are now complete, concatenated."""
        stream = self._pending + data
        frames = []
        start = next_magic(stream, 0)
        while start < len(stream):
            length = frame_length(stream, start)
            if length is None:
                break
            if length == 0:
                start = next_magic(stream, start + 1)
                continue
            frames.append(stream[start : start + length])
            start = next_magic(stream, start + length)
        self._pending = stream[start:]
        return b"".join(frames)


def next_magic(stream: bytes, start: int) -> int:
    """Return the first index from `start` on at which a frame may begin, or the end of the stream."""
    match = MAGIC.search(stream, start)
    return len(stream) if match is None else match.start()


def frame_length(stream: bytes, start: int) -> int | None:
    """Return the length of the frame that begins at `start`: 0 if none does, None if bytes are missing."""
    if len(stream) < start + (HEADER_2 if stream[start] == MAGIC_2 else HEADER_1):
        return None
    message = mavlink.mavlink_map.get(message_id_at(stream, start))
    end = frame_end(stream, start)
    if message is None or end is None or stream[start + 1] > message.unpacker.size:
        return 0
    if len(stream) < end:
        return None
    signed = stream[start] == MAGIC_2 and stream[start + 2] == SIGNED
    checked = end - CHECKSUM - (SIGNATURE if signed else 0)
    checksum = mavlink.x25crc(stream[start + 1 : checked])
    checksum.accumulate(bytes((message.crc_extra,)))
    right = checksum.crc == int.from_bytes(stream[checked : checked + CHECKSUM], "little")
    return end - start if right else 0


def message_id_at(stream: bytes, start: int) -> int:
    """Return the message id of the frame that begins at `start`; its header must be complete."""
    if stream[start] == MAGIC_1:
        return stream[start + 5]
    return int.from_bytes(stream[start + 7 : start + 10], "little")


def frame_end(data: bytes, start: int) -> int | None:
    """Return the end of the frame that begins at `start`, by its header; None where none begins."""
    magic, left = data[start], len(data) - start
    if magic == MAGIC_2 and left >= HEADER_2:
        flags = data[start + 2]
        if flags in {0, SIGNED}:
            return start + HEADER_2 + data[start + 1] + CHECKSUM + (SIGNATURE if flags else 0)
    elif magic == MAGIC_1 and left >= HEADER_1:
        return start + HEADER_1 + data[start + 1] + CHECKSUM
    return None


Stream = tuple[int, int, int]
"""System, component and link."""


def key_of(text: str) -> bytes:
    """Return the key in 64 hexadecimal digits, or a passphrase's SHA-256, as ground stations derive it."""
    if len(text) == 2 * KEY_BYTES:
        try:
            return bytes.fromhex(text)
        except ValueError:
            pass
    return hashlib.sha256(text.encode()).digest()


def ticks_of(unix_s: float) -> int:
    """Convert a Unix time to a time stamp of signing."""
    return max(0, min(LONGEST_TIMESTAMP, round((unix_s - EPOCH_UNIX_S) * TICKS_PER_S)))


class Signing:
    """One end of a signed link."""

    def __init__(self, key: bytes, *, link_id: int = 0) -> None:
        """Take a key.

        Raises:
            ValueError: the key does not have 32 bytes.
        """
        if len(key) != KEY_BYTES:
            raise ValueError(f"a signing key has {KEY_BYTES} bytes, not {len(key)}")
        self._key = key
        self._link_id = link_id
        self._newest = 0
        self._streams: dict[Stream, int] = {}

    def accepts(self, frame: bytes, unix_s: float) -> bool:
        """Check whether a whole frame is signed with the key and newer than its predecessors."""
        if frame[0] != MAGIC_2 or not frame[2] & SIGNED:
            return False
        signed, signature = frame[:-6], frame[-6:]
        if not hmac.compare_digest(hashlib.sha256(self._key + signed).digest()[:6], signature):
            return False
        timestamp = int.from_bytes(frame[-12:-6], "little")
        stream = (frame[5], frame[6], frame[-13])
        known = self._streams.get(stream)
        oldest = (
            max(self._newest, ticks_of(unix_s)) - NEW_STREAM_MAY_LAG_TICKS
            if known is None
            else known + 1
        )
        if timestamp < oldest:
            return False
        self._streams[stream] = timestamp
        self._newest = max(self._newest, timestamp)
        return True

    def prepare(self, encoder: mavlink.MAVLink, unix_s: float) -> None:
        """Let an encoder sign the messages it packs next, with the present time stamp or a later one."""
        signing = encoder.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = self._key, self._link_id, True
        self._newest = max(self._newest, ticks_of(unix_s), signing.timestamp)
        signing.timestamp = self._newest


class EmulatorCodec:
    """One MAVLink endpoint: decodes messages to this autopilot and encodes its own."""

    def __init__(
        self,
        system_id: int,
        counters: Counter[str],
        signing: Signing | None = None,
        *,
        component_id: int = COMPONENT_ID,
    ) -> None:
        self.signing = signing
        """Signs and checks every frame; None accepts unsigned frames."""
        self._system_id, self._component_id = system_id, component_id
        self._counters = counters
        self._encoder = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._parser = mavlink.MAVLink(None)

    def decode(self, data: bytes, unix_s: float = 0.0) -> list[MAVLink_message]:
        """Return the messages of one datagram that concern this autopilot; count the others."""
        heard = []
        for frame, message in self._messages(data):
            if self.signing is not None and not self.signing.accepts(frame, unix_s):
                self._counters["not signed"] += 1
            elif self._is_for_me(message):
                heard.append(message)
        return heard

    def _messages(self, data: bytes) -> Iterator[tuple[bytes, MAVLink_message]]:
        """Yield each whole frame of a datagram with its message; count the bytes outside frames.

        pymavlink's own parser also takes frames in pieces, byte by byte, and costs twice as much.
        """
        start = 0
        while start < len(data):
            end = frame_end(data, start)
            if end is None or end > len(data):
                self._counters["bad data"] += 1
                start = next_magic(data, start + 1)
            elif message_id_at(data, start) not in mavlink.mavlink_map:
                # The checksum of an unknown message cannot be verified: nothing in the frame can be trusted.
                self._counters["unknown message"] += 1
                start = end
            else:
                frame = data[start:end]
                try:
                    message = self._parser.decode(bytearray(frame))
                except mavlink.MAVError:
                    self._counters["bad data"] += 1
                    start = next_magic(data, start + 1)
                else:
                    start = end
                    yield frame, message

    def encode(self, messages: Iterable[MAVLink_message], unix_s: float = 0.0) -> bytes:
        """Return the frames of the messages, concatenated, with consecutive sequence numbers."""
        encoder = self._encoder
        encoder.signing.sign_outgoing = False
        if self.signing is not None:
            self.signing.prepare(encoder, unix_s)
        frames = []
        for message in messages:
            frames.append(message.pack(encoder))
            encoder.seq = (encoder.seq + 1) % 256
        return b"".join(frames)

    def _is_for_me(self, message: MAVLink_message) -> bool:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if sender == (self._system_id, self._component_id):
            self._counters["from itself"] += 1
            return False
        if not (
            getattr(message, "target_system", 0) in {0, self._system_id}
            and getattr(message, "target_component", 0) in {0, self._component_id}
        ):
            self._counters["for another"] += 1
            return False
        return True


def whole_number(value: float) -> int | None:
    """Return the integer in a float field, or None if its value is none."""
    return int(value) if math.isfinite(value) and value == int(value) else None
