import math
import struct
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import PlantParameters, SteadyWind, Wind
from tests.kit.autopilot import GroundStation, new_station
from tests.kit.wire import of_type

Version = tuple[int, int]

OFFBOARD, GUIDED_COURSE, LOITER = (176, 1, 6), (176, 1, 4, 19), (176, 1, 4, 3)
STEERED = (1, 14)
"""The last version that flies the course of a velocity."""

UNSUPPORTED, NON_FINITE = "unsupported setpoint", "non-finite field"
REJECTED = "TEMPORARILY_REJECTED"

EAST_M = 50_000.0
"""So far away that the bearing stays what it is."""


def offboard(vehicle: GroundStation, north_m_s: float = 0.0, east_m_s: float = 20.0) -> None:
    vehicle.velocity_setpoint(north_m_s, east_m_s)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "ACCEPTED"


def fly(vehicle: GroundStation, to_s: float, setpoint: Callable[[], object]) -> None:
    """Stream a setpoint at 10 Hz until `to_s`."""
    start = round(vehicle.truth.time_s * 10.0)
    for tenth in range(start, round(to_s * 10.0)):
        setpoint()
        vehicle.advance((tenth + 1) / 10.0)


def course_deg(vehicle: GroundStation) -> float:
    return math.degrees(vehicle.truth.course_rad)


def guided_course(wind: Wind | None = None, **changes: object) -> GroundStation:
    """A PX4 in Guided Course."""
    vehicle = new_station(wind, autopilot="px4", **changes)
    assert vehicle.result(vehicle.command_long(*GUIDED_COURSE)) == "ACCEPTED"
    return vehicle


def global_position(vehicle: GroundStation, frame: int, altitude_m: float) -> None:
    """Half a degree of longitude further east, where the parallel's bearing is 89.8 degrees."""
    vehicle.send(
        mavlink.MAVLink_set_position_target_global_int_message(
            0, 7, 1, frame, 0xDF8, 470_000_000, 85_000_000, altitude_m, *(0,) * 8
        )
    )


def set_whole(vehicle: GroundStation, name: str, value: int) -> None:
    (same_bytes,) = struct.unpack("<f", struct.pack("<i", value))
    assert vehicle.write(name, same_bytes, 6)[0].get_type() == "PARAM_VALUE"


def ground_station_speaks(vehicle: GroundStation, kind: int = mavlink.MAV_TYPE_GCS) -> None:
    vehicle.send(mavlink.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3))


@pytest.mark.parametrize(
    ("version", "number"),
    [(None, 0x0112_0080), ((1, 18), 0x0112_0080), ((1, 16), 0x0110_00FF), ((1, 14), 0x010E_00FF)],
)
def test_it_tells_the_version_whose_manners_it_has(version, number):
    told = new_station(autopilot="px4", version=version).command_long(512, 148)[-1]
    assert told.flight_sw_version == number
    assert told.capabilities == 59_647


@pytest.mark.parametrize("version", [(1, 13), (2, 0), (4, 7)])
def test_versions_that_are_not_known_are_no_configuration(version):
    with pytest.raises(ValueError, match=r"1\.14, 1\.15, 1\.16, 1\.17, 1\.18"):
        new_station(autopilot="px4", version=version)


@pytest.mark.parametrize("setpoint", ["velocity_setpoint", "position_setpoint"])
def test_offboard_needs_a_setpoint_within_half_a_second(setpoint):
    vehicle = new_station(autopilot="px4")
    getattr(vehicle, setpoint)(20.0, 0.0)
    vehicle.advance(0.6)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == REJECTED
    getattr(vehicle, setpoint)(20.0, 0.0)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "ACCEPTED"
    assert vehicle.truth.mode == "OFFBOARD"


