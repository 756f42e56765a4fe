"""Messages by which a companion shows itself to autopilot and ground stations."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

INFO: int = mavlink.MAV_SEVERITY_INFO
NOTICE: int = mavlink.MAV_SEVERITY_NOTICE
WARNING: int = mavlink.MAV_SEVERITY_WARNING

CHUNK = 50
"""Characters in one STATUSTEXT."""

MOST_CHUNKS = 6
"""Longer texts are cut: a telemetry radio carries a few hundred bytes a second."""


def status_texts(text: str, severity: int, number: int) -> list[MAVLink_message]:
    """STATUSTEXT, for ground stations that listen to the vehicle: as many as the text needs.

    Args:
        text: whatever is not ASCII becomes a question mark.
        severity: MAV_SEVERITY.
        number: of this text, 1 to 65535, by which ground stations join the parts of a long one.
    """
    content = text.encode("ascii", "replace")
    if len(content) <= CHUNK:
        return [mavlink.MAVLink_statustext_message(severity, content)]
    content = content[: MOST_CHUNKS * CHUNK - 1]
    # The end is known by a part that is not full: a text that fills its last one is followed by an empty one.
    starts = range(0, len(content) + 1, CHUNK)
    return [
        mavlink.MAVLink_statustext_message(severity, content[start : start + CHUNK], number, chunk)
        for chunk, start in enumerate(starts)
    ]


def named_value(name: str, value: float, time_s: float) -> MAVLink_message:
    """NAMED_VALUE_FLOAT: a number that ground stations plot by its name.

    Args:
        name: at most 10 ASCII characters.
        value: finite.
        time_s: when it was true, on the sender's clock; the field turns over after 49 days.
    """
    return mavlink.MAVLink_named_value_float_message(
        round(time_s * 1e3) % 2**32, name.encode("ascii"), value
    )


def time_question(stamp: int) -> MAVLink_message:
    """TIMESYNC that asks for the autopilot's time; the stamp (ns) comes back with the answer."""
    return mavlink.MAVLink_timesync_message(0, stamp)


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


def ground_station_heartbeat() -> MAVLink_message:
    """HEARTBEAT of a ground station: the only one whose end is an event for some autopilots."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )
