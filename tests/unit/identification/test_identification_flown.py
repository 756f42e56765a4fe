"""How an autopilot answered on a flight that was flown for another purpose."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from tests.kit.records import still_flight, still_follower
from vfguide.elementwise import FloatArray
from vfguide.identification.flown import (
    Answer,
    SlipAnswer,
    answer_sentence,
    flown_profile,
    flown_responses,
    flown_slip,
    known_slips,
    slip_sentence,
    with_responses,
)
from vfguide.record.vehicle import VehicleRecord
from vfguide.state import Airframe

STEP_S = 0.05
LIMITS = {"airspeed_min": 12.0, "airspeed_max": 32.0, "max_bank": 0.8, "max_acceleration": 3.0}
AIRFRAME = Airframe(hold="heading-hold", alpha=1.0, beta=0.4, cruise=20.0, **LIMITS)


def first_order(told: FloatArray, rate: float, dead_time_s: float, first: float) -> FloatArray:
    """What follows its setpoints with a bandwidth (1/s) after a dead time, exactly at each sample."""
    late = np.concatenate((np.full(round(dead_time_s / STEP_S), first), told))[: len(told)]
    seen, keeps = [first], math.exp(-rate * STEP_S)
    for one in late[:-1]:
        seen.append(one + (seen[-1] - one) * keeps)
    return np.array(seen)


def flight(duration_s: float = 120.0, *, change: float = 1.0) -> tuple[FloatArray, VehicleRecord]:
    """Calm air, setpoints that swing slowly: alpha 0.8 1/s after 0.3 s, beta 0.6 1/s after 0.5 s."""
    time_s = np.arange(0.0, duration_s, STEP_S)
    course_told = change * (0.3 * np.sin(0.21 * time_s) + 0.2 * np.sin(0.9 * time_s))
    speed_told = 20.0 + change * (1.5 * np.sin(0.13 * time_s) + 0.8 * np.sin(0.7 * time_s))
    course = first_order(course_told, 0.8, 0.3, 0.0)
    speed = first_order(speed_told, 0.6, 0.5, 20.0)
    vehicle = still_follower(
        time_s,
        course_rad=course,
        ground_speed_m_s=speed,
        heading_rad=course,
        airspeed_m_s=speed,
        course_setpoint_rad=course_told,
        airspeed_setpoint_m_s=speed_told,
        mode=np.ones(len(time_s), dtype=np.int8),
    )
    return time_s, vehicle


def answers(
    time_s: FloatArray,
    vehicle: VehicleRecord,
    airframe: Airframe = AIRFRAME,
    sent_before_s: float = 0.0,
) -> tuple[Answer, Answer]:
    told = (vehicle.course_setpoint_rad, vehicle.airspeed_setpoint_m_s)
    asked = np.column_stack((time_s - sent_before_s, *told))
    return flown_responses(time_s, vehicle, vehicle.mode == 1, airframe, asked)


def test_bandwidth_and_dead_time_are_found_from_setpoints_that_were_no_steps():
    course, speed = answers(*flight())
    for answer, bandwidth, dead_time in ((course, 0.8, 0.3), (speed, 0.6, 0.5)):
        assert answer.good
        found = answer.response
        assert found.gain == pytest.approx(bandwidth, rel=0.05)
        assert found.least < bandwidth < found.greatest
        assert found.dead_time == pytest.approx(dead_time, abs=0.06)


def test_the_words_say_how_sure_it_is_and_whether_the_mission_fits():
    time_s, vehicle = flight()
    course, speed = answers(time_s, vehicle)
    assert "known well; the mission says 1.00" in answer_sentence(course)
    assert "the mission's 0.40 fits" not in answer_sentence(speed)
    fits, _ = answers(time_s, vehicle, msgspec.structs.replace(AIRFRAME, alpha=0.8))
    assert "the mission's 0.80 fits" in answer_sentence(fits)
    lines = flown_profile([course, speed], {}).splitlines()
    assert lines[0].startswith("f1:")
    fields = "alpha_1_s course_dead_time_s course_lag_s beta_1_s speed_dead_time_s speed_lag_s"
    assert [line.split(":")[0].strip() for line in lines[1:]] == fields.split()
    # The flight's report has it as well.
    record = still_flight(time_s, replace(vehicle, role="leader"))
    (leader,) = with_responses(record, (course, speed), {}).vehicles
    assert leader.response.alpha_1_s == pytest.approx(0.8, rel=0.05)
    assert leader.response.slips is None


@pytest.mark.parametrize(
    ("duration_s", "change", "why"),
    [
        (15.0, 1.0, "15 s of setpoints and answers are too short"),
        (60.0, 0.01, "hardly any other course was asked for"),
    ],
)
def test_what_cannot_be_told_is_not_told(duration_s, change, why):
    course, speed = answers(*flight(duration_s, change=change))
    assert course.response is speed.response is None
    assert answer_sentence(course) == f"f1: course: {UNKNOWN.format(why)}"
    assert flown_profile([course, speed], {}) == ""


UNKNOWN = "cannot be told, {}; fly `vfguide identify` to know it"


def test_a_speed_that_goes_its_own_way_gives_no_number():
    time_s, vehicle = flight()
    # Nothing of it is an answer: it swings as no setpoint does.
    own = 20.0 + 1.5 * np.sin(0.37 * time_s + 1.0)
    _, speed = answers(time_s, replace(vehicle, airspeed_m_s=own))
    assert speed.response is None
    told = UNKNOWN.format("quite other values explain this flight as well")
    assert answer_sentence(speed) == f"f1: speed: {told}"


def test_moments_that_are_not_guided_are_not_fitted():
    time_s, vehicle = flight()
    # By hand in the first half: whatever was set then was not flown.
    by_hand = time_s < 60.0
    wild = replace(
        vehicle,
        course_setpoint_rad=np.where(by_hand, 2.0, vehicle.course_setpoint_rad),
        mode=np.where(by_hand, 0, vehicle.mode),
    )
    course, _ = answers(time_s, wild)
    assert course.response.gain == pytest.approx(0.8, rel=0.05)


def test_setpoints_count_from_when_they_went_out_not_from_the_next_sample():
    time_s, vehicle = flight()
    # Each went out 0.04 s before the sample that has it first: the answer is then 0.04 s later than it seems.
    course, _ = answers(time_s, vehicle, sent_before_s=0.04)
    total_s = 1.0 / course.response.gain + course.response.dead_time
    # 1 / 0.8 s and 0.3 s, and the 0.04 s.
    assert total_s == pytest.approx(1.25 + 0.3 + 0.04, abs=0.005)


def test_a_circle_in_wind_shows_the_bandwidth_although_the_drift_changes_all_the_time():
    time_s, vehicle = flight()
    fine, wind, heading, headings = 10, 8.0, 0.0, []
    for now in time_s.tolist():
        headings.append(heading)
        for _ in range(fine):
            course = math.atan2(wind + 20.0 * math.sin(heading), 20.0 * math.cos(heading))
            heading += 1.2 * math.remainder(0.15 * now - course, math.tau) * STEP_S / fine
    seen = np.array(headings)
    east, north = wind + 20.0 * np.sin(seen), 20.0 * np.cos(seen)
    circling = replace(
        vehicle,
        heading_rad=seen,
        course_rad=np.arctan2(east, north),
        ground_speed_m_s=np.hypot(north, east),
        airspeed_m_s=np.full_like(seen, 20.0),
        wind_east_m_s=np.full_like(seen, wind),
        course_setpoint_rad=0.15 * time_s,
    )
    answer, _ = answers(time_s, circling)
    assert answer.response.gain == pytest.approx(1.2, rel=0.01)
    assert answer.response.dead_time < 0.01


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


def slip_told(time_s: FloatArray, vehicle: VehicleRecord, *, mission: bool = False) -> SlipAnswer:
    return flown_slip(time_s, vehicle, vehicle.mode == 1, AIRFRAME, mission)


RIGHT = np.ones(2400)
LEFT_AND_RIGHT = np.where(np.arange(2400) // 480 % 2, -1.0, 1.0)


# Its attitude may be off, which makes a circle less sure than an eight: 1.96 times 0.5 degrees of bank are
# 0.00839 rad/s of 0.178: 4.7 %.
@pytest.mark.parametrize("efficiency", [1.0, 0.745])
@pytest.mark.parametrize(
    ("side", "surely"), [(RIGHT, (0.044, 0.05)), (LEFT_AND_RIGHT, (0.0, 0.016))]
)
def test_the_share_that_is_turned_is_found_on_a_circle_and_on_an_eight(side, surely, efficiency):
    slip = slip_told(*turning_flight(side, efficiency)).slip
    assert slip.efficiency.value == pytest.approx(efficiency, abs=0.01)
    assert surely[0] <= slip.efficiency.half_width / efficiency <= surely[1]
    assert slip.slips is (efficiency < 0.9)


def test_an_attitude_that_is_off_by_less_leaves_the_truth_within_the_interval():
    found = slip_told(*turning_flight(RIGHT, 0.745, roll_error=math.radians(0.8))).slip
    # tan 20 / tan 20.8 = 0.958.
    assert found.efficiency.value == pytest.approx(0.958 * 0.745, abs=0.003)
    assert abs(found.efficiency.value - 0.745) < found.efficiency.half_width


def test_who_flew_straight_or_was_not_recorded_tells_nothing():
    straight = slip_told(*turning_flight(np.zeros(2400), 1.0))
    sentence = "f1: slip: cannot be told, it hardly turned; fly `vfguide identify` to know it"
    assert slip_sentence(straight) == sentence
    time_s, vehicle = turning_flight(RIGHT, 1.0)
    unknown = slip_told(time_s, replace(vehicle, bank_rad=np.full_like(time_s, np.nan)))
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
    found = slip_told(time_s, rolling).slip
    assert found.efficiency.value == pytest.approx(0.745, abs=0.01)


def test_the_words_of_a_slip_say_how_sure_it_is_and_whether_the_mission_fits():
    slipping = turning_flight(LEFT_AND_RIGHT, 0.745)
    sentence = slip_sentence(slip_told(*slipping))
    assert sentence.startswith("f1: slip: it turns 0.7")
    assert sentence.endswith(": it slips; the mission's slips: false does not fit")
    answer = slip_told(*slipping, mission=True)
    assert slip_sentence(answer).endswith(": it slips; the mission's slips: true fits")
    # 0.88 is too near to 0.9 for a circle.
    assert slip_sentence(slip_told(*turning_flight(RIGHT, 0.88))).endswith(
        ": open, since below 0.9 it slips; fly `vfguide identify` to know it"
    )
    lines = flown_profile([], known_slips([answer])).splitlines()
    assert lines[0].startswith("f1:")
    assert lines[1].startswith("  slips: true # it turns 0.7")
