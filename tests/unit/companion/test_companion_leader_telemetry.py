"""A leader without a companion, as a follower hears it: true, late, false, and stamped wrongly."""

import math
import re
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import Flight, new_flight
from tests.kit.states import FRAME
from tests.kit.wire import framed as packed
from tests.kit.wire import parsed, position_report
from vfguide.companion.alerts import Alerts
from vfguide.companion.leader_telemetry import LeaderTelemetry
from vfguide.companion.plan import ForeignLeader
from vfguide.companion.witnesses import HeightWitnesses
from vfguide.state import Airframe

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
    witnesses = HeightWitnesses(planned=588.0, own=math.nan, above=100.0)
    known = {"moved_s": 5.0, "system_id": 2, "beside": lambda _heard: witnesses}
    return LeaderTelemetry(replace(LEADER, **changes), FRAME, alerts, **known)


def said(alerts: Alerts) -> list[str]:
    """What the pilot should know of the leader, without its beginning."""
    return [one.text.removeprefix("the leader ") for one in alerts.heard(0.0)]


def position(
    sent_s: float, north: float, east: float, velocity: tuple[float, float] = (20.0, 0.0)
) -> MAVLink_message:
    latitude, longitude = FRAME.to_geodetic(north, east)
    return position_report(
        time_boot_ms=round((sent_s + BOOTED_S) * 1e3),
        lat=round(latitude * 1e7),
        lon=round(longitude * 1e7),
        vx=round(velocity[0] * 100.0),
        vy=round(velocity[1] * 100.0),
    )


def hear(
    telemetry: LeaderTelemetry,
    sent_s: float,
    north: float | None = None,
    east: float = 0.0,
    velocity: tuple[float, float] = (20.0, 0.0),
    *,
    altitude: float = 588.0,
    stamp_s: float | None = None,
    late_s: float = 0.2,
    system_id: int = 7,
) -> bool:
    """Hear where the leader is: 20 m/s north from the origin, 0.2 s late, if nothing is said."""
    place = 20.0 * sent_s if north is None else north
    message = position(sent_s if stamp_s is None else stamp_s, place, east, velocity)
    message.alt = round(altitude * 1e3)
    return telemetry.take(packed(message, system_id=system_id), sent_s + late_s)


def hear_place(telemetry: LeaderTelemetry, sent_s: float, north: float, east: float = 0.0) -> bool:
    """Hear a FOLLOW_TARGET with a position and nothing else, 0.2 s late."""
    latitude, longitude = FRAME.to_geodetic(north, east)
    place = (round(latitude * 1e7), round(longitude * 1e7), 588.0)
    zero = [0.0] * 3
    message = mavlink.MAVLink_follow_target_message(
        round((sent_s + BOOTED_S) * 1e3), 1, *place, zero, zero, [1.0, *zero], zero, zero, 0
    )
    return telemetry.take(packed(message), sent_s + 0.2)


def fly(
    telemetry: LeaderTelemetry, until_s: float, *, begin_s: float = 0.0, late_s: float = 0.2
) -> None:
    """Hear it four times a second."""
    for step in range(round((until_s - begin_s) * 4.0) + 1):
        hear(telemetry, begin_s + step / 4.0, late_s=late_s)


def followed(until_s: float = 5.0, alerts: Alerts | None = None, **changes: Any) -> LeaderTelemetry:
    """Make a listener that has heard it until a time."""
    telemetry = listener(alerts, **changes)
    fly(telemetry, until_s)
    return telemetry


def answer(telemetry: LeaderTelemetry, sent_s: float, asked: int) -> None:
    """Hear an answer to a question for its time."""
    message = mavlink.MAVLink_timesync_message(round((sent_s + BOOTED_S) * 1e9), asked)
    telemetry.take(packed(message), 5.6)


def test_place_and_time_are_those_of_when_it_was_sent():
    telemetry = followed()
    newest = telemetry.newest
    assert newest.time_s == pytest.approx(5.0, abs=1e-3)
    assert (newest.north, newest.east) == pytest.approx((100.0, 0.0), abs=0.05)
    assert (newest.course, newest.ground_speed) == pytest.approx((0.0, 20.0), abs=1e-3)
    assert newest.altitude_amsl == pytest.approx(588.0)


