import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from pymap3d.vincenty import vdist

from tests.kit.autopilot import address, asked, sent
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.px4 import Px4, Px4ByMavsdk, point_ahead
from vfguide.mavlink.reports import CommandReport, VersionReport

GUIDED_COURSE, OFFBOARD, LOITER = 4 << 16 | 19 << 24, 6 << 16, 4 << 16 | 3 << 24
SET_MODE, ACCEPTED, REJECTED = 176, 0, 1


def of_version(major: int, minor: int) -> Px4:
    """One that has told its version."""
    plane = Px4(address(px4_steering="auto"))
    plane.hear(VersionReport(major=major, minor=minor))
    return plane


@pytest.mark.parametrize(
    ("versions", "mode", "words"),
    [
        (((1, 13), (1, 14)), OFFBOARD, "by velocities in offboard"),
        (((1, 15), (1, 17), (0, 0)), OFFBOARD, "by positions ahead in offboard"),
        (((1, 18), (1, 19), (2, 0)), GUIDED_COURSE, "in Guided Course"),
    ],
)
def test_the_version_tells_how_it_is_steered(versions, mode, words):
    for major, minor in versions:
        plane = Px4(address(px4_steering="auto"))
        assert not plane.is_ready
        assert words in str(plane.hear(VersionReport(major=major, minor=minor)))
        assert plane.is_ready
        assert [one for one in (GUIDED_COURSE, OFFBOARD, LOITER) if plane.is_engaged(one)] == [mode]


@pytest.mark.parametrize(
    ("minor", "parameter", "repeats"),
    # MAVSDK repeats the setpoints of offboard while its companion hangs.
    [(18, "NAV_DLL_ACT decides", False), (16, "COM_OBL_RC_ACT decides", True)],
)
def test_it_is_told_what_stops_an_aircraft_whose_companion_dies(minor, parameter, repeats):
    version = VersionReport(major=1, minor=minor)
    vehicle = address(px4_steering="auto")
    assert parameter in str(Px4(vehicle).hear(version))
    assert ("not while it hangs" in str(Px4ByMavsdk(vehicle).hear(version))) is repeats


def test_before_its_version_is_known_nothing_is_steered():
    plane = Px4(address(px4_steering="auto"))
    assert plane.fly(asked(1.0, 20.0)) == plane.stay_ready(asked(1.0, 20.0)) == []
    assert plane.engage() == plane.hold_altitude(588.0) == []
    assert not plane.is_engaged(GUIDED_COURSE)
    assert not plane.is_engaged(OFFBOARD)
    (question,) = sent(plane.questions())
    # MAV_CMD_REQUEST_MESSAGE, AUTOPILOT_VERSION.
    assert (question.command, question.param1) == (512, 148)


def test_one_that_does_not_tell_its_version_is_steered_by_positions():
    plane = Px4(address(px4_steering="auto"))
    asked_for = [len(plane.questions()) for _ in range(6)]
    assert asked_for == [1, 1, 1, 1, 0, 0]
    assert plane.is_engaged(OFFBOARD)
    assert plane.holds_altitude


def test_one_that_refuses_guided_course_three_times_is_steered_by_positions():
    plane = of_version(1, 18)

    def refused(result: int = REJECTED) -> str | None:
        plane.engage()
        return plane.hear(CommandReport(command=SET_MODE, result=result))

    assert [refused(), refused()] == [None, None]
    refused(ACCEPTED)
    assert [refused(), refused()] == [None, None]
    text = str(refused())
    assert "Guided Course is refused" in text
    assert "select OFFBOARD" in text
    assert plane.is_engaged(OFFBOARD)


def test_answers_that_it_did_not_ask_for_do_not_change_its_steering():
    plane = of_version(1, 18)
    refusal = CommandReport(command=SET_MODE, result=REJECTED)
    plane.engage()
    for _ in range(9):
        plane.hear(refusal)
    plane.hand_back()
    for _ in range(9):
        plane.hear(refusal)
    assert not plane.is_engaged(OFFBOARD)


