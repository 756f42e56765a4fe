"""How a PX4 answers, by its own parameters."""

import math

import pytest

from tests.kit.autopilot import address
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.px4_parameters import px4_response, px4_warnings

FACTORY = {
    "NPFG_PERIOD": 10.0,
    "NPFG_DAMPING": 0.7,
    "FW_AIRSPD_MIN": 10.0,
    "FW_AIRSPD_MAX": 20.0,
    "FW_R_LIM": 50.0,
    "FW_R_TC": 0.4,
    "FW_T_TAS_TC": 5.0,
    "FW_THR_ASPD_MIN": 0.0,
    "FW_THR_TRIM": 0.6,
    "FW_THR_ASPD_MAX": 0.0,
}
"""As PX4 1.18.0-beta1 comes, but for the throttles of its simulated airplane."""

TRIMMED = FACTORY | {
    "FW_T_TAS_TC": 2.0,
    "FW_THR_ASPD_MIN": 0.28,
    "FW_THR_TRIM": 0.58,
    "FW_THR_ASPD_MAX": 0.98,
}

NEEDS = FlightNeeds(
    system_id=1,
    airspeed_min=11.0,
    airspeed_max=19.0,
    airspeed=15.0,
    max_bank=math.radians(45.0),
    alpha=0.9,
    rate_hz=25.0,
)


def test_the_course_s_bandwidth_is_npfg_s():
    # 4 pi 0.7 / 10
    assert px4_response(FACTORY).alpha == pytest.approx(0.8796, abs=1e-4)


def test_what_the_parameters_tell_is_taken():
    assert px4_response({"FW_AIRSPD_MIN": 10.0, "FW_R_LIM": 50.0, "FW_R_TC": 0.3}) == (
        AutopilotResponse(
            airspeed_min=10.0,
            max_bank=math.radians(50.0),
            course_lag=0.3,
            speed_hold="total-energy",
        )
    )


@pytest.mark.parametrize(
    ("parameters", "climb", "sink"),
    [
        # As PX4 comes: it may climb at 5 m/s, and goes to a new altitude at 3.
        (
            {
                "FW_T_CLMB_MAX": 5.0,
                "FW_T_CLMB_R_SP": 3.0,
                "FW_T_SINK_MAX": 5.0,
                "FW_T_SINK_R_SP": 2.0,
            },
            3.0,
            2.0,
        ),
        ({"FW_T_CLMB_MAX": 2.5, "FW_T_CLMB_R_SP": 3.0, "FW_T_SINK_MAX": 1.5}, 2.5, 1.5),
        ({"FW_T_CLMB_R_SP": 0.0}, None, None),
    ],
)
def test_the_height_goes_to_another_at_the_lower_of_two_rates(parameters, climb, sink):
    response = px4_response(parameters)
    assert (response.climb_max, response.sink_max) == (climb, sink)


def test_what_was_not_answered_is_not_known():
    assert px4_response({}) == AutopilotResponse()


@pytest.mark.parametrize(
    ("parameters", "beta"),
    [
        (FACTORY, 1.5),
        (TRIMMED, 3.0),
        (TRIMMED | {"FW_T_TAS_TC": 5.0}, 3.0),
        (FACTORY | {"FW_T_TAS_TC": 2.0}, 1.5),
        (TRIMMED | {"FW_T_TAS_TC": 10.0}, None),
        # Not in order, they are no throttles of level flight.
        (TRIMMED | {"FW_THR_TRIM": 0.2}, 1.5),
        ({"FW_T_TAS_TC": 5.0}, None),
    ],
)
def test_the_speed_s_beta_is_known_where_it_was_measured(parameters, beta):
    assert px4_response(parameters).beta == beta


def test_a_hold_whose_throttles_are_not_set_creeps_to_a_new_airspeed():
    hold = px4_response(FACTORY).creeping_hold
    # As measured on 1.18: 0.6 of a step within 2 s.
    assert hold is not None
    assert (hold.share, hold.time) == (0.6, 70.0)
    assert px4_response(TRIMMED).creeping_hold is None
    assert px4_response(FACTORY | {"FW_T_TAS_TC": 10.0}).creeping_hold is None


@pytest.mark.parametrize("name", ["NPFG_PERIOD", "NPFG_DAMPING", "FW_R_LIM", "FW_R_TC"])
def test_a_parameter_of_nothing_tells_nothing(name):
    response = px4_response(FACTORY | {name: 0.0})
    assert None in {response.alpha, response.max_bank, response.course_lag}


def test_an_autopilot_without_the_throttles_of_its_airspeeds_is_told_what_that_costs():
    (warning,) = px4_warnings(FACTORY, NEEDS, None)
    assert warning.startswith("FW_THR_ASPD_MIN, FW_THR_TRIM and FW_THR_ASPD_MAX are 0, 0.6 and 0")
    assert "costs accuracy" in warning
    assert px4_warnings(TRIMMED, NEEDS, None) == []


def test_all_that_the_response_wants_is_asked_for():
    plane = Px4(address())
    assert set(FACTORY) <= set(plane.parameters)
    assert plane.response(FACTORY, NEEDS) == px4_response(FACTORY)
