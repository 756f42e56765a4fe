"""MAVLink 2 message signing: only who has the key is heard, and nobody else can get in its way.

pymavlink signs what goes out, with a time stamp set here: its own moves by 10 µs for each packet, so that a
restarted program would be taken for a recording of itself. What comes in is checked here: pymavlink notes a
packet's time stamp before it looks at the signature, so that one forged packet from the future would shut
the true sender out.
"""

import hashlib
import hmac
from collections.abc import Callable

from pymavlink.dialects.v20.ardupilotmega import MAVLink

from vfguide.errors import InputError
from vfguide.mavlink.framing import MAGIC_2, SIGNATURE, SIGNED, Frame

KEY_SIZE = 32
EPOCH_S = 1_420_070_400
"""Unix time of 1 January 2015, from which time stamps count."""

UNITS_PER_S = 100_000
PATIENCE = 60 * UNITS_PER_S
"""How much older than this end's time the first packet of a stream may be."""

LATEST = 2**48 - 1
TIME_STAMP, DIGEST = slice(-12, -6), slice(-6, None)
"""Places in a frame, after the link's number."""


def signing_key(text: str) -> bytes:
    """A key as 64 hexadecimal digits.

    Raises:
        InputError: it is something else; the message does not repeat it.
    """
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    if len(key) != KEY_SIZE:
        raise InputError(f"a signing key is {2 * KEY_SIZE} hexadecimal digits")
    return key


class Signing:
    """One end of a signed connection."""

    def __init__(self, key: bytes, clock: Callable[[], float], *, link_id: int = 1) -> None:
        """Hold a key.

        Args:
            key: 32 bytes that both ends have.
            clock: tells the Unix time, s. The other end refuses what is older than what it has heard.
            link_id: of this end's connection; each connection of a computer has its own.
        """
        self._key = key
        self._clock = clock
        self._link_id = link_id
        self._newest = 0
        self._streams: dict[tuple[int, int, int], int] = {}

    def accepts(self, frame: Frame) -> bool:
        """Whether a frame is signed with the key, and newer than those before it in its stream."""
        if not self.vouches_for(frame):
            return False
        stamp, stream = stamp_and_stream(frame)
        self._streams[stream] = stamp
        self._newest = max(self._newest, stamp)
        return True

    def vouches_for(self, frame: Frame) -> bool:
        """The same, without taking the frame: it may be accepted afterwards."""
        content = frame.content
        if content[0] != MAGIC_2 or not content[2] & SIGNED:
            return False
        digest = hashlib.sha256(self._key + content[: DIGEST.start]).digest()[:6]
        if not hmac.compare_digest(digest, content[DIGEST]):
            return False
        stamp, stream = stamp_and_stream(frame)
        last = self._streams.get(stream)
        return stamp > (self._now() - PATIENCE if last is None else last)

    def prepare(self, encoder: MAVLink) -> None:
        """Let an encoder sign what it packs next, at this end's time."""
        signing = encoder.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = self._key, self._link_id, True
        # pymavlink counts on from here by one for each packet; time never goes back below that.
        signing.timestamp = self._newest = max(self._now(), signing.timestamp)

    def _now(self) -> int:
        """Time in the units of time stamps: the clock's, or that of the newest packet heard."""
        units = round((self._clock() - EPOCH_S) * UNITS_PER_S)
        return max(self._newest, min(max(units, 0), LATEST))


def stamp_and_stream(frame: Frame) -> tuple[int, tuple[int, int, int]]:
    """Time stamp of a signed frame, and the stream in which those have to rise."""
    content = frame.content
    stamp = int.from_bytes(content[TIME_STAMP], "little")
    return stamp, (frame.system_id, frame.component_id, content[-SIGNATURE])
