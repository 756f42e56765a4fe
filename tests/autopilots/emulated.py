"""The emulator as a pilot and a companion have it: MAVLink bytes both ways, in virtual time."""

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot
from tests.kit.autopilot import GroundStation

LISTENS_S = 4.0


class Emulated(GroundStation):
    """One emulated aircraft, and all that it has said."""

    def __init__(self, autopilot: Autopilot, system_id: int) -> None:
        """Take an aircraft at the start of its flight."""
        super().__init__(autopilot, system_id)
        self.time_s = 0.0
        self.heard: list[tuple[float, MAVLink_message]] = []
        """Time of simulation, message."""

    def decoded(self, data: bytes) -> list[MAVLink_message]:
        messages = super().decoded(data)
        self.heard += ((self.time_s, one) for one in messages)
        return messages

    def advance(self, to_s: float) -> list[MAVLink_message]:
        self.time_s = to_s
        return super().advance(to_s)

    def pass_time(self, seconds: float) -> None:
        """Let time pass."""
        self.advance(self.time_s + seconds)

    def answer(self, message: MAVLink_message) -> str:
        """Send a command, and return the MAV_RESULT of its acknowledgement."""
        return self.result(self.send(message))

    def course_deg(self) -> float:
        """True course over ground, degrees."""
        return math.degrees(self.truth.course_rad)

    def airspeed_m_s(self) -> float:
        """True airspeed."""
        return self.truth.airspeed_m_s

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
        self.command_long(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
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
