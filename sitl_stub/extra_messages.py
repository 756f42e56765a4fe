"""Messages of MAVLink's common set that pymavlink's dialect for ArduPilot does not have."""

import struct
from collections.abc import Sequence

from pymavlink.dialects.v20.ardupilotmega import MAVLink, MAVLink_message

from sitl_stub.modes import Mode

PROTOCOL_VERSION = 300
AVAILABLE_MODES = 435

MAVLINK_2 = 200
"""MAVLink 2.0 as PROTOCOL_VERSION says it; 100 is the oldest that is understood."""


class ExtraMessage(MAVLink_message):  # type: ignore[misc] # pymavlink is not typed
    """A message given by its number, the extra byte of its checksum, and its payload."""

    def __init__(self, message_id: int, name: str, crc_extra: int, payload: bytes) -> None:
        super().__init__(message_id, name)
        self._extra = crc_extra
        self._content = payload

    def pack(self, mav: MAVLink) -> bytes:
        """The frame."""
        packed: bytes = self._pack(mav, self._extra, self._content)
        return packed


def protocol_version() -> MAVLink_message:
    """PROTOCOL_VERSION: MAVLink 1 and 2; no hashes of specification and library."""
    payload = struct.pack("<HHH16x", MAVLINK_2, 100, MAVLINK_2)
    return ExtraMessage(PROTOCOL_VERSION, "PROTOCOL_VERSION", 217, payload)


def available_modes(modes: Sequence[Mode], index: int) -> list[MAVLink_message]:
    """AVAILABLE_MODES of the mode with this number (from 1), or of all for 0."""
    numbers = range(1, len(modes) + 1) if index == 0 else range(index, index + 1)
    messages: list[MAVLink_message] = []
    for number in numbers:
        if 1 <= number <= len(modes):
            mode = modes[number - 1]
            name = mode.name.encode("ascii")
            payload = struct.pack("<IIBBB35s", mode.custom_mode, 0, len(modes), number, 0, name)
            messages.append(ExtraMessage(AVAILABLE_MODES, "AVAILABLE_MODES", 134, payload))
    return messages
