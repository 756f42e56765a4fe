"""What an autopilot's own parameters say: what does not fit a mission, and how it answers."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.autopilot import address
from tests.kit.wire import framed, parsed
from vfguide.mavlink.ardupilot import NAMES, ArduPlane
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds, request_parameters
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.reports import ParameterReport

PLANE, PX4 = ArduPlane(address()), Px4(address(px4_steering="auto"))

NEEDS = FlightNeeds(
    airspeed_min=14.0,
    airspeed_max=26.0,
    airspeed=20.0,
    max_bank=math.radians(45.0),
    # 12000 cdeg/rad are 2.094 rad/rad, and 2.094 * 9.80665 / 20 = 1.027.
    alpha=1.027,
    rate_hz=25.0,
    system_id=2,
)

FITTING_ARDUPLANE = {
    "FS_GCS_ENABL": 1.0,
    "FS_LONG_ACTN": 1.0,
    "FS_LONG_TIMEOUT": 5.0,
    "MAV_GCS_SYSID": 2.0,
    "GUIDED_P": 12_000.0,
    "SCHED_LOOP_RATE": 200.0,
    "TECS_TIME_CONST": 3.0,
    "AIRSPEED_MIN": 12.0,
    "AIRSPEED_MAX": 28.0,
    "ROLL_LIMIT_DEG": 45.0,
}

RECIPE = {"FW_THR_ASPD_MIN": 0.28, "FW_THR_TRIM": 0.58, "FW_THR_ASPD_MAX": 0.98, "FW_T_TAS_TC": 2.0}

FITTING_PX4 = {
    "NAV_DLL_ACT": 1.0,
    "COM_DL_LOSS_T": 10.0,
    "COM_DLL_EXCEPT": 0.0,
    # 4 pi 0.7 / 8.5 = 1.035
    "NPFG_PERIOD": 8.5,
    "NPFG_DAMPING": 0.7,
    "COM_OF_LOSS_T": 1.0,
    "COM_OBL_RC_ACT": 5.0,
    "FW_AIRSPD_MIN": 12.0,
    "FW_AIRSPD_MAX": 28.0,
    "FW_R_LIM": 50.0,
} | RECIPE


@pytest.mark.parametrize(
    ("alpha", "warned"), [(0.3, True), (0.45, False), (1.4, False), (1.5, True)]
)
def test_a_vehicle_that_slips_may_turn_half_as_fast_as_its_bank_says(alpha, warned):
    # 12000 cdeg/rad at 20 m/s are 1.027 1/s, half of it 0.514: 0.395 and 1.467 are the bounds.
    needs = replace(NEEDS, alpha=alpha, slips=True)
    warnings = PLANE.parameter_warnings(FITTING_ARDUPLANE, needs)
    assert any("gives alpha 1.03" in warning for warning in warnings) is warned


@pytest.mark.parametrize(("adapter", "fitting"), [(PLANE, FITTING_ARDUPLANE), (PX4, FITTING_PX4)])
def test_parameters_that_fit_or_are_not_known_bring_no_warning(adapter, fitting):
    assert adapter.parameter_warnings(fitting, NEEDS) == []
    assert adapter.parameter_warnings({}, NEEDS) == []


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("FS_GCS_ENABL", 0.0, "FS_GCS_ENABL is 0: should this companion fall silent"),
        ("FS_GCS_ENABL", 3.0, "FS_GCS_ENABL is 3, which leaves GUIDED out"),
        ("MAV_GCS_SYSID", 255.0, "MAV_GCS_SYSID is 255: a ground station's heartbeats"),
        ("FS_LONG_ACTN", 0.0, "FS_LONG_ACTN is 0: should this companion fall silent"),
        ("FS_LONG_TIMEOUT", 1.0, "FS_LONG_TIMEOUT is 1 s: a companion that starts anew"),
        ("FS_LONG_TIMEOUT", 60.0, "FS_LONG_TIMEOUT is 60 s: a companion that starts anew"),
        ("GUIDED_P", 5000.0, "GUIDED_P is 5000: courses are taken up slowly"),
        ("GUIDED_P", 16_000.0, "gives alpha 1.37 1/s at 20 m/s, and the mission says 1.027"),
        ("TECS_TIME_CONST", 5.0, "TECS_TIME_CONST is 5: the speed answers slowly"),
        ("SCHED_LOOP_RATE", 20.0, "25 reports a second will be refused"),
        ("SCHED_LOOP_RATE", 60.0, "25 reports a second will come unevenly"),
        ("AIRSPEED_MIN", 15.0, "AIRSPEED_MIN is 15 m/s and the mission asks for down to 14"),
        ("AIRSPEED_MAX", 22.0, "AIRSPEED_MAX is 22 m/s and the mission asks for up to 26"),
        ("ROLL_LIMIT_DEG", 30.0, "is 30 degrees and the mission turns with up to 45"),
    ],
)
def test_what_does_not_fit_arduplane_is_told_in_words(name, value, words):
    """What is unsafe or not flown speaks against taking off; what flies worse does not."""
    faults = PLANE.parameter_faults(FITTING_ARDUPLANE | {name: value}, NEEDS)
    warnings = PLANE.parameter_warnings(FITTING_ARDUPLANE | {name: value}, NEEDS)
    assert any(words in warning and warning.startswith(name) for warning in warnings)
    flies_worse = name in {"GUIDED_P", "TECS_TIME_CONST"} or "unevenly" in words
    assert bool(faults) is not flies_worse
    assert set(faults) <= set(warnings)


@pytest.mark.parametrize(
    ("climb", "counted_on", "words"),
    [
        # Half of g w / V: 0.5 * 9.80665 * 5 / 20 = 1.226 m/s²; 3 * 20 / 4.9033 = 12.24 m/s would give 3.
        (5.0, 3.0, "rise by 1.2 m/s² at most"),
        (5.0, 3.0, "(12 would do), or max_acceleration_m_s2 to 1.2"),
        (12.3, 3.0, None),
        (5.0, 1.2, None),
        (0.0, 3.0, None),
        (math.nan, 3.0, None),
    ],
)
def test_what_a_tecs_lets_the_speed_rise_by_is_told_where_the_mission_counts_on_more(
    climb, counted_on, words
):
    needs = replace(NEEDS, max_acceleration=counted_on)
    warnings = PLANE.parameter_warnings(FITTING_ARDUPLANE | {"TECS_CLMB_MAX": climb}, needs)
    assert [words in warning for warning in warnings if words is not None] == [True] * bool(words)
    assert bool(warnings) is bool(words)


def test_the_names_before_version_4_5_are_understood():
    old = {"ARSPD_FBW_MIN": 15.0, "ARSPD_FBW_MAX": 30.0, "LIM_ROLL_CD": 3000.0}
    first, second = PLANE.parameter_warnings(old, NEEDS)
    assert "ARSPD_FBW_MIN is 15" in first
    assert "LIM_ROLL_CD (in degrees) is 30" in second


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("COM_OF_LOSS_T", 0.2, "one late setpoint ends offboard"),
        ("COM_OF_LOSS_T", 30.0, "flies its last course on for that long"),
        ("COM_OBL_RC_ACT", 6.0, "COM_OBL_RC_ACT is 6: when the setpoints stop, the aircraft ends"),
        ("COM_OBL_RC_ACT", 0.0, "without one it returns to its launch, as all others do"),
        ("NAV_DLL_ACT", 0.0, "flies its last course on for ever; 1 lets it loiter"),
        ("NAV_DLL_ACT", 5.0, "NAV_DLL_ACT is 5: when nothing is heard any more"),
        ("COM_DLL_EXCEPT", 3.0, "in Guided Course NAV_DLL_ACT does nothing"),
        ("COM_DL_LOSS_T", 60.0, "COM_DL_LOSS_T is 60 s"),
        ("NPFG_PERIOD", 20.0, "give alpha 0.44 1/s, and the mission says 1.027"),
        ("FW_AIRSPD_MIN", 15.0, "FW_AIRSPD_MIN is 15 m/s"),
        ("FW_R_LIM", 40.0, "FW_R_LIM is 40 degrees"),
        ("FW_THR_ASPD_MIN", 0.0, "half of a new airspeed comes within 2 s"),
    ],
)
def test_what_does_not_fit_px4_is_told_in_words(name, value, words):
    (warning,) = PX4.parameter_warnings(FITTING_PX4 | {name: value}, NEEDS)
    assert words in warning
    flies_worse = name in {"NPFG_PERIOD", "FW_THR_ASPD_MIN"}
    assert PX4.parameter_faults(FITTING_PX4 | {name: value}, NEEDS) == [warning] * (not flies_worse)


@pytest.mark.parametrize(
    ("steering", "stops_by"),
    [
        ("guided-course", "NAV_DLL_ACT"),
        *((one, "COM_OBL_RC_ACT") for one in ("position", "velocity")),
    ],
)
def test_only_the_fail_safe_that_acts_is_spoken_of(steering, stops_by):
    changes = {"NAV_DLL_ACT": 0.0, "COM_OBL_RC_ACT": 0.0}
    plane = Px4(address(px4_steering=steering))
    (warning,) = plane.parameter_warnings(FITTING_PX4 | changes, NEEDS)
    assert warning.startswith(stops_by)


@given(st.dictionaries(st.sampled_from(NAMES), st.floats(allow_nan=False, allow_infinity=False)))
def test_any_values_are_borne(values):
    assert all(isinstance(line, str) for line in PLANE.parameter_warnings(values, NEEDS))


def test_parameters_are_asked_for_by_name():
    (message,) = parsed(Codec(7, 1).encode(request_parameters(7, 3, ["GUIDED_P"])))
    assert (message.target_system, message.target_component) == (7, 3)
    assert (message.param_id, message.param_index) == ("GUIDED_P", -1)


def test_arduplanes_numbers_are_real_and_px4s_whole_ones_are_bytes(codec):
    as_bytes = struct.unpack("<f", struct.pack("<i", 5))[0]
    real = mavlink.MAVLink_param_value_message(b"FW_R_LIM", 50.0, 9, 1, 0)
    whole = mavlink.MAVLink_param_value_message(b"COM_OBL_RC_ACT", as_bytes, 6, 1, 0)
    reports = codec.decode(framed(real) + framed(whole))
    values = [(one.name, Px4(address()).parameter_value(one)) for one in reports]
    assert values == [("FW_R_LIM", 50.0), ("COM_OBL_RC_ACT", 5.0)]


@given(value=st.floats(width=32), kind=st.integers(0, 255), name=st.binary(max_size=16))
def test_no_parameter_value_is_too_strange(value, kind, name):
    message = mavlink.MAVLink_param_value_message(name, value, kind, 1, 0)
    for report in Codec(7, 1).decode(framed(message)):
        assert isinstance(report, ParameterReport)
        assert report.whole is not None or math.isfinite(report.value)


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

TRIMMED = FACTORY | RECIPE

SLOW_NEEDS = replace(NEEDS, airspeed_min=11.0, airspeed_max=19.0, airspeed=15.0, alpha=0.9)


def test_what_the_parameters_tell_is_taken():
    # 4 pi 0.7 / 10
    assert PX4.response(FACTORY, SLOW_NEEDS).alpha == pytest.approx(0.8796, abs=1e-4)
    some = PX4.response({"FW_AIRSPD_MIN": 10.0, "FW_R_LIM": 50.0, "FW_R_TC": 0.3}, SLOW_NEEDS)
    assert some == AutopilotResponse(
        airspeed_min=10.0, max_bank=math.radians(50.0), course_lag=0.3, speed_hold="total-energy"
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
    response = PX4.response(
        {f"FW_T_{name}": value for name, value in parameters.items()}, SLOW_NEEDS
    )
    assert (response.climb_max, response.sink_max) == rates


@pytest.mark.parametrize("response", [PX4.response({}, SLOW_NEEDS), PLANE.response({}, SLOW_NEEDS)])
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
    assert PX4.response(parameters, SLOW_NEEDS).beta == beta


def test_a_hold_whose_throttles_are_not_set_creeps_to_a_new_airspeed():
    hold = PX4.response(FACTORY, SLOW_NEEDS).creeping_hold
    # As measured on 1.18: 0.6 of a step within 2 s.
    assert hold is not None
    assert (hold.share, hold.time) == (0.6, 70.0)
    assert PX4.response(TRIMMED, SLOW_NEEDS).creeping_hold is None
    assert PX4.response(FACTORY | {"FW_T_TAS_TC": 10.0}, SLOW_NEEDS).creeping_hold is None


@pytest.mark.parametrize("name", ["NPFG_PERIOD", "NPFG_DAMPING", "FW_R_LIM", "FW_R_TC"])
def test_a_parameter_of_nothing_tells_nothing(name):
    response = PX4.response(FACTORY | {name: 0.0}, SLOW_NEEDS)
    assert None in {response.alpha, response.max_bank, response.course_lag}


def test_an_autopilot_without_the_throttles_of_its_airspeeds_is_told_what_that_costs():
    (warning,) = PX4.parameter_warnings(FACTORY, SLOW_NEEDS)
    assert warning.startswith("FW_THR_ASPD_MIN, FW_THR_TRIM and FW_THR_ASPD_MAX are 0, 0.6 and 0")
    assert "costs accuracy" in warning
    assert PX4.parameter_warnings(TRIMMED, SLOW_NEEDS) == []


def test_all_that_the_response_wants_is_asked_for():
    assert set(FACTORY) <= set(PX4.parameters)


FAST = replace(SLOW_NEEDS, airspeed_min=12.0, airspeed_max=32.0, airspeed=20.0, alpha=1.2)
"""Of an ArduPlane."""


@pytest.mark.parametrize(
    ("guided_p", "slips", "alpha"),
    [
        # 50 degrees of bank per radian: 0.8727 * 9.80665 / 20 = 0.428 1/s, of which 0.745 are flown.
        (5000.0, True, 0.319),
        # Coordinated turns follow all of the bank.
        (12_000.0, False, 1.027),
    ],
)
def test_the_course_s_alpha_is_what_guided_p_gives(guided_p, slips, alpha):
    parameters = {"GUIDED_P": guided_p, "TECS_TIME_CONST": 5.0}
    response = PLANE.response(parameters, replace(FAST, slips=slips))
    assert response.alpha == pytest.approx(alpha, abs=0.001)
    assert response.beta == pytest.approx(0.4)


@pytest.mark.parametrize(
    "parameters",
    [
        {"AIRSPEED_MIN": 10.0, "AIRSPEED_MAX": 30.0, "ROLL_LIMIT_DEG": 40.0},
        {"ARSPD_FBW_MIN": 10.0, "ARSPD_FBW_MAX": 30.0, "LIM_ROLL_CD": 4000.0},
    ],
)
def test_limits_are_told_under_both_names(parameters):
    assert PLANE.response(parameters, FAST) == AutopilotResponse(
        airspeed_min=10.0, airspeed_max=30.0, max_bank=math.radians(40.0)
    )


def test_the_height_goes_to_another_as_fast_as_the_tecs_lets_it():
    response = PLANE.response({"TECS_CLMB_MAX": 3.5, "TECS_SINK_MAX": 2.5}, FAST)
    assert (response.climb_max, response.sink_max) == (3.5, 2.5)
    nothing = PLANE.response({"TECS_CLMB_MAX": 0.0, "TECS_SINK_MAX": math.nan}, FAST)
    assert (nothing.climb_max, nothing.sink_max) == (None, None)
