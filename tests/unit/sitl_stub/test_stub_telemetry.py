import math
from itertools import accumulate

import pytest

from sitl_stub import ArticleWind, PlantParameters, SteadyWind
from sitl_stub.streams import Schedule
from tests.kit.autopilot import new_station
from tests.kit.wire import of_type, types_of

CROSSWIND = SteadyWind(5.0, math.pi / 2)


def test_unrequested_telemetry_comes_at_1_hz_from_time_zero_on():
    vehicle = new_station()
    defaults = ["HEARTBEAT", "SYS_STATUS", "ATTITUDE", "VFR_HUD", "GLOBAL_POSITION_INT"]
    assert types_of(vehicle.advance(0.0)) == defaults
    assert vehicle.advance(0.0) == []
    assert vehicle.advance(0.999) == []
    assert types_of(vehicle.advance(1.0)) == defaults
    assert types_of(vehicle.advance(3.5)) == defaults * 2


@pytest.mark.parametrize("interval_us", [10_000, 20_000, 33_333, 40_000, 50_000])
@pytest.mark.parametrize("step_s", [20.0, 0.05])
def test_streams_neither_drift_nor_lose_what_the_caller_s_clock_rounds(interval_us, step_s):
    vehicle = new_station()
    assert vehicle.interval(30, interval_us) == "ACCEPTED"
    times = accumulate([step_s] * round(20.0 / step_s))
    said = [one for time_s in times for one in vehicle.advance(time_s)]
    stamps = [message.time_boot_ms for message in of_type(said, "ATTITUDE")]
    assert stamps == [round(k * interval_us / 1000) for k in range(20_000_000 // interval_us + 1)]


def test_one_long_advance_reports_the_same_flight_as_many_short_ones():
    long, short = new_station(ArticleWind()), new_station(ArticleWind())
    for vehicle in (long, short):
        vehicle.interval(33, 50_000)
    one = long.autopilot.advance(10.0)
    many = b"".join(short.autopilot.advance(index * 0.05) for index in range(201))
    assert one == many


def test_a_position_comes_after_its_companions_of_the_same_instant():
    vehicle = new_station()
    for message_id in (33, 32, 74, 30, 168, 2, 245, 242):
        assert vehicle.interval(message_id, 100_000) == "ACCEPTED"
    vehicle.advance(0.0)
    messages = vehicle.advance(0.1)
    assert types_of(messages) == [
        *("SYSTEM_TIME", "EXTENDED_SYS_STATE", "HOME_POSITION", "WIND", "ATTITUDE", "VFR_HUD"),
        *("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"),
    ]
    assert {m.time_boot_ms for m in messages if hasattr(m, "time_boot_ms")} == {100}


def test_a_stream_is_stopped_and_put_back_to_its_default():
    vehicle = new_station()
    vehicle.advance(0.0)
    assert vehicle.interval(33, -1) == "ACCEPTED"
    assert of_type(vehicle.advance(2.0), "GLOBAL_POSITION_INT") == []
    assert vehicle.interval(33, 0) == "ACCEPTED"
    assert len(of_type(vehicle.advance(5.0), "GLOBAL_POSITION_INT")) == 3
    vehicle.interval(32, 500_000)
    vehicle.interval(32, 0)
    assert of_type(vehicle.advance(7.0), "LOCAL_POSITION_NED") == []


def test_an_interval_of_zero_is_that_of_the_chosen_streams_where_they_were_chosen():
    vehicle = new_station(streams=((33, 200_000),))
    vehicle.interval(33, 50_000)
    assert vehicle.interval(33, 0) == "ACCEPTED"
    assert vehicle.command_long(510, 33)[-1].interval_us == 200_000


@pytest.mark.parametrize(
    ("message_id", "interval_us"), [(33, 5_000), (33, -2), (9_999, 50_000), (33.5, 50_000), (0, -1)]
)
def test_streams_it_cannot_send_are_denied(message_id, interval_us):
    assert new_station().interval(message_id, interval_us) == "DENIED"
    # PX4 tells of no wind.
    assert new_station(autopilot="px4").interval(168, 100_000) == "DENIED"


@pytest.mark.parametrize(
    ("message_id", "answers"),
    # There is no message 4711.
    [(0, ["HEARTBEAT"]), (148, ["AUTOPILOT_VERSION"]), (242, ["HOME_POSITION"]), (4_711, [])],
)
def test_a_single_message_follows_the_acknowledgement_of_its_request(message_id, answers):
    vehicle = new_station()
    replies = vehicle.command_long(512, message_id)
    assert vehicle.result(replies) == ("ACCEPTED" if answers else "DENIED")
    assert types_of(replies) == ["COMMAND_ACK", *answers]


def test_what_is_told_of_a_turn_northbound_in_a_crosswind():
    """5 m/s to the east: the nose is asin(5/20) = 14.48 deg left, 345.52 deg."""
    vehicle = new_station(CROSSWIND)
    told = {message.get_type(): message for message in vehicle.advance(0.0)}
    position, hud = told["GLOBAL_POSITION_INT"], told["VFR_HUD"]
    # hdg is the nose and the velocity is over ground.
    assert position.hdg == 34_552
    assert (position.vx, position.vy, position.vz) == (1936, 0, 0)
    assert (hud.airspeed, hud.groundspeed) == pytest.approx((20.0, 19.364917))
    assert (hud.heading, hud.alt) == (346, 500.0)
    # Home is on the ground below the start.
    home = vehicle.command_long(512, 242)[1]
    assert (home.latitude, home.longitude, home.altitude) == (470_000_000, 80_000_000, 400_000)
    attitude = of_type(new_station().advance(0.0), "ATTITUDE")[0]
    assert math.degrees(attitude.roll) == pytest.approx(15.0)
    assert attitude.yawspeed == pytest.approx(0.13139, abs=1e-4)


def test_a_position_is_rounded_to_the_nearest_unit_of_the_message():
    vehicle = new_station()
    vehicle.command_long(176, 1, 10)
    position = of_type(vehicle.advance(7.0), "GLOBAL_POSITION_INT")[-1]
    truth = vehicle.truth
    assert position.lat == round(truth.latitude_deg * 1e7)
    assert position.lon == round(truth.longitude_deg * 1e7)
    assert (position.alt, position.relative_alt) == (500_000, 100_000)


@pytest.mark.parametrize("kind", ["heading-hold", "course-hold"])
def test_the_flight_starts_on_its_course_at_its_airspeed_in_any_wind(kind):
    vehicle = new_station(ArticleWind(), plant=PlantParameters(kind=kind), course_rad=2.0)
    truth = vehicle.truth
    assert (truth.course_rad, truth.airspeed_m_s) == pytest.approx((2.0, 20.0))
    air_m_s = truth.north_m_s - truth.wind_north_m_s, truth.east_m_s - truth.wind_east_m_s
    nose = math.cos(truth.heading_rad), math.sin(truth.heading_rad)
    assert air_m_s == pytest.approx((20.0 * nose[0], 20.0 * nose[1]))


def test_the_wind_estimate_says_where_from_and_converges_with_20_s():
    vehicle = new_station(CROSSWIND)
    vehicle.interval(168, 1_000_000)
    estimate = of_type(vehicle.advance(20.0), "WIND")[-1]
    assert estimate.direction == pytest.approx(270.0)
    assert estimate.speed == pytest.approx(5.0 * (1.0 - math.exp(-1.0)), abs=1e-4)


def test_the_local_position_is_from_home_on_the_ground():
    vehicle = new_station()
    vehicle.command_long(176, 1, 10)
    vehicle.interval(32, 1_000_000)
    local = of_type(vehicle.advance(100.0), "LOCAL_POSITION_NED")[-1]
    # 2000 m at 500 m of altitude, along the meridian.
    assert (local.x, local.y, local.z) == pytest.approx((2000.0, 0.0, -100.0), abs=0.01)


@pytest.mark.parametrize(
    ("boot_s", "first_ms"),
    # It wraps like its 32 bits.
    [(12.34, 12_340), (2**32 / 1000.0, 0)],
)
def test_time_since_boot_starts_where_it_is_told(boot_s, first_ms):
    vehicle = new_station(boot_time_s=boot_s)
    assert of_type(vehicle.advance(0.0), "ATTITUDE")[0].time_boot_ms == first_ms
    assert of_type(vehicle.advance(1.0), "ATTITUDE")[0].time_boot_ms == first_ms + 1000


def test_the_same_seed_repeats_the_flight_to_the_bit_and_another_does_not():
    def flight(seed: int) -> bytes:
        vehicle = new_station(ArticleWind(), position_noise_m=0.3, seed=seed)
        out = b""
        for index in range(200):
            if index == 10:
                vehicle.guided()
                vehicle.interval(33, 50_000)
            if index > 20:
                vehicle.command_int(43002, 0, float(index), 9.8)
            out += vehicle.autopilot.advance(index * 0.05)
        return out

    assert flight(3) == flight(3)
    assert flight(3) != flight(4)


@pytest.mark.parametrize("to_s", [0.5, math.nan, math.inf])
def test_time_does_not_go_back_or_astray(to_s):
    vehicle = new_station()
    vehicle.advance(1.0)
    with pytest.raises(ValueError, match="cannot"):
        vehicle.autopilot.advance(to_s)


def test_sequence_numbers_are_consecutive_over_replies_and_telemetry():
    vehicle = new_station()
    messages = [*vehicle.advance(0.0), *vehicle.command_long(176, 1, 15), *vehicle.advance(100.0)]
    assert [m.get_seq() for m in messages] == [index % 256 for index in range(len(messages))]


def test_a_reboot_forgets_mode_streams_and_boot_time_but_flies_on():
    vehicle = new_station()
    vehicle.advance(1.0)
    vehicle.interval(33, 50_000)
    vehicle.guided()
    assert len(of_type(vehicle.advance(2.0), "GLOBAL_POSITION_INT")) == 20
    # Anything but a reboot is denied.
    vehicle.command_long(246, 2)
    before = vehicle.truth
    assert before.mode == "GUIDED"
    vehicle.command_long(246, 1)
    after = vehicle.truth
    assert after.mode == "LOITER"
    assert (after.latitude_deg, after.longitude_deg) == (before.latitude_deg, before.longitude_deg)
    # One position a second again, 1 s and 2 s after the boot at 2 s.
    positions = of_type(vehicle.advance(4.0), "GLOBAL_POSITION_INT")
    assert [one.time_boot_ms for one in positions] == [1000, 2000]


def test_a_schedule_with_nothing_in_it_has_nothing_due():
    schedule = Schedule([1])
    assert schedule.pop_due(5_000) == []
    schedule.every(1, 2_000)
    assert schedule.next_due_us == 6_000
    schedule.stop(1)
    assert schedule.next_due_us is None
