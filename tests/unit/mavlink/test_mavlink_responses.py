"""How an autopilot answers, by its own parameters."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.autopilot import address
from vfguide.mavlink.ardupilot import arduplane_response
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
    ("parameters", "rates"),
    [
        # As PX4 comes: it may climb at 5 m/s, and goes to a new altitude at 3.
        ({"CLMB_MAX": 5.0, "CLMB_R_SP": 3.0, "SINK_MAX": 5.0, "SINK_R_SP": 2.0}, (3.0, 2.0)),
        ({"CLMB_MAX": 2.5, "CLMB_R_SP": 3.0, "SINK_MAX": 1.5}, (2.5, 1.5)),
        ({"CLMB_R_SP": 0.0}, (None, None)),
    ],
)
def test_the_height_goes_to_another_at_the_lower_of_two_rates(parameters, rates):
    response = px4_response({f"FW_T_{name}": value for name, value in parameters.items()})
    assert (response.climb_max, response.sink_max) == rates


@pytest.mark.parametrize("response", [px4_response({}), arduplane_response({}, NEEDS)])
def test_what_was_not_answered_is_not_known(response):
    assert response == AutopilotResponse()


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


FAST = replace(NEEDS, airspeed_min=12.0, airspeed_max=32.0, airspeed=20.0, alpha=1.2)
"""Of an ArduPlane."""


def test_factory_settings_of_a_vehicle_that_slips_are_slow():
    # 50 degrees of bank per radian: 0.8727 * 9.80665 / 20 = 0.428 1/s, of which 0.745 are flown.
    response = arduplane_response(
        {"GUIDED_P": 5000.0, "TECS_TIME_CONST": 5.0}, replace(FAST, slips=True)
    )
    assert response.alpha == pytest.approx(0.319, abs=0.001)
    assert response.beta == pytest.approx(0.4)


def test_coordinated_turns_follow_all_of_the_bank():
    response = arduplane_response({"GUIDED_P": 12_000.0}, FAST)
    assert response.alpha == pytest.approx(1.027, abs=0.001)


@pytest.mark.parametrize(
    "parameters",
    [
        {"AIRSPEED_MIN": 10.0, "AIRSPEED_MAX": 30.0, "ROLL_LIMIT_DEG": 40.0},
        {"ARSPD_FBW_MIN": 10.0, "ARSPD_FBW_MAX": 30.0, "LIM_ROLL_CD": 4000.0},
    ],
)
def test_limits_are_told_under_both_names(parameters):
    assert arduplane_response(parameters, FAST) == AutopilotResponse(
        airspeed_min=10.0, airspeed_max=30.0, max_bank=math.radians(40.0)
    )


def test_the_height_goes_to_another_as_fast_as_the_tecs_lets_it():
    response = arduplane_response({"TECS_CLMB_MAX": 3.5, "TECS_SINK_MAX": 2.5}, FAST)
    assert (response.climb_max, response.sink_max) == (3.5, 2.5)
    nothing = arduplane_response({"TECS_CLMB_MAX": 0.0, "TECS_SINK_MAX": math.nan}, FAST)
    assert (nothing.climb_max, nothing.sink_max) == (None, None)
