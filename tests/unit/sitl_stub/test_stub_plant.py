import math
from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace

from sitl_stub import ArticleWind, CalmWind, PlantParameters, SteadyWind
from sitl_stub.geometry import wrap_to_pi
from sitl_stub.lagging_plant import (
    MAX_LAGGING_STEP_S,
    MAX_STEP_S,
    course_hold_rates,
    tecs_acceleration_m_s2,
    tecs_integral_rate_m_s3,
    with_speed_kind,
)
from sitl_stub.loops import Targets, TurnTarget, turn_rate_rad_s, wanted_bank_rad
from sitl_stub.px4 import EmulatedPx4
from tests.kit.autopilot import new_station
from tests.kit.plants import flown, held, plant_state

Kind = Literal["course-hold", "heading-hold"]
KINDS: tuple[Kind, ...] = ("course-hold", "heading-hold")


@pytest.mark.parametrize("kind", KINDS)
def test_a_small_step_reaches_63_percent_after_one_time_constant(kind):
    plant, share = PlantParameters(kind=kind), 1.0 - math.exp(-1.0)
    turned = flown(plant, held(0.1), 1.0 / 1.2, step_s=1.0 / 120.0)[-1]
    assert turned.direction_rad == pytest.approx(0.1 * share, abs=2e-5)
    faster = flown(plant, held(speed_m_s=22.0), 1.25)[-1]
    assert faster.speed_m_s == pytest.approx(20.0 + 2.0 * share, abs=1e-4)


@pytest.mark.parametrize(
    ("target", "course_deg", "rate_rad_s"),
    [
        (TurnTarget("course", math.pi / 2), 0.0, 0.4903325),
        # The shorter way round: alpha times 10 degrees, and as fast as the bank allows.
        (TurnTarget("course", 0.0), 10.0, -1.2 * math.radians(10.0)),
        (TurnTarget("course", 0.0), 190.0, 0.4903325),
        (TurnTarget("course", 0.0), 350.0, 1.2 * math.radians(10.0)),
        # 2 m/s^2 at 20 m/s: 0.1 rad/s, less than the bank limit.
        (TurnTarget("course", 2.0, max_acceleration_m_s2=2.0), 0.0, 0.1),
    ],
)
def test_it_turns_the_shorter_way_no_faster_than_its_limits(target, course_deg, rate_rad_s):
    """Nose to the north at 20 m/s."""
    course_rad = math.radians(course_deg)
    rate = turn_rate_rad_s(
        PlantParameters(), target, course_rad=course_rad, heading_rad=0.0, speed_m_s=20.0
    )
    assert rate == pytest.approx(rate_rad_s)


@pytest.mark.parametrize(
    ("asked", "seconds", "flown_m_s"),
    # At most 3 m/s² more, and at most 32 m/s.
    [(32.0, 1.0, 23.0), (90.0, 30.0, 32.0)],
)
def test_speed_changes_no_faster_than_its_limit_and_stays_in_its_range(asked, seconds, flown_m_s):
    end = flown(PlantParameters(), held(speed_m_s=asked), seconds)[-1]
    assert end.speed_m_s == pytest.approx(flown_m_s)


def test_a_climb_is_limited_and_then_settles():
    states = flown(PlantParameters(), held(altitude_m=530.0), 40.0)
    # Up to 3 m/s with a time constant of 1 s: 3 (t - 1 + exp(-t)).
    after = states[1000]
    assert after.altitude_amsl_m == pytest.approx(500.0 + 3.0 * (4.0 + math.exp(-5.0)), abs=1e-3)
    assert after.climb_m_s == pytest.approx(3.0 * (1.0 - math.exp(-5.0)), abs=1e-3)
    assert states[-1].altitude_amsl_m == pytest.approx(530.0, abs=1e-3)


def test_a_descent_has_a_limit_of_its_own():
    plant = PlantParameters(climb_rate_max_m_s=5.0, sink_rate_max_m_s=2.0)
    after = flown(plant, held(altitude_m=400.0), 20.0)[-1]
    assert after.climb_m_s == pytest.approx(-2.0, abs=1e-6)


@pytest.mark.parametrize("delay_s", [1.0, 3.3])
def test_a_target_that_climbs_steadily_is_followed_by_the_declared_delay_later(delay_s):
    plant = PlantParameters(height_delay_s=delay_s)
    end = flown(plant, lambda t: held(altitude_m=500.0 + 2.0 * (t + 0.01)), 40.0, step_s=0.02)[-1]
    assert end.altitude_amsl_m == pytest.approx(500.0 + 2.0 * (40.0 - delay_s), abs=0.01)


