"""MAVSDK 4, as its users write it, against the emulator with PX4's manners."""

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, TypeVar

import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, PositionNedYaw, VelocityNedYaw
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import FlightMode, TelemetryAsync

from tests.kit.sockets import PATIENCE_S

T = TypeVar("T")


@asynccontextmanager
async def connected(port: int) -> AsyncIterator[System]:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        yield await mavsdk.first_autopilot(timeout_s=PATIENCE_S)


async def first(stream: AsyncIterator[T], holds: Callable[[T], bool] = bool) -> T:
    """The first value of a stream of which something holds."""
    async with asyncio.timeout(PATIENCE_S):
        async for value in stream:
            if holds(value):
                return value
    raise AssertionError("the stream has ended")


def anything(_value: object) -> bool:
    return True


async def test_it_reads_position_velocity_heading_and_parameters(emulate):
    options = ("--autopilot", "px4", "--airborne", "--wind", "steady:5,90")
    async with emulate(*options) as emulation, connected(emulation.port) as system:
        telemetry = TelemetryAsync(system)
        position = await first(telemetry.subscribe_position(), anything)
        assert position.latitude_deg == pytest.approx(47.3977, abs=0.01)
        assert position.relative_altitude_m == pytest.approx(100.0, abs=1.0)
        await telemetry.set_rate_velocity_ned(10.0)
        velocity = await first(telemetry.subscribe_velocity_ned(), anything)
        assert 14.0 < math.hypot(velocity.north_m_s, velocity.east_m_s) < 26.0
        heading = await first(telemetry.subscribe_heading(), anything)
        assert 0.0 <= heading.heading_deg < 360.0
        assert await first(telemetry.subscribe_in_air(), anything)
        parameters = ParamAsync(system)
        assert await parameters.get_param_float("FW_AIRSPD_MAX") == pytest.approx(32.0)
        assert await parameters.get_param_int("COM_OBL_RC_ACT") == 0
        everything = await parameters.get_all_params()
        assert {"FW_AIRSPD_MIN", "COM_OF_LOSS_T"} <= {one.name for one in everything.float_params}
        version = await InfoAsync(system).get_version()
        assert version.flight_sw_major == 1
        assert await MissionRawAsync(system).download_mission() == []


async def test_it_arms_takes_off_and_finds_the_aircraft_in_a_loiter(emulate):
    options = ("--autopilot", "px4", "--speedup", "10", "--ready-after", "2")
    async with emulate(*options) as emulation, connected(emulation.port) as system:
        telemetry, action = TelemetryAsync(system), ActionAsync(system)
        await first(telemetry.subscribe_health_all_ok())
        assert not await first(telemetry.subscribe_in_air(), anything)
        await action.arm()
        await action.takeoff()
        await first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD)
        state = await emulation.until(lambda state: state["mode"] == "AUTO.LOITER")
        assert state["altitude_amsl_m"] > 588.0 + 45.0
        assert state["armed"]


@pytest.mark.parametrize("version", ["1.14", "1.18"])
async def test_offboard_positions_and_the_velocities_of_1_14_are_obeyed_and_their_end_is_noticed(
    emulate, version
):
    options = ("--autopilot", "px4", "--airborne", "--speedup", "2", "--wind", "steady:5,90")
    options += ("--autopilot-version", version)
    async with emulate(*options) as emulation, connected(emulation.port) as system:
        offboard = OffboardAsync(system)
        if version == "1.14":
            await offboard.set_velocity_ned(VelocityNedYaw(-10.0, 10.0, 0.0, 135.0))
        else:
            # So far away that the bearing stays what it is.
            far = PositionNedYaw(-50_000.0, 50_000.0, -100.0, 135.0)
            await offboard.set_position_ned(far)
        await offboard.start()

        def flies_south_east(state: dict[str, Any]) -> bool:
            error = math.remainder(state["course_rad"] - math.radians(135.0), math.tau)
            return state["mode"] == "OFFBOARD" and abs(error) < math.radians(0.5)

        await emulation.until(flies_south_east)
        await offboard.stop()
        await emulation.until(lambda state: state["mode"] == "AUTO.LOITER")
