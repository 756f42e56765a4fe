"""Autopilots that can only be engaged while setpoints arrive, and those that need none."""

import struct
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import HEADING, SET_MODE, Flight, heard_until, new_flight
from tests.kit.wire import packed, parsed
from vfguide.companion.supervisor import Mode

CHANGE_SPEED, REQUEST_MESSAGE = 178, 512
GROUND_STATION, COMPANION = 6, 18
POSITION = "SET_POSITION_TARGET_GLOBAL_INT"
BY_POSITIONS = (1, 16)
"""A version that is steered in offboard."""


def test_px4_hears_setpoints_before_it_is_asked_for_offboard():
    flown = new_flight(kind="px4", version=BY_POSITIONS, until_s=40.0)
    setpoints = flown.times(POSITION)
    assert flown.times(SET_MODE)
    assert setpoints[0] < flown.times(SET_MODE)[0]
    assert flown.autopilot_mode == "OFFBOARD"
    assert flown.mode_at(40.0) is Mode.TRACKING
    # A speed goes with every setpoint by which it is steered, and with no other.
    steered = [time for time in setpoints if flown.mode_at(time).steers]
    assert flown.times(CHANGE_SPEED) == steered


def test_px4_hears_setpoints_from_a_companion_that_may_not_engage_and_may_be_put_into_offboard():
    flown = new_flight(kind="px4", version=BY_POSITIONS, engage=False, until_s=10.0)
    assert flown.later(POSITION, 5.0) == [pytest.approx(5.1 + 0.1 * k) for k in range(50)]
    assert flown.times(CHANGE_SPEED) == flown.times(SET_MODE) == []
    assert flown.autopilot_mode == "LOITER"
    flown.pilot("OFFBOARD")
    assert flown.autopilot_mode == "OFFBOARD"
    flown.run(50.0)
    assert flown.autopilot_mode == "OFFBOARD"
    assert flown.mode_at(50.0) is Mode.TRACKING
    assert flown.times(SET_MODE) == []


@pytest.mark.parametrize("mode", ["ALTCTL", "LOITER"])
def test_px4_that_the_pilot_took_hears_the_stream_and_nothing_that_it_would_obey(mode):
    flown = new_flight(kind="px4", version=BY_POSITIONS, until_s=10.0)
    assert flown.autopilot_mode == "OFFBOARD"
    flown.pilot(mode, until_s=20.0)
    assert flown.mode_at(20.0) is Mode.PILOT
    stream = flown.later(POSITION, 10.0)
    assert max(later - earlier for earlier, later in pairwise(stream)) <= 0.25 + 1e-6
    assert stream[-1] > 19.75
    assert flown.later(CHANGE_SPEED, 10.0) == flown.later(SET_MODE, 10.0) == []
    assert flown.autopilot_mode == mode


@pytest.mark.parametrize("vehicle", ["f1", "leader"])
def test_the_pilot_of_px4_can_select_offboard_again(vehicle):
    flown = new_flight(vehicle, kind="px4", version=BY_POSITIONS, until_s=10.0)
    flown.pilot("LOITER", until_s=15.0)
    flown.pilot("OFFBOARD")
    assert flown.autopilot_mode == "OFFBOARD"
    flown.run(70.0)
    assert flown.autopilot_mode == "OFFBOARD"
    assert flown.mode_at(70.0) is Mode.TRACKING


def test_px4_that_was_given_back_for_lack_of_a_leader_hears_no_stream():
    patience = {"prediction_s": 2.0, "breakaway_s": 2.0}
    flown = new_flight(
        kind="px4", version=BY_POSITIONS, link=heard_until(10.0), patience=patience, until_s=20.0
    )
    assert flown.mode_at(20.0) is Mode.LOST
    assert flown.later(POSITION, 10.0)
    assert flown.later(POSITION, 14.5) == []


def test_arduplane_hears_no_setpoints_while_it_is_not_engaged():
    waiting = new_flight(engage=False, until_s=10.0)
    assert waiting.times(HEADING) == waiting.times(POSITION) == []
    taken = new_flight(until_s=10.0)
    taken.pilot("LOITER", until_s=20.0)
    assert taken.times(HEADING)
    assert taken.later(HEADING, 10.0) == taken.times(POSITION) == []


def test_px4_that_has_guided_course_is_engaged_without_a_stream_once_it_has_told_its_version():
    flown = new_flight(kind="px4", until_s=60.0)
    assert flown.times(POSITION) == []
    assert flown.times(REQUEST_MESSAGE)[0] < flown.times(SET_MODE)[0]
    (text,) = [text for _, text in flown.events if "PX4 1.18" in text]
    assert text.endswith("should it and every ground station fall silent, NAV_DLL_ACT decides")
    assert flown.autopilot_mode == "GUIDED"
    assert flown.mode_at(60.0) is Mode.TRACKING
    assert flown.later(HEADING, 50.0)
    assert flown.autopilot.truth().altitude_amsl_m == pytest.approx(588.0, abs=0.5)


def test_one_whose_version_cannot_be_asked_for_is_flown_by_positions():
    flown = new_flight(kind="px4", lose=frozenset({REQUEST_MESSAGE}), until_s=60.0)
    assert flown.autopilot_mode == "OFFBOARD"
    assert flown.mode_at(60.0) is Mode.TRACKING


def heartbeat_kinds(flown: Flight, from_s: float) -> set[int]:
    sent = b"".join(data for time, data in flown.sent if time > from_s)
    return {one.type for one in parsed(sent) if one.get_type() == "HEARTBEAT"}


def test_a_ground_station_beats_beside_the_companion_until_a_pilot_flies():
    flown = new_flight(kind="px4", until_s=20.0)
    assert heartbeat_kinds(flown, 10.0) == {COMPANION, GROUND_STATION}
    flown.pilot("ALTCTL", until_s=30.0)
    assert flown.mode_at(30.0) is Mode.PILOT
    assert heartbeat_kinds(flown, 22.0) == {COMPANION}


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_no_ground_station_beats_where_the_autopilot_has_another_fail_safe(kind):
    flown = new_flight(kind=kind, version=BY_POSITIONS if kind == "px4" else None, until_s=20.0)
    assert heartbeat_kinds(flown, 0.0) == {COMPANION}


def test_a_companion_that_dies_in_guided_course_leaves_an_aircraft_that_loiters():
    flown = new_flight(kind="px4", until_s=20.0)
    (one,) = struct.unpack("<f", struct.pack("<i", 1))
    setting = mavlink.MAVLink_param_set_message(2, 1, b"NAV_DLL_ACT", one, 6)
    flown.autopilot.receive(packed(setting))
    flown.run(40.0)
    assert flown.autopilot_mode == "GUIDED"
    flown.autopilot.advance(51.0)
    assert flown.autopilot_mode == "GUIDED"
    flown.autopilot.advance(54.0)
    assert flown.autopilot_mode == "LOITER"
