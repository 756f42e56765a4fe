"""Whether a vehicle slips, from a flight that was flown for another purpose."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.unit.identification.test_identification_flown import AIRFRAME, flight
from vfguide.elementwise import FloatArray
from vfguide.identification.flown import (
    SlipAnswer,
    flown_profile,
    flown_slip,
    known_slips,
    slip_sentence,
)
from vfguide.record.vehicle import VehicleRecord

SPEED = 20.0
BANK = math.radians(20.0)
BY_BANK = 9.80665 * math.tan(BANK) / SPEED
"""rad/s: 0.178."""


def turning_flight(
    side: FloatArray, efficiency: float, *, roll_error: float = 0.0
) -> tuple[FloatArray, VehicleRecord]:
    """Turns of 20 degrees of bank to the side that each sample has, in a wind of (3, -4) m/s."""
    time_s, vehicle = flight(0.05 * len(side))
    rate = efficiency * BY_BANK * side
    heading = np.concatenate(([0.0], np.cumsum(rate[:-1]) * 0.05))
    north, east = SPEED * np.cos(heading) + 3.0, SPEED * np.sin(heading) - 4.0
    return time_s, replace(
        vehicle,
        heading_rad=heading,
        course_rad=np.arctan2(east, north),
        ground_speed_m_s=np.hypot(north, east),
        airspeed_m_s=np.full_like(side, SPEED),
        bank_rad=BANK * side + roll_error,
    )


def told(time_s: FloatArray, vehicle: VehicleRecord, *, mission: bool = False) -> SlipAnswer:
    return flown_slip(time_s, vehicle, vehicle.mode == 1, AIRFRAME, mission)


RIGHT = np.ones(2400)
LEFT_AND_RIGHT = np.where(np.arange(2400) // 480 % 2, -1.0, 1.0)


@pytest.mark.parametrize("efficiency", [1.0, 0.745])
@pytest.mark.parametrize("side", [RIGHT, LEFT_AND_RIGHT])
def test_the_share_that_is_turned_is_found_on_a_circle_and_on_an_eight(side, efficiency):
    answer = told(*turning_flight(side, efficiency))
    assert answer.slip is not None
    assert answer.slip.efficiency.value == pytest.approx(efficiency, abs=0.01)
    assert answer.slip.slips is (efficiency < 0.9)


def test_an_attitude_that_may_be_off_makes_a_circle_less_sure_than_an_eight():
    circle = told(*turning_flight(RIGHT, 0.745)).slip
    eight = told(*turning_flight(LEFT_AND_RIGHT, 0.745)).slip
    assert circle is not None
    assert eight is not None
    # 1.96 times 0.5 degrees of bank are 0.00839 rad/s of 0.178: 4.7 % of 0.745.
    assert circle.efficiency.half_width == pytest.approx(0.035, abs=0.002)
    assert eight.efficiency.half_width < 0.012


def test_an_attitude_that_is_off_by_less_leaves_the_truth_within_the_interval():
    found = told(*turning_flight(RIGHT, 0.745, roll_error=math.radians(0.8))).slip
    assert found is not None
    # tan 20 / tan 20.8 = 0.958.
    assert found.efficiency.value == pytest.approx(0.958 * 0.745, abs=0.003)
    assert abs(found.efficiency.value - 0.745) < found.efficiency.half_width


def test_who_flew_straight_or_was_not_recorded_tells_nothing():
    straight = told(*turning_flight(np.zeros(2400), 1.0))
    sentence = "f1: slip: cannot be told, it hardly turned; fly `vfguide identify` to know it"
    assert slip_sentence(straight) == sentence
    time_s, vehicle = turning_flight(RIGHT, 1.0)
    unknown = told(time_s, replace(vehicle, bank_rad=np.full_like(time_s, np.nan)))
    assert slip_sentence(unknown) == (
        "f1: slip: cannot be told, the record holds too little of its bank, airspeed, heading and"
        " velocity; fly `vfguide identify` to know it"
    )
    assert known_slips([straight, unknown]) == {}


def test_turns_on_the_ground_are_no_turns_by_bank():
    time_s, vehicle = turning_flight(RIGHT, 0.745)
    # For a minute it taxies in circles, level and slower than 0.8 times 12 m/s.
    taxi = time_s < 50.0
    rolling = replace(
        vehicle,
        airspeed_m_s=np.where(taxi, 9.0, SPEED),
        bank_rad=np.where(taxi, 0.0, vehicle.bank_rad),
        mode=np.zeros_like(vehicle.mode),
    )
    found = told(time_s, rolling).slip
    assert found is not None
    assert found.efficiency.value == pytest.approx(0.745, abs=0.01)


def test_the_words_say_how_sure_it_is_and_whether_the_mission_fits():
    slipping = turning_flight(LEFT_AND_RIGHT, 0.745)
    sentence = slip_sentence(told(*slipping))
    assert sentence.startswith("f1: slip: it turns 0.7")
    assert sentence.endswith(": it slips; the mission's slips: false does not fit")
    answer = told(*slipping, mission=True)
    assert slip_sentence(answer).endswith(": it slips; the mission's slips: true fits")
    # 0.88 is too near to 0.9 for a circle.
    assert slip_sentence(told(*turning_flight(RIGHT, 0.88))).endswith(
        ": open, since below 0.9 it slips; fly `vfguide identify` to know it"
    )
    lines = flown_profile([], known_slips([answer])).splitlines()
    assert lines[0].startswith("f1:")
    assert lines[1].startswith("  slips: true # it turns 0.7")
