"""The mission protocol of an autopilot that has no mission, no fence and no rally points."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message


def mission_reply(message: MAVLink_message) -> list[MAVLink_message]:
    """Empty lists to who asks, of missions, fences and rally points alike; no room for who brings one."""
    to = (message.get_srcSystem(), message.get_srcComponent())
    kind = message.mission_type
    name = message.get_type()
    if name == "MISSION_REQUEST_LIST":
        return [mavlink.MAVLink_mission_count_message(*to, 0, kind)]
    if name == "MISSION_CLEAR_ALL" or (name == "MISSION_COUNT" and message.count == 0):
        result = mavlink.MAV_MISSION_ACCEPTED
    elif name == "MISSION_COUNT":
        result = mavlink.MAV_MISSION_NO_SPACE
    else:
        result = mavlink.MAV_MISSION_INVALID_SEQUENCE
    return [mavlink.MAVLink_mission_ack_message(*to, result, kind)]


MISSION_MESSAGES = (
    "MISSION_REQUEST_LIST",
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_COUNT",
    "MISSION_CLEAR_ALL",
)
"""What `mission_reply` answers."""
