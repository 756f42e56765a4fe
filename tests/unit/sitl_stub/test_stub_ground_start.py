"""What QGroundControl asks a vehicle at start-up, in its order, and other courtesies."""

import math
import struct
from typing import Literal

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import PlantParameters, SteadyWind
from sitl_stub.route import Route
from tests.kit.autopilot import GroundStation, new_station
from tests.kit.wire import command_long, of_type, packed

LANDED, TAKING_OFF, FLYING = 1, 3, 2


def on_ground(
    autopilot: Literal["ardupilot", "px4"] = "ardupilot",
    *,
    plant: PlantParameters | None = None,
    ready_after_s: float = 0.0,
) -> GroundStation:
    """Makes an aircraft that stands on the ground at 400 m, its nose to the east."""
    return new_station(
        SteadyWind(3.0, 0.0),
        autopilot=autopilot,
        plant=plant,
        altitude_amsl_m=400.0,
        course_rad=math.pi / 2,
        airborne=False,
        armed=False,
        ready_after_s=ready_after_s,
    )


def landed_state(vehicle: GroundStation) -> int:
    return int(vehicle.command_long(512, 245)[-1].landed_state)


def test_nothing_moves_until_it_is_armed_in_a_mode_that_takes_off():
    vehicle = on_ground()
    start = vehicle.truth
    assert (start.mode, start.armed, landed_state(vehicle)) == ("MANUAL", False, LANDED)
    assert vehicle.result(vehicle.command_long(176, 1, 13)) == "ACCEPTED"
    here = vehicle.flown(10.0)
    assert (here.latitude_deg, here.longitude_deg) == (start.latitude_deg, start.longitude_deg)
    assert here.ground_speed_m_s == 0.0
    assert vehicle.result(vehicle.command_long(400, 1)) == "ACCEPTED"
    assert vehicle.flown(11.0).ground_speed_m_s == pytest.approx(4.0)


@pytest.mark.parametrize("kind", ["heading-hold", "course-hold", "bank"])
def test_arduplane_takes_off_climbs_and_loiters_ahead_of_the_runway(kind):
    vehicle = on_ground(plant=PlantParameters(kind=kind))
    vehicle.command_long(400, 1)
    vehicle.command_long(176, 1, 13)
    vehicle.advance(8.0)
    assert landed_state(vehicle) == TAKING_OFF
    vehicle.advance(120.0)
    assert landed_state(vehicle) == FLYING
    centre_east_deg = 8.0 + 200.0 / 76_060.0
    for second in range(121, 160):
        truth = vehicle.flown(float(second))
        north_m = (truth.latitude_deg - 47.0) * 111_180.0
        east_m = (truth.longitude_deg - centre_east_deg) * 76_060.0
        assert math.hypot(north_m, east_m) == pytest.approx(80.0, abs=20.0)
        assert truth.altitude_amsl_m == pytest.approx(450.0, abs=2.5)
    assert vehicle.truth.mode == "TAKEOFF"


def test_px4_takes_off_by_command_and_ends_in_a_loiter():
    vehicle = on_ground("px4")
    assert vehicle.result(vehicle.command_long(400, 1)) == "ACCEPTED"
    assert vehicle.result(vehicle.command_long(22, 0, 0, 0, math.nan)) == "ACCEPTED"
    assert vehicle.truth.mode == "AUTO.TAKEOFF"
    truth = vehicle.flown(90.0)
    assert truth.mode == "AUTO.LOITER"
    assert truth.altitude_amsl_m == pytest.approx(450.0, abs=2.5)


def test_a_mode_that_does_not_take_off_ends_the_roll_and_a_reboot_on_the_ground_disarms():
    vehicle = on_ground()
    vehicle.command_long(400, 1)
    vehicle.command_long(176, 1, 13)
    vehicle.advance(1.0)
    vehicle.command_long(176, 1, 0)
    assert vehicle.flown(5.0).ground_speed_m_s == 0.0
    assert vehicle.truth.armed
    vehicle.command_long(246, 1)
    assert not vehicle.truth.armed