@pytest.mark.parametrize("steering", ["guided-course", "position", "velocity"])
def test_a_way_that_the_mission_chooses_stays(steering):
    plane = Px4(address(px4_steering=steering))
    assert plane.is_ready
    assert plane.questions() == []
    before = [plane.is_engaged(one) for one in (GUIDED_COURSE, OFFBOARD)]
    plane.hear(VersionReport(major=1, minor=16))
    for _ in range(5):
        plane.hear(CommandReport(command=SET_MODE, result=REJECTED))
    assert [plane.is_engaged(one) for one in (GUIDED_COURSE, OFFBOARD)] == before


@pytest.mark.parametrize(
    ("steering", "engaged", "others"),
    [
        # Offboard is told by the main mode alone.
        (
            "position",
            (6 << 16, 6 << 16 | 3 << 24, 0x0106 << 16),
            (GUIDED_COURSE, LOITER, 4 << 16 | 6 << 24, 7 << 16, 6, 15, 0, 2**32 - 1),
        ),
        # Guided Course by main and sub mode.
        ("guided-course", (GUIDED_COURSE,), (LOITER, 6 << 16 | 19 << 24, OFFBOARD)),
    ],
)
def test_the_mode_tells_whether_it_is_engaged(steering, engaged, others):
    plane = Px4(address(px4_steering=steering))
    assert [mode for mode in (*engaged, *others) if plane.is_engaged(mode)] == list(engaged)


@pytest.mark.parametrize(
    ("steering", "streams", "counts", "holds", "altitude"),
    [
        ("guided-course", False, True, True, [(186, 588.5, 0.0)]),
        # In offboard no message is about the altitude alone.
        ("position", True, False, True, []),
        ("velocity", True, False, False, []),
    ],
)
def test_what_each_way_needs_and_holds(steering, streams, counts, holds, altitude):
    plane = Px4(address(px4_steering=steering))
    assert plane.streams_before_engaging is streams
    assert plane.counts_ground_stations is counts
    assert plane.holds_altitude is holds
    told = sent(plane.hold_altitude(588.5))
    assert [(one.command, one.param1, one.param2) for one in told] == altitude
    # What is streamed beforehand is the setpoint without the speed.
    before = sent(plane.stay_ready(asked(math.radians(150.0), 20.0)))
    steered, _ = sent(plane.fly(asked(math.radians(150.0), 20.0)))
    assert [one.to_dict() for one in before] == [steered.to_dict()] * streams


@pytest.mark.parametrize(("course", "degrees"), [(-1.0, 302.704), (150.0, 314.367), (0.0, 0.0)])
def test_guided_course_takes_a_course_over_ground_in_degrees(course, degrees):
    heading, _ = sent(Px4(address()).fly(asked(course, 20.0)))
    assert (heading.get_type(), heading.command, heading.param1) == ("COMMAND_LONG", 43_002, 0.0)
    assert heading.param2 == pytest.approx(degrees, abs=1e-3)


def test_a_course_goes_as_a_position_1500_m_ahead_and_nothing_else():
    plane = Px4(address(px4_steering="position"))
    setpoint, _ = sent(plane.fly(asked(math.radians(90.0), 20.0)))
    assert setpoint.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"
    # Bits 3-5 velocity, 6-8 acceleration, 10 yaw, 11 yaw rate: 56 + 448 + 1024 + 2048.
    assert (setpoint.type_mask, setpoint.coordinate_frame, setpoint.alt) == (0xDF8, 5, 588.0)
    # The parallel of 47 degrees has a radius of 4 357 690 m.
    degrees = math.degrees(1500.0 / 4_357_690.0)
    assert setpoint.lon_int == pytest.approx(8e7 + degrees * 1e7, abs=30.0)
    assert setpoint.lat_int == pytest.approx(47e7, abs=1.0)


