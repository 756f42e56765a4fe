"""Who on a connection is the autopilot that is expected there, by its heartbeat.

At a UDP port anybody may speak. An address becomes the peer, and hears the setpoints, only after a heartbeat
of the right system with a right checksum; on a signed connection it has to be signed, too.
"""

from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVError, MAVLink, MAVLink_message

from vfguide.mavlink.framing import Frame, frames_of
from vfguide.mavlink.signing import Signing

SILENCE_S = 10.0
"""s that a peer must be silent before another address may take its place: a router that is started anew."""

SIGNED_SILENCE_S = 1.0
"""The same where the heartbeat is signed: nobody else can have sent it."""


class Introduction:
    """Looks for the heartbeat of one autopilot, and notes which others are there instead."""

    def __init__(
        self, system_id: int, component_id: int, *, signing: Signing | None = None
    ) -> None:
        """Expect an autopilot.

        Args:
            system_id: of the vehicle.
            component_id: of its autopilot.
            signing: of the connection, if it is signed.
        """
        self.others: Counter[int] = Counter()
        """Heartbeats of autopilots of other systems, by system."""
        self._source = (system_id, component_id)
        self._signing = signing
        self._parser = MAVLink(None)

    @property
    def silence_s(self) -> float:
        """How long a peer must be silent before another address may take its place, s."""
        return SILENCE_S if self._signing is None else SIGNED_SILENCE_S

    def is_given_by(self, datagram: bytes) -> bool:
        """Whether there is a heartbeat of the expected autopilot among the frames; never raises."""
        return any(
            frame is not None
            and frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
            and self._is_expected(frame)
            for frame in frames_of(datagram)
        )

    def _is_expected(self, frame: Frame) -> bool:
        message = self._decoded(frame)
        if message is None or message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if (frame.system_id, frame.component_id) != self._source:
            if frame.system_id != self._source[0]:
                self.others[frame.system_id] += 1
            return False
        return self._signing is None or self._signing.vouches_for(frame)

    def _decoded(self, frame: Frame) -> MAVLink_message | None:
        try:
            return self._parser.decode(bytearray(frame.content))
        except MAVError:
            return None

    def complaint(self) -> str | None:
        """What is wrong where only other systems were heard, with the remedy; None where none was."""
        if not self.others:
            return None
        heard = " and ".join(str(system_id) for system_id in sorted(self.others)[:3])
        expected = self._source[0]
        return (
            f"heard system {heard}, expected {expected}: set system_id in the mission, "
            f"or SYSID_THISMAV (PX4: MAV_SYS_ID) to {expected}, or choose the port of this vehicle"
        )
