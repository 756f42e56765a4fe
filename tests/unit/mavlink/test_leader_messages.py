"""What an aircraft without a companion says, from bytes to SI units."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.states import leader_at
from tests.kit.wire import frame_of, framed, position_report
from vfguide.mavlink.codec import traffic_report
from vfguide.mavlink.leader_messages import (
    READERS,
    LeaderCodec,
    LeaderReport,
    follow_target_message,
)
from vfguide.mavlink.reports import TimeReport


def global_position(**values: int) -> MAVLink_message:
    return position_report(**({"time_boot_ms": 1500, "vx": 1200, "vy": -900} | values))


def target(**values: Any) -> MAVLink_message:
    fields = {key: [0.0, 0.0, 0.0] for key in ("acc", "rates", "position_cov")} | {
        "timestamp": 2500,
        "est_capabilities": 0b11,
        "lat": 473977420,
        "lon": 85455940,
        "alt": 588.0,
        "vel": [12.0, -9.0, 0.0],
        "attitude_q": [1.0, 0.0, 0.0, 0.0],
        "custom_state": 0,
    }
    return mavlink.MAVLink_follow_target_message(**(fields | values))


def adsb(**values: Any) -> MAVLink_message:
    fields = {
        "ICAO_address": 0x4B1900,
        "lat": 473977420,
        "lon": 85455940,
        "altitude_type": mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
        "altitude": 588_000,
        "heading": 9000,
        "hor_velocity": 3000,
        "ver_velocity": 0,
        "callsign": b"HB-CDE",
        "emitter_type": 1,
        "tslc": 2,
        "flags": 0b1111,
        "squawk": 7000,
    }
    return mavlink.MAVLink_adsb_vehicle_message(**(fields | values))


def one(message: MAVLink_message, codec: LeaderCodec | None = None) -> LeaderReport:
    (report,) = (codec or LeaderCodec(system_id=7)).decode(framed(message))
    assert isinstance(report, LeaderReport)
    return report


def refused(message: MAVLink_message) -> dict[str, int]:
    codec = LeaderCodec(system_id=7)
    assert codec.decode(framed(message)) == []
    return dict(codec.counters)


def high_latency(failures: int = 0) -> MAVLink_message:
    return mavlink.MAVLink_high_latency2_message(
        *(4500, 1, 3, 0, 473977420, 85455940, 588, 0, 45, 0, 0, 0, 100, 0, 75),
        *(0, 0, 0, 0, 0, 0, -1, 0, failures, 0, 0, 0),
    )


# Counts microseconds and metres per second.
COVARIANCE = mavlink.MAVLink_global_position_int_cov_message(
    3_500_000, 0, 473977420, 85455940, 588_000, 100_000, 12.0, -9.0, 0.0, [0.0] * 36
)


@pytest.mark.parametrize(
    ("message", "stamp_s", "velocity"),
    [
        (global_position(), 1.5, (12.0, -9.0)),
        (target(), 2.5, (12.0, -9.0)),
        # A follow target tells a velocity only where its bit says so.
        (target(est_capabilities=0b01), 2.5, None),
        (COVARIANCE, 3.5, (12.0, -9.0)),
        # Tells a place alone.
        (high_latency(), 4.5, None),
    ],
)
def test_each_message_is_read_in_si_units(message, stamp_s, velocity):
    report = one(message)
    place = (report.latitude_deg, report.longitude_deg, report.altitude_amsl)
    assert place == pytest.approx((47.397742, 8.545594, 588.0))
    assert report.stamp_s == pytest.approx(stamp_s)
    assert report.velocity == (velocity and pytest.approx(velocity))


def test_adsb_tells_its_course_and_how_old_it_is_but_no_time():
    report = one(adsb(), LeaderCodec(icao_address=0x4B1900))
    assert (report.stamp_s, report.age_s) == (None, 2.0)
    assert report.velocity == pytest.approx((0.0, 30.0), abs=1e-9)
    # A pressure altitude is none to keep clear by.
    by_pressure = one(adsb(altitude_type=0), LeaderCodec(icao_address=0x4B1900))
    assert math.isnan(by_pressure.altitude_amsl)


def test_altitude_of_another_aircraft_says_by_how_much_it_may_be_off():
    """An airliner at 10 km by air pressure is far above; a type that there is not says nothing."""
    airliner = traffic_report(adsb(altitude_type=0, altitude=10_000_000))
    assert (airliner.altitude_amsl, airliner.altitude_error) == (10_000.0, 500.0)
    geometric = traffic_report(adsb())
    assert (geometric.altitude_amsl, geometric.altitude_error) == (588.0, 0.0)
    for values in ({"altitude_type": 7}, {"altitude_type": 0, "flags": 0b1101}):
        assert math.isnan(traffic_report(adsb(**values)).altitude_amsl)


@pytest.mark.parametrize("values", [{"ICAO_address": 1}, {"flags": 0b1110}, {"tslc": 6}])
def test_adsb_of_another_aircraft_or_without_a_fresh_place_is_refused(values):
    assert LeaderCodec(icao_address=0x4B1900).decode(framed(adsb(**values))) == []


def test_any_component_of_the_aircraft_may_speak_and_no_other_system():
    codec = LeaderCodec(system_id=7)
    assert len(codec.decode(framed(target(), component_id=191))) == 1
    assert codec.decode(framed(global_position(), system_id=8)) == []
    assert codec.counters == {"of another system": 1}
    # Whoever passes ADS-B on.
    receiver = LeaderCodec(icao_address=0x4B1900)
    assert len(receiver.decode(framed(adsb(), system_id=200))) == 1


@pytest.mark.parametrize(
    "message",
    [
        global_position(lat=-(2**31), lon=-(2**31)),
        global_position(lat=2**31 - 1),
        global_position(lat=0, lon=0),
        target(est_capabilities=0),
        target(vel=[math.nan, 0.0, 0.0]),
        target(vel=[math.inf, 0.0, 0.0]),
        target(vel=[2000.0, 0.0, 0.0]),
        high_latency(mavlink.HL_FAILURE_FLAG_GPS),
    ],
)
def test_what_is_no_place_or_no_velocity_is_refused(message):
    assert refused(message) == {"out of range": 1}


@pytest.mark.parametrize("altitude", [math.nan, math.inf, -1e9, 1e9])
def test_altitude_that_no_aircraft_has_is_not_known(altitude):
    assert math.isnan(one(target(alt=altitude)).altitude_amsl)


def test_answers_about_the_time_are_read_and_questions_are_not():
    codec = LeaderCodec(system_id=7)
    answer, question = (mavlink.MAVLink_timesync_message(tc1, 123) for tc1 in (456, 0))
    assert codec.decode(framed(answer)) == [TimeReport(stamp=123, autopilot_ns=456)]
    assert codec.decode(framed(question)) == []


@given(st.binary(max_size=300))
def test_no_bytes_raise(data):
    LeaderCodec(system_id=7).decode(data)


@given(st.sampled_from(sorted(READERS)), st.binary(min_size=1, max_size=255))
def test_no_payload_raises_or_leads_to_numbers_that_are_none(number, payload):
    frame = frame_of(number, payload)
    for report in LeaderCodec(system_id=7).decode(frame):
        if isinstance(report, TimeReport):
            continue
        assert abs(report.latitude_deg) <= 90.0
        assert abs(report.longitude_deg) <= 180.0
        assert report.velocity is None or math.isfinite(math.hypot(*report.velocity))
        assert not math.isinf(report.altitude_amsl)


def test_own_follow_target_says_what_the_motion_is():
    motion = leader_at(time_s=12.5, course=math.pi / 2.0, acceleration=0.5, turn_rate=0.1)
    message = follow_target_message(
        motion, latitude_deg=47.0, longitude_deg=8.0, altitude_amsl=588.0, heading=math.pi / 2.0
    )
    # East at 20 m/s, faster by 0.5 m/s², turning right: 20 * 0.1 = 2 m/s² toward south.
    assert message.vel == pytest.approx([0.0, 20.0, 0.0], abs=1e-9)
    assert message.acc == pytest.approx([-2.0, 0.5, 0.0], abs=1e-9)
    assert message.attitude_q == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    assert message.est_capabilities == 0b1111
    report = one(message)
    assert report.stamp_s == pytest.approx(12.5)
    assert (report.latitude_deg, report.longitude_deg) == pytest.approx((47.0, 8.0))
