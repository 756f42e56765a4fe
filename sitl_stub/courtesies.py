"""Small messages that are answered whatever the aircraft does."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

LONGEST_TEXT = 50


def timesync_reply(message: MAVLink_message, boot_ns: int) -> list[MAVLink_message]:
    """A request has no time of the other side's: it comes back with this side's, in nanoseconds."""
    if message.tc1 != 0:
        return []
    return [mavlink.MAVLink_timesync_message(boot_ns, message.ts1)]


def ping_reply(message: MAVLink_message) -> list[MAVLink_message]:
    """A request is addressed to nobody: it comes back to who sent it."""
    if message.target_system or message.target_component:
        return []
    to = (message.get_srcSystem(), message.get_srcComponent())
    return [mavlink.MAVLink_ping_message(message.time_usec, message.seq, *to)]


def status_text(text: str) -> MAVLink_message:
    """A STATUSTEXT of severity INFO."""
    content = text.encode("ascii")[:LONGEST_TEXT]
    return mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_INFO, content)