def test_the_course_of_a_velocity_is_flown_by_1_14_and_its_length_is_ignored():
    vehicle = new_station(SteadyWind(5.0, 0.0), autopilot="px4", version=STEERED)
    offboard(vehicle)
    fly(vehicle, 15.0, lambda: vehicle.velocity_setpoint(0.0, 35.0))
    assert course_deg(vehicle) == pytest.approx(90.0, abs=1e-2)
    assert vehicle.truth.airspeed_m_s == pytest.approx(20.0)
    # The zero vector keeps the stream alive and the course as it was.
    before = course_deg(vehicle)
    fly(vehicle, 20.0, lambda: vehicle.velocity_setpoint(0.0, 0.0))
    assert vehicle.truth.mode == "OFFBOARD"
    assert course_deg(vehicle) == pytest.approx(before, abs=1e-3)


@pytest.mark.parametrize("version", [(1, 17), (1, 18)])
def test_a_velocity_alone_is_accepted_and_keeps_the_course_from_1_17_on(version):
    vehicle = new_station(SteadyWind(5.0, 1.0), autopilot="px4", version=version, course_rad=1.0)
    vehicle.advance(5.0)
    offboard(vehicle)
    before = course_deg(vehicle)
    fly(vehicle, 15.0, lambda: vehicle.velocity_setpoint(0.0, -20.0, z=-200.0, mask=3523))
    assert vehicle.truth.mode == "OFFBOARD"
    assert course_deg(vehicle) == pytest.approx(before, abs=0.1)
    assert vehicle.truth.altitude_amsl_m == 500.0


@pytest.mark.parametrize("version", [(1, 15), (1, 16)])
def test_a_velocity_alone_keeps_the_bank_of_the_moment_on_1_15_and_1_16(version):
    vehicle = new_station(autopilot="px4", version=version)
    vehicle.advance(5.0)
    circling = vehicle.truth.bank_rad
    assert abs(circling) > 0.1
    offboard(vehicle)
    fly(vehicle, 15.0, lambda: vehicle.velocity_setpoint(0.0, 20.0))
    assert vehicle.truth.bank_rad == pytest.approx(circling, abs=1e-3)


@pytest.mark.parametrize("version", [(1, 14), (1, 16), (1, 18)])
def test_a_position_is_flown_to_at_its_height_by_every_version(version):
    vehicle = new_station(SteadyWind(5.0, 0.0), autopilot="px4", version=version)
    vehicle.position_setpoint(0.0, EAST_M)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "ACCEPTED"
    fly(vehicle, 40.0, lambda: vehicle.position_setpoint(0.0, EAST_M, z=-120.0))
    assert course_deg(vehicle) == pytest.approx(90.0, abs=0.5)
    assert vehicle.truth.altitude_amsl_m == pytest.approx(520.0, abs=1e-3)


@pytest.mark.parametrize(("frame", "altitude_m"), [(5, 510.0), (6, 110.0)])
def test_a_global_position_carries_course_and_height(frame, altitude_m):
    vehicle = new_station(autopilot="px4")
    global_position(vehicle, frame, altitude_m)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "ACCEPTED"
    fly(vehicle, 40.0, lambda: global_position(vehicle, frame, altitude_m))
    assert vehicle.truth.altitude_amsl_m == pytest.approx(510.0, abs=1e-3)
    assert course_deg(vehicle) == pytest.approx(90.0, abs=0.5)


@pytest.mark.parametrize(
    ("setpoint", "counter"),
    [
        # Frames of an older MAVLink, and masks that are neither position nor velocity.
        *(
            (lambda one, frame=frame: global_position(one, frame, 510.0), UNSUPPORTED)
            for frame in (0, 3)
        ),
        *(
            (lambda one, mask=mask: one.velocity_setpoint(20.0, 0.0, mask=mask), UNSUPPORTED)
            for mask in (3527 & ~1, 3527 | 8, 3527 & ~64)
        ),
        (lambda one: one.velocity_setpoint(math.nan, 0.0), NON_FINITE),
        (lambda one: one.velocity_setpoint(20.0, 0.0, z=math.inf, mask=3523), NON_FINITE),
        (lambda one: one.position_setpoint(math.nan, 0.0), NON_FINITE),
    ],
)
def test_what_is_no_setpoint_is_counted_and_does_not_feed_the_stream(setpoint, counter):
    vehicle = new_station(autopilot="px4")
    setpoint(vehicle)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == REJECTED
    assert vehicle.autopilot.counters[counter] == 1