def test_its_turn_is_found_by_the_listener():
    telemetry, rate, radius = listener(), 0.1, 200.0
    for step in range(80):
        sent_s = 0.25 * step
        course = rate * sent_s
        place = radius * math.sin(course), radius * (1.0 - math.cos(course))
        hear(telemetry, sent_s, *place, (20.0 * math.cos(course), 20.0 * math.sin(course)))
    assert telemetry.newest.turn_rate == pytest.approx(rate, abs=2e-3)


def test_from_places_alone_the_velocity_is_found_and_the_first_is_no_motion():
    telemetry = listener()
    assert not hear_place(telemetry, 0.0, 0.0)
    assert telemetry.newest is None
    for sent_s in range(1, 10):
        hear_place(telemetry, float(sent_s), 20.0 * sent_s)
    newest = telemetry.newest
    assert (newest.ground_speed, newest.course) == pytest.approx((20.0, 0.0), abs=0.01)


def test_one_better_message_alone_does_not_take_over():
    telemetry = followed(2.0)
    assert not hear_place(telemetry, 2.1, 42.0)
    assert hear(telemetry, 2.25)


def test_a_better_message_takes_over_and_the_next_best_waits_three_seconds():
    telemetry = followed(2.0)
    for sent_s in (2.25, 2.5, 2.75):
        hear_place(telemetry, sent_s, 20.0 * sent_s)
    assert not hear(telemetry, 3.0)
    # The first one of the better kind was not used either.
    assert telemetry.counters["a better message comes"] == 2
    assert hear(telemetry, 6.0)


def test_what_another_system_says_is_not_heard_and_told_once(alerts):
    telemetry = listener(alerts)
    assert not any(hear(telemetry, 0.25 * step, system_id=8) for step in range(40))
    assert telemetry.newest is None
    (words,) = said(alerts)
    assert words.startswith("is not heard, system 8 is")


@pytest.mark.parametrize(
    ("north", "velocity"),
    [(3000.0, (20.0, 0.0)), (100.0, (-20.0, 0.0)), (100.0, (150.0, 0.0)), (100.0, (20.0, 200.0))],
)
def test_one_message_that_cannot_be_true_moves_nothing(alerts, north, velocity):
    telemetry = followed(alerts=alerts)
    before = telemetry.newest
    assert not hear(telemetry, 5.25, north, 0.0, velocity)
    assert telemetry.newest is before
    assert telemetry.counters["impossible"] == 1
    (words,) = said(alerts)
    assert words.startswith("reports what cannot be")


def test_a_leader_on_the_ground_is_followed_once_it_flies(alerts):
    telemetry = listener(alerts)
    for step in range(8):
        hear(telemetry, 0.25 * step, 0.0, 0.0, (0.0, 0.0))
    assert telemetry.newest is None
    assert telemetry.counters["not flying"] == 8
    for step in range(1, 60):
        # From 2 s on it accelerates by 2 m/s² to 20 m/s.
        speed = min(0.5 * step, 20.0)
        north = 0.25 * step**2 * 0.25 if speed < 20.0 else 100.0 + 5.0 * (step - 40)
        hear(telemetry, 1.75 + 0.25 * step, north, 0.0, (speed, 0.0))
    assert telemetry.newest is not None
    assert [re.split(r":| \(", words)[0] for words in said(alerts)] == ["does not fly", "flies"]


def test_time_that_runs_backward_once_is_not_believed_nor_an_altitude_that_steps():
    telemetry = followed()
    assert not hear(telemetry, 5.25, 100.0, stamp_s=-900.0)
    assert telemetry.counters["time stamp not believed"] == 1
    hear(telemetry, 5.25, altitude=788.0)
    assert math.isnan(telemetry.newest.altitude_amsl)


def test_after_a_reboot_it_is_followed_again_by_its_new_clock(alerts):
    telemetry = followed(alerts=alerts)
    for step in range(12):
        sent_s = 8.0 + 0.25 * step
        # Its clock begins at 0 at 8 s.
        hear(telemetry, sent_s, stamp_s=sent_s - 8.0 - BOOTED_S + 0.1)
    assert telemetry.newest.time_s == pytest.approx(10.75, abs=2e-3)
    assert telemetry.newest.north == pytest.approx(215.0, abs=0.1)
    assert any("another clock" in words for words in said(alerts))


