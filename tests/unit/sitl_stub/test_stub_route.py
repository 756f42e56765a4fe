"""An emulated aircraft that flies by itself, and the messages that others hear it by."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, Route
from sitl_stub.options import OptionError, parse_route, parse_stream
from sitl_stub.route import RouteFollower
from tests.kit.autopilot import new_autopilot
from tests.kit.wire import of_type, packed, parsed, types_of

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
