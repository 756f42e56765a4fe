import pytest

from tests.kit.missions import mission_with, plan_of, shipped, with_vehicle
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.supervisor import ModeTimeouts
from vfguide.mavlink.adapter import AutopilotSetpoint
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.px4 import Px4


def test_a_follower_knows_what_its_leader_flies():
    known, leads = plan_of(vehicle="f1").task.leader, plan_of(vehicle="leader").task
    assert (known.path, known.path_gains) == (leads.path, leads.path_gains)
    assert known.airspeed == leads.airspeed == 20.0
    assert known.rate_filter_s == shipped("line-calm").controller.rate_filter_s


@pytest.mark.parametrize(("lowest", "highest", "away"), [(12, 32, 20), (12, 18, 18), (22, 32, 22)])
def test_a_follower_flies_away_at_its_leaders_airspeed_as_far_as_it_can(lowest, highest, away):
    changed = with_vehicle("line-calm", "f1", airspeed_range_m_s=(lowest, highest))
    assert flight_plan(changed, "f1").task.airspeed == away


def test_patience_is_the_missions():
    assert plan_of().timeouts == ModeTimeouts()
    said = {"telemetry_s": 2.0, "leader_s": 3.0, "prediction_s": 4.0, "breakaway_s": 0.0}
    changed = mission_with("line-calm", patience=said)
    for name in ("leader", "f1"):
        assert flight_plan(changed, name).timeouts == ModeTimeouts(**said)


def test_heights_frames_and_limits_are_those_of_the_mission_in_si_units():
    assert plan_of("survey-racetrack", "lead").altitude_amsl == 488.0 + 120.0
    assert plan_of("survey-racetrack", "right").altitude_amsl == 488.0 + 120.0 + 10.0
    place = plan_of().frame.to_local(47.397742, 8.545594)
    assert place == pytest.approx((0.0, 0.0), abs=1e-6)
    airframe = plan_of("transit-abreast", "wing").airframe
    assert airframe.max_bank == pytest.approx(0.6981317, abs=1e-7)
    assert (airframe.airspeed_min, airframe.airspeed_max) == (14.0, 30.0)
    assert (airframe.alpha, airframe.beta, airframe.hold) == (1.2, 0.8, "heading-hold")


def test_each_filter_has_its_own_time_constant():
    times = {"position_filter_s": 1.1, "wind_filter_s": 0.7, "rate_filter_s": 0.3}
    changed = mission_with("line-calm", controller=times)
    for name in ("leader", "f1"):
        settings = flight_plan(changed, name).settings
        assert (settings.filters.position_s, settings.filters.wind_s) == (1.1, 0.7)
        assert settings.rate_filter_s == 0.3
    assert flight_plan(changed, "f1").task.leader.rate_filter_s == 0.3


def test_each_autopilot_gets_its_own_adapter_which_takes_the_turn_that_the_bank_allows():
    assert isinstance(adapter_of(shipped("line-calm").vehicles["f1"]), ArduPlane)
    assert isinstance(adapter_of(shipped("survey-racetrack").vehicles["left"]), Px4)
    setpoint = AutopilotSetpoint(
        course=0.0, speed=20.0, altitude_amsl=588.0, latitude_deg=47.0, longitude_deg=8.0
    )
    heading, _ = adapter_of(shipped("transit-abreast").vehicles["wing"]).fly(setpoint)
    # g tan(40 degrees) = 9.80665 * 0.8390996
    assert heading.param3 == pytest.approx(8.228756, abs=1e-6)
    assert (heading.target_system, heading.target_component) == (2, 1)
