"""Frames as an autopilot would send them, and an emulated autopilot to obey what is sent."""

from collections.abc import Callable
from typing import Literal

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, AutopilotConfig, CalmWind, PlantParameters
from vfguide.mavlink.adapter import Px4Steering, Vehicle
from vfguide.mavlink.codec import Codec
from vfguide.state import Hold

SYSTEM_ID, COMPONENT_ID = 7, 1

Framing = Callable[..., bytes]


@pytest.fixture
def codec() -> Codec:
    """Listens to system 7, component 1."""
    return Codec(SYSTEM_ID, COMPONENT_ID)


@pytest.fixture(scope="session")
def frame() -> Framing:
    """Packs a message as its sender would."""

    def pack(
        message: MAVLink_message,
        *,
        system_id: int = SYSTEM_ID,
        component_id: int = COMPONENT_ID,
        version_1: bool = False,
    ) -> bytes:
        sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        return bytes(message.pack(sender, force_mavlink1=version_1))

    return pack


@pytest.fixture(scope="session")
def position() -> Callable[..., MAVLink_message]:
    """GLOBAL_POSITION_INT with whatever is of interest in it."""

    def make(
        *,
        lat: int = 473_977_420,
        lon: int = 85_455_940,
        vx: int = 0,
        vy: int = 0,
        hdg: int = 0,
        time_boot_ms: int = 1000,
        alt: int = 588_000,
    ) -> MAVLink_message:
        return mavlink.MAVLink_global_position_int_message(
            time_boot_ms, lat, lon, alt, 100_000, vx, vy, 0, hdg
        )

    return make


@pytest.fixture(scope="session")
def parsed() -> Callable[[bytes], list[MAVLink_message]]:
    """Messages in bytes, by a parser that has nothing to do with the code under test."""

    def parse(data: bytes) -> list[MAVLink_message]:
        return mavlink.MAVLink(None).parse_buffer(data) or []

    return parse


@pytest.fixture(scope="session")
def address() -> Callable[..., Vehicle]:
    """System 7, component 3, 45 degrees of bank: an address that a default would not hit."""

    def make(
        hold: Hold = "heading-hold",
        *,
        component_id: int = 3,
        px4_steering: Px4Steering = "guided-course",
    ) -> Vehicle:
        return Vehicle(
            system_id=SYSTEM_ID,
            component_id=component_id,
            hold=hold,
            lateral_acceleration=9.80665,
            px4_steering=px4_steering,
        )

    return make


class Flown:
    """An emulated aircraft, 20 m/s northbound at 500 m, and what it answers."""

    def __init__(
        self,
        kind: Literal["ardupilot", "px4"],
        plant: Hold,
        version: tuple[int, int] | None = None,
    ) -> None:
        config = AutopilotConfig(
            system_id=SYSTEM_ID,
            autopilot=kind,
            autopilot_version=version,
            plant=PlantParameters(kind=plant),
            latitude_deg=47.0,
            longitude_deg=8.0,
            altitude_amsl_m=500.0,
            home_altitude_amsl_m=400.0,
            course_rad=0.0,
            airspeed_m_s=20.0,
        )
        self.autopilot = Autopilot(config, CalmWind())
        self._codec = Codec(SYSTEM_ID, COMPONENT_ID)
        self._now = 0.0

    def obey(self, messages: list[MAVLink_message]) -> list[tuple[int, str]]:
        """Send messages; returns (command, result) of each acknowledgement."""
        replies = self.autopilot.receive(self._codec.encode(messages))
        return [
            (
                reply.command,
                mavlink.enums["MAV_RESULT"][reply.result].name.removeprefix("MAV_RESULT_"),
            )
            for reply in mavlink.MAVLink(None).parse_buffer(replies) or []
            if reply.get_type() == "COMMAND_ACK"
        ]

    def stream(self, messages: Callable[[], list[MAVLink_message]], duration_s: float) -> None:
        """Repeat messages at 10 Hz while the aircraft flies on."""
        for _ in range(round(duration_s * 10)):
            self.obey(messages())
            self._now += 0.1
            self.autopilot.advance(self._now)


@pytest.fixture
def flown() -> Callable[..., Flown]:
    """Makes an emulated aircraft."""

    def make(
        kind: Literal["ardupilot", "px4"],
        plant: Hold = "heading-hold",
        *,
        version: tuple[int, int] | None = None,
    ) -> Flown:
        return Flown(kind, plant, version)

    return make
