"""A guard without a model: what throws the aircraft about is softened within seconds, or handed back."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.states import vehicle_at
from vfguide.companion.strain_guard import (
    HANDED_BACK,
    JOINING_S,
    SOFTENED,
    SOFTEST,
    StrainGuard,
    swing,
)
from vfguide.state import Airframe, Gusts, Setpoint

PERIOD = 0.05
AIRFRAME = Airframe()

GUSTS = Gusts(share=0.9, surprise_north=0.0, surprise_east=0.0, power=1.0, correlation=0.0)

Asked = Callable[[float], tuple[float, float, bool]]
"""(course in rad, bank in rad, whether a limit cut the setpoint) at a time, s."""


def watched(
    asked: Asked,
    seconds: float,
    *,
    begun_s: float = 0.0,
    guard: StrainGuard | None = None,
    gusts: Gusts | None = None,
    airframe: Airframe = AIRFRAME,
) -> tuple[StrainGuard, list[tuple[float, str]]]:
    """A guard that has watched for so long, and what it has said."""
    guard, said = guard or StrainGuard(), []
    for step in range(round(seconds / PERIOD)):
        time_s = begun_s + step * PERIOD
        course, bank, limited = asked(time_s)
        setpoint = Setpoint(course=course, speed=20.0, speed_limited=limited)
        state = replace(vehicle_at(time_s=time_s), gusts=gusts)
        text = guard.watch(state, setpoint, airframe, bank, in_place=True)
        if text is not None:
            said.append((time_s, text))
    return guard, said


def calm(time_s: float) -> tuple[float, float, bool]:
    return 0.05 * math.sin(0.3 * time_s), 0.05 * math.sin(0.3 * time_s), False


def thrown(time_s: float) -> tuple[float, float, bool]:
    """From full turn to full turn every second and a half, as 59 degrees of bank a second were."""
    side = 1.0 if time_s % 3.0 < 1.5 else -1.0
    return side, 0.6 * math.sin(math.tau * time_s / 3.0), True


def joins(time_s: float) -> tuple[float, float, bool]:
    """A turn onto the slot at the limit."""
    if time_s >= 8.0:
        return 0.0, 0.0, False
    return (1.2, 0.7, True) if time_s < 6.0 else (-0.8, -0.6, True)


@pytest.mark.parametrize("asked", [calm, joins])
def test_a_quiet_flight_and_a_turn_onto_the_slot_are_left_alone(asked):
    guard, said = watched(asked, 60.0)
    assert (guard.softness.course, guard.softness.speed, said) == (1.0, 1.0, [])


def test_what_is_thrown_is_softened_within_3_seconds_and_the_pilot_hears_it_once():
    guard, _ = watched(calm, 20.0)
    guard, said = watched(thrown, 10.0, begun_s=20.0, guard=guard)
    (first, text), *others = said
    assert text == SOFTENED
    # Three changes of side take four and a half seconds; then it is immediate.
    assert first <= 20.0 + 4.5 + 3.0
    assert not others
    assert guard.softness.course < 0.5


def test_setpoints_that_gusts_push_to_a_limit_for_a_fifth_of_the_time_are_softened():
    def gusty(time_s: float) -> tuple[float, float, bool]:
        return 0.0, 0.0, time_s % 1.0 < 0.4

    guard, said = watched(gusty, 30.0, gusts=GUSTS)
    assert guard.softness.speed < 1.0
    assert guard.softness.course == 1.0
    # That is no news for the pilot: nothing is thrown.
    assert not said
    # A manoeuvre in smooth air asks for limits, too.
    guard, _ = watched(gusty, 30.0)
    assert guard.softness.speed == 1.0


def test_setpoints_that_noise_shakes_wear_servos_and_are_softened_without_a_word():
    # 0.05 rad to and fro at each of 20 steps a second, of alpha 1 and 0.49 rad/s: 0.1 of the greatest turn.
    def shaken(time_s: float) -> tuple[float, float, bool]:
        return (0.05 if round(time_s / PERIOD) % 2 else -0.05), 0.0, False

    late = Airframe(course_lag=0.4)
    guard, said = watched(shaken, 40.0, airframe=late)
    assert guard.softness.course < 0.5
    assert guard.softness.speed == 1.0
    assert not said
    # In gusts, and of a hold that answers at once, as much is what flying takes.
    assert watched(shaken, 40.0, airframe=late, gusts=GUSTS)[0].softness.course == 1.0
    assert watched(shaken, 40.0)[0].softness.course == 1.0


def test_quickness_comes_back_slowly():
    guard, _ = watched(thrown, JOINING_S + 8.0)
    soft = guard.softness.course
    guard, _ = watched(calm, 40.0, begun_s=JOINING_S + 8.0, guard=guard)
    assert soft < guard.softness.course
    guard, _ = watched(calm, 300.0, begun_s=JOINING_S + 48.0, guard=guard)
    assert guard.softness.course == 1.0


def test_what_softness_does_not_end_within_15_seconds_is_handed_back():
    guard, said = watched(thrown, JOINING_S + 30.0)
    assert guard.gives_up
    assert said[-1][1] == HANDED_BACK
    assert said[-1][0] < JOINING_S + 5.0 + 3.0 * 2.5 + 16.0
    assert guard.softness.course == SOFTEST
    # Once the pilot has the vehicle, it is watched anew.
    guard.reset()
    assert not guard.gives_up


def test_a_swing_is_what_goes_to_and_fro_beyond_twice_the_range():
    # 0 to 1 and back is one roll into a turn and out of it; three times that is two rolls too many.
    assert swing([0.0, 1.0, 0.0]) == 0.0
    assert swing([0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]) == pytest.approx(4.0)


@given(st.lists(st.tuples(st.floats(-4.0, 4.0), st.floats(-1.5, 1.5), st.booleans()), max_size=400))
def test_softness_stays_within_its_bounds_whatever_is_flown(flown):
    guard, _ = watched(lambda time_s: flown[round(time_s / PERIOD)], PERIOD * len(flown))
    assert SOFTEST <= guard.softness.course <= 1.0
    assert SOFTEST <= guard.softness.speed <= 1.0
