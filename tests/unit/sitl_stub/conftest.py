"""A ground station that talks to one emulated autopilot in MAVLink bytes."""

import math
from collections.abc import Callable
from typing import Literal

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, AutopilotConfig, CalmWind, PlantParameters, Wind

LATITUDE_DEG, LONGITUDE_DEG = 47.0, 8.0
ALTITUDE_M, HOME_ALTITUDE_M = 500.0, 400.0


class GroundStation:
    """Encodes what it sends, decodes what comes back, and moves simulation time."""

    def __init__(self, autopilot: Autopilot, system_id: int) -> None:
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
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        system_id = self.system_id if target is None else target
        return self.send(mavlink.MAVLink_command_long_message(system_id, 1, command, 0, *padded))

    def command_int(
        self, command: int, *parameters: float, frame: int = 3, z: float = 0.0
    ) -> list[MAVLink_message]:
        padded = (*parameters, *(0.0,) * (4 - len(parameters)))
        return self.send(
            mavlink.MAVLink_command_int_message(
                self.system_id, 1, frame, command, 0, 0, *padded, 0, 0, z
            )
        )

    def result(self, replies: list[MAVLink_message]) -> str:
        """The MAV_RESULT of the one acknowledgement among the replies."""
        (ack,) = (reply for reply in replies if reply.get_type() == "COMMAND_ACK")
        name: str = mavlink.enums["MAV_RESULT"][ack.result].name
        return name.removeprefix("MAV_RESULT_")

    def guided(self) -> None:
        assert self.result(self.command_long(176, 1, 15)) == "ACCEPTED"

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


StationFactory = Callable[..., GroundStation]


@pytest.fixture
def ground_station() -> Callable[[Autopilot, int], GroundStation]:
    """Makes a ground station for an autopilot with this system id."""
    return GroundStation


@pytest.fixture
def station() -> StationFactory:
    """Makes a ground station with its aircraft: 20 m/s, northbound, in the air over 47 N 8 E."""

    def make(
        wind: Wind | None = None,
        *,
        autopilot: Literal["ardupilot", "px4"] = "ardupilot",
        version: tuple[int, int] | None = None,
        plant: PlantParameters | None = None,
        position_noise_m: float = 0.0,
        seed: int = 0,
        boot_time_s: float = 0.0,
        course_rad: float = 0.0,
    ) -> GroundStation:
        config = AutopilotConfig(
            system_id=7,
            autopilot=autopilot,
            autopilot_version=version,
            plant=plant or PlantParameters(),
            latitude_deg=LATITUDE_DEG,
            longitude_deg=LONGITUDE_DEG,
            altitude_amsl_m=ALTITUDE_M,
            home_altitude_amsl_m=HOME_ALTITUDE_M,
            course_rad=course_rad % math.tau,
            airspeed_m_s=20.0,
            position_noise_m=position_noise_m,
            seed=seed,
            boot_time_s=boot_time_s,
        )
        return GroundStation(Autopilot(config, wind or CalmWind()), config.system_id)

    return make
