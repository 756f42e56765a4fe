"""An emulated aircraft that flies by itself, and the messages that others hear it by."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, PlantParameters, Route, SteadyWind
from sitl_stub.config import OptionError
from sitl_stub.route import RouteFollower
from sitl_stub.settings import parse_route, parse_stream
from tests.kit.autopilot import new_autopilot, new_station
from tests.kit.wire import of_type, packed, parsed, types_of

SPEED, ALTITUDE, HEADING = 43000, 43001, 43002
LATERAL = 9.80665


def test_a_mode_change_is_acknowledged_announced_and_shown_at_once():
    vehicle = new_station()
    ack, text, heartbeat = vehicle.command_long(176, 1, 15)
    assert (ack.command, ack.result, ack.target_system, ack.target_component) == (176, 0, 255, 190)
    assert text.text == "Mode GUIDED"
    assert heartbeat.custom_mode == 15
    assert heartbeat.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    assert heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert vehicle.truth.mode == "GUIDED"


def test_only_its_own_commands_and_those_for_everyone_are_obeyed_and_no_echo_of_its_own():
    vehicle = new_station()
    echo = vehicle.autopilot.advance(0.0)
    assert vehicle.autopilot.receive(echo) == b""
    assert vehicle.autopilot.counters["from itself"] == 5
    assert vehicle.command_long(176, 1, 15, target=8) == []
    assert vehicle.truth.mode == "LOITER"
    assert vehicle.autopilot.counters["for another"] == 1
    assert vehicle.result(vehicle.command_long(176, 1, 15, target=0)) == "ACCEPTED"
    # By the message that sets a mode, too.
    vehicle.send(mavlink.MAVLink_set_mode_message(7, 1, 5))
    assert vehicle.truth.mode == "FBWA"


@pytest.mark.parametrize("parameters", [(1, 99), (0, 15), (1, 15.5), (1, -1)])
def test_a_mode_that_does_not_exist_is_denied(parameters):
    vehicle = new_station()
    assert vehicle.result(vehicle.command_long(176, *parameters)) == "DENIED"
    assert vehicle.truth.mode == "LOITER"


def test_loiter_turns_at_a_15_deg_bank():
    vehicle = new_station()
    truth = vehicle.flown(10.0)
    # g tan(15 deg) / 20 = 0.13139 rad/s
    assert truth.course_rad == pytest.approx(1.3139, abs=1e-4)
    assert math.degrees(truth.bank_rad) == pytest.approx(15.0)
    assert truth.airspeed_m_s == pytest.approx(20.0)


def test_other_modes_keep_the_course_they_had():
    vehicle = new_station(SteadyWind(5.0, 1.0), course_rad=0.7)
    vehicle.command_long(176, 1, 10)
    assert vehicle.flown(30.0).course_rad == pytest.approx(0.7, abs=1e-6)


@pytest.mark.parametrize(("kind", "pointed"), [(0, "course_rad"), (1, "heading_rad")])
def test_a_course_is_flown_over_ground_in_a_crosswind_and_a_heading_points_the_nose(kind, pointed):
    vehicle = new_station(SteadyWind(5.0, math.pi / 2)).guided()
    assert vehicle.result(vehicle.command_int(HEADING, kind, 45.0, LATERAL)) == "ACCEPTED"
    truth = vehicle.flown(20.0)
    assert math.degrees(getattr(truth, pointed)) == pytest.approx(45.0, abs=1e-3)
    assert truth.heading_rad < truth.course_rad


def test_with_a_lateral_acceleration_of_zero_the_aircraft_hardly_turns():
    vehicle = new_station().guided()
    vehicle.command_int(HEADING, 0, 90.0, 0.0)
    # 0.05 m/s^2 at 20 m/s for 10 s: 0.025 rad.
    assert vehicle.flown(10.0).course_rad == pytest.approx(0.025, abs=1e-6)


@pytest.mark.parametrize(
    ("speed", "acceleration", "after_s", "flown"),
    [
        # Held for ever.
        (25.0, 0, 300.0, 25.0),
        # 0.5 m/s² for 4 s.
        (30.0, 0.5, 4.0, 22.0),
    ],
)
def test_an_airspeed_is_taken_up_as_fast_as_is_commanded(speed, acceleration, after_s, flown):
    vehicle = new_station().guided()
    assert vehicle.result(vehicle.command_int(SPEED, 0, speed, acceleration)) == "ACCEPTED"
    assert vehicle.flown(after_s).airspeed_m_s == pytest.approx(flown)


def test_the_limits_themselves_are_accepted_despite_single_precision():
    vehicle = new_station(
        plant=PlantParameters(airspeed_min_m_s=12.3, airspeed_max_m_s=28.3)
    ).guided()
    assert vehicle.result(vehicle.command_int(SPEED, 0, 12.3, 0)) == "ACCEPTED"
    assert vehicle.result(vehicle.command_int(SPEED, 0, 28.3, 0)) == "ACCEPTED"


def test_the_article_s_plant_takes_a_ground_speed_without_a_jump():
    plant = PlantParameters(kind="course-hold")
    vehicle = new_station(SteadyWind(6.0, 0.3), plant=plant).guided()
    before = vehicle.truth
    assert vehicle.result(vehicle.command_int(SPEED, 1, 21.5, 0)) == "ACCEPTED"
    speeds = (before.ground_speed_m_s, before.airspeed_m_s)
    assert (vehicle.truth.ground_speed_m_s, vehicle.truth.airspeed_m_s) == pytest.approx(speeds)
    assert vehicle.result(vehicle.command_int(SPEED, 1, 0.0, 0)) == "FAILED"
    vehicle.command_int(HEADING, 0, 90.0, LATERAL)
    assert vehicle.flown(30.0).ground_speed_m_s == pytest.approx(21.5)


def test_the_common_speed_command_is_ignored_once_the_guided_one_was_used():
    vehicle = new_station().guided()
    vehicle.command_long(178, 0, 22.0)
    assert vehicle.flown(20.0).airspeed_m_s == pytest.approx(22.0, abs=1e-3)
    vehicle.command_int(SPEED, 0, 24.0, 0)
    replies = vehicle.command_long(178, 0, 18.0)
    assert vehicle.result(replies) == "ACCEPTED"
    assert types_of(replies) == ["COMMAND_ACK", "STATUSTEXT"]
    assert vehicle.flown(40.0).airspeed_m_s == pytest.approx(24.0, abs=1e-3)
    # A mode that there is not changes nothing.
    assert vehicle.result(vehicle.command_long(176, 1, 99)) == "DENIED"
    assert types_of(vehicle.command_long(178, 0, 18.0)) == ["COMMAND_ACK", "STATUSTEXT"]
    vehicle.command_long(176, 1, 12)
    vehicle.guided()
    vehicle.command_long(178, 0, 18.0)
    assert vehicle.flown(60.0).airspeed_m_s == pytest.approx(18.0, abs=1e-3)
    vehicle.command_int(SPEED, 0, 24.0, 0)
    # A reboot begins in LOITER.
    vehicle.command_long(246, 1)
    vehicle.command_long(178, 0, 18.0)
    assert vehicle.flown(80.0).airspeed_m_s == pytest.approx(18.0, abs=1e-3)


@pytest.mark.parametrize(
    ("mode", "command", "expected"),
    [
        # No change, and the default.
        (12, (178, 0, -1.0), "ACCEPTED"),
        (12, (178, 0, -2.0), "ACCEPTED"),
        (12, (178, 0, 50.0), "FAILED"),
        (12, (178, 9, 20.0), "DENIED"),
        (12, (31_337,), "UNSUPPORTED"),
        # A direction that is neither course, heading nor none, and none, which needs no numbers.
        (15, (HEADING, 3, 10.0, LATERAL), "DENIED"),
        (15, (HEADING, 2, math.nan, math.nan), "ACCEPTED"),
    ],
)
def test_a_command_is_answered(mode, command, expected):
    vehicle = new_station()
    vehicle.command_long(176, 1, mode)
    assert vehicle.result(vehicle.command_long(*command)) == expected


@pytest.mark.parametrize(
    ("frame", "z", "answer", "flown_m"),
    [
        *((frame, 530.0, "ACCEPTED", 530.0) for frame in (0, 5)),
        *((frame, 130.0, "ACCEPTED", 530.0) for frame in (3, 6)),
        # Above terrain.
        (10, 100.0, "DENIED", 500.0),
    ],
)
def test_an_altitude_is_flown_in_either_frame(frame, z, answer, flown_m):
    vehicle = new_station().guided()
    assert vehicle.result(vehicle.command_int(ALTITUDE, 0, 0, 0, frame=frame, z=z)) == answer
    assert vehicle.flown(60.0).altitude_amsl_m == pytest.approx(flown_m, abs=1e-3)


def test_leaving_and_entering_guided_clears_all_commands():
    vehicle = new_station().guided()
    vehicle.command_int(HEADING, 0, 90.0, LATERAL)
    vehicle.command_int(SPEED, 0, 25.0, 0)
    vehicle.command_int(ALTITUDE, frame=0, z=900.0)
    vehicle.advance(10.0)
    vehicle.command_long(176, 1, 12)
    vehicle.guided()
    height_m = vehicle.truth.altitude_amsl_m
    truth = vehicle.flown(40.0)
    assert math.degrees(truth.bank_rad) == pytest.approx(15.0)
    assert truth.airspeed_m_s == pytest.approx(20.0, abs=1e-3)
    assert truth.altitude_amsl_m == pytest.approx(height_m)


@pytest.mark.parametrize("command", [SPEED, HEADING, ALTITUDE, 178, 176, 400, 511, 512])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_non_finite_value_is_denied_counted_and_never_flown(command, value):
    vehicle = new_station().guided()
    before = vehicle.truth
    assert vehicle.result(vehicle.command_int(command, value, value, value, z=value)) == "DENIED"
    assert vehicle.autopilot.counters["non-finite field"] == 1
    assert vehicle.truth == before


LATITUDE, LONGITUDE = 47.0, 8.0
METRES = math.degrees(1.0 / 6_368_000.0)
"""Degrees of latitude for one metre, to 0.2 %."""


def place(north_m: float, east_m: float) -> tuple[float, float]:
    east_deg = east_m * METRES / math.cos(math.radians(LATITUDE))
    return LATITUDE + north_m * METRES, LONGITUDE + east_deg


SQUARE = Route(tuple(place(*corner) for corner in ((0, 0), (600, 0), (600, 600), (0, 600), (0, 0))))
LINE = Route((place(0, 0), place(500, 0)))


def autopilot(route: Route, *streams: tuple[int, int]) -> Autopilot:
    return new_autopilot(
        altitude_amsl_m=588.0,
        home_altitude_amsl_m=488.0,
        route=route,
        streams=streams or None,
        icao_address=0x4B1900,
    )


def north_east(flown: Autopilot) -> tuple[float, float]:
    truth = flown.truth()
    shrink = math.cos(math.radians(LATITUDE))
    return (
        (truth.latitude_deg - LATITUDE) / METRES,
        (truth.longitude_deg - LONGITUDE) / METRES * shrink,
    )


def test_it_flies_a_line_and_on_beyond_its_end():
    flown = autopilot(LINE)
    flown.advance(60.0)
    north, east = north_east(flown)
    assert flown.truth().mode == "AUTO"
    assert north == pytest.approx(1200.0, rel=0.01)
    assert abs(east) < 0.5


def test_it_flies_round_and_round():
    flown = autopilot(SQUARE)
    corners = set()
    for step in range(1, 261):
        flown.advance(float(step))
        north, east = north_east(flown)
        # Corners are cut and overshot by the turn's radius; nowhere is it farther off.
        assert -60.0 < north < 660.0
        assert -60.0 < east < 660.0
        if step > 125:
            corners.add((round(north / 600.0), round(east / 600.0)))
    assert corners == {(0, 0), (1, 0), (1, 1), (0, 1)}


def test_where_its_route_crosses_itself_it_flies_on_as_before():
    eight = Route(
        tuple(place(*one) for one in ((0, 0), (400, 0), (400, 200), (200, 200), (200, -200)))
    )
    follower = RouteFollower(eight)
    latitude, longitude = (math.radians(one) for one in place(0, 0))
    assert follower.course_rad(latitude, longitude, 20.0) == pytest.approx(0.0, abs=0.01)
    for north_m in range(0, 210, 10):
        latitude, longitude = (math.radians(one) for one in place(north_m, 0))
        course = follower.course_rad(latitude, longitude, 20.0)
    # At (200, 0), where the last leg crosses the first one toward the west.
    assert course == pytest.approx(0.0, abs=0.01)


def test_a_mode_that_a_pilot_selects_ends_the_route():
    flown = autopilot(SQUARE)
    flown.advance(5.0)
    flown.receive(packed(mavlink.MAVLink_set_mode_message(7, 1, 15)))
    assert flown.truth().mode == "GUIDED"


def newest(name: str) -> tuple[MAVLink_message, Autopilot]:
    """The last message of a kind on a flight of 10 s, and who has sent it."""
    flown = autopilot(LINE, (getattr(mavlink, f"MAVLINK_MSG_ID_{name}"), 1_000_000))
    return of_type(parsed(flown.advance(10.0)), name)[-1], flown


def test_it_sends_what_was_asked_for_and_its_heartbeat_alone():
    flown = autopilot(LINE, (mavlink.MAVLINK_MSG_ID_FOLLOW_TARGET, 100_000))
    kinds = types_of(parsed(flown.advance(10.0)))
    assert set(kinds) == {"HEARTBEAT", "FOLLOW_TARGET"}
    assert kinds.count("FOLLOW_TARGET") == 101


@pytest.mark.parametrize(
    "name", ["FOLLOW_TARGET", "GLOBAL_POSITION_INT_COV", "HIGH_LATENCY2", "ADSB_VEHICLE"]
)
def test_every_message_tells_the_same_place(name):
    message, flown = newest(name)
    latitude = getattr(message, "lat", getattr(message, "latitude", None))
    assert latitude * 1e-7 == pytest.approx(flown.truth().latitude_deg, abs=1e-7)


def test_satellites_are_told_coarse_units_and_a_transponder_its_address_and_course():
    summary, _ = newest("HIGH_LATENCY2")
    assert (summary.altitude, summary.heading) == (588, 0)
    # 20 m/s in 0.2 m/s.
    assert (summary.airspeed, summary.groundspeed) == (100, 100)
    adsb, _ = newest("ADSB_VEHICLE")
    assert (adsb.ICAO_address, adsb.heading % 36000, adsb.hor_velocity) == (0x4B1900, 0, 2000)


def test_options_are_read():
    assert parse_route("47,8;47.1,8;47,8").points_deg == ((47.0, 8.0), (47.1, 8.0), (47.0, 8.0))
    assert parse_stream("FOLLOW_TARGET:10") == (144, 100_000)


@pytest.mark.parametrize(
    ("option", "parse", "text"),
    [
        *(
            ("--route", parse_route, text)
            for text in ("", "47,8", "47;8", "47,8;x,9", "95,0;1,1", "nan,0;1,1")
        ),
        *(
            ("--stream", parse_stream, text)
            for text in ("", "FOLLOW_TARGET", "FOLLOW_TARGET:0", "PING:1", "VFR_HUD:nan")
        ),
    ],
)
def test_what_is_no_route_or_no_stream_is_refused(option, parse, text):
    with pytest.raises(OptionError, match=option):
        parse(text)


offsets = st.tuples(st.floats(-2000.0, 2000.0), st.floats(-2000.0, 2000.0))


@given(st.lists(offsets, min_size=2, max_size=8), st.lists(offsets, min_size=1, max_size=8))
def test_from_anywhere_there_is_a_course(corners, places):
    try:
        follower = RouteFollower(Route(tuple(place(*one) for one in corners)))
    except ValueError:
        return
    for one in places:
        latitude, longitude = (math.radians(value) for value in place(*one))
        assert math.isfinite(follower.course_rad(latitude, longitude, 20.0))