@pytest.mark.parametrize(("kind", "within_deg"), [("heading-hold", 1e-3), ("bank", 0.01)])
def test_a_course_is_flown_with_the_drift_taken_off(kind, within_deg):
    # Course north in 5 m/s to the east: the nose settles asin(5/20) = 14.478 deg to the left.
    end = flown(PlantParameters(kind=kind), held(), 60.0, SteadyWind(5.0, math.pi / 2))[-1]
    assert math.degrees(wrap_to_pi(end.direction_rad)) == pytest.approx(-14.4775, abs=within_deg)
    assert end.roll_rad == pytest.approx(0.0, abs=1e-3)


def test_heading_hold_drifts_under_a_commanded_heading():
    wind = SteadyWind(5.0, math.pi / 2)
    start, *_, end = flown(PlantParameters(), held(hold="heading"), 10.0, wind)
    assert end.direction_rad == 0.0
    drift_m = (end.longitude_rad - start.longitude_rad) * 6.3886e6 * math.cos(math.radians(47.0))
    assert drift_m == pytest.approx(50.0, abs=0.1)


def test_course_hold_under_a_ground_speed_does_not_feel_the_wind():
    plant = PlantParameters(kind="course-hold")
    wanted = held(1.0, 21.0, speed="ground-speed")
    calm, windy = (
        flown(plant, wanted, 30.0, wind, start=plant_state(speed="ground-speed"))[-1]
        for wind in (CalmWind(), SteadyWind(6.0, 2.0))
    )
    assert windy == calm


def test_course_hold_under_an_airspeed_gets_its_ground_speed_from_the_triangle():
    rates = course_hold_rates(PlantParameters(kind="course-hold"), held(), 0.0, 20.0, (0.0, 5.0))
    assert (rates.north_m_s, rates.east_m_s) == pytest.approx((19.364917, 0.0))


@pytest.mark.parametrize("course_rad", [0.0, 1.0, 4.0])
def test_switching_between_airspeed_and_ground_speed_does_not_jump(course_rad):
    wind_m_s = (-3.0, 4.0)
    there = with_speed_kind(plant_state(course_rad), "ground-speed", wind_m_s)
    back = with_speed_kind(there, "airspeed", wind_m_s)
    assert there.speed_m_s != 20.0
    assert back.speed_m_s == pytest.approx(20.0)


def test_course_hold_ground_speed_keeps_the_airspeed_flyable():
    # Headwind of 8: an airspeed of at most 32 leaves 24 over ground; of at least 12 leaves 4.
    plant = PlantParameters(kind="course-hold")
    start, headwind = plant_state(speed="ground-speed"), SteadyWind(8.0, math.pi)
    for asked, flown_m_s in ((30.0, 24.0), (1.0, 4.0)):
        wanted = held(0.0, asked, speed="ground-speed")
        end = flown(plant, wanted, 30.0, headwind, start=start)[-1]
        assert end.speed_m_s == pytest.approx(flown_m_s)


@pytest.mark.parametrize("kind", KINDS)
def test_a_hurricane_leaves_everything_finite(kind):
    plant = PlantParameters(kind=kind)
    end = flown(plant, held(), 30.0, SteadyWind(60.0, 3.0), start=plant_state(1.0))[-1]
    values = (end.direction_rad, end.speed_m_s, end.latitude_rad, end.longitude_rad)
    assert all(map(math.isfinite, values))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("alpha_1_s", {"alpha_1_s": 0.0}),
        ("beta_1_s", {"beta_1_s": math.nan}),
        ("airspeed_max", {"airspeed_min_m_s": 20.0, "airspeed_max_m_s": 10.0}),
        ("max_bank_rad", {"max_bank_rad": math.pi}),
        # A hold of ground speeds cannot lag.
        ("tecs", {"kind": "course-hold", "speed_response": "tecs"}),
        ("six-dof has a speed hold of its own", {"kind": "six-dof", "speed_response": "tecs"}),
    ],
)
def test_an_aircraft_that_cannot_fly_is_refused_by_name(name, values):
    with pytest.raises(ValueError, match=name):
        PlantParameters(**values)


BANK = PlantParameters(kind="bank")
OWN = replace(EmulatedPx4.loops, max_bank_rad=math.radians(50.0))
"""As `sitl-stub --autopilot px4` flies where no plant is named."""
TECS = PlantParameters(speed_response="tecs")


NPFG = PlantParameters(kind="npfg", alpha_1_s=0.9, max_bank_rad=math.radians(50.0))


