"""A leader without a companion, as a follower hears it: true messages, late ones, false ones."""

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.alerts import Alerts
from vfguide.companion.leader_telemetry import LeaderTelemetry
from vfguide.companion.plan import ForeignLeader
from vfguide.frames import LocalFrame
from vfguide.state import Airframe

FRAME = LocalFrame(47.397742, 8.545594, 488.0)
BOOTED_S = 1000.0
LEADER = ForeignLeader(
    connection="udpin://127.0.0.1:14560",
    system_id=7,
    icao_address=None,
    least_delay_s=0.2,
    airframe=Airframe(),
    rate_filter_s=0.6,
    height=100.0,
)


def listener(alerts: Alerts | None = None, **changes: Any) -> LeaderTelemetry:
    return LeaderTelemetry(replace(LEADER, **changes), FRAME, alerts, moved_s=5.0, system_id=2)


def said(alerts: Alerts) -> list[str]:
    """What the pilot should know of the leader, without its beginning."""
    return [one.text.removeprefix("the leader ") for one in alerts.heard(0.0)]


def packed(message: MAVLink_message, system_id: int = 7) -> bytes:
    return bytes(message.pack(mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)))


def position(
    sent_s: float, north: float, east: float, velocity: tuple[float, float] = (20.0, 0.0)
) -> MAVLink_message:
    latitude, longitude = FRAME.to_geodetic(north, east)
    return mavlink.MAVLink_global_position_int_message(
        round((sent_s + BOOTED_S) * 1e3),
        round(latitude * 1e7),
        round(longitude * 1e7),
        588_000,
        100_000,
        round(velocity[0] * 100.0),
        round(velocity[1] * 100.0),
        0,
        0,
    )


def northbound(sent_s: float) -> bytes:
    """20 m/s north from the origin."""
    return packed(position(sent_s, 20.0 * sent_s, 0.0))


def fly(
    telemetry: LeaderTelemetry, until_s: float, *, begin_s: float = 0.0, rate_hz: float = 4.0
) -> None:
    for step in range(round((until_s - begin_s) * rate_hz) + 1):
        sent_s = begin_s + step / rate_hz
        telemetry.take(northbound(sent_s), sent_s + 0.2)


def test_place_and_time_are_those_of_when_it_was_sent():
    telemetry = listener()
    fly(telemetry, 5.0)
    newest = telemetry.newest
    assert newest is not None
    assert newest.time_s == pytest.approx(5.0, abs=1e-3)
    assert (newest.north, newest.east) == pytest.approx((100.0, 0.0), abs=0.05)
    assert (newest.course, newest.ground_speed) == pytest.approx((0.0, 20.0), abs=1e-3)
    assert newest.altitude_amsl == pytest.approx(588.0)


def test_its_turn_is_found_by_the_listener():
    telemetry, rate, radius = listener(), 0.1, 200.0
    for step in range(80):
        sent_s = 0.25 * step
        course = rate * sent_s
        message = position(
            sent_s,
            radius * math.sin(course),
            radius * (1.0 - math.cos(course)),
            (20.0 * math.cos(course), 20.0 * math.sin(course)),
        )
        telemetry.take(packed(message), sent_s + 0.2)
    assert telemetry.newest is not None
    assert telemetry.newest.turn_rate == pytest.approx(rate, abs=2e-3)


def target(sent_s: float, north: float) -> bytes:
    """FOLLOW_TARGET without a velocity."""
    latitude, longitude = FRAME.to_geodetic(north, 0.0)
    zero = [0.0, 0.0, 0.0]
    return packed(
        mavlink.MAVLink_follow_target_message(
            round((sent_s + BOOTED_S) * 1e3),
            0b1,
            round(latitude * 1e7),
            round(longitude * 1e7),
            588.0,
            zero,
            zero,
            [1.0, 0.0, 0.0, 0.0],
            zero,
            zero,
            0,
        )
    )


def test_from_places_alone_the_velocity_is_found():
    telemetry = listener()
    for sent_s in range(10):
        telemetry.take(target(float(sent_s), 20.0 * sent_s), sent_s + 0.2)
    assert telemetry.newest is not None
    assert telemetry.newest.ground_speed == pytest.approx(20.0, abs=0.1)
    assert telemetry.newest.course == pytest.approx(0.0, abs=0.01)