def test_an_aircraft_that_is_disarmed_on_its_take_off_roll_stands():
    vehicle = on_ground()
    vehicle.command_long(400, 1)
    vehicle.command_long(176, 1, 13)
    assert vehicle.flown(1.0).ground_speed_m_s == pytest.approx(4.0)
    assert vehicle.result(vehicle.command_long(400, 0)) == "ACCEPTED"
    assert vehicle.flown(30.0).ground_speed_m_s == 0.0
    assert landed_state(vehicle) == LANDED
    vehicle.command_long(400, 1)
    assert vehicle.flown(31.0).ground_speed_m_s == pytest.approx(4.0)


def test_a_take_off_leads_straight_ahead_whatever_route_was_to_be_flown():
    """Home is at 47 N 8 E with the nose to the east, the route leads back to the west."""
    route = Route(((47.0, 8.0), (47.0, 7.9)))
    vehicle = new_station(
        altitude_amsl_m=400.0, course_rad=math.pi / 2, airborne=False, armed=False, route=route
    )
    vehicle.command_long(400, 1)
    vehicle.command_long(176, 1, 13)
    assert vehicle.flown(15.0).altitude_amsl_m < 448.0
    assert vehicle.truth.course_rad == pytest.approx(math.pi / 2, abs=0.01)


@pytest.mark.parametrize(
    ("autopilot", "refusal"), [("ardupilot", "FAILED"), ("px4", "TEMPORARILY_REJECTED")]
)
def test_it_is_not_armed_before_its_sensors_have_settled(autopilot, refusal):
    vehicle = on_ground(autopilot, ready_after_s=3.0)
    replies = vehicle.command_long(400, 1)
    assert vehicle.result(replies) == refusal
    assert replies[-1].text.startswith("Arm: Waiting for GPS")
    health = vehicle.command_long(512, 1)[-1].onboard_control_sensors_health
    assert health & 0x10000020 == 0
    vehicle.advance(3.0)
    assert vehicle.result(vehicle.command_long(400, 1)) == "ACCEPTED"


def test_arduplane_does_not_arm_with_an_airspeed_it_cannot_fly():
    vehicle = on_ground()
    vehicle.write("AIRSPEED_MIN", 3.0)
    replies = vehicle.command_long(400, 1)
    assert vehicle.result(replies) == "FAILED"
    assert replies[-1].text == "Arm: AIRSPEED_MIN too low (3 < 5)"
    assert vehicle.result(vehicle.command_long(400, 1, 2989)) == "ACCEPTED"


def test_in_the_air_it_is_disarmed_by_force_only():
    vehicle = new_station()
    assert vehicle.result(vehicle.command_long(400, 0)) == "FAILED"
    assert vehicle.truth.armed
    assert vehicle.result(vehicle.command_long(400, 0, 21196)) == "ACCEPTED"
    heartbeat = vehicle.advance(0.0)[0]
    assert not heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert vehicle.result(vehicle.command_long(400, 2)) == "UNSUPPORTED"


MISSION, FENCE, RALLY = 0, 1, 2
AUTOPILOTS = ["ardupilot", "px4"]


def number_of(frame: bytes) -> int:
    return int.from_bytes(frame[7:10], "little")


def frames(vehicle: GroundStation, command: int, *parameters: float) -> list[bytes]:
    """Whole MAVLink 2 frames that answer, of messages that pymavlink does not know too."""
    data, found = vehicle.autopilot.receive(packed(command_long(command, *parameters))), []
    while data:
        found.append(data[: 12 + data[1]])
        data = data[12 + data[1] :]
    return found


