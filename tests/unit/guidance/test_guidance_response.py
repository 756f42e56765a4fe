"""The response is learned from what is flown anyway, of holds that are stepped by their own equations."""

import math
import random
from collections import deque
from collections.abc import Callable

import pytest

from vfguide.guidance.response import COURSE, SPEED, HoldKind, HoldLearner, HoldResponse

PERIOD = 0.05


class Hold:
    """A hold of one number: rate = gain * lag(setpoint(t - T) - value), within a limit."""

    def __init__(self, gain: float, dead_time: float, lag: float, limit: float = math.inf) -> None:
        self.gain, self.lag, self.limit = gain, lag, limit
        self.value = self.rate = 0.0
        self._on_the_way = deque([0.0] * round(dead_time / PERIOD))

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


def response_of(learner: HoldLearner) -> HoldResponse:
    found = learner.response()
    assert found is not None
    return found


def weave(time_s: float) -> float:
    """Courses as a follower is asked for while it joins, rad."""
    return 0.3 * math.sin(0.5 * time_s) + 0.15 * math.sin(1.3 * time_s)


@pytest.mark.parametrize("gain", [0.3, 0.8, 2.0])
@pytest.mark.parametrize(("dead_time", "lag"), [(0.0, 0.0), (0.3, 0.0), (0.1, 0.5)])
def test_a_weaving_course_shows_gain_dead_time_and_lag(gain, dead_time, lag):
    found = response_of(learned(COURSE, Hold(gain, dead_time, lag), weave, noise=0.005))
    assert found.gain == pytest.approx(gain, rel=0.25)
    assert found.late == pytest.approx(dead_time + lag, abs=0.16)
    assert found.earliest - 0.03 <= dead_time + lag <= found.latest + 0.03
    assert found.explained > 0.95


def test_a_steady_turn_shows_the_gain_but_not_the_delay():
    # Around a circle by 0.1 rad/s the error is 0.1 / 0.5 = 0.2 rad, whatever the dead time adds to it.
    hold = Hold(0.5, 0.0, 0.0)
    found = response_of(learned(COURSE, hold, lambda time_s: 0.2 + 0.1 * time_s, seconds=60.0))
    assert found.gain == pytest.approx(0.5, rel=0.1)
    assert found.latest - found.earliest > 0.3


def test_more_noise_leaves_more_doubt():
    spreads = [
        response_of(learned(COURSE, Hold(0.8, 0.2, 0.3), weave, seconds=15.0, noise=noise)).spread
        for noise in (0.0, 0.1)
    ]
    assert spreads[1] > 1.2 * spreads[0]


def test_an_aircraft_that_ignores_its_setpoints_has_no_response():
    learner, chance = HoldLearner(COURSE), random.Random(2)
    for step in range(800):
        time_s = step * PERIOD
        learner.note(weave(time_s), time_s)
        learner.observe(time_s, 0.0, chance.gauss(0.0, 0.05), limit=1.0, angle=True)
    found = learner.response()
    assert found is None or found.explained < 0.5


def test_speeds_are_learned_by_their_own_changes():
    def asked(time_s: float) -> float:
        return 2.0 if time_s % 20.0 < 10.0 else -1.0

    found = response_of(learned(SPEED, Hold(0.4, 0.5, 0.0), asked, seconds=60.0, angle=False))
    assert found.gain == pytest.approx(0.4, rel=0.25)
    assert found.late == pytest.approx(0.5, abs=0.35)


def test_what_is_thrown_from_limit_to_limit_is_known_by_its_timing() -> None:
    """Half a radian per second to either side: the gain is large enough for that, the delay is seen."""

    def asked(time_s: float) -> float:
        return 1.5 if time_s % 4.0 < 2.0 else -1.5

    found = response_of(
        learned(COURSE, Hold(2.0, 0.3, 0.0, limit=0.5), asked, seconds=20.0, limit=0.5)
    )
    assert found.late == pytest.approx(0.3, abs=0.16)
    assert found.least <= 2.0 <= found.greatest
    assert found.least > 0.35


def test_a_declaration_that_fits_explains_the_flight_and_one_off_by_three_does_not():
    learner = learned(COURSE, Hold(0.5, 0.2, 0.0), weave)
    assert learner.explained_by(0.5, 0.2, 0.0) > 0.98
    assert learner.explained_by(1.5, 0.2, 0.0) < 0.0
    assert learner.explained_by(0.17, 0.2, 0.0) < 0.7
