"""MAVLink as bytes, packed and parsed by pymavlink alone."""

from itertools import pairwise

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message


def packed(
    *messages: MAVLink_message,
    system_id: int = 255,
    component_id: int = 190,
    version_1: bool = False,
) -> bytes:
    """Pack messages as their sender would; a ground station, if nothing is said."""
    sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
    return b"".join(bytes(one.pack(sender, force_mavlink1=version_1)) for one in messages)


def signing_sender(
    key: bytes | None,
    at_s: float,
    *,
    system_id: int = 255,
    component_id: int = 190,
    link_id: int = 0,
) -> mavlink.MAVLink:
    """Make pymavlink's own encoder, which signs with a key from a time on, s since 1970."""
    sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
    if key is not None:
        sender.signing.secret_key, sender.signing.sign_outgoing = key, True
        sender.signing.link_id = link_id
        sender.signing.timestamp = signing_ticks(at_s)
    return sender


def signing_ticks(at_s: float) -> int:
    """Return a time in units of 10 us since 2015, as signatures tell it."""
    return round((at_s - 1_420_070_400.0) * 1e5)


def framed(
    message: MAVLink_message, *, system_id: int = 7, component_id: int = 1, version_1: bool = False
) -> bytes:
    """Pack a message of an autopilot, system 7 if nothing is said."""
    return packed(message, system_id=system_id, component_id=component_id, version_1=version_1)


def frame_of(
    number: int,
    payload: bytes,
    crc_extra: int | None = None,
    *,
    system_id: int = 7,
    component_id: int = 1,
) -> bytes:
    """Make a frame of MAVLink 2 around any payload, with the checksum of its message."""
    extra = mavlink.mavlink_map[number].crc_extra if crc_extra is None else crc_extra
    header = bytes([len(payload), 0, 0, 0, system_id, component_id]) + number.to_bytes(3, "little")
    checksum = mavlink.x25crc(header + payload + bytes([extra])).crc
    return b"\xfd" + header + payload + checksum.to_bytes(2, "little")


def spoken(*messages: MAVLink_message) -> bytes:
    """Pack messages as the autopilot of f1 sends them."""
    return packed(*messages, system_id=2, component_id=1)


def beat(system_id: int = 1) -> bytes:
    """Pack a heartbeat of some system's autopilot."""
    message = mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
    return packed(message, system_id=system_id, component_id=1)


def heartbeat(
    mode: int = 15, *, status: int = 4, armed: bool = True, autopilot: int = 3
) -> MAVLink_message:
    """Make a heartbeat of a fixed wing: in GUIDED of ArduPlane, in the air, if nothing is said."""
    return mavlink.MAVLink_heartbeat_message(1, autopilot, 1 | armed << 7, mode, status, 3)


def parsed(data: bytes) -> list[MAVLink_message]:
    """Return the messages in bytes."""
    return mavlink.MAVLink(None).parse_buffer(data) or []


def of_type(messages: list[MAVLink_message], name: str) -> list[MAVLink_message]:
    """Return the messages of one type."""
    return [one for one in messages if one.get_type() == name]


def types_of(messages: list[MAVLink_message]) -> list[str]:
    """Return the type of each message."""
    return [one.get_type() for one in messages]


def cut(stream: bytes, places: list[int]) -> list[bytes]:
    """Cut a stream into pieces at places, which count on from its beginning beyond its end."""
    edges = [0, *sorted(place % (len(stream) + 1) for place in places), len(stream)]
    return [stream[start:end] for start, end in pairwise(edges)]


def command_long(
    number: int, *parameters: float, system_id: int = 0, component_id: int = 1
) -> MAVLink_message:
    """Make a COMMAND_LONG; parameters that are not given are 0."""
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(system_id, component_id, number, 0, *padded)


def number_of(message: MAVLink_message) -> int | str:
    """Return the number of a command, the name of any other message."""
    if message.get_type() in {"COMMAND_INT", "COMMAND_LONG"}:
        return int(message.command)
    return str(message.get_type())


def result_name(number: int) -> str:
    """Return the name of a MAV_RESULT."""
    return str(mavlink.enums["MAV_RESULT"][number].name).removeprefix("MAV_RESULT_")


def position_report(
    *,
    lat: int = 473_977_420,
    lon: int = 85_455_940,
    vx: int = 0,
    vy: int = 0,
    hdg: int = 0,
    time_boot_ms: int = 1000,
    alt: int = 588_000,
) -> MAVLink_message:
    """Make a GLOBAL_POSITION_INT with whatever is of interest in it."""
    return mavlink.MAVLink_global_position_int_message(
        time_boot_ms, lat, lon, alt, 100_000, vx, vy, 0, hdg
    )


def northbound(time_s: float) -> MAVLink_message:
    """Make the position of an aircraft that flies north from the origin of line-calm at 20 m/s."""
    # 89.93 degE7 to the metre.
    latitude = 473_977_420 + round(20.0 * 89.93 * time_s)
    return position_report(lat=latitude, vx=2000, time_boot_ms=round(time_s * 1e3))


def flown_position(
    time_s: float, place: tuple[float, float], *, north_m_s: float, altitude_m: float = 588.0
) -> MAVLink_message:
    """Make the GLOBAL_POSITION_INT of a vehicle that flies north, by the time since its boot."""
    latitude, longitude = (round(angle * 1e7) for angle in place)
    return position_report(
        lat=latitude,
        lon=longitude,
        vx=round(100 * north_m_s),
        time_boot_ms=round(1e3 * time_s),
        alt=round(1e3 * altitude_m),
    )