def test_each_position_sets_the_airspeed_back_to_the_autopilot_s_own():
    vehicle = new_station(autopilot="px4")

    def both() -> None:
        vehicle.position_setpoint(EAST_M, 0.0)
        vehicle.command_long(178, 0, 24.0, -1)

    vehicle.position_setpoint(EAST_M, 0.0)
    vehicle.command_long(*OFFBOARD)
    fly(vehicle, 15.0, both)
    assert vehicle.truth.airspeed_m_s == pytest.approx(24.0, abs=1e-3)
    fly(vehicle, 30.0, lambda: vehicle.position_setpoint(EAST_M, 0.0))
    assert vehicle.truth.airspeed_m_s == pytest.approx(20.0, abs=1e-3)


def test_position_and_velocity_together_steer_but_take_no_airspeed():
    vehicle = new_station(autopilot="px4")

    def both() -> None:
        vehicle.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 7, 1, 1, 0xDC0, 0, EAST_M, -100, 0, 20, 0, 0, 0, 0, 0, 0
            )
        )
        vehicle.command_long(178, 0, 24.0, -1)

    both()
    vehicle.command_long(*OFFBOARD)
    assert vehicle.result(vehicle.command_long(178, 0, 24.0, -1)) == "ACCEPTED"
    fly(vehicle, 15.0, both)
    assert course_deg(vehicle) == pytest.approx(90.0, abs=1e-2)
    assert vehicle.truth.airspeed_m_s == pytest.approx(20.0, abs=1e-3)


@pytest.mark.parametrize(
    ("patience_s", "action", "mode"),
    [(1.0, 0, "AUTO.RTL"), (1.0, 3, "AUTO.RTL"), (1.0, 5, "AUTO.LOITER"), (3.0, 5, "AUTO.LOITER")],
)
def test_a_lost_stream_leaves_offboard_0_7_seconds_after_its_patience(patience_s, action, mode):
    vehicle = new_station(autopilot="px4")
    vehicle.write("COM_OF_LOSS_T", patience_s)
    set_whole(vehicle, "COM_OBL_RC_ACT", action)
    offboard(vehicle)
    assert vehicle.flown(patience_s + 0.65).mode == "OFFBOARD"
    assert vehicle.flown(patience_s + 0.75).mode == mode


def test_a_mode_that_is_refused_ends_no_fail_safe():
    vehicle = new_station(autopilot="px4")
    offboard(vehicle)
    vehicle.advance(5.0)
    assert vehicle.command_long(512, 0)[-1].system_status == mavlink.MAV_STATE_CRITICAL
    assert vehicle.result(vehicle.command_long(176, 1, 6)) == REJECTED
    assert vehicle.command_long(512, 0)[-1].system_status == mavlink.MAV_STATE_CRITICAL


def test_a_reboot_in_the_air_forgets_the_stream_of_setpoints():
    vehicle = new_station(autopilot="px4")
    offboard(vehicle)
    vehicle.command_long(246, 1)
    assert vehicle.flown(5.0).mode == "AUTO.LOITER"
    assert vehicle.command_long(512, 0)[-1].system_status == mavlink.MAV_STATE_ACTIVE


def test_the_stream_is_lost_just_as_late_in_one_long_advance():
    long, short = new_station(autopilot="px4"), new_station(autopilot="px4")
    for vehicle in (long, short):
        offboard(vehicle)
    long.advance(5.0)
    for tenth in range(51):
        short.advance(tenth / 10.0)
    expected, found = short.truth, long.truth
    assert found.mode == "AUTO.RTL"
    assert found.course_rad == pytest.approx(expected.course_rad, abs=1e-4)