@pytest.mark.parametrize(
    ("plant", "airspeed_m_s", "target", "bank_deg"),
    [
        # 12000 cdeg/rad and a tenth of a radian.
        (BANK, 20.0, (0.1,), 12.0),
        # Limited by the aircraft, and by the acceleration that is commanded: atan(2 / 9.80665).
        (BANK, 20.0, (-2.0,), -45.0),
        (BANK, 20.0, (2.0, 2.0), 11.527),
        # PX4 wants the bank of the turn that alpha asks for: atan(0.9 * 15 * sin(0.1) / 9.80665);
        # at 90 degrees atan(1.3766) = 54 degrees, beyond the limit.
        (NPFG, 15.0, (0.1,), 7.826),
        (NPFG, 15.0, (-0.1,), -7.826),
        (NPFG, 15.0, (2.0,), 50.0),
        (NPFG, 15.0, (3.0,), 50.0),
    ],
)
def test_a_course_error_wants_a_bank_within_the_limits(plant, airspeed_m_s, target, bank_deg):
    wanted = wanted_bank_rad(
        plant,
        TurnTarget("course", *target),
        course_rad=0.0,
        heading_rad=0.0,
        airspeed_m_s=airspeed_m_s,
    )
    assert math.degrees(wanted) == pytest.approx(bank_deg, abs=1e-3)


@pytest.mark.parametrize(
    ("plant", "share"),
    [
        (BANK, 1.0 - math.exp(-1.0)),
        # The delay is that of a second lag: 1 - (0.4 e^(-t/0.4) - 0.2 e^(-t/0.2)) / 0.2.
        (
            PlantParameters(kind="npfg", roll_time_s=0.4, roll_delay_s=0.2),
            1.0 - (0.4 * math.exp(-1.0) - 0.2 * math.exp(-2.0)) / 0.2,
        ),
    ],
)
def test_the_roll_follows_with_its_time_constant_and_its_delay(plant, share):
    end = flown(plant, held(0.5, hold="bank"), 0.4)[-1]
    assert end.roll_rad == pytest.approx(0.5 * share, abs=1e-4)


@pytest.mark.parametrize("efficiency", [1.0, 0.7])
def test_the_turn_is_that_of_the_bank_flown(efficiency):
    plant = PlantParameters(kind="bank", turn_efficiency=efficiency)
    states = flown(plant, held(math.radians(30.0), hold="bank"), 6.0)
    rate = math.remainder(states[-1].direction_rad - states[-201].direction_rad, math.tau)
    # g tan(30 deg) / 20 = 0.28310 rad/s
    assert rate == pytest.approx(efficiency * 0.28310, abs=1e-4)


def test_a_speed_step_starts_as_steeply_as_measured_and_overshoots():
    states = flown(TECS, held(speed_m_s=25.0), 60.0)
    first = (states[40].speed_m_s - states[0].speed_m_s) / 0.2
    assert first == pytest.approx(2.5, abs=0.01)
    assert 25.2 < max(one.speed_m_s for one in states) < 26.0
    assert states[-1].speed_m_s == pytest.approx(25.0, abs=0.1)


def test_a_slow_sinusoid_of_speed_comes_out_as_large_and_as_late_as_measured():
    # Measured on ArduPlane with the dead time of 0.5 s: gain 0.93 to 1.07, 2.2 to 2.4 s late.
    omega, step_s = math.tau / 24.0, 0.02
    states = flown(
        TECS, lambda t: held(speed_m_s=20.0 + 1.5 * math.sin(omega * t)), 240.0, step_s=step_s
    )
    swings = np.array([one.speed_m_s for one in states]) - 20.0
    # The last two periods. Of a sine that is late by p the wave's angle is -pi / 2 - p.
    last = np.arange(round(192.0 / step_s), swings.size)
    wave = np.mean(swings[last] * np.exp(-1j * omega * step_s * last)) * 2.0 / 1.5
    assert 0.93 < abs(wave) < 1.07
    assert 2.2 < (-math.pi / 2.0 - np.angle(wave)) / omega + TECS.speed_delay_s < 2.4


def test_height_gives_way_by_some_metres_while_the_speed_changes():
    states = flown(TECS, held(speed_m_s=26.0), 60.0)
    lost_m = 500.0 - min(one.altitude_amsl_m for one in states)
    assert 2.0 < lost_m < 5.0
    assert states[-1].altitude_amsl_m == pytest.approx(500.0, abs=0.2)


def test_the_integral_stands_still_while_the_acceleration_is_at_its_limit():
    assert tecs_acceleration_m_s2(10.0, 0.0, 2.5) == 2.5
    assert tecs_integral_rate_m_s3(10.0, 0.0, 2.5) == 0.0
    assert tecs_integral_rate_m_s3(1.0, 0.0, 2.5) == pytest.approx(0.03)
    assert tecs_integral_rate_m_s3(-1.0, 3.5, 2.5) == pytest.approx(-0.03)