def test_the_first_place_alone_is_no_motion():
    telemetry = listener()
    assert not telemetry.take(target(0.0, 0.0), 0.2)
    assert telemetry.newest is None


def test_one_better_message_alone_does_not_take_over():
    telemetry = listener()
    fly(telemetry, 2.0)
    assert not telemetry.take(target(2.1, 42.0), 2.3)
    assert telemetry.take(northbound(2.25), 2.45)


def test_a_better_message_takes_over_and_the_next_best_waits_three_seconds():
    telemetry = listener()
    fly(telemetry, 2.0)
    for sent_s in (2.25, 2.5, 2.75):
        telemetry.take(target(sent_s, 20.0 * sent_s), sent_s + 0.2)
    assert not telemetry.take(northbound(3.0), 3.2)
    # The first one of the better kind was not used either.
    assert telemetry.counters["a better message comes"] == 2
    assert telemetry.take(northbound(6.0), 6.2)


def test_what_another_system_says_is_not_heard():
    telemetry = listener()
    message = position(0.0, 0.0, 0.0)
    assert not telemetry.take(packed(message, system_id=8), 0.2)
    assert telemetry.newest is None


def test_who_hears_another_aircraft_in_its_place_is_told_once():
    alerts = Alerts()
    telemetry = listener(alerts)
    for step in range(40):
        sent_s = 0.25 * step
        telemetry.take(packed(position(sent_s, 5.0 * step, 0.0), system_id=8), sent_s + 0.2)
    (words,) = said(alerts)
    assert words.startswith("is not heard, system 8 is")


@pytest.mark.parametrize(
    ("north", "velocity"),
    [(3000.0, (20.0, 0.0)), (100.0, (-20.0, 0.0)), (100.0, (150.0, 0.0)), (100.0, (20.0, 200.0))],
)
def test_one_message_that_cannot_be_true_moves_nothing(north, velocity):
    alerts = Alerts()
    telemetry = listener(alerts)
    fly(telemetry, 5.0)
    before = telemetry.newest
    assert not telemetry.take(packed(position(5.25, north, 0.0, velocity)), 5.45)
    assert telemetry.newest is before
    assert telemetry.counters["impossible"] == 1
    (words,) = said(alerts)
    assert words.startswith("reports what cannot be")


def test_a_leader_on_the_ground_is_followed_once_it_flies():
    alerts = Alerts()
    telemetry = listener(alerts)
    for step in range(8):
        telemetry.take(packed(position(0.25 * step, 0.0, 0.0, (0.0, 0.0))), 0.25 * step + 0.2)
    assert telemetry.newest is None
    assert telemetry.counters["not flying"] == 8
    for step in range(1, 60):
        # From 2 s on it accelerates by 2 m/s² to 20 m/s.
        speed = min(0.5 * step, 20.0)
        north = 0.25 * step**2 * 0.25 if speed < 20.0 else 100.0 + 5.0 * (step - 40)
        sent_s = 1.75 + 0.25 * step
        telemetry.take(packed(position(sent_s, north, 0.0, (speed, 0.0))), sent_s + 0.2)
    assert telemetry.newest is not None
    assert [words.split(":")[0].split(" (")[0] for words in said(alerts)] == [
        "does not fly",
        "flies",
    ]


def test_time_that_runs_backward_once_is_not_believed():
    telemetry = listener()
    fly(telemetry, 5.0)
    assert not telemetry.take(packed(position(-900.0, 100.0, 0.0)), 5.45)
    assert telemetry.counters["time stamp not believed"] == 1


def test_after_a_reboot_it_is_followed_again_by_its_new_clock():
    alerts = Alerts()
    telemetry = listener(alerts)
    fly(telemetry, 5.0)
    for step in range(12):
        sent_s = 8.0 + 0.25 * step
        # Its clock begins at 0 at 8 s.
        message = position(sent_s - 8.0 - BOOTED_S + 0.1, 20.0 * sent_s, 0.0)
        telemetry.take(packed(message), sent_s + 0.2)
    assert telemetry.newest is not None
    assert telemetry.newest.time_s == pytest.approx(10.75, abs=2e-3)
    assert telemetry.newest.north == pytest.approx(215.0, abs=0.1)
    assert any("another clock" in words for words in said(alerts))


