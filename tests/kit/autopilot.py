"""Emulated autopilots in the air, and a ground station that talks to one in MAVLink bytes."""

import math
from collections.abc import Callable, Coroutine
from typing import Any, Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, AutopilotConfig, CalmWind, PlantParameters, Truth, Wind
from sitl_stub.links import Address, parse_address
from sitl_stub.server import serve_all
from sitl_stub.settings import Settings
from tests.kit.wire import command_long, parsed, result_name
from vfguide.mavlink.adapter import AutopilotSetpoint, Px4Steering, Vehicle
from vfguide.mavlink.codec import Codec
from vfguide.state import Hold

LATITUDE_DEG, LONGITUDE_DEG = 47.0, 8.0
ALTITUDE_M, HOME_ALTITUDE_M = 500.0, 400.0

Kind = Literal["ardupilot", "px4"]

REAL32 = mavlink.MAV_PARAM_TYPE_REAL32


def config_of(**changes: Any) -> AutopilotConfig:
    """Configure system 7: 20 m/s, northbound, in the air over 47 N 8 E, but for what is given."""
    fields: dict[str, Any] = {
        "system_id": 7,
        "plant": PlantParameters(),
        "latitude_deg": LATITUDE_DEG,
        "longitude_deg": LONGITUDE_DEG,
        "altitude_amsl_m": ALTITUDE_M,
        "home_altitude_amsl_m": HOME_ALTITUDE_M,
        "course_rad": 0.0,
        "airspeed_m_s": 20.0,
    }
    return AutopilotConfig(**(fields | changes))


def new_autopilot(wind: Wind | None = None, **changes: Any) -> Autopilot:
    """Make an autopilot that has just booted, in calm air if nothing is said."""
    return Autopilot(config_of(**changes), wind or CalmWind())


class GroundStation:
    """Encodes what it sends, decodes what comes back, and moves simulation time."""

    def __init__(self, autopilot: Autopilot, system_id: int = 7) -> None:
        self.autopilot = autopilot
        self.system_id = system_id
        self._link = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser = mavlink.MAVLink(None)

    def frame(self, message: MAVLink_message) -> bytes:
        return bytes(message.pack(self._link))

    def send(self, message: MAVLink_message) -> list[MAVLink_message]:
        return self.decoded(self.autopilot.receive(self.frame(message)))

    def decoded(self, data: bytes) -> list[MAVLink_message]:
        return self._parser.parse_buffer(data) or []

    def advance(self, to_s: float) -> list[MAVLink_message]:
        return self.decoded(self.autopilot.advance(to_s))

    def command_long(
        self, command: int, *parameters: float, target: int | None = None
    ) -> list[MAVLink_message]:
        system_id = self.system_id if target is None else target
        return self.send(command_long(command, *parameters, system_id=system_id))

    def command_int(
        self, command: int, *parameters: float, frame: int = 3, z: float = 0.0
    ) -> list[MAVLink_message]:
        padded = (*parameters, *(0.0,) * (4 - len(parameters)))
        return self.send(
            mavlink.MAVLink_command_int_message(
                self.system_id, 1, frame, command, 0, 0, *padded, 0, 0, z
            )
        )

    def obey(self, messages: list[MAVLink_message]) -> list[tuple[int, str]]:
        """Send a companion's messages; return (command, result) of each acknowledgement."""
        replies = self.decoded(self.autopilot.receive(Codec(7, 1).encode(messages)))
        acks = (reply for reply in replies if reply.get_type() == "COMMAND_ACK")
        return [(ack.command, result_name(ack.result)) for ack in acks]

    def result(self, replies: list[MAVLink_message]) -> str:
        """Return the MAV_RESULT of the one acknowledgement among the replies."""
        (ack,) = (reply for reply in replies if reply.get_type() == "COMMAND_ACK")
        return result_name(ack.result)

    @property
    def truth(self) -> Truth:
        """Where the aircraft is, and how it flies."""
        return self.autopilot.truth()

    def flown(self, to_s: float) -> Truth:
        """Fly on until a time; return how it flies then."""
        self.advance(to_s)
        return self.truth

    def guided(self) -> "GroundStation":
        """Select ArduPlane's GUIDED."""
        assert self.result(self.command_long(176, 1, 15)) == "ACCEPTED"
        return self

    def read(self, name: str) -> MAVLink_message:
        """Return the answer about a parameter."""
        (value,) = self.send(mavlink.MAVLink_param_request_read_message(7, 1, name.encode(), -1))
        return value

    def write(self, name: str, value: float, kind: int = REAL32) -> list[MAVLink_message]:
        return self.send(mavlink.MAVLink_param_set_message(7, 1, name.encode(), value, kind))

    def interval(self, message_id: int, interval_us: float) -> str:
        return self.result(self.command_long(511, message_id, interval_us))

    def position_setpoint(
        self, north_m: float, east_m: float, *, z: float = -100.0, mask: int = 0xDF8
    ) -> list[MAVLink_message]:
        return self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, self.system_id, 1, 1, mask, north_m, east_m, z, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )

    def velocity_setpoint(
        self, north_m_s: float, east_m_s: float, *, z: float = 0.0, mask: int = 3527
    ) -> list[MAVLink_message]:
        return self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, self.system_id, 1, 1, mask, 0, 0, z, north_m_s, east_m_s, 0, 0, 0, 0, 0, 0
            )
        )


def new_station(
    wind: Wind | None = None,
    *,
    autopilot: Kind = "ardupilot",
    version: tuple[int, int] | None = None,
    course_rad: float = 0.0,
    plant: PlantParameters | None = None,
    **changes: Any,
) -> GroundStation:
    """Make a ground station with its aircraft."""
    vehicle = new_autopilot(
        wind,
        autopilot=autopilot,
        autopilot_version=version,
        course_rad=course_rad % math.tau,
        plant=plant or PlantParameters(),
        **changes,
    )
    return GroundStation(vehicle)


def asked(course: float, speed: float) -> AutopilotSetpoint:
    """Ask for a course and a speed over 47 N 8 E, at 588 m."""
    return AutopilotSetpoint(
        course=course, speed=speed, altitude_amsl=588.0, latitude_deg=47.0, longitude_deg=8.0
    )


def address(
    hold: Hold = "heading-hold",
    *,
    component_id: int = 3,
    px4_steering: Px4Steering = "guided-course",
) -> Vehicle:
    """Name system 7, component 3, 45 degrees of bank: an address that a default would not hit."""
    return Vehicle(
        system_id=7,
        component_id=component_id,
        hold=hold,
        lateral_acceleration=9.80665,
        px4_steering=px4_steering,
    )


def sent(messages: list[MAVLink_message]) -> list[MAVLink_message]:
    """Return a companion's messages as the other side reads them."""
    return parsed(Codec(7, 3).encode(messages))


def serve(
    autopilot: Autopilot,
    url: str = "udpin://127.0.0.1:0",
    *,
    on_open: Callable[[Address], None] | None = None,
    **options: Any,
) -> Coroutine[None, None, None]:
    """Serve an autopilot that has not flown yet, with options of `sitl-stub` by their fields."""
    say = None if on_open is None else (lambda _autopilot, opened: on_open(opened))
    settings = Settings.of({"system_id": autopilot.system_id, **options})
    return serve_all([(autopilot, parse_address(url))], settings, on_open=say)