@pytest.mark.parametrize(
    ("mask", "flown_m"), [(2499, 520.0), (3523, 520.0), (2503, 500.0), (3527, 500.0)]
)
def test_z_is_flown_as_height_when_it_is_not_masked(mask, flown_m):
    vehicle = new_station(autopilot="px4", version=STEERED)
    offboard(vehicle)
    fly(vehicle, 40.0, lambda: vehicle.velocity_setpoint(20.0, 0.0, z=-120.0, mask=mask))
    assert vehicle.truth.altitude_amsl_m == pytest.approx(flown_m, abs=1e-3)


def test_guided_course_keeps_the_course_of_its_entry_until_it_is_told_another():
    vehicle = new_station(SteadyWind(5.0, 0.0), autopilot="px4")
    vehicle.advance(7.0)
    vehicle.command_long(*GUIDED_COURSE)
    before = course_deg(vehicle)
    vehicle.advance(20.0)
    assert course_deg(vehicle) == pytest.approx(before, abs=1e-2)


@pytest.mark.parametrize(
    ("kind", "degrees", "answer"),
    [
        (0.0, 90.0, "ACCEPTED"),
        (math.nan, 90.0, "DENIED"),
        (0.0, -270.0, "ACCEPTED"),
        (0.0, 450.0, "ACCEPTED"),
        (1.0, 90.0, "DENIED"),
        (2.0, 90.0, "DENIED"),
    ],
)
def test_a_course_is_taken_over_ground_and_beyond_a_turn(kind, degrees, answer):
    vehicle = guided_course()
    assert vehicle.result(vehicle.command_long(43_002, kind, degrees)) == answer
    vehicle.advance(20.0)
    flown = 90.0 if answer == "ACCEPTED" else 0.0
    assert math.remainder(course_deg(vehicle) - flown, 360.0) == pytest.approx(0.0, abs=1e-2)


@pytest.mark.parametrize(
    ("mode", "course", "height"),
    [
        (GUIDED_COURSE, "ACCEPTED", "ACCEPTED"),
        (LOITER, "DENIED", "ACCEPTED"),
        (OFFBOARD, "DENIED", "DENIED"),
    ],
)
def test_course_and_height_are_denied_where_they_are_not_the_autopilot_s_to_hold(
    mode, course, height
):
    vehicle = new_station(autopilot="px4")
    vehicle.velocity_setpoint(20.0, 0.0)
    vehicle.command_long(*mode)
    assert vehicle.result(vehicle.command_long(43_002, 0, 90.0)) == course
    assert vehicle.result(vehicle.command_long(186, 120.0, 1)) == height


@pytest.mark.parametrize(
    ("frame", "answer", "mode"), [(6, "ACCEPTED", "AUTO.LOITER"), (1, "DENIED", "AUTO.COURSE")]
)
def test_a_reposition_ends_the_course_unless_its_frame_is_none_on_the_globe(frame, answer, mode):
    vehicle = guided_course()
    assert vehicle.result(vehicle.command_int(192, -1.0, frame=frame, z=100.0)) == answer
    assert vehicle.truth.mode == mode


@pytest.mark.parametrize(
    ("kind", "speed", "flown"),
    [(0, 24.0, 24.0), (0, 99.0, 32.0), (0, 5.0, 12.0), (0, math.nan, 20.0), (1, 24.0, 24.0)],
)
def test_every_speed_is_accepted_and_flown_as_far_as_it_can_be(kind, speed, flown):
    vehicle = guided_course()
    assert vehicle.result(vehicle.command_long(178, kind, speed, -1)) == "ACCEPTED"
    assert vehicle.flown(20.0).airspeed_m_s == pytest.approx(flown, abs=1e-3)


def test_the_article_s_plant_takes_a_ground_speed_by_it():
    vehicle = guided_course(SteadyWind(5.0, 1.0), plant=PlantParameters(kind="course-hold"))
    assert vehicle.result(vehicle.command_long(178, 1, 22.0)) == "ACCEPTED"
    assert vehicle.flown(15.0).ground_speed_m_s == pytest.approx(22.0, abs=1e-3)


