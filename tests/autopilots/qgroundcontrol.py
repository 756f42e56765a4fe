"""What QGroundControl 5 sends to an ArduPlane when it connects, and what it hears, by a port of its own.

In the order of its start: heartbeats, streams at its own rates, AUTOPILOT_VERSION, the list of modes, all
parameters, mission, fence and rally points, the home position.
"""

import socket
from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.autopilots.ground_station import Caller

STREAMS_HZ = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: 2,
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: 2,
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: 2,
    mavlink.MAV_DATA_STREAM_POSITION: 3,
    mavlink.MAV_DATA_STREAM_EXTRA1: 10,
    mavlink.MAV_DATA_STREAM_EXTRA2: 10,
    mavlink.MAV_DATA_STREAM_EXTRA3: 3,
}
"""What it asks an ArduPilot for, by its settings as they come."""

AVAILABLE_MODES = 435
PLANS = (
    mavlink.MAV_MISSION_TYPE_MISSION,
    mavlink.MAV_MISSION_TYPE_FENCE,
    mavlink.MAV_MISSION_TYPE_RALLY,
)


class QGroundControl(Caller):
    """Speaks from a thread of its own until it is closed."""

    HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 192, 0, 4, 3)

    def __init__(self, port: int, system_id: int) -> None:
        """Connect to a TCP port of the vehicle with this system id."""
        self.heard: Counter[tuple[int, str]] = Counter()
        """Messages by component and kind."""
        self.values: dict[str, float] = {}
        """The newest of each NAMED_VALUE_FLOAT."""
        self.plans: set[int] = set()
        super().__init__(system_id, socket.create_connection(("127.0.0.1", port), 10.0))

    def start(self) -> None:
        """Everything it asks for at first."""
        to = (self.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        for stream, rate_hz in STREAMS_HZ.items():
            self.send(mavlink.MAVLink_request_data_stream_message(*to, stream, rate_hz, 1))
        request, interval = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self.command(request, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        self.command(request, AVAILABLE_MODES)
        self.send(mavlink.MAVLink_param_request_list_message(*to))
        for plan in PLANS:
            self.send(mavlink.MAVLink_mission_request_list_message(*to, plan))
        self.command(interval, mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1_000_000)

    def fly_to(self, latitude_deg: float, longitude_deg: float, height_m: float) -> None:
        """Fly to here: COMMAND_INT of MAV_CMD_DO_REPOSITION, height above home."""
        frame, number = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mavlink.MAV_CMD_DO_REPOSITION
        place = (round(latitude_deg * 1e7), round(longitude_deg * 1e7), height_m)
        changes_mode = mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        self.results.pop(number, None)
        self.send(
            mavlink.MAVLink_command_int_message(
                self.system_id, 1, frame, number, 0, 0, -1, changes_mode, 0, 0, *place
            )
        )

    def _hear(self, data: bytes) -> None:
        for message in self._parser.parse_buffer(data) or []:
            if message.get_srcSystem() == self.system_id:
                self._take(message, self.now())

    def _take(self, message: MAVLink_message, arrival_s: float) -> None:
        super()._take(message, arrival_s)
        kind = message.get_type()
        self.heard[message.get_srcComponent(), kind] += 1
        if kind == "NAMED_VALUE_FLOAT":
            self.values[message.name] = message.value
        elif kind == "MISSION_COUNT":
            self.plans.add(message.mission_type)