def test_a_late_leader_is_told_once_and_again_when_it_is_in_time():
    alerts = Alerts()
    telemetry = listener(alerts)
    fly(telemetry, 5.0)
    for step in range(4):
        sent_s = 5.25 + 0.25 * step
        telemetry.take(northbound(sent_s), sent_s + 1.7)
    fly(telemetry, 12.0, begin_s=10.0)
    assert [words.split(":")[0] for words in said(alerts)] == [
        "is heard 1.7 s late",
        "is heard in time again",
    ]


def test_altitude_that_steps_is_not_known():
    telemetry = listener()
    fly(telemetry, 5.0)
    message = position(5.25, 105.0, 0.0)
    message.alt += 200_000
    telemetry.take(packed(message), 5.45)
    assert telemetry.newest is not None
    assert math.isnan(telemetry.newest.altitude_amsl)


def test_it_is_asked_for_its_time_and_believes_its_answer():
    telemetry = listener(least_delay_s=None)
    fly(telemetry, 5.0)
    said = mavlink.MAVLink(None).parse_buffer(telemetry.say(5.2)) or []
    assert [one.get_type() for one in said] == ["HEARTBEAT", "TIMESYNC"]
    assert telemetry.say(5.3) == b""
    # 0.2 s there, 0.2 s back.
    answer = mavlink.MAVLink_timesync_message(round((5.4 + BOOTED_S) * 1e9), said[1].ts1)
    telemetry.take(packed(answer), 5.6)
    telemetry.take(northbound(5.5), 5.7)
    assert telemetry.newest is not None
    assert telemetry.newest.time_s == pytest.approx(5.5, abs=2e-3)


def test_an_answer_says_nothing_of_a_program_beside_the_autopilot():
    telemetry = listener(least_delay_s=None)
    for sent_s in range(6):
        telemetry.take(target(float(sent_s), 20.0 * sent_s), sent_s + 0.2)
    said = mavlink.MAVLink(None).parse_buffer(telemetry.say(5.2)) or []
    # The autopilot was started 3 s after the program that sends FOLLOW_TARGET.
    answer = mavlink.MAVLink_timesync_message(round((2.4 + BOOTED_S) * 1e9), said[1].ts1)
    telemetry.take(packed(answer), 5.6)
    telemetry.take(target(6.0, 120.0), 6.2)
    assert telemetry.newest is not None
    assert telemetry.newest.time_s == pytest.approx(6.2, abs=2e-3)


def test_an_answer_that_nobody_asked_for_says_nothing():
    telemetry = listener(least_delay_s=None)
    fly(telemetry, 5.0)
    answer = mavlink.MAVLink_timesync_message(round((5.4 + BOOTED_S) * 1e9), 12345)
    telemetry.take(packed(answer), 5.6)
    telemetry.take(northbound(5.5), 5.7)
    assert telemetry.newest is not None
    assert telemetry.newest.time_s == pytest.approx(5.7, abs=2e-3)


numbers = st.integers(-(2**31), 2**31 - 1)
small = st.integers(-(2**15), 2**15 - 1)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 2**32 - 1), numbers, numbers, numbers, small, small), max_size=20
    )
)
def test_whatever_is_said_in_its_name_the_motion_stays_finite(said):
    telemetry = listener()
    fly(telemetry, 3.0)
    for number, (stamp, lat, lon, alt, vx, vy) in enumerate(said):
        now = 3.2 + 0.1 * number
        message = mavlink.MAVLink_global_position_int_message(stamp, lat, lon, alt, 0, vx, vy, 0, 0)
        telemetry.take(packed(message), now)
        newest = telemetry.newest
        assert newest is not None
        assert newest.time_s <= now
        assert math.isfinite(newest.north + newest.east + newest.course + newest.ground_speed)
        assert math.isfinite(newest.turn_rate + newest.acceleration + newest.turn_acceleration)


def bare_place(sent_s: float, north: float, east: float) -> bytes:
    """FOLLOW_TARGET with a position and nothing else."""
    latitude, longitude = FRAME.to_geodetic(north, east)
    message = mavlink.MAVLink_follow_target_message(
        round((sent_s + BOOTED_S) * 1e3),
        1,
        round(latitude * 1e7),
        round(longitude * 1e7),
        588.0,
        [0.0] * 3,
        [0.0] * 3,
        [1.0, 0.0, 0.0, 0.0],
        [0.0] * 3,
        [0.0] * 3,
        0,
    )
    return packed(message)