@pytest.mark.parametrize(
    ("version", "command", "answer"),
    [
        # Guided Course came with 1.18; these modes do not exist.
        *(((1, 17), GUIDED_COURSE, REJECTED), ((1, 17), (43_002, 0, 90.0), "UNSUPPORTED")),
        *((None, (176, 1, *mode), REJECTED) for mode in ((9, 0), (4, 99), (6, 1), (-1, 0))),
        *((None, (176, 1, main, 0), REJECTED) for main in (6.5, 300)),
        # ArduPlane's.
        *((None, (command,), "UNSUPPORTED") for command in (43_000, 43_001)),
    ],
)
def test_what_it_does_not_have_is_refused(version, command, answer):
    vehicle = new_station(autopilot="px4", version=version)
    vehicle.velocity_setpoint(20.0, 0.0)
    assert vehicle.result(vehicle.command_long(*command)) == answer
    assert vehicle.truth.mode == "AUTO.LOITER"


@pytest.mark.parametrize(("action", "mode"), [(1, "AUTO.LOITER"), (2, "AUTO.RTL")])
def test_guided_course_ends_13_seconds_after_the_last_ground_station(action, mode):
    vehicle = new_station(autopilot="px4")
    ground_station_speaks(vehicle)
    set_whole(vehicle, "NAV_DLL_ACT", action)
    vehicle.command_long(*GUIDED_COURSE)
    vehicle.advance(5.0)
    ground_station_speaks(vehicle)
    assert vehicle.flown(17.9).mode == "AUTO.COURSE"
    messages = vehicle.advance(18.1)
    assert vehicle.truth.mode == mode
    assert [m.text for m in of_type(messages, "STATUSTEXT")] == ["Failsafe activated"]


@pytest.mark.parametrize(
    ("speaks", "excepted", "mode"),
    # A companion is no ground station; Guided Course can be excepted by a bit.
    [(18, 0, "AUTO.LOITER"), (18, 2, "AUTO.COURSE"), (mavlink.MAV_TYPE_GCS, 0, "AUTO.COURSE")],
)
def test_whose_heartbeats_keep_guided_course(speaks, excepted, mode):
    vehicle = new_station(autopilot="px4")
    ground_station_speaks(vehicle)
    set_whole(vehicle, "COM_DLL_EXCEPT", excepted)
    set_whole(vehicle, "NAV_DLL_ACT", 1)
    vehicle.command_long(*GUIDED_COURSE)
    for second in range(14):
        ground_station_speaks(vehicle, speaks)
        vehicle.advance(second + 1.0)
    assert vehicle.truth.mode == mode


def test_without_a_ground_station_the_fail_safe_acts_as_soon_as_it_is_switched_on():
    vehicle = guided_course()
    vehicle.advance(30.0)
    set_whole(vehicle, "NAV_DLL_ACT", 1)
    assert vehicle.truth.mode == "AUTO.LOITER"
    vehicle.advance(31.0)
    ground_station_speaks(vehicle)
    assert vehicle.result(vehicle.command_long(*GUIDED_COURSE)) == "ACCEPTED"


def test_an_unknown_parameter_is_answered_with_an_error():
    asked = mavlink.MAVLink_param_request_read_message(7, 1, b"NOPE", -1)
    (error,) = new_station(autopilot="px4").send(asked)
    assert error.get_type() == "PARAM_ERROR"
    assert (error.param_id, error.error) == ("NOPE", mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)
    assert new_station(autopilot="px4", version=(1, 17)).send(asked) == []
    assert new_station().send(asked) == []


def test_position_control_is_left_to_the_pilot():
    vehicle = new_station(autopilot="px4")
    offboard(vehicle)
    assert vehicle.result(vehicle.command_long(176, 1, 3)) == "ACCEPTED"
    vehicle.position_setpoint(-EAST_M, 0.0)
    truth = vehicle.flown(5.0)
    assert truth.mode == "POSCTL"
    assert truth.course_rad == pytest.approx(0.0, abs=1e-6)
