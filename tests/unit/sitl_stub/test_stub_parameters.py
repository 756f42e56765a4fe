import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import PlantParameters
from sitl_stub.parameters import Parameters, ParameterType, int8, int16, int32, real, stored
from tests.kit.autopilot import GroundStation, new_station
from tests.kit.wire import of_type

INT32 = mavlink.MAV_PARAM_TYPE_INT32


def listed(vehicle: GroundStation) -> list[Any]:
    """The whole list, which comes by and by."""
    values = vehicle.send(mavlink.MAVLink_param_request_list_message(7, 1))
    values += vehicle.advance(vehicle.truth.time_s + 0.9)
    return of_type(values, "PARAM_VALUE")


def test_the_list_is_complete_and_numbered_and_tells_the_limits_flown():
    vehicle = new_station()
    values = listed(vehicle)
    assert [value.param_index for value in values] == list(range(len(values)))
    assert {value.param_count for value in values} == {len(values)}
    by_name = {value.param_id: value.param_value for value in values}
    assert (by_name["AIRSPEED_MIN"], by_name["AIRSPEED_MAX"]) == (12.0, 32.0)
    assert by_name["ROLL_LIMIT_DEG"] == pytest.approx(45.0)
    assert by_name["FS_GCS_ENABL"] == 0.0
    assert {"GUIDED_P", "SCHED_LOOP_RATE", "FS_LONG_ACTN", "TKOFF_ALT"} <= by_name.keys()
    # It comes in parts, so that datagrams stay short.
    asked = vehicle.frame(mavlink.MAVLink_param_request_list_message(7, 1))
    assert len(vehicle.autopilot.receive(asked)) < 500


def test_one_is_read_by_name_or_by_number_and_none_that_is_none():
    vehicle = new_station()
    value = vehicle.read("AIRSPEED_MIN")
    (same,) = vehicle.send(mavlink.MAVLink_param_request_read_message(7, 1, b"", value.param_index))
    assert (same.param_id, same.param_value) == ("AIRSPEED_MIN", 12.0)
    assert vehicle.send(mavlink.MAVLink_param_request_read_message(7, 1, b"NONE", -1)) == []
    assert vehicle.send(mavlink.MAVLink_param_request_read_message(7, 1, b"", 999)) == []
    assert vehicle.write("NONE", 1.0) == []


def test_a_new_airspeed_limit_is_stored_answered_and_flown_by():
    vehicle = new_station().guided()
    (answer,) = vehicle.write("AIRSPEED_MAX", 24.0)
    assert answer.param_value == 24.0
    assert vehicle.read("AIRSPEED_MAX").param_value == 24.0
    assert vehicle.result(vehicle.command_int(43000, 0, 25.0)) == "FAILED"
    assert vehicle.result(vehicle.command_int(43000, 0, 24.0)) == "ACCEPTED"


def test_guided_p_is_what_the_bank_plant_flies_by():
    vehicle = new_station(plant=PlantParameters(kind="bank"))
    assert vehicle.read("GUIDED_P").param_value == 12_000.0
    vehicle.guided()
    vehicle.command_int(43002, 0, 0.0, 9.8)
    vehicle.advance(20.0)
    vehicle.write("GUIDED_P", 3000.0)
    vehicle.command_int(43002, 0, 20.0, 9.8)
    vehicle.advance(20.5)
    # 3000 cdeg/rad * 0.349 rad = 10.5 deg at most
    assert 0.0 < math.degrees(vehicle.truth.bank_rad) < 10.5


def test_npfg_s_parameters_are_what_px4_s_course_is_flown_by():
    def lag_s(period_s: float) -> float:
        """Of a course that turns with 3 degrees a second."""
        vehicle = new_station(autopilot="px4", plant=PlantParameters(kind="npfg"))
        vehicle.write("NPFG_PERIOD", period_s)
        vehicle.command_long(176, 1, 4, 19)
        for tenth in range(300):
            vehicle.advance(tenth / 10.0)
            vehicle.command_long(43_002, 0, 0.3 * tenth)
        behind = math.radians(0.3 * 299) - vehicle.truth.course_rad
        return math.remainder(behind, math.tau) / math.radians(3.0)

    # 4 pi 0.7 / 10 = 0.880, and half of it; setpoints are 0.05 s old on average, and 0.1 s when they end.
    assert lag_s(10.0) == pytest.approx(1.137 + 0.05, abs=0.06)
    assert lag_s(20.0) == pytest.approx(2.274 + 0.05, abs=0.06)
    assert lag_s(0.0) == pytest.approx(1.0 / 1.2 + 0.05, abs=0.06)


