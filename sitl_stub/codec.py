"""MAVLink frames in and out, without a socket."""

import math
from collections import Counter
from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.signing import Signing, frames_of

COMPONENT_ID = 1
"""MAV_COMP_ID_AUTOPILOT1."""


class Codec:
    """One MAVLink endpoint: parses what is meant for this autopilot, encodes what it says."""

    def __init__(
        self, system_id: int, counters: Counter[str], signing: Signing | None = None
    ) -> None:
        self.signing = signing
        """Checks and signs every frame; None: nobody is asked for a signature."""
        self._system_id = system_id
        self._counters = counters
        self._encoder = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=COMPONENT_ID)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True

    def decode(self, data: bytes, unix_s: float = 0.0) -> list[MAVLink_message]:
        """The messages of one datagram that this autopilot should look at; the rest is counted."""
        if self.signing is not None:
            data = self._genuine(self.signing, data, unix_s)
        parser = self._parser
        # A datagram holds whole frames. What an earlier one left behind would swallow this one's.
        parser.buf = bytearray()
        parser.buf_index = 0
        parser.expected_length = mavlink.HEADER_LEN_V1 + 2
        parser.have_prefix_error = False
        return [message for message in parser.parse_buffer(data) or () if self._is_for_me(message)]

    def encode(self, messages: Iterable[MAVLink_message], unix_s: float = 0.0) -> bytes:
        """The frames of the messages, one after the other, with consecutive sequence numbers."""
        encoder = self._encoder
        encoder.signing.sign_outgoing = False
        if self.signing is not None:
            self.signing.prepare(encoder, unix_s)
        frames = []
        for message in messages:
            frames.append(message.pack(encoder))
            encoder.seq = (encoder.seq + 1) % 256
        return b"".join(frames)

    def _genuine(self, signing: Signing, data: bytes, unix_s: float) -> bytes:
        genuine = []
        for frame in frames_of(data):
            if signing.accepts(frame, unix_s):
                genuine.append(frame)
            else:
                self._counters["not signed"] += 1
        return b"".join(genuine)

    def _is_for_me(self, message: MAVLink_message) -> bool:
        name = message.get_type()
        if name == "BAD_DATA":
            self._counters["bad data"] += 1
            return False
        # An unknown id skips the checksum: nothing in such a frame can be trusted.
        if name.startswith("UNKNOWN_"):
            self._counters["unknown message"] += 1
            return False
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if sender == (self._system_id, COMPONENT_ID):
            self._counters["from itself"] += 1
            return False
        if not (
            getattr(message, "target_system", 0) in {0, self._system_id}
            and getattr(message, "target_component", 0) in {0, COMPONENT_ID}
        ):
            self._counters["for another"] += 1
            return False
        return True


def whole_number(value: float) -> int | None:
    """The integer that a float field carries, or None if it carries none."""
    return int(value) if math.isfinite(value) and value == int(value) else None