@settings(deadline=None, derandomize=True)
@given(
    course=st.floats(-10.0, 10.0),
    latitude=st.floats(-60.0, 60.0),
    longitude=st.floats(-180.0, 180.0),
)
def test_the_point_ahead_is_on_the_course(course, latitude, longitude):
    setpoint = replace(asked(course, 20.0), latitude_deg=latitude, longitude_deg=longitude)
    ahead = point_ahead(setpoint, 1500.0)
    distance, bearing = vdist(latitude, longitude, *ahead)
    assert float(distance) == pytest.approx(1500.0, abs=0.2)
    off = math.remainder(float(bearing) - math.degrees(course), 360.0)
    # What the meridians converge on 750 m at 60 degrees: 750 / 6.4e6 * tan(60) = 0.012 degrees.
    assert abs(off) < 0.013


def test_a_course_goes_as_a_velocity_and_nothing_else():
    plane = Px4(address(px4_steering="velocity"))
    setpoint, _ = sent(plane.fly(asked(math.radians(150.0), 20.0)))
    assert setpoint.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    # Bits 0-2 position, 6-8 acceleration, 10 yaw, 11 yaw rate: 7 + 448 + 1024 + 2048.
    assert (setpoint.type_mask, setpoint.coordinate_frame, setpoint.vz) == (3527, 1, 0.0)
    assert (setpoint.vx, setpoint.vy) == pytest.approx((-17.320508, 10.0), abs=1e-5)


@pytest.mark.parametrize("steering", ["guided-course", "position", "velocity"])
@pytest.mark.parametrize(("hold", "speed_type"), [("heading-hold", 0.0), ("course-hold", 1.0)])
def test_a_speed_goes_by_command_and_leaves_the_throttle_alone(steering, hold, speed_type):
    plane = Px4(address(hold, px4_steering=steering))
    _, speed = sent(plane.fly(asked(0.0, 17.25)))
    assert (speed.get_type(), speed.command) == ("COMMAND_LONG", 178)
    assert (speed.param1, speed.param2, speed.param3) == (speed_type, 17.25, -1.0)


@pytest.mark.parametrize(
    ("steering", "modes"),
    [("guided-course", (4.0, 19.0)), ("position", (6.0, 0.0)), ("velocity", (6.0, 0.0))],
)
def test_modes_are_set_by_main_and_sub_mode(steering, modes):
    plane = Px4(address(px4_steering=steering))
    for command, wanted in zip(
        sent([*plane.engage(), *plane.hand_back()]), (modes, (4.0, 3.0)), strict=True
    ):
        assert (command.get_type(), command.command) == ("COMMAND_LONG", SET_MODE)
        assert (command.param1, command.param2, command.param3) == (1.0, *wanted)


def test_hold_is_what_it_is_handed_back_to():
    plane = Px4(address(px4_steering="auto"))
    modes = (LOITER, GUIDED_COURSE, OFFBOARD, 4 << 16)
    assert [plane.is_handed_back(mode) for mode in modes] == [True, False, False, False]


@pytest.mark.parametrize(
    ("kind", "steering", "count"),
    [
        (ArduPlane, "auto", 11),
        *((Px4, "auto", 8), (Px4, "guided-course", 11), (Px4, "position", 11)),
        (Px4, "velocity", 11),
    ],
)
def test_every_message_is_addressed_to_the_vehicle(kind, steering, count):
    plane = kind(address(px4_steering=steering))
    messages = [
        *plane.questions(),
        *plane.fly(asked(1.0, 20.0)),
        *plane.stay_ready(asked(1.0, 20.0)),
        *plane.engage(),
        *plane.hand_back(),
        *plane.hold_altitude(588.0),
        *plane.request_telemetry(20.0),
    ]
    assert len(messages) == count
    for message in sent(messages):
        assert (message.target_system, message.target_component) == (7, 3)


@settings(deadline=None, derandomize=True)
@given(course=st.floats(-1e4, 1e4), speed=st.floats(1.0, 100.0))
def test_the_velocity_points_along_any_course(course, speed):
    setpoint, _ = sent(Px4(address(px4_steering="velocity")).fly(asked(course, speed)))
    off = math.remainder(math.atan2(setpoint.vy, setpoint.vx) - course, 2.0 * math.pi)
    assert abs(off) < 1e-6
    assert math.hypot(setpoint.vx, setpoint.vy) == pytest.approx(speed, rel=1e-6)


