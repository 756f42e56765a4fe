import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from vfguide.companion.steering import TrackingMonitor
from vfguide.state import Airframe, Setpoint, VehicleState


def state(time_s: float, course: float) -> VehicleState[float]:
    return VehicleState(
        time_s=time_s,
        north=0.0,
        east=0.0,
        course=course,
        ground_speed=20.0,
        heading=course,
        airspeed=20.0,
        wind_north=0.0,
        wind_east=0.0,
        wind_rate_north=0.0,
        wind_rate_east=0.0,
        wind_jerk_north=0.0,
        wind_jerk_east=0.0,
    )


def complaints(
    course: Callable[[float], float], wanted: Callable[[float], float], seconds: float
) -> list[tuple[float, str]]:
    """What is said of a course and a setpoint over time, at 20 Hz."""
    watch = TrackingMonitor(Airframe())
    found = []
    for step in range(round(seconds * 20)):
        now = step / 20
        setpoint = Setpoint(course=wanted(now), speed=20.0, limited=False)
        complaint = watch.watch(state(now, course(now)), setpoint)
        if complaint is not None:
            found.append((now, complaint))
    return found


def test_an_aircraft_that_ignores_its_course_is_told_of_within_ten_seconds() -> None:
    ((when, text),) = complaints(lambda _: 0.0, lambda _: 0.5, 60.0)
    assert when < 10.0
    assert "the course does not follow the setpoints: asked to turn at" in text


def test_an_aircraft_that_turns_the_wrong_way_is_told_of() -> None:
    assert complaints(lambda now: -0.1 * now, lambda now: -0.1 * now + 0.4, 30.0)


def test_a_first_order_course_is_followed() -> None:
    assert complaints(lambda now: 1.0 - math.exp(-1.2 * now), lambda _: 1.0, 30.0) == []


def test_a_course_four_times_slower_than_the_mission_says_still_follows() -> None:
    assert complaints(lambda now: 1.0 - math.exp(-0.3 * now), lambda _: 1.0, 30.0) == []


def test_a_turn_at_the_bank_limit_is_followed() -> None:
    # 9.80665 / 20 m/s = 0.49 rad/s with 45 degrees of bank.
    assert complaints(lambda now: 0.49 * now, lambda now: 0.49 * now + 2.0, 30.0) == []


def test_a_nose_that_turns_into_a_swinging_wind_follows_although_the_course_stays() -> None:
    # the setpoint stands 0.08 rad/s / 1.2 1/s = 0.067 rad ahead all the time
    watch = TrackingMonitor(Airframe())
    for step in range(1200):
        now = step / 20
        flown = replace(state(now, 0.0), heading=0.08 * now)
        setpoint = Setpoint(course=0.067, speed=20.0, limited=False)
        assert watch.watch(flown, setpoint) is None


def test_small_errors_are_nobodys_business() -> None:
    assert complaints(lambda _: 0.0, lambda _: 0.03, 60.0) == []


def test_it_says_when_the_course_follows_again() -> None:
    def course(now: float) -> float:
        return 0.0 if now < 20.0 else 0.3 * (now - 20.0)

    texts = [text for _, text in complaints(course, lambda now: course(now) + 0.3, 40.0)]
    assert len(texts) == 2
    assert texts[1] == "the course follows again, nothing to do"


@pytest.mark.parametrize(("off", "words"), [(25.0, "25 m above"), (-30.0, "30 m below")])
def test_an_altitude_that_cannot_be_told_is_complained_of_once(off: float, words: str) -> None:
    watch = TrackingMonitor(Airframe())
    texts = [watch.watch_altitude(off) for _ in range(10)]
    assert words in str(texts[0])
    assert texts[1:] == [None] * 9
    assert watch.watch_altitude(5.0) is None
    assert watch.watch_altitude(off) is not None
