"""The response is learned from what is flown anyway, and fields are as slow as its aircraft bears.

One rule for gains: margins of 45 degrees and 6 dB for every response that an aircraft may have.
"""

import cmath
import math
import random
from collections import deque
from collections.abc import Callable
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
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
from vfguide.guidance.response import (
    AS_DECLARED,
    COURSE,
    DECLARED,
    SPEED,
    TOLD,
    UNKNOWN,
    Certainty,
    HoldCertainty,
    HoldKind,
    HoldLearner,
    Softness,
    amplification_of,
    bandwidth_of,
    bearable,
    factor_of,
)
from vfguide.laws.field import SlotField
from vfguide.state import Airframe

PERIOD = 0.05


class Hold:
    """A hold of one number: rate = gain * lag(setpoint(t - T) - value), within a limit."""

    def __init__(
        self,
        gain: float,
        dead_time: float,
        lag: float,
        limit: float = math.inf,
        *,
        earlier: float = 0.0,
    ) -> None:
        """It has followed a setpoint at `earlier` for long, and does so for the dead time."""
        self.gain, self.lag, self.limit = gain, lag, limit
        self.value, self.rate = 0.0, gain * earlier
        self._on_the_way = deque([earlier] * round(dead_time / PERIOD))

    def fly(self, setpoint: float) -> None:
        self._on_the_way.append(setpoint)
        error = self._on_the_way.popleft() - self.value
        share = PERIOD / (self.lag + PERIOD)
        self.rate += share * (min(max(self.gain * error, -self.limit), self.limit) - self.rate)
        self.value += PERIOD * self.rate


def learned(
    kind: HoldKind,
    hold: Hold,
    asked: Callable[[float], float],
    *,
    seconds: float = 40.0,
    noise: float = 0.0,
    angle: bool = True,
    limit: float = 10.0,
) -> HoldLearner:
    """What is known after some seconds of setpoints."""
    learner, chance = HoldLearner(kind), random.Random(1)
    for step in range(round(seconds / PERIOD)):
        time_s = step * PERIOD
        learner.note(asked(time_s), time_s)
        rate = hold.rate + chance.gauss(0.0, noise) if angle else None
        learner.observe(time_s, hold.value, rate, limit=limit, angle=angle)
        hold.fly(asked(time_s))
    return learner


def weave(time_s: float) -> float:
    """Courses as a follower is asked for while it joins, rad."""
    return 0.3 * math.sin(0.5 * time_s) + 0.15 * math.sin(1.3 * time_s)


@pytest.mark.parametrize("gain", [0.3, 0.8, 2.0])
@pytest.mark.parametrize(("dead_time", "lag"), [(0.0, 0.0), (0.3, 0.0), (0.1, 0.5)])
def test_a_weaving_course_shows_gain_dead_time_and_lag(gain, dead_time, lag):
    found = learned(COURSE, Hold(gain, dead_time, lag), weave, noise=0.005).response()
    assert found.gain == pytest.approx(gain, rel=0.25)
    assert found.late == pytest.approx(dead_time + lag, abs=0.16)
    assert found.earliest - 0.03 <= dead_time + lag <= found.latest + 0.03
    assert found.explained > 0.95


def test_a_steady_turn_shows_the_gain_but_not_the_delay():
    # Around a circle by 0.1 rad/s the error is 0.1 / 0.5 = 0.2 rad, whatever the dead time adds to it.
    hold = Hold(0.5, 0.0, 0.0)
    found = learned(COURSE, hold, lambda time_s: 0.2 + 0.1 * time_s, seconds=60.0).response()
    assert found.gain == pytest.approx(0.5, rel=0.1)
    assert found.latest - found.earliest > 0.3


def test_more_noise_leaves_more_doubt():
    still, shaken = (
        learned(COURSE, Hold(0.8, 0.2, 0.3), weave, seconds=15.0, noise=noise).response().spread
        for noise in (0.0, 0.1)
    )
    assert shaken > 1.2 * still


def test_what_was_flown_before_the_first_setpoint_does_not_count():
    """It turns right by 0.12 rad/s and is sent left: that lasts 0.4 s, then the roll lags by 0.4 s."""
    hold = Hold(1.0, 0.4, 0.4, earlier=0.12)
    learner = learned(COURSE, hold, lambda t: weave(t) - 0.25, seconds=12.0, noise=0.002)
    found = learner.response()
    assert found.gain == pytest.approx(1.0, rel=0.2)
    assert found.late == pytest.approx(0.8, abs=0.16)
    assert found.explained > 0.98


def test_an_aircraft_that_ignores_its_setpoints_has_no_response():
    learner, chance = HoldLearner(COURSE), random.Random(2)
    for step in range(800):
        time_s = step * PERIOD
        learner.note(weave(time_s), time_s)
        learner.observe(time_s, 0.0, chance.gauss(0.0, 0.05), limit=1.0, angle=True)
    found = learner.response()
    assert found is None or found.explained < 0.5


def test_speeds_are_learned_by_their_own_changes():
    hold = Hold(0.4, 0.5, 0.0)
    learner = learned(
        SPEED, hold, lambda s: 2.0 if s % 20.0 < 10.0 else -1.0, seconds=60, angle=False
    )
    found = learner.response()
    assert found.gain == pytest.approx(0.4, rel=0.25)
    assert found.late == pytest.approx(0.5, abs=0.35)