def requested(vehicle: GroundStation, message_id: int, parameter: float = 0.0) -> list[bytes]:
    """The frames that follow the acknowledgement of a request."""
    return frames(vehicle, 512, message_id, parameter)[1:]


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_qgroundcontrol_s_start_up_gets_an_answer_to_every_question(autopilot):
    vehicle = new_station(autopilot=autopilot)
    vehicle.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    (version,) = of_type(vehicle.command_long(512, 148), "AUTOPILOT_VERSION")
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    # Modes one by one, as the count in the first one tells; then the parameters.
    (first,) = requested(vehicle, 435, 1)
    count = first[10 + 8]
    assert count == len({requested(vehicle, 435, index + 1)[0][10:14] for index in range(count)})
    # Metadata it has none of; a denial is an answer too.
    assert vehicle.result(vehicle.command_long(512, 397)) == "DENIED"
    values = of_type(vehicle.send(mavlink.MAVLink_param_request_list_message(7, 1)), "PARAM_VALUE")
    values += of_type(vehicle.advance(0.9), "PARAM_VALUE")
    listed = [value for value in values if value.param_index != 65_535]
    assert len(listed) == listed[0].param_count
    for kind in (MISSION, FENCE, RALLY):
        (answer,) = vehicle.send(mavlink.MAVLink_mission_request_list_message(7, 1, kind))
        assert (answer.get_type(), answer.count, answer.mission_type) == ("MISSION_COUNT", 0, kind)
        assert (answer.target_system, answer.target_component) == (255, 190)


def test_the_protocol_version_is_mavlink_2():
    vehicle = new_station()
    (frame,) = requested(vehicle, 300)
    assert number_of(frame) == 300
    assert struct.unpack("<HHH", frame[10:-2].ljust(22, b"\0")[:6]) == (200, 100, 200)
    checksum = mavlink.x25crc(frame[1:-2])
    checksum.accumulate(bytes([217]))
    assert struct.pack("<H", checksum.crc) == frame[-2:]
    assert [number_of(one) for one in frames(vehicle, 519, 1)] == [77, 300]


def test_all_modes_come_at_once_for_index_0_and_none_for_one_too_many():
    vehicle = new_station()
    modes = requested(vehicle, 435, 0)
    names = {frame[10 + 11 : -2].rstrip(b"\0").decode("ascii") for frame in modes}
    assert {"GUIDED", "LOITER", "TAKEOFF", "RTL"} <= names
    assert requested(vehicle, 435, len(modes) + 1) == []


def test_a_list_that_is_brought_finds_no_room_and_an_item_that_is_not_there_is_refused():
    vehicle = new_station()
    (full,) = vehicle.send(mavlink.MAVLink_mission_count_message(7, 1, 3, MISSION))
    assert (full.get_type(), full.type) == ("MISSION_ACK", mavlink.MAV_MISSION_NO_SPACE)
    (none,) = vehicle.send(mavlink.MAVLink_mission_request_int_message(7, 1, 0, FENCE))
    assert none.type == mavlink.MAV_MISSION_INVALID_SEQUENCE
    (cleared,) = vehicle.send(mavlink.MAVLink_mission_clear_all_message(7, 1, RALLY))
    assert (cleared.type, cleared.mission_type) == (mavlink.MAV_MISSION_ACCEPTED, RALLY)


def test_time_is_synchronised_with_who_asks_and_a_ping_comes_back():
    vehicle = new_station(boot_time_s=5.0)
    vehicle.advance(2.0)
    (answer,) = vehicle.send(mavlink.MAVLink_timesync_message(0, 123_456))
    assert (answer.tc1, answer.ts1) == (7_000_000_000, 123_456)
    assert vehicle.send(mavlink.MAVLink_timesync_message(1, 2)) == []
    (answer,) = vehicle.send(mavlink.MAVLink_ping_message(99, 7, 0, 0))
    assert (answer.seq, answer.target_system, answer.target_component) == (7, 255, 190)