def test_a_late_leader_is_told_once_and_again_when_it_is_in_time(alerts):
    telemetry = followed(alerts=alerts)
    fly(telemetry, 6.0, begin_s=5.25, late_s=1.7)
    fly(telemetry, 12.0, begin_s=10.0)
    words = [text.split(":")[0] for text in said(alerts)]
    assert words == ["is heard 1.7 s late", "is heard in time again"]


@pytest.mark.parametrize(("asked", "late_s"), [(True, 0.0), (False, 0.2)])
def test_it_is_asked_for_its_time_and_believes_its_answer_and_no_other(asked, late_s):
    telemetry = followed(least_delay_s=None)
    beat, question = parsed(telemetry.say(5.2))
    assert (beat.get_type(), question.get_type()) == ("HEARTBEAT", "TIMESYNC")
    assert telemetry.say(5.3) == b""
    # 0.2 s there, 0.2 s back.
    answer(telemetry, 5.4, question.ts1 if asked else 12345)
    hear(telemetry, 5.5)
    assert telemetry.newest.time_s == pytest.approx(5.5 + late_s, abs=2e-3)


def test_an_answer_says_nothing_of_a_program_beside_the_autopilot():
    telemetry = listener(least_delay_s=None)
    for sent_s in range(6):
        hear_place(telemetry, float(sent_s), 20.0 * sent_s)
    said = parsed(telemetry.say(5.2))
    # The autopilot was started 3 s after the program that sends FOLLOW_TARGET.
    answer(telemetry, 2.4, said[1].ts1)
    hear_place(telemetry, 6.0, 120.0)
    assert telemetry.newest.time_s == pytest.approx(6.2, abs=2e-3)


STAMP, NUMBER = st.integers(0, 2**32 - 1), st.integers(-(2**31), 2**31 - 1)
SMALL = st.integers(-(2**15), 2**15 - 1)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(STAMP, NUMBER, NUMBER, NUMBER, SMALL, SMALL), max_size=20))
def test_whatever_is_said_in_its_name_the_motion_stays_finite(said):
    telemetry = followed(3.0)
    for number, (stamp, lat, lon, alt, vx, vy) in enumerate(said):
        now = 3.2 + 0.1 * number
        message = mavlink.MAVLink_global_position_int_message(stamp, lat, lon, alt, 0, vx, vy, 0, 0)
        telemetry.take(packed(message), now)
        newest = telemetry.newest
        assert newest.time_s <= now
        assert math.isfinite(newest.north + newest.east + newest.course + newest.ground_speed)
        assert math.isfinite(newest.turn_rate + newest.acceleration + newest.turn_acceleration)


@pytest.mark.parametrize("gap_s", [6, 10, 15, 30])
def test_after_a_gap_with_a_turn_in_it_a_leader_that_tells_places_alone_is_found_again(gap_s):
    # 20 m/s round a circle of 170 m: 0.118 rad/s, so that 15 s are 100 degrees.
    telemetry, rate = listener(), 20.0 / 170.0

    def place(at_s: float) -> tuple[float, float]:
        return 170.0 * math.sin(rate * at_s), 170.0 - 170.0 * math.cos(rate * at_s)

    for sent_s in (*range(20), *range(20 + gap_s, 60 + gap_s)):
        hear_place(telemetry, sent_s, *place(sent_s))
    newest = telemetry.newest
    assert newest.time_s == pytest.approx(59.0 + gap_s, abs=0.01)
    assert (newest.north, newest.east) == pytest.approx(place(newest.time_s), abs=1.0)
    off = (newest.course - rate * newest.time_s + math.pi) % (2.0 * math.pi) - math.pi
    assert abs(off) < 0.1


def test_a_jump_of_a_leader_that_tells_places_alone_is_not_followed_at_once():
    telemetry = listener()
    for sent_s in range(20):
        hear_place(telemetry, sent_s, 20.0 * sent_s, 0.0)
    for sent_s in range(20, 24):
        assert not hear_place(telemetry, sent_s, 20.0 * sent_s, 300.0)
    newest = telemetry.newest
    assert newest.east == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize(("altitude_m", "off"), [(0.0, "588 m below"), (635.0, "47 m above")])
