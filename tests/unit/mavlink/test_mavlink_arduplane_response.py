"""How an ArduPlane answers, by its own parameters."""

import math

import pytest
from msgspec.structs import replace

from vfguide.mavlink.ardupilot import arduplane_response
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds

NEEDS = FlightNeeds(
    system_id=1,
    airspeed_min=12.0,
    airspeed_max=32.0,
    airspeed=20.0,
    max_bank=0.785,
    alpha=1.2,
    rate_hz=25.0,
)
SLIPPING = replace(NEEDS, slips=True)


def test_factory_settings_of_a_vehicle_that_slips_are_slow():
    # 50 degrees of bank per radian: 0.8727 * 9.80665 / 20 = 0.428 1/s, of which 0.745 are flown.
    response = arduplane_response({"GUIDED_P": 5000.0, "TECS_TIME_CONST": 5.0}, SLIPPING)
    assert response.alpha == pytest.approx(0.319, abs=0.001)
    assert response.beta == pytest.approx(0.4)


def test_coordinated_turns_follow_all_of_the_bank():
    assert arduplane_response({"GUIDED_P": 12_000.0}, NEEDS).alpha == pytest.approx(
        1.027, abs=0.001
    )


@pytest.mark.parametrize(
    "parameters",
    [
        {"AIRSPEED_MIN": 10.0, "AIRSPEED_MAX": 30.0, "ROLL_LIMIT_DEG": 40.0},
        {"ARSPD_FBW_MIN": 10.0, "ARSPD_FBW_MAX": 30.0, "LIM_ROLL_CD": 4000.0},
    ],
)
def test_limits_are_told_under_both_names(parameters):
    assert arduplane_response(parameters, NEEDS) == AutopilotResponse(
        airspeed_min=10.0, airspeed_max=30.0, max_bank=math.radians(40.0)
    )


def test_the_height_goes_to_another_as_fast_as_the_tecs_lets_it():
    response = arduplane_response({"TECS_CLMB_MAX": 3.5, "TECS_SINK_MAX": 2.5}, NEEDS)
    assert (response.climb_max, response.sink_max) == (3.5, 2.5)
    nothing = arduplane_response({"TECS_CLMB_MAX": 0.0, "TECS_SINK_MAX": math.nan}, NEEDS)
    assert (nothing.climb_max, nothing.sink_max) == (None, None)


def test_what_was_not_answered_is_not_known():
    assert arduplane_response({}, NEEDS) == AutopilotResponse()