def test_an_interval_that_was_set_can_be_asked_for():
    vehicle = new_station()
    vehicle.interval(33, 50_000)
    (answer,) = of_type(vehicle.command_long(510, 33), "MESSAGE_INTERVAL")
    assert (answer.message_id, answer.interval_us) == (33, 50_000)
    assert of_type(vehicle.command_long(510, 32), "MESSAGE_INTERVAL")[0].interval_us == -1
    assert of_type(vehicle.command_long(510, 9_999), "MESSAGE_INTERVAL")[0].interval_us == 0
    assert vehicle.interval(33, 3.4e38) == "ACCEPTED"
    assert of_type(vehicle.command_long(510, 33), "MESSAGE_INTERVAL")[0].interval_us == 2**31 - 1


def test_older_ground_stations_get_arduplane_s_streams_at_their_rate():
    vehicle = new_station()
    vehicle.send(mavlink.MAVLink_request_data_stream_message(7, 1, 0, 4, 1))
    vehicle.advance(0.0)
    messages = vehicle.advance(1.0)
    for name in ("GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD", "GPS_RAW_INT", "SYSTEM_TIME"):
        assert len(of_type(messages, name)) == 4
    vehicle.send(mavlink.MAVLink_request_data_stream_message(7, 1, 6, 0, 0))
    assert of_type(vehicle.advance(2.0), "GLOBAL_POSITION_INT") == []


def test_px4_flies_home_and_holds_there_when_told():
    vehicle = new_station(autopilot="px4")
    vehicle.advance(10.0)
    assert vehicle.result(vehicle.command_long(20)) == "ACCEPTED"
    assert vehicle.truth.mode == "AUTO.RTL"
    truth = vehicle.flown(120.0)
    north_m = (truth.latitude_deg - 47.0) * 111_180.0
    east_m = (truth.longitude_deg - 8.0) * 76_060.0
    assert math.hypot(north_m, east_m) == pytest.approx(80.0, abs=10.0)


def reposition(
    vehicle: GroundStation,
    flags: int,
    latitude_deg: float = 47.01,
    speed_m_s: float = -1.0,
    altitude_m: float = 520.0,
) -> str:
    message = mavlink.MAVLink_command_int_message(
        *(7, 1, 0, 192, 0, 0, speed_m_s, flags, 0, 0),
        *(round(latitude_deg * 1e7), 80_000_000, altitude_m),
    )
    return vehicle.result(vehicle.send(message))


@pytest.mark.parametrize(
    ("speed_m_s", "flown"),
    [(24.0, 24.0), (99.0, 32.0), (-1.0, 20.0), (0.0, 20.0), (math.nan, 20.0)],
)
def test_px4_flies_to_a_place_on_the_bearing_and_at_the_airspeed_of_the_command(speed_m_s, flown):
    vehicle = new_station(autopilot="px4")
    assert reposition(vehicle, 1, 47.03, speed_m_s) == "ACCEPTED"
    truth = vehicle.flown(30.0)
    assert truth.mode == "AUTO.LOITER"
    assert truth.airspeed_m_s == pytest.approx(flown, abs=1e-3)
    assert math.degrees(math.remainder(truth.course_rad, math.tau)) == pytest.approx(0.0, abs=2.5)


def test_arduplane_is_repositioned_in_guided_and_forgets_its_course():
    vehicle = new_station()
    assert reposition(vehicle, 0) == "FAILED"
    assert reposition(vehicle, 1) == "ACCEPTED"
    assert vehicle.truth.mode == "GUIDED"
    truth = vehicle.flown(200.0)
    assert truth.altitude_amsl_m == pytest.approx(520.0, abs=0.1)
    assert (truth.latitude_deg - 47.01) * 111_180.0 == pytest.approx(0.0, abs=95.0)
    assert reposition(vehicle, 1, 95.0) == "DENIED"
    assert vehicle.command_long(192)[0].result == 8  # MAV_RESULT_COMMAND_INT_ONLY


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_height_that_is_no_number_repositions_nobody(autopilot):
    vehicle = new_station(autopilot=autopilot)
    before = vehicle.truth
    assert reposition(vehicle, 1, 47.01, -1.0, math.nan) == "DENIED"
    assert vehicle.truth == before