@pytest.mark.parametrize("response", ["px4", "px4-untrimmed"])
def test_the_throttles_of_its_airspeeds_decide_how_px4_s_speed_answers(response):
    vehicle = new_station(
        autopilot="px4", plant=PlantParameters(kind="npfg", speed_response=response)
    )
    trimmed = response == "px4"
    assert (vehicle.read("FW_THR_ASPD_MIN").param_value > 0.0) is trimmed
    assert vehicle.read("FW_T_TAS_TC").param_value == (2.0 if trimmed else 5.0)

    def missing_m_s(to_s: float, wanted_m_s: float) -> float:
        vehicle.command_long(178, 0, wanted_m_s, -1)
        vehicle.advance(to_s)
        return abs(float(vehicle.truth.airspeed_m_s) - wanted_m_s)

    vehicle.command_long(176, 1, 4, 19)
    first = missing_m_s(20.0, 22.0)
    for name, value in (("MIN", 0.28), ("MAX", 0.0 if trimmed else 0.98)):
        vehicle.write(f"FW_THR_ASPD_{name}", value)
    second = missing_m_s(120.0, 22.0), missing_m_s(140.0, 24.0)
    assert (first < 0.1) is trimmed
    assert (second[1] < 0.1) is not trimmed


def test_a_roll_that_is_set_slower_is_flown_slower():
    def bank_deg(roll_s: float) -> float:
        vehicle = new_station(autopilot="px4", plant=PlantParameters(kind="npfg"))
        vehicle.command_long(176, 1, 4, 19)
        vehicle.advance(10.0)
        vehicle.write("FW_R_TC", roll_s)
        vehicle.command_long(43_002, 0, 30.0)
        vehicle.advance(10.3)
        return math.degrees(vehicle.truth.bank_rad)

    assert bank_deg(0.4) > 1.5 * bank_deg(0.8)


def test_px4_s_list_begins_with_its_checksum_which_changes_with_a_value_and_ends_the_list():
    vehicle = new_station(autopilot="px4")
    first = listed(vehicle)[0]
    assert (first.param_id, first.param_index) == ("_HASH_CHECK", 65_535)
    before = struct.pack("<f", vehicle.read("_HASH_CHECK").param_value)
    vehicle.write("NAV_LOITER_RAD", 120.0)
    assert struct.pack("<f", vehicle.read("_HASH_CHECK").param_value) != before
    vehicle.send(mavlink.MAVLink_param_request_list_message(7, 1))
    vehicle.write("_HASH_CHECK", 0.0)
    assert of_type(vehicle.advance(vehicle.truth.time_s + 1.0), "PARAM_VALUE") == []


def test_the_ground_s_silence_is_noticed_once_the_fail_safe_is_on():
    vehicle = new_station()
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    vehicle.guided()
    vehicle.send(heartbeat)
    assert vehicle.flown(60.0).mode == "GUIDED"  # off, as it comes
    vehicle.write("FS_GCS_ENABL", 1.0)
    vehicle.write("FS_LONG_ACTN", 1.0)
    for second in range(61, 80):
        vehicle.send(heartbeat)
        vehicle.advance(float(second))
    assert vehicle.truth.mode == "GUIDED"
    assert vehicle.flown(90.0).mode == "RTL"


@given(st.floats(width=32), st.sampled_from(["A", "B", "C", "D"]))
def test_whatever_is_set_stays_a_finite_number_within_its_type(value, name):
    for encoding in ("cast", "bytewise"):
        parameters = Parameters(
            [real("A", 1.0), int8("B", 1), int16("C", 1), int32("D", 1)],
            "cast" if encoding == "cast" else "bytewise",
        )
        parameters.set(name, parameters.decoded(name, value))
        assert math.isfinite(parameters[name])
        assert math.isfinite(stored(parameters.kind(name), parameters[name]))
        struct.pack("<f", parameters.encoded(name))


def test_a_type_bounds_and_rounds_what_it_stores():
    assert stored(ParameterType.INT8, 200.4) == 127.0
    assert stored(ParameterType.INT16, -1e9) == -32_768.0
    assert stored(ParameterType.INT16, 11.6) == 12.0
    assert stored(ParameterType.REAL32, 0.1) == pytest.approx(0.1, abs=1e-8)
    assert math.isfinite(stored(ParameterType.REAL32, 1e300))