def test_guided_is_the_only_mode_that_obeys_and_setpoints_need_not_arrive_before():
    plane = ArduPlane(address())
    assert [mode for mode in range(30) if plane.is_engaged(mode)] == [15]
    assert not plane.is_engaged(6 << 16)
    assert not plane.streams_before_engaging


def test_a_course_goes_as_course_over_ground_with_a_lateral_acceleration():
    heading, _ = sent(ArduPlane(address()).fly(asked(math.pi / 2, 20.0)))
    assert (heading.get_type(), heading.command) == ("COMMAND_INT", 43_002)
    assert (heading.param1, heading.param2, heading.param4) == (0.0, 90.0, 0.0)
    assert heading.param3 == pytest.approx(9.80665, abs=1e-6)


@pytest.mark.parametrize(("hold", "speed_type"), [("heading-hold", 0.0), ("course-hold", 1.0)])
def test_a_speed_is_of_the_kind_that_the_vehicle_holds_and_not_slewed(hold, speed_type):
    _, speed = sent(ArduPlane(address(hold)).fly(asked(0.0, 17.25)))
    assert (speed.get_type(), speed.command) == ("COMMAND_INT", 43_000)
    assert (speed.param1, speed.param2, speed.param3) == (speed_type, 17.25, 0.0)


def test_an_altitude_is_above_mean_sea_level_and_the_climb_rate_left_to_the_autopilot():
    (altitude,) = sent(ArduPlane(address()).hold_altitude(588.5))
    assert (altitude.get_type(), altitude.command) == ("COMMAND_INT", 43_001)
    assert (altitude.frame, altitude.z, altitude.param3) == (0, 588.5, 0.0)


@pytest.mark.parametrize(("act", "mode"), [("engage", 15.0), ("hand_back", 12.0)])
def test_modes_are_set_by_command_with_the_custom_mode_flag(act, mode):
    (command,) = sent(getattr(ArduPlane(address()), act)())
    assert command.get_type() == "COMMAND_LONG"
    assert (command.command, command.param1, command.param2, command.param3) == (176, 1, mode, 0)


@pytest.mark.parametrize(("rate_hz", "interval_us"), [(20.0, 50_000.0), (30.0, 33_333.0)])
def test_position_and_airspeed_are_asked_for_at_the_rate(rate_hz, interval_us):
    commands = sent(ArduPlane(address()).request_telemetry(rate_hz))
    assert {command.command for command in commands} == {511}
    # 74 is VFR_HUD, 33 GLOBAL_POSITION_INT; twice a second SYS_STATUS, GPS_RAW_INT, BATTERY_STATUS
    # (147) and EKF_STATUS_REPORT.
    intervals = {command.param1: command.param2 for command in commands}
    assert intervals == {74: interval_us, 33: interval_us} | dict.fromkeys((1, 24, 147, 193), 5e5)


def course_on_the_wire(course: float) -> float:
    heading, _ = sent(ArduPlane(address()).fly(asked(course, 20.0)))
    return heading.param2


@pytest.mark.parametrize(
    ("course", "degrees"),
    [
        *((course, 0.0) for course in (0.0, -0.0, -1e-9, -1e-17, math.tau, math.tau - 1e-9)),
        (-math.pi / 2, 270.0),
        (5.0 * math.pi, 180.0),
        (math.radians(359.9994), 359.999),
        (math.radians(359.9996), 0.0),
    ],
)
def test_a_course_is_counted_as_a_compass_does(course, degrees):
    assert course_on_the_wire(course) == pytest.approx(degrees, abs=3e-5)


@settings(deadline=None, derandomize=True, max_examples=400)
@example(course=-5e-324)
@example(course=math.nextafter(2.0 * math.pi, 0.0))
@example(course=math.radians(359.9995))
@given(course=st.floats(-1e4, 1e4) | st.floats(-1e-3, 1e-3) | st.floats(6.2831, 6.2832))
def test_no_course_leaves_the_compass_after_single_precision(course):
    degrees = course_on_the_wire(course)
    assert 0.0 <= degrees < 360.0
    off = math.remainder(math.radians(degrees) - course, 2.0 * math.pi)
    assert abs(math.degrees(off)) < 6e-4
