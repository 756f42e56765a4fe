"""Followers in turbulence: they keep their slots without rolling after every wobble of their leader."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.kit.flight import fly
from tests.kit.missions import content_of, mission_with, shipped
from vfguide.lab.report.figures import slot_error
from vfguide.lab.studies import prediction
from vfguide.lab.studies.prediction import expected_precision
from vfguide.mission import Mission
from vfguide.mission.flight_path import path_of
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

SETTLED_S = 60.0


def roll_rate(record: FlightRecord, vehicle: VehicleRecord) -> float:
    """Root mean square of how fast a vehicle rolls once all are in their slots, rad/s."""
    late = record.time_s >= SETTLED_S
    rates = np.gradient(vehicle.bank_rad[late], record.time_s[late])
    return float(np.sqrt(np.mean(rates**2)))


@pytest.fixture(scope="module")
def gusty() -> FlightRecord:
    """Four ArduPlanes in moderate turbulence."""
    rehearsal = {"rate_hz": 12.5}  # half the shipped rate, in half the time
    return fly("ardupilot-sitl", 120.0, wind={"turbulence": "moderate"}, rehearsal=rehearsal).record


def test_followers_roll_no_more_than_their_leader_and_reach_no_limit(gusty):
    leader = roll_rate(gusty, gusty.leader)
    # With slots in the measured frame it was 3 to 4 times the leader's, and half of all setpoints at a limit.
    # By the declared response it is 1.3 times; the learned lag, to the nearest 0.2 s, makes 1.7 of that.
    assert max(roll_rate(gusty, one) for one in gusty.followers) < 1.9 * leader
    late = gusty.time_s >= SETTLED_S
    limited = [float(one.limited[late].mean()) for one in gusty.followers]
    assert max(limited) < 0.05


def test_followers_hold_the_slots_of_the_formation_as_it_is_meant(gusty):
    path = path_of(shipped("ardupilot-sitl").path)
    places = zip(gusty.leader.north_m, gusty.leader.east_m, strict=True)
    course = np.array([path.nearest(float(n), float(e)).course for n, e in places])
    meant = replace(gusty.leader, course_rad=course)
    late = gusty.time_s >= SETTLED_S
    off_m = [slot_error(meant, one).distance_m[late].mean() for one in gusty.followers]
    # Light turbulence, half as strong, left 3.9 m with slots in the measured frame, and leaves below 2.6 now.
    assert float(np.mean(off_m)) < 2.0 * 2.6


def test_first_order_holds_keep_the_slots_that_are_meant_in_moderate_gusts():
    formation = fly("line-wind", 60.0, wind={"turbulence": "moderate"}).summary.formation
    assert formation.intended_error_m is not None
    # 0.33 m with a quarter of all setpoints at a limit; the guard leaves a seventh of them there.
    assert formation.intended_error_m < 0.6


@pytest.fixture
def as_declared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what `check` flies with aircraft that answer otherwise: tests/unit/bench looks at that."""
    monkeypatch.setattr(prediction, "fly_unlike_declared", lambda *_: ())


@pytest.mark.usefixtures("as_declared")
def test_what_check_expects_of_gusty_air_is_near_what_is_flown():
    windy = mission_with(
        "line-wind",
        wind={"turbulence": "moderate"},
        rehearsal={"duration_s": 60.0, "rate_hz": 10.0, "seed": 2},
        acceptance={"mean_error_m": 0.3},
    )
    flown = fly(windy).summary.formation.mean_error_m
    (expected,) = expected_precision(windy) or ()
    assert expected is not None
    assert flown is not None
    assert (expected.severity, expected.field) == ("warning", "acceptance.mean_error_m")
    assert "article wind, moderate turbulence, ideal sensors" in expected.message
    (metres,) = re.findall(r"expect (\d\.\d\d) m of mean", expected.message)
    assert 0.7 < float(metres) / flown < 1.4


@pytest.mark.usefixtures("as_declared")
def test_check_says_which_two_come_too_near_by_an_order():
    content = content_of("shapes")
    content["acceptance"] = {"min_separation_m": 12.0}
    content["rehearsal"]["rate_hz"] = 10.0
    content["orders"] = [{"at_s": 12, "shape": "trail", "spacing_m": 10}]
    _, *found = expected_precision(Mission.model_validate(content)) or ()
    assert {(one.severity, one.field) for one in found} == {("error", "orders")}
    assert all("less than 12 m" in one.message for one in found)


def test_a_rehearsal_that_is_stopped_promises_nothing():
    assert expected_precision(mission_with("line-calm"), stop=lambda: True) is None
