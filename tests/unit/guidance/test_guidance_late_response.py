"""How a vehicle that answers late moves, and how slow the fields of laws are flown for it."""

import math
from typing import Literal

import pytest
from msgspec.structs import replace

from tests.kit.missions import plan_of
from tests.kit.states import vehicle_at
from vfguide.guidance.airframe import (
    Bias,
    Inner,
    coordinated_turn_rate,
    course_error_for,
    first_order_lag,
    propagate,
    wanted_bank,
)
from vfguide.guidance.bandwidth import AS_DECLARED, Certainty, bandwidth_of
from vfguide.laws.field import SlotField
from vfguide.state import Airframe


@pytest.mark.parametrize("lag", [0.0, 0.4])
@pytest.mark.parametrize("turn_rate", [-0.3, 0.0, 0.13, 0.35])
def test_a_course_error_for_a_turn_rate_brings_that_turn_rate(lag, turn_rate):
    airframe = Airframe(course_lag=lag)
    for speed in (15.0, 20.0, 25.0):
        error = course_error_for(turn_rate, speed, airframe)
        bank = wanted_bank(error, speed, airframe)
        assert coordinated_turn_rate(bank, speed) == pytest.approx(turn_rate, abs=1e-12)


def test_a_lag_leaves_a_third_after_its_time_constant():
    assert first_order_lag(1.0, 0.0, 0.4, 0.4) == pytest.approx(math.exp(-1.0))
    assert first_order_lag(1.0, 0.0, 0.4, 0.0) == 0.0


def test_a_vehicle_moves_with_the_wind_and_along_its_turn():
    # 0.2 rad/s at 20 m/s are a radius of 100 m; after 1 s the arc is 20 m long.
    bank = math.atan(0.2 * 20.0 / 9.80665)
    now = vehicle_at(0.0, 0.0, math.atan2(3.0, 20.0), math.hypot(20.0, 3.0), wind=(0.0, 3.0))
    for _ in range(100):
        now = propagate(now, Inner(bank=bank), Bias(), 0.01, Airframe())
    assert now.heading == pytest.approx(0.2, abs=1e-9)
    assert now.north == pytest.approx(100.0 * math.sin(0.2), abs=1e-3)
    assert now.east == pytest.approx(100.0 * (1.0 - math.cos(0.2)) + 3.0, abs=1e-3)


def field_of(gains: dict[str, float] | None = None, **airframe: float | str) -> SlotField:
    """The field of the mission circle-wind, but for what is given of gains and airframe."""
    plan = plan_of("circle-wind")
    chosen = plan.gains.model_copy(update=gains)
    return SlotField(chosen, plan.settings, replace(plan.airframe, **airframe))


def within(field: SlotField, certainty: Certainty = AS_DECLARED, *, slips: bool) -> SlotField:
    """The field, as slow as its aircraft bears it."""
    sliding = field.settings.sliding
    bandwidth = bandwidth_of(
        field.airframe,
        certainty,
        slips=slips,
        period=0.04,
        loop_delay=sliding.loop_delay_s,
        factor=sliding.boundary_layer_factor,
    )
    return field.within(bandwidth)


def gain(field: SlotField, law: Literal["course", "speed"]) -> float:
    """How fast the course or speed law beneath a field answers, 1/s."""
    sliding = field.settings.sliding
    bandwidth = sliding.course_bandwidth if law == "course" else sliding.speed_bandwidth
    return sliding.kappa / sliding.layer(0.04, bandwidth)


def test_without_a_delay_nothing_is_slowed():
    known = field_of()
    bounded = within(known, slips=False)
    assert bounded.gains == known.gains
    assert gain(bounded, "course") == gain(known, "course")
    assert gain(bounded, "speed") == gain(known, "speed")


def test_each_field_is_slower_than_the_law_inside_it():
    known = field_of(course_dead_time=0.4, course_lag=0.2, speed_dead_time=0.6)
    slowed = within(known, slips=False)
    share = 2.0 / math.pi
    lateral = 20.0 * share * slowed.gains.chi_inf * slowed.gains.k_y
    assert lateral <= gain(slowed, "course") / 2.0 + 1e-9
    along = share * slowed.gains.v_inf_m_s * slowed.gains.k_x
    assert along <= gain(slowed, "speed") / 2.0 + 1e-9
    assert gain(slowed, "course") < gain(known, "course")


@pytest.mark.parametrize(("k_x", "expected_k_x"), [(0.05, 0.05), (10.0, 0.4 / (12.0 / math.pi))])
def test_what_is_sent_as_speed_has_nothing_of_the_measured_one(k_x, expected_k_x):
    beta = 1.2
    gains = {"k_x": k_x, "v_inf_m_s": 6.0}
    known = field_of(gains, beta=beta, speed_dead_time=0.8, speed_hold="total-energy")
    known.settings = replace(
        known.settings, sliding=replace(known.settings.sliding, loop_delay_s=0.5)
    )
    sent = within(known, slips=False).for_speed()
    slope = 2.0 / math.pi * sent.gains.v_inf_m_s * sent.gains.k_x
    # V + (dV/dt) / beta, where dV/dt falls by the gain and by the slope of the field with each m/s.
    assert 1.0 - (gain(sent, "speed") + slope) / beta == pytest.approx(0.0, abs=1e-9)
    # No more than a third of beta, half of what is left to the law inside.
    assert sent.gains.k_x == pytest.approx(expected_k_x)
    assert not sent.answers_course_error


def test_the_course_law_of_a_vehicle_that_slips_is_no_faster_than_its_yaw_bears():
    # kappa 3 and factor 4.8 alone: 1 / (4.8 (0.05 + 0.2 * 0.5)) = 1.4 1/s.
    slowed = within(field_of(course_dead_time=0.5), slips=True)
    assert gain(slowed, "course") == pytest.approx(0.45)
    assert 20.0 * 2.0 / math.pi * slowed.gains.chi_inf * slowed.gains.k_y <= 0.225 + 1e-9