@pytest.mark.parametrize(
    ("plant", "speed_kind", "longest_s", "within_m"),
    [
        (PlantParameters(), "airspeed", MAX_STEP_S, 0.005),
        (PlantParameters(kind="course-hold"), "airspeed", MAX_STEP_S, 0.005),
        (PlantParameters(kind="course-hold"), "ground-speed", MAX_STEP_S, 0.005),
        (BANK, "airspeed", MAX_LAGGING_STEP_S, 0.05),
        (PlantParameters(kind="bank", speed_response="tecs"), "airspeed", MAX_LAGGING_STEP_S, 0.05),
    ],
)
def test_the_longest_step_is_converged_to_what_telemetry_resolves(
    plant, speed_kind, longest_s, within_m
):
    """For a minute in a wind that turns, while course and speed are commanded anew every 50 ms."""

    def aim(now_s: float) -> Targets:
        at_s = math.floor(now_s / 0.05 + 1e-6) * 0.05
        return held(0.13 * at_s, 20.0 + 3.0 * math.sin(0.3 * at_s), speed=speed_kind)

    coarse, fine = (
        flown(plant, aim, 60.0, ArticleWind(), step_s=step_s, start=plant_state(0.5))[-1]
        for step_s in (longest_s, 0.0025)
    )
    north_rad = coarse.latitude_rad - fine.latitude_rad
    east_rad = (coarse.longitude_rad - fine.longitude_rad) * math.cos(fine.latitude_rad)
    assert 6.4e6 * math.hypot(north_rad, east_rad) < within_m
    assert abs(wrap_to_pi(coarse.direction_rad - fine.direction_rad)) < math.radians(0.01)


@pytest.mark.parametrize(
    ("plant", "lag"),
    [
        # 1 / 0.9 for the loop and 0.3 for the dead time; the roll is still in a steady turn.
        (
            PlantParameters(kind="npfg", alpha_1_s=0.9, roll_time_s=0.4, course_dead_time_s=0.3),
            1.0 / 0.9 + 0.3,
        ),
        # As `sitl-stub --autopilot px4` flies: 1.20 and 1.17 s were measured.
        (OWN, 1.2),
    ],
)
def test_px4_s_course_in_a_ramp_lags_by_its_bandwidth_and_its_dead_time(plant, lag):
    vehicle = new_station(autopilot="px4", plant=plant, airspeed_m_s=15.0)
    vehicle.command_long(176, 1, 4, 19)
    for step in range(600):
        vehicle.advance(step / 20)
        vehicle.command_long(43_002, 0, 6.0 * step / 20)
    behind = math.radians(6.0 * 599 / 20) - vehicle.truth.course_rad
    lag_s = math.remainder(behind, math.tau) / math.radians(6.0)
    assert lag_s == pytest.approx(lag, abs=0.05)


PX4 = PlantParameters(kind="npfg", speed_response="px4")
UNTRIMMED = PlantParameters(kind="npfg", speed_response="px4-untrimmed")


def test_px4s_airspeed_creeps_without_the_throttles_of_each_airspeed():
    """Steps of 2 m/s as it comes: half within 2 to 3 s, 0.65 after 12 s, 0.85 to 0.9 after 55 s."""
    states = flown(UNTRIMMED, held(speed_m_s=22.0), 60.0, step_s=0.01)
    shares = [(one.speed_m_s - 20.0) / 2.0 for one in states]
    assert shares[300] == pytest.approx(0.6, abs=0.15)
    assert shares[1200] == pytest.approx(0.66, abs=0.05)
    assert shares[5500] == pytest.approx(0.82, abs=0.05)


def test_px4s_airspeed_setpoint_slews_with_1_m_s2():
    states = flown(PX4, held(speed_m_s=24.0), 3.0)
    references = [one.memory[1] if one.memory else 20.0 for one in states]
    assert references[200] == pytest.approx(21.0, abs=0.02)
    assert references[-1] == pytest.approx(23.0, abs=0.02)


def test_px4s_airspeed_follows_slow_changes_at_once_and_swings_at_half_a_hertz():
    """As measured: 1.04 times as large in 12 s, and 1.8 times in 3 s."""

    def gain(period_s: float, size_m_s: float) -> float:
        turning = math.tau / period_s
        states = flown(
            PX4,
            lambda t: held(speed_m_s=20.0 + size_m_s * math.sin(turning * t)),
            6.0 * period_s,
            step_s=0.01,
        )
        late = [one.speed_m_s for one in states[len(states) // 2 :]]
        return (max(late) - min(late)) / (2.0 * size_m_s)

    assert gain(12.0, 1.0) == pytest.approx(1.05, abs=0.06)
    assert gain(3.0, 0.25) == pytest.approx(1.8, abs=0.25)


def test_px4s_airspeed_rests_where_it_is_commanded():
    states = flown(PX4, held(speed_m_s=22.0), 15.0)
    assert states[-1].speed_m_s == pytest.approx(22.0, abs=0.01)
    # 0.4 of overshoot e^(-pi D / sqrt(1 - D²)) of what the lead and the slewing leave.
    assert max(one.speed_m_s for one in states) < 22.5
