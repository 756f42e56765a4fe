"""Messages by which a companion shows itself to autopilot and ground stations."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message


def status_text(text: str) -> MAVLink_message:
    """STATUSTEXT, for ground stations that listen to the vehicle; longer than 50 characters is cut."""
    return mavlink.MAVLink_statustext_message(
        mavlink.MAV_SEVERITY_NOTICE, text.encode("ascii", "replace")[:50]
    )


def heartbeat() -> MAVLink_message:
    """HEARTBEAT of an onboard computer."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )
