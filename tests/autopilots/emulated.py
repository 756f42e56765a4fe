"""The emulator as a pilot and a companion have it: MAVLink bytes both ways, in virtual time."""

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot
from tests.kit.wire import command_long, packed

LISTENS_S = 4.0


class Emulated:
    """One emulated aircraft, and all that it has said."""

    def __init__(self, autopilot: Autopilot, system_id: int, starts_s: float = 0.0) -> None:
        """Take an aircraft at the start of its flight."""
        self.autopilot = autopilot
        self.system_id = system_id
        self.time_s = starts_s
        self.heard: list[tuple[float, MAVLink_message]] = []
        """Time of simulation, message."""
        self._parser = mavlink.MAVLink(None)

    def send(self, message: MAVLink_message) -> list[MAVLink_message]:
        """Send a message: what is answered at once."""
        return self._hear(self.autopilot.receive(packed(message)))

    def pass_time(self, seconds: float) -> None:
        """Let time pass."""
        self.advance_to(self.time_s + seconds)

    def advance_to(self, time_s: float) -> None:
        """Let time pass until then."""
        self.time_s = time_s
        self._hear(self.autopilot.advance(time_s))

    def result(self, message: MAVLink_message) -> int:
        """Send a command, and return the MAV_RESULT of its acknowledgement."""
        (ack,) = (one for one in self.send(message) if one.get_type() == "COMMAND_ACK")
        return int(ack.result)

    def course_deg(self) -> float:
        """True course over ground, degrees."""
        return math.degrees(self.autopilot.truth().course_rad)

    def airspeed_m_s(self) -> float:
        """True airspeed."""
        return self.autopilot.truth().airspeed_m_s

    def custom_mode(self) -> int:
        """Mode of the last heartbeat."""
        return int(self._last("HEARTBEAT").custom_mode)

    def texts(self) -> list[str]:
        """Everything said by STATUSTEXT so far."""
        return [one.text for _, one in self.heard if one.get_type() == "STATUSTEXT"]

    def parameter(self, name: str) -> tuple[float, int] | None:
        """Value as it is sent and MAV_PARAM_TYPE of a parameter; None for an unknown one."""
        asked = mavlink.MAVLink_param_request_read_message(self.system_id, 1, name.encode(), -1)
        answers = [one for one in self.send(asked) if one.get_type() == "PARAM_VALUE"]
        return (answers[0].param_value, answers[0].param_type) if answers else None

    def version(self) -> tuple[int, int]:
        """Firmware's version and capabilities of AUTOPILOT_VERSION."""
        wanted = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
        request = mavlink.MAV_CMD_REQUEST_MESSAGE
        self.send(command_long(request, wanted, system_id=self.system_id))
        told = self._last("AUTOPILOT_VERSION")
        return told.flight_sw_version, told.capabilities

    def rates_hz(self) -> Mapping[str, float]:
        """How often each message comes unasked."""
        before = len(self.heard)
        self.pass_time(LISTENS_S)
        names = [one.get_type() for _, one in self.heard[before:]]
        return {name: names.count(name) / LISTENS_S for name in names}

    def _last(self, kind: str) -> MAVLink_message:
        return next(one for _, one in reversed(self.heard) if one.get_type() == kind)

    def _hear(self, data: bytes) -> list[MAVLink_message]:
        messages = self._parser.parse_buffer(data) or []
        self.heard += ((self.time_s, one) for one in messages)
        return messages
