"""MAVLink 2 message signing: who has no key is not heard, and cannot shut out who has one.

Time stamps count 10 microseconds from the beginning of 2015. Each stream (system, component, link) has to
move forward in time, so that nothing can be played back; and only a frame whose signature is right moves
anything, so that a forged one from the far future locks nobody out.
"""

import hashlib
import hmac

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub.framing import MAGIC_2, SIGNED, frame_length, next_magic

KEY_BYTES = 32
EPOCH_UNIX_S = 1_420_070_400
TICKS_PER_S = 100_000
NEW_STREAM_MAY_LAG_TICKS = 60 * TICKS_PER_S
"""By how much a stream that was not heard before may be behind, by the specification."""

LONGEST_TIMESTAMP = 2**48 - 1

Stream = tuple[int, int, int]
"""System, component and link."""


def key_of(text: str) -> bytes:
    """The key in 64 hexadecimal digits, or, as ground stations make it, of a passphrase: its SHA-256."""
    if len(text) == 2 * KEY_BYTES:
        try:
            return bytes.fromhex(text)
        except ValueError:
            pass
    return hashlib.sha256(text.encode()).digest()


def ticks_of(unix_s: float) -> int:
    """A Unix time as a time stamp of signing."""
    return max(0, min(LONGEST_TIMESTAMP, round((unix_s - EPOCH_UNIX_S) * TICKS_PER_S)))


class Signing:
    """One end of a signed link."""

    def __init__(self, key: bytes, *, link_id: int = 0) -> None:
        """Take a key.

        Raises:
            ValueError: it has not 32 bytes.
        """
        if len(key) != KEY_BYTES:
            raise ValueError(f"a signing key has {KEY_BYTES} bytes, not {len(key)}")
        self._key = key
        self._link_id = link_id
        self._newest = 0
        self._streams: dict[Stream, int] = {}

    def accepts(self, frame: bytes, unix_s: float) -> bool:
        """Whether a whole frame is signed with the key and newer than what came before it."""
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
        """Let an encoder sign what it packs next: its clock follows the time and never stands still."""
        signing = encoder.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = self._key, self._link_id, True
        self._newest = max(self._newest, ticks_of(unix_s), signing.timestamp)
        signing.timestamp = self._newest


def frames_of(data: bytes) -> list[bytes]:
    """The frames of known messages with a right checksum in a datagram."""
    frames = []
    start = next_magic(data, 0)
    while start < len(data):
        length = frame_length(data, start)
        if length:
            frames.append(data[start : start + length])
        start = next_magic(data, start + (length or 1))
    return frames