def test_an_altitude_that_cannot_be_right_is_not_followed_and_told_once(alerts, altitude_m, off):
    telemetry = listener(alerts)
    for step in range(20):
        hear(telemetry, 0.25 * step, altitude=altitude_m)
    # Its place is followed, at one's own height.
    assert telemetry.newest.north == pytest.approx(95.0, abs=0.1)
    assert math.isnan(telemetry.newest.height)
    (text,) = said(alerts)
    assert f"an altitude of {altitude_m:.0f} m, {off} the mission's: own height kept" in text


def test_a_leader_that_climbs_to_the_missions_height_and_beyond_is_followed(alerts):
    telemetry, heights = listener(alerts), []
    for step in range(120):
        hear(telemetry, 0.25 * step, altitude=548.0 + 0.75 * step)
        heights.append(telemetry.newest.height)
    # 25 m below the flying height of 100 m, 15 m above where it began.
    assert math.isnan(heights[0] + heights[19])
    assert (heights[20], heights[-1]) == pytest.approx((75.0, 149.25))
    words = [text[:25] for text in said(alerts)]
    assert words == ["reports an altitude of 54", "reports an altitude that "]


@given(st.lists(st.floats(-1000.0, 30_000.0), min_size=1, max_size=30))
def test_whatever_altitude_is_first_told_none_is_followed_far_from_the_missions(altitudes):
    telemetry, near = listener(), False
    for step, altitude in enumerate(altitudes):
        hear(telemetry, 0.25 * step, altitude=altitude)
        near = near or abs(altitude - 588.0) <= 25.001
        newest = telemetry.newest
        assert near or math.isnan(newest.height)


def stamped(stamp: Callable[[int], int], until_s: float) -> Flight:
    """Fly with an autopilot whose boot times are others."""

    def edited(message: MAVLink_message, _now: float) -> MAVLink_message:
        if message.get_type() == "GLOBAL_POSITION_INT":
            message.time_boot_ms = stamp(message.time_boot_ms)
        return message

    return new_flight(edit=edited, until_s=until_s)


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        (lambda _ms: 0, "stand still"),
        (lambda _ms: 123_456, "stand still"),
        (lambda ms: ms * 1000 % 2**32, "run 1000 times too fast"),
        (lambda ms: ms // 1000, "times too slow"),
    ],
    ids=["zero", "stuck", "microseconds", "seconds"],
)
def test_an_own_boot_time_that_tells_no_time_is_told_and_flown_by_arrival(stamp, words):
    flown = stamped(stamp, 20.0)
    (text,) = flown.told("boot times")
    assert words in text
    assert "flown by when its reports arrive" in text
    assert flown.mode.steers


def test_boot_times_that_tell_time_again_are_gone_by_and_end_no_right_to_engage():
    flown = stamped(lambda ms: 5000 if 8_000 < ms < 12_000 else ms, 32.0)
    wrong, right = flown.told("boot times")
    assert "stand still" in wrong
    assert "tell time again" in right
    assert flown.told("rebooted") == []
    assert flown.mode.steers


@pytest.mark.parametrize("rate", [0.0, 1e-3, 1000.0])
def test_a_leader_whose_stamps_tell_no_time_is_followed_by_arrival(alerts, rate):
    telemetry = listener(alerts)
    for step in range(41):
        sent_s = 0.25 * step
        message = position(sent_s, 20.0 * sent_s, 0.0)
        message.time_boot_ms = round(message.time_boot_ms * rate) % 2**32
        telemetry.take(packed(message), sent_s + 0.2)
    newest = telemetry.newest
    assert newest is not None
    # The listener is told that the fastest message takes 0.2 s.
    assert newest.time_s == pytest.approx(10.0, abs=0.01)
    assert newest.north == pytest.approx(200.0, abs=0.5)
    (text,) = said(alerts)
    assert text.startswith("sends time stamps that ")
    assert "followed by when its messages arrive" in text


def test_a_leader_whose_messages_repeat_wholly_is_not_taken_for_one_without_a_clock(alerts):
    telemetry = listener(alerts)
    for step in range(40):
        telemetry.take(packed(position(5.0, 100.0, 0.0)), 5.2 + 0.25 * step)
    assert telemetry.newest is not None
    assert telemetry.newest.time_s == pytest.approx(5.0, abs=0.01)
    assert said(alerts) == []
