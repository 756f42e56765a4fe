import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import BadLink, Fault, PlantParameters
from sitl_stub.air import AirData, density_ratio
from sitl_stub.sensor_errors import SensorErrors
from tests.kit.autopilot import GroundStation, new_autopilot
from tests.kit.wire import command_long, of_type, packed, types_of


def make(**changes: object) -> GroundStation:
    """Makes an aircraft in the air at 580 m with some fields of its configuration changed."""
    height = {"altitude_amsl_m": 580.0, "home_altitude_amsl_m": 480.0}
    return GroundStation(new_autopilot(**(height | changes)))


def test_the_standard_atmosphere_is_known():
    # ICAO: 1.225 kg/m^3 at sea level, 1.1116 at 1000 m, 0.7361 at 5000 m.
    assert density_ratio(0.0) == 1.0
    assert density_ratio(1000.0) * 1.225 == pytest.approx(1.1116, abs=2e-4)
    assert density_ratio(5000.0) * 1.225 == pytest.approx(0.7361, abs=2e-4)
    assert AirData(indicated=True).shown_per_true(580.0) == pytest.approx(0.9723, abs=1e-4)


def test_an_indicated_airspeed_is_flown_faster_and_shown_as_commanded():
    vehicle = make(indicated_airspeed=True)
    vehicle.guided()
    assert vehicle.result(vehicle.command_int(43000, 0, 22.0)) == "ACCEPTED"
    assert vehicle.result(vehicle.command_int(43000, 0, 32.5)) == "FAILED"
    hud = of_type(vehicle.advance(30.0), "VFR_HUD")[-1]
    assert hud.airspeed == pytest.approx(22.0, abs=1e-3)
    assert vehicle.truth.airspeed_m_s == pytest.approx(22.0 / 0.9723, abs=2e-3)
    vehicle.command_int(43000, 0, 32.0)
    hud = of_type(vehicle.advance(60.0), "VFR_HUD")[-1]
    assert hud.airspeed == pytest.approx(32.0, abs=1e-3)


def test_a_sensor_that_is_off_by_3_percent_is_flown_by_all_the_same():
    vehicle = make(airspeed_calibration=1.03)
    assert vehicle.truth.airspeed_m_s == pytest.approx(20.0 / 1.03)
    assert of_type(vehicle.advance(0.0), "VFR_HUD")[0].airspeed == pytest.approx(20.0)


@pytest.mark.parametrize("plant", ["heading-hold", "bank", "six-dof"])
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_an_altitude_that_drifts_is_held_as_it_is_measured(autopilot, plant):
    errors = SensorErrors("standalone", seed=3, system_id=7)
    before, after = errors.altitude_drift_m(0.0), errors.altitude_drift_m(100.0)
    assert after - before > 3.0
    vehicle = make(
        autopilot=autopilot, plant=PlantParameters(kind=plant), sensors="standalone", seed=3
    )
    vehicle.interval(33, 100_000)
    vehicle.advance(95.0)
    reports = [one.alt * 1e-3 for one in of_type(vehicle.advance(105.0), "GLOBAL_POSITION_INT")]
    # What it measured at the start is what it measures still; a noise of 0.8 m of 100 reports is left.
    assert sum(reports) / len(reports) == pytest.approx(580.0 + before, abs=0.5)
    true_m = vehicle.truth.altitude_amsl_m
    assert true_m == pytest.approx(580.0 + before - after, abs=1.0)


def test_neighbours_share_most_of_what_their_altitudes_by_satellites_are_off():
    apart, off = [], []
    for seed in range(30):
        one, two = (SensorErrors("standalone", seed=seed, system_id=number) for number in (1, 2))
        apart.append(one.satellite_altitude_m(0.0) - two.satellite_altitude_m(0.0))
        off.append(one.satellite_altitude_m(0.0))
    # 2 . 1.26 m shared, 2 . 0.2 m each one's own; a third of margin for 30 draws.
    assert math.sqrt(sum(x * x for x in apart) / 30) == pytest.approx(0.4 * 1.414, rel=0.33)
    assert math.sqrt(sum(x * x for x in off) / 30) == pytest.approx(2.55, rel=0.33)


