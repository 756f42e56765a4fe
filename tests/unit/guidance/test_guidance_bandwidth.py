"""One rule for gains: margins of 45 degrees and 6 dB for every response that an aircraft may have."""

import cmath
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.guidance.bandwidth import (
    AS_DECLARED,
    DECLARED,
    TOLD,
    UNKNOWN,
    Certainty,
    HoldCertainty,
    Softness,
    amplification_of,
    bandwidth_of,
    bearable,
    factor_of,
)
from vfguide.state import Airframe

PERIOD = 0.05
QUICKEST = {"period": PERIOD, "loop_delay": 0.0, "factor": 0.0}
USUAL = {"slips": False, "period": PERIOD, "loop_delay": 0.0, "factor": 3.5}


def margins(gain: float, strength: float, delay: float) -> tuple[float, float]:
    """(phase margin in degrees, gain margin in dB) of L = k g exp(-D s) / s, found numerically."""
    crossover = strength * gain
    phase = math.degrees(cmath.phase(cmath.exp(-1j * crossover * delay) / 1j))
    # The phase falls through -180 degrees where D w is a quarter turn.
    turnover = 0.5 * math.pi / delay
    return 180.0 + phase, -20.0 * math.log10(strength * gain / turnover)


def test_without_doubt_and_delay_the_loop_takes_a_quarter_of_pi_of_its_period():
    # pi / 4 / (1.1 * 0.05 s).
    assert bearable(0.0, DECLARED, **QUICKEST) == pytest.approx(14.28, abs=0.01)


def test_a_delay_that_is_predicted_counts_by_a_fifth():
    # 0.05 + 0.2 * 0.5 = 0.15 s instead of 0.05.
    fastest = bearable(0.0, DECLARED, **QUICKEST)
    assert bearable(0.5, DECLARED, **QUICKEST) == pytest.approx(fastest / 3.0)


def test_what_is_known_less_well_is_flown_more_slowly():
    known = [bearable(0.3, one, **QUICKEST) for one in (DECLARED, TOLD, UNKNOWN)]
    assert known == sorted(known, reverse=True)
    # pi / 4 / (3 * (0.05 + 0.06 + 0.4)).
    assert known[-1] == pytest.approx(0.513, abs=0.001)


@given(
    spread=st.floats(1.0, 5.0),
    late=st.floats(0.0, 2.0),
    delay=st.floats(0.0, 2.0),
    strength=st.floats(0.0, 1.0),
    lateness=st.floats(0.0, 1.0),
)
def test_every_response_that_may_be_leaves_45_degrees_and_6_db(
    spread, late, delay, strength, lateness
):
    gain = bearable(delay, HoldCertainty(spread=spread, late=late), **QUICKEST)
    # Any response of the set: strength from 1 / spread to spread, delay from none to the greatest.
    possible = spread ** (2.0 * strength - 1.0)
    phase, decibels = margins(gain, possible, PERIOD + 0.2 * delay + lateness * late)
    assert phase >= 45.0 - 1e-6
    assert decibels >= 6.0


def test_sharpness_1_just_keeps_the_margins_and_half_of_it_is_the_usual_loop():
    assert factor_of(1.0) == pytest.approx(4.0 / math.pi)
    assert factor_of(0.5) == pytest.approx(3.5)
    assert factor_of(0.0) == pytest.approx(3.5**2 * math.pi / 4.0)


def test_a_vehicle_that_slips_is_turned_no_faster_than_its_yaw_bears():
    late = Airframe(course_lag=0.3)
    assert bandwidth_of(late, AS_DECLARED, **(USUAL | {"slips": True})).course == pytest.approx(
        0.45
    )
    assert bandwidth_of(late, AS_DECLARED, **USUAL).course > 1.0


def test_a_total_energy_hold_is_led_at_a_third_of_its_own_pace():
    slow = Airframe(beta=0.6, speed_hold="total-energy")
    assert bandwidth_of(slow, AS_DECLARED, **USUAL).energy_field == pytest.approx(0.2)
    # Known within a factor of 3 instead of 1.5 it may be half as fast.
    doubted = Certainty(course=DECLARED, speed=HoldCertainty(spread=3.0, late=0.0))
    assert bandwidth_of(slow, doubted, **USUAL).energy_field == pytest.approx(0.1)


def test_a_slow_hold_is_not_driven_by_setpoints_many_times_its_errors():
    slow = Airframe(alpha=0.3, beta=0.2)
    # Four times as quick at sharpness 0.5.
    held = bandwidth_of(slow, AS_DECLARED, **USUAL, amplification=amplification_of(0.5))
    assert (held.course, held.speed) == pytest.approx((1.2, 0.8))
    assert bandwidth_of(slow, AS_DECLARED, **USUAL).course > 5.0
    assert amplification_of(1.0) == pytest.approx(16.0)
    assert amplification_of(0.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("sharpness", "bound"), [(0.5, 3.0 / 1.5), (0.75, 2.0 * 3.0 / 1.5), (0.0, 3.0 / 6.0)]
)
def test_gusts_of_the_speed_ask_for_no_more_than_all_acceleration(sharpness, bound):
    lively = Airframe(alpha=4.0, beta=20.0, max_acceleration=3.0)
    held = bandwidth_of(lively, AS_DECLARED, **USUAL, amplification=amplification_of(sharpness))
    assert held.speed == pytest.approx(bound)


def test_softness_slows_the_loop_that_is_flown_not_the_one_that_could_be():
    # The loop has 1 / (3.5 * 0.05) = 5.7 1/s, whatever more the aircraft bears.
    soft = bandwidth_of(Airframe(), AS_DECLARED, **USUAL, softness=Softness(course=0.5))
    assert soft.course == pytest.approx(2.857, abs=0.001)
    assert soft.speed == pytest.approx(14.28, abs=0.01)