@pytest.mark.parametrize("gap_s", [6, 10, 15, 30])
def test_after_a_gap_with_a_turn_in_it_a_leader_that_tells_places_alone_is_found_again(gap_s):
    # 20 m/s round a circle of 170 m: 0.118 rad/s, so that 15 s are 100 degrees.
    telemetry, rate = listener(), 20.0 / 170.0

    def place(at_s: float) -> tuple[float, float]:
        return 170.0 * math.sin(rate * at_s), 170.0 - 170.0 * math.cos(rate * at_s)

    for sent_s in (*range(20), *range(20 + gap_s, 60 + gap_s)):
        telemetry.take(bare_place(sent_s, *place(sent_s)), sent_s + 0.2)
    newest = telemetry.newest
    assert newest is not None
    assert newest.time_s == pytest.approx(59.0 + gap_s, abs=0.01)
    assert (newest.north, newest.east) == pytest.approx(place(newest.time_s), abs=1.0)
    off = (newest.course - rate * newest.time_s + math.pi) % (2.0 * math.pi) - math.pi
    assert abs(off) < 0.1


def test_a_jump_of_a_leader_that_tells_places_alone_is_not_followed_at_once():
    telemetry = listener()
    for sent_s in range(20):
        telemetry.take(bare_place(sent_s, 20.0 * sent_s, 0.0), sent_s + 0.2)
    for sent_s in range(20, 24):
        assert not telemetry.take(bare_place(sent_s, 20.0 * sent_s, 300.0), sent_s + 0.2)
    newest = telemetry.newest
    assert newest is not None
    assert newest.east == pytest.approx(0.0, abs=1.0)


def high(sent_s: float, altitude_m: float) -> bytes:
    """20 m/s north from the origin, at an altitude above mean sea level."""
    message = position(sent_s, 20.0 * sent_s, 0.0)
    message.alt = round(altitude_m * 1e3)
    return packed(message)


@pytest.mark.parametrize(("altitude_m", "off"), [(0.0, "588 m below"), (635.0, "47 m above")])
def test_an_altitude_that_cannot_be_right_is_not_followed_and_told_once(altitude_m, off):
    alerts = Alerts()
    telemetry = listener(alerts)
    for step in range(20):
        telemetry.take(high(0.25 * step, altitude_m), 0.25 * step + 0.2)
    assert telemetry.newest is not None
    # Its place is followed, at one's own height.
    assert telemetry.newest.north == pytest.approx(95.0, abs=0.1)
    assert math.isnan(telemetry.newest.height)
    (text,) = said(alerts)
    assert f"an altitude of {altitude_m:.0f} m, {off} the mission's: own height kept" in text


def test_a_leader_that_climbs_to_the_missions_height_and_beyond_is_followed():
    alerts = Alerts()
    telemetry = listener(alerts)
    heights = []
    for step in range(120):
        telemetry.take(high(0.25 * step, 548.0 + 0.75 * step), 0.25 * step + 0.2)
        assert telemetry.newest is not None
        heights.append(telemetry.newest.height)
    assert math.isnan(heights[0])
    # 25 m below the flying height of 100 m, 15 m above where it began.
    assert math.isnan(heights[19])
    assert heights[20] == pytest.approx(75.0)
    assert heights[-1] == pytest.approx(149.25)
    assert [text.split(",")[0][:25] for text in said(alerts)] == [
        "reports an altitude of 54",
        "is as high as the mission",
    ]


@given(st.lists(st.floats(-1000.0, 30_000.0), min_size=1, max_size=30))
def test_whatever_altitude_is_first_told_none_is_followed_far_from_the_missions(altitudes):
    telemetry, near = listener(), False
    for step, altitude in enumerate(altitudes):
        telemetry.take(high(0.25 * step, altitude), 0.25 * step + 0.2)
        near = near or abs(altitude - 588.0) <= 25.001
        newest = telemetry.newest
        assert newest is not None
        assert near or math.isnan(newest.height)