def test_a_receiver_tells_the_altitude_by_satellites_whatever_the_barometer_shows():
    vehicle = make(sensors="standalone", seed=3)
    vehicle.interval(24, 1_000_000)
    report = of_type(vehicle.advance(1.5), "GPS_RAW_INT")[-1]
    error_m = SensorErrors("standalone", seed=3, system_id=7).satellite_altitude_m(1.0)
    true_m = vehicle.autopilot.truth().altitude_amsl_m
    assert report.alt * 1e-3 == pytest.approx(true_m + error_m, abs=0.3)


def test_a_height_that_is_commanded_is_reached_as_it_is_measured():
    vehicle = make(sensors="standalone", seed=10)
    vehicle.guided()
    # 120 m above home, which is at 480 m.
    assert vehicle.result(vehicle.command_int(43001, 0, 0, 0.0, z=120.0)) == "ACCEPTED"
    vehicle.advance(60.0)
    drift_m = SensorErrors("standalone", seed=10, system_id=7).altitude_drift_m(60.0)
    assert abs(drift_m) > 1.0
    assert vehicle.truth.altitude_amsl_m == pytest.approx(600.0 - drift_m, abs=0.5)


def test_a_glitch_moves_reported_positions_for_its_time_and_nothing_else():
    glitched = make(faults=(Fault("offset", 2.0, 3.0, 40.0, -30.0),))
    right = make()
    for each in (glitched, right):
        each.interval(33, 1_000_000)
    positions = zip(
        of_type(glitched.advance(7.5), "GLOBAL_POSITION_INT"),
        of_type(right.advance(7.5), "GLOBAL_POSITION_INT"),
        strict=True,
    )
    off_m = [round((one.lat - other.lat) * 1e-7 * 111_180.0) for one, other in positions]
    assert off_m == [0, 0, 40, 40, 40, 0, 0, 0]
    assert glitched.truth == right.truth


@pytest.mark.parametrize(
    ("faults", "cog_deg"),
    [
        # 3 m/s south and 3 m/s east
        ((Fault("velocity", 0.0, 9.0, -3.0, 3.0),), 135),
        # At a bank of 15 degrees it turns by 7.53 degrees in the second before its last velocity.
        ((Fault("held", 1.5, 60.0),), 7.53),
    ],
)
def test_a_course_over_ground_is_that_of_the_velocity_that_is_reported(faults, cog_deg):
    vehicle = make(faults=faults).guided()
    vehicle.advance(2.0)
    vehicle.command_long(43002, 0, 90.0, 9.8)
    (report,) = of_type(vehicle.advance(8.0) and vehicle.command_long(512, 24), "GPS_RAW_INT")
    assert report.cog == pytest.approx(100 * cog_deg, abs=1)


NOISE = {
    "position_noise_m": 0.5,
    "velocity_noise_m_s": 0.3,
    "heading_noise_rad": math.radians(1.0),
    "airspeed_noise_m_s": 0.5,
}


@pytest.mark.parametrize(
    ("noise", "name", "field", "unit", "size"),
    [
        ("position_noise_m", "GLOBAL_POSITION_INT", "lat", 1e-7 * 111_180.0, 0.5),
        ("position_noise_m", "GLOBAL_POSITION_INT", "lon", 1e-7 * 76_060.0, 0.5),
        ("velocity_noise_m_s", "GLOBAL_POSITION_INT", "vx", 0.01, 0.3),
        ("heading_noise_rad", "GLOBAL_POSITION_INT", "hdg", 0.01, 1.0),
        ("airspeed_noise_m_s", "VFR_HUD", "airspeed", 1.0, 0.5),
    ],
)
def test_each_measurement_has_noise_of_its_own_size(noise, name, field, unit, size):
    others = {one: value for one, value in NOISE.items() if one != noise}
    noisy, quiet, still = make(**NOISE), make(**others), make()
    for each in (noisy, quiet, still):
        each.interval(33, 10_000)
        each.interval(74, 10_000)
    shown, true = (of_type(each.advance(20.0), name) for each in (noisy, still))
    unchanged = of_type(quiet.advance(20.0), name)
    assert [getattr(one, field) for one in unchanged] == [getattr(one, field) for one in true]
    # No other error is as large as half a turn of a heading in cdeg.
    pairs = zip(shown, true, strict=True)
    errors = [(getattr(a, field) - getattr(b, field) + 18_000) % 36_000 - 18_000 for a, b in pairs]
    spread = math.sqrt(sum(error**2 for error in errors) / len(errors))
    assert spread * unit == pytest.approx(size, rel=0.1)
    assert abs(sum(errors) / len(errors)) * unit < 0.1 * size
    assert noisy.truth == still.truth


@pytest.mark.parametrize(
    ("loop_hz", "interval_us", "stamps"),
    [
        # 20 Hz on a scheduler of 50 Hz comes 40 and 60 ms apart.
        (50.0, 50_000, [0, 60, 100, 160, 200, 260, 300, 360, 400, 460, 500]),
        (50.0, 40_000, list(range(0, 501, 40))),
        (200.0, 20_000, list(range(0, 501, 20))),
    ],
)
def test_a_stream_comes_at_turns_of_the_scheduler(loop_hz, interval_us, stamps):
    vehicle = make(loop_rate_hz=loop_hz)
    vehicle.interval(33, interval_us)
    positions = of_type(vehicle.advance(0.5), "GLOBAL_POSITION_INT")
    assert [position.time_boot_ms for position in positions] == stamps


def test_a_stream_faster_than_four_fifths_of_the_loop_is_denied():
    vehicle = make(loop_rate_hz=50.0)
    assert vehicle.interval(33, 20_000) == "DENIED"
    assert vehicle.interval(33, 25_000) == "ACCEPTED"
    assert vehicle.read("SCHED_LOOP_RATE").param_value == 50.0


def test_old_parameters_have_old_names_and_units():
    vehicle = make(old_parameter_names=True)
    assert vehicle.read("TRIM_ARSPD_CM").param_value == 2000.0
    vehicle.write("ARSPD_FBW_MAX", 25.0)
    vehicle.guided()
    assert vehicle.result(vehicle.command_int(43000, 0, 26.0)) == "FAILED"
    assert vehicle.send(mavlink.MAVLink_param_request_read_message(7, 1, b"AIRSPEED_MAX", -1)) == []


def test_a_slow_link_delays_both_ways():
    vehicle = make()
    link = BadLink(vehicle.autopilot, delay_s=0.2)
    assert link.advance(0.0) == b""
    assert link.advance(0.19) == b""
    assert len(vehicle.decoded(link.advance(0.2))) == 5
    assert link.receive(packed(command_long(176, 1, 15, system_id=7))) == b""
    link.advance(0.39)
    assert link.truth().mode == "LOITER"
    assert link.next_due_s == pytest.approx(0.4)
    link.advance(0.4)
    assert link.truth().mode == "GUIDED"
    answers = types_of(vehicle.decoded(link.advance(0.6)))
    assert answers == ["COMMAND_ACK", "STATUSTEXT", "HEARTBEAT"]


def test_a_lossy_link_loses_its_share_and_repeats_by_its_seed():
    def heard(seed: int) -> bytes:
        vehicle = make()
        vehicle.interval(33, 10_000)
        link = BadLink(vehicle.autopilot, delay_s=0.1, jitter_s=0.05, loss=0.3, seed=seed)
        return b"".join(link.advance(0.05 * index) for index in range(400))

    positions = of_type(make().decoded(heard(1)), "GLOBAL_POSITION_INT")
    assert len(positions) / 1990 == pytest.approx(0.7, abs=0.04)
    order = [position.time_boot_ms for position in positions]
    assert order != sorted(order)
    assert heard(1) == heard(1) != heard(2)
