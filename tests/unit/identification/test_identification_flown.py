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
    answer_sentence,
    flown_profile,
    flown_responses,
    with_responses,
)
from vfguide.record.vehicle import VehicleRecord
from vfguide.state import Airframe

STEP_S = 0.05
AIRFRAME = Airframe(
    hold="heading-hold",
    alpha=1.0,
    beta=0.4,
    airspeed_min=12.0,
    airspeed_max=32.0,
    max_bank=0.8,
    max_acceleration=3.0,
    cruise=20.0,
)


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
    time_s: FloatArray, vehicle: VehicleRecord, airframe: Airframe = AIRFRAME
) -> tuple[Answer, Answer]:
    asked = (time_s, vehicle.course_setpoint_rad, vehicle.airspeed_setpoint_m_s)
    return flown_responses(time_s, vehicle, vehicle.mode == 1, airframe, np.column_stack(asked))


def test_bandwidth_and_dead_time_are_found_from_setpoints_that_were_no_steps():
    course, speed = answers(*flight())
    for answer, bandwidth, dead_time in ((course, 0.8, 0.3), (speed, 0.6, 0.5)):
        assert answer.response is not None
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
    near = msgspec.structs.replace(AIRFRAME, alpha=0.8)
    fits, _ = answers(time_s, vehicle, near)
    assert "the mission's 0.80 fits" in answer_sentence(fits)
    lines = flown_profile([course, speed], {}).splitlines()
    assert lines[0].startswith("f1:")
    fields = "alpha_1_s course_dead_time_s course_lag_s beta_1_s speed_dead_time_s speed_lag_s"
    assert [line.split(":")[0].strip() for line in lines[1:]] == fields.split()


def test_the_flight_s_report_has_what_it_shows():
    time_s, vehicle = flight()
    record = still_flight(time_s, replace(vehicle, role="leader"))
    (leader,) = with_responses(record, answers(time_s, vehicle), {}).vehicles
    assert leader.response is not None
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
    assert answer_sentence(course) == (
        f"f1: course: cannot be told, {why}; fly `vfguide identify` to know it"
    )
    assert flown_profile([course, speed], {}) == ""


def test_a_speed_that_goes_its_own_way_gives_no_number():
    time_s, vehicle = flight()
    # Nothing of it is an answer: it swings as no setpoint does.
    own = 20.0 + 1.5 * np.sin(0.37 * time_s + 1.0)
    _, speed = answers(time_s, replace(vehicle, airspeed_m_s=own))
    assert speed.response is None
    assert answer_sentence(speed) == (
        "f1: speed: cannot be told, quite other values explain this flight as well; "
        "fly `vfguide identify` to know it"
    )


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
    assert course.response is not None
    assert course.response.gain == pytest.approx(0.8, rel=0.05)


def test_setpoints_count_from_when_they_went_out_not_from_the_next_sample():
    time_s, vehicle = flight()
    # Each went out 0.04 s before the sample that has it first: the answer is then 0.04 s later than it seems.
    asked = np.column_stack(
        (time_s - 0.04, vehicle.course_setpoint_rad, vehicle.airspeed_setpoint_m_s)
    )
    course, _ = flown_responses(time_s, vehicle, vehicle.mode == 1, AIRFRAME, asked)
    assert course.response is not None
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
    assert answer.response is not None
    assert answer.response.gain == pytest.approx(1.2, rel=0.01)
    assert answer.response.dead_time < 0.01