def test_what_is_thrown_from_limit_to_limit_is_known_by_its_timing():
    # Half a radian per second to either side: the gain is large enough for that, the delay is seen.
    hold = Hold(2.0, 0.3, 0.0, limit=0.5)
    learner = learned(COURSE, hold, lambda s: 1.5 if s % 4.0 < 2.0 else -1.5, seconds=20, limit=0.5)
    found = learner.response()
    assert found.late == pytest.approx(0.3, abs=0.16)
    assert 0.35 < found.least <= 2.0 <= found.greatest


def test_a_declaration_that_fits_explains_the_flight_and_one_off_by_three_does_not():
    learner = learned(COURSE, Hold(0.5, 0.2, 0.0), weave)
    assert learner.explained_by(0.5, 0.2, 0.0) > 0.98
    assert learner.explained_by(1.5, 0.2, 0.0) < 0.0
    assert learner.explained_by(0.17, 0.2, 0.0) < 0.7


@pytest.mark.parametrize("lag", [0.0, 0.4])
@pytest.mark.parametrize("turn_rate", [-0.3, 0.0, 0.13, 0.35])
def test_a_course_error_for_a_turn_rate_brings_that_turn_rate(lag, turn_rate):
    airframe = Airframe(course_lag=lag)
    for speed in (15.0, 20.0, 25.0):
        bank = wanted_bank(course_error_for(turn_rate, speed, airframe), speed, airframe)
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
    late = field_of(course_dead_time=0.5)
    slowed = within(late, slips=True)
    assert gain(slowed, "course") == pytest.approx(0.45)
    assert gain(within(late, slips=False), "course") > 1.0
    assert 20.0 * 2.0 / math.pi * slowed.gains.chi_inf * slowed.gains.k_y <= 0.225 + 1e-9


QUICKEST = {"period": PERIOD, "loop_delay": 0.0, "factor": 0.0}
USUAL = {"slips": False, "period": PERIOD, "loop_delay": 0.0, "factor": 3.5}


def margins(gain: float, strength: float, delay: float) -> tuple[float, float]:
    """(phase margin in degrees, gain margin in dB) of L = k g exp(-D s) / s, found numerically."""
    crossover = strength * gain
    phase = math.degrees(cmath.phase(cmath.exp(-1j * crossover * delay) / 1j))
    # The phase falls through -180 degrees where D w is a quarter turn.
    turnover = 0.5 * math.pi / delay
    return 180.0 + phase, -20.0 * math.log10(strength * gain / turnover)


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
    assert (amplification_of(1.0), amplification_of(0.0)) == pytest.approx((16.0, 1.0))


def test_a_total_energy_hold_is_led_at_a_third_of_its_own_pace():
    slow = Airframe(beta=0.6, speed_hold="total-energy")
    assert bandwidth_of(slow, AS_DECLARED, **USUAL).energy_field == pytest.approx(0.2)
    # Known within a factor of 3 instead of 1.5 it may be half as fast.
    doubted = Certainty(course=DECLARED, speed=HoldCertainty(spread=3.0, late=0.0))
    assert bandwidth_of(slow, doubted, **USUAL).energy_field == pytest.approx(0.1)


SLOW, LIVELY = {"alpha": 0.3, "beta": 0.2}, {"alpha": 4.0, "beta": 20.0, "max_acceleration": 3.0}


@pytest.mark.parametrize(
    ("airframe", "sharpness", "bounds"),
    [
        # Four times as quick at sharpness 0.5.
        (SLOW, 0.5, {"course": 1.2, "speed": 0.8}),
        # A late one 0.8 times as quick at 0.5, four times that at 1; a slow one 0.5 1/s, but at most four
        # times as quick.
        ({"alpha": 1.0, "course_lag": 0.01}, 0.5, {"course": 0.8}),
        ({"alpha": 0.5, "course_lag": 0.01}, 1.0, {"course": 1.6}),
        ({"alpha": 0.3, "course_lag": 0.01}, 0.5, {"course": 0.5}),
        ({"alpha": 0.1, "course_lag": 0.01}, 0.5, {"course": 0.4}),
        # Gusts of the speed ask for no more than all acceleration.
        (LIVELY, 0.5, {"speed": 3.0 / 1.5}),
        (LIVELY, 0.75, {"speed": 2.0 * 3.0 / 1.5}),
        (LIVELY, 0.0, {"speed": 3.0 / 6.0}),
    ],
)
def test_a_hold_is_not_driven_by_setpoints_many_times_its_errors(airframe, sharpness, bounds):
    chosen = USUAL | {"amplification": amplification_of(sharpness)}
    held = bandwidth_of(Airframe(**airframe), AS_DECLARED, **chosen)
    assert {name: getattr(held, name) for name in bounds} == pytest.approx(bounds)
    assert bandwidth_of(Airframe(**SLOW), AS_DECLARED, **USUAL).course > 5.0


def test_softness_slows_the_loop_that_is_flown_not_the_one_that_could_be():
    # The loop has 1 / (3.5 * 0.05) = 5.7 1/s, whatever more the aircraft bears.
    soft = bandwidth_of(Airframe(), AS_DECLARED, **USUAL, softness=Softness(course=0.5))
    assert soft.course == pytest.approx(2.857, abs=0.001)
    assert soft.speed == pytest.approx(14.28, abs=0.01)
