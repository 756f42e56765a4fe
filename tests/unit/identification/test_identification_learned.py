"""Responses that are known, integrated finely by another method, and found again from 20 reports a second."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from vfguide.elementwise import FloatArray
from vfguide.guidance.response import HoldResponse
from vfguide.identification.learned import HoldSamples, as_seen, followed, response_in

FINE_S = 0.0025
"""Step of the truth: an explicit Euler step of this size is right to a thousandth."""

EVERY = 20
"""Of them there is a report: 20 Hz."""

WIND = (3.0, -4.0)
G = 9.80665


def steps(size: float, base: float) -> tuple[FloatArray, FloatArray]:
    """When setpoints went out, and which: one up, one back, one down, one back."""
    return (
        np.array([-5.0, 1.5, 7.0, 12.0, 19.0]),
        np.array([base, base + size, base, base - size, base]),
    )


def setpoint_at(times: FloatArray, values: FloatArray, time_s: float) -> float:
    return float(values[max(int(np.searchsorted(times, time_s, side="right")) - 1, 0)])


def course_flight(alpha: float, dead_time: float, lag: float, noise: float) -> HoldSamples:
    """20 m/s of airspeed in a wind; the course is what is held, the heading what is seen."""
    setpoint_s, told = steps(0.26, 0.0)
    drift = math.asin(4.0 / 20.0)
    heading, bank = drift, 0.0
    headings = []
    for number in range(round(24.0 / FINE_S)):
        headings.append(heading)
        target = setpoint_at(setpoint_s, told, number * FINE_S - dead_time)
        course = math.atan2(20.0 * math.sin(heading) + WIND[1], 20.0 * math.cos(heading) + WIND[0])
        error = target - course
        if lag > 0.0:
            wanted = max(-math.pi / 4, min(math.pi / 4, alpha * 20.0 / G * error))
            bank += FINE_S / lag * (wanted - bank)
            heading += FINE_S * G * math.tan(bank) / 20.0
        else:
            heading += FINE_S * alpha * error
    seen = np.array(headings[::EVERY])
    seen += noise * np.random.default_rng(1).standard_normal(len(seen))
    course = np.arctan2(20.0 * np.sin(seen) + WIND[1], 20.0 * np.cos(seen) + WIND[0])
    return HoldSamples(
        time_s=np.arange(len(seen)) * FINE_S * EVERY,
        value=course,
        turned=seen,
        limit=np.full(len(seen), G * math.tan(math.pi / 4) / 20.0),
        setpoint_s=setpoint_s,
        setpoint=told,
    )


def speed_flight(beta: float, dead_time: float, lag: float, noise: float) -> HoldSamples:
    setpoint_s, told = steps(2.0, 20.0)
    speed, acceleration = 20.0, 0.0
    speeds = []
    for number in range(round(24.0 / FINE_S)):
        speeds.append(speed)
        target = setpoint_at(setpoint_s, told, number * FINE_S - dead_time)
        wanted = max(-3.0, min(3.0, beta * (target - speed)))
        acceleration = acceleration + FINE_S / lag * (wanted - acceleration) if lag else wanted
        speed += FINE_S * acceleration
    seen = np.array(speeds[::EVERY])
    seen += noise * np.random.default_rng(2).standard_normal(len(seen))
    return HoldSamples(
        time_s=np.arange(len(seen)) * FINE_S * EVERY,
        value=seen,
        limit=np.full(len(seen), 3.0),
        setpoint_s=setpoint_s,
        setpoint=told,
    )


def found(samples: HoldSamples) -> HoldResponse:
    response = response_in(samples)
    assert response is not None
    return response


FLIGHTS = {"course": course_flight, "speed": speed_flight}


@pytest.mark.parametrize("kind", ["course", "speed"])
@pytest.mark.parametrize(("bandwidth", "dead_time"), [(1.2, 0.2), (0.6, 0.5), (1.8, 0.3)])
def test_first_order_and_dead_time_are_found_within_five_percent(kind, bandwidth, dead_time):
    response = found(FLIGHTS[kind](bandwidth, dead_time, 0.0, 0.0))
    assert response.gain == pytest.approx(bandwidth, rel=0.05)
    assert response.dead_time == pytest.approx(dead_time, rel=0.05)
    assert response.lag == 0.0
    assert response.least < bandwidth < response.greatest


@pytest.mark.parametrize("kind", ["course", "speed"])
def test_without_a_dead_time_none_is_found(kind):
    response = found(FLIGHTS[kind](1.2, 0.0, 0.0, 0.0))
    assert response.gain == pytest.approx(1.2, rel=0.05)
    assert response.dead_time == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("kind", ["course", "speed"])
def test_a_lag_is_told_from_a_dead_time(kind):
    response = found(FLIGHTS[kind](1.0, 0.2, 0.4, 0.0))
    assert response.gain == pytest.approx(1.0, rel=0.05)
    assert response.dead_time == pytest.approx(0.2, abs=0.02)
    assert response.lag == pytest.approx(0.4, rel=0.06)


@pytest.mark.parametrize(("kind", "noise"), [("course", 0.005), ("speed", 0.1)])
def test_noise_widens_the_bounds_and_they_hold_the_truth(kind, noise):
    quiet = found(FLIGHTS[kind](1.2, 0.3, 0.0, 0.0))
    noisy = found(FLIGHTS[kind](1.2, 0.3, 0.0, noise))
    assert noisy.doubt > 1.3 * quiet.doubt
    assert noisy.least < 1.2 < noisy.greatest
    assert noisy.earliest < 0.3 < noisy.latest


@pytest.mark.parametrize(("kind", "noise"), [("course", 0.005), ("speed", 0.1)])
def test_what_was_learned_would_have_flown_what_was_seen(kind, noise):
    samples = FLIGHTS[kind](1.2, 0.3, 0.0, noise)
    left = followed(samples, found(samples)) - samples.seen
    assert np.std(left) == pytest.approx(noise, rel=0.1)


def test_setpoints_are_indicated_airspeeds_and_what_is_seen_are_true_ones():
    """At 700 m the true airspeed is 6.6 % greater: 1.3 m/s, as much as a step."""
    flight = speed_flight(0.6, 0.4, 0.0, 0.0)
    seen = found(as_seen(replace(flight, value=flight.value + 1.3)))
    assert seen.gain == pytest.approx(0.6, rel=0.05)
    assert seen.dead_time == pytest.approx(0.4, abs=0.05)
