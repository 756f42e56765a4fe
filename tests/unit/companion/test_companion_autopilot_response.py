"""A vehicle whose mission leaves its response to what its autopilot says of itself."""

import pytest
from msgspec.structs import replace

from tests.kit.companion import Flight, companion_of, new_flight
from tests.kit.missions import plan_of, shipped
from vfguide.companion.mission_plan import adapter_of
from vfguide.companion.parameter_check import TRIES, ParameterCheck, response_sentence
from vfguide.companion.plan import FlightPlan, flown_by
from vfguide.companion.supervisor import Mode
from vfguide.mavlink.parameters import AutopilotResponse
from vfguide.mavlink.reports import ParameterReport

WORDS = "flown by the autopilot's own parameters"
LIMITS = "12 to 32 m/s, 45 degrees of bank"


@pytest.fixture
def asking() -> FlightPlan:
    """A plan whose alpha is far from what the emulated autopilot does."""
    declared = plan_of()
    slow = replace(declared.airframe, alpha=0.3, beta=0.3)
    return replace(declared, airframe=slow, asks_response=True)


def flight_by(plan: FlightPlan, until_s: float, kind: str = "ardupilot") -> Flight:
    flown = new_flight(kind=kind)
    flown.companion = companion_of(plan=plan, autopilot=kind)
    flown.run(until_s)
    return flown


def test_nothing_is_steered_before_the_autopilot_has_told_and_the_pilot_hears_what(asking):
    flown = flight_by(asking, 30.0)
    told, words = next((time, text) for time, text in flown.texts() if WORDS in text)
    steering = next(time for time, mode in flown.modes if mode in {Mode.JOINING, Mode.TRACKING})
    assert told < 10.0
    assert steering > 0.0
    # The emulated autopilot's 3 m/s are 0.5 * 9.80665 * 3 / 20 = 0.74 m/s² at 20 m/s.
    costs = next(text for _, text in flown.texts() if "TECS_CLMB_MAX is 3 m/s" in text)
    assert "0.7 m/s" in costs
    # GUIDED_P of the emulated 1.2 1/s at 22 m/s, flown at 20 m/s: 1.2 * 22 / 20.
    assert "alpha 1.32" in words


def test_a_px4_tells_its_course_loop_and_what_it_takes_of_the_mission(asking):
    flown = flight_by(asking, 30.0, "px4")
    told, words = next((time, text) for time, text in flown.texts() if WORDS in text)
    assert told < 10.0
    # The emulated loops' 1.2 1/s as NPFG_PERIOD and NPFG_DAMPING, limits of both.
    assert "alpha 1.20, beta 3.00 1/s, 0.40 s of roll lag, 0.20 s of dead time, 12 to 32" in words
    # Its climb of 3 m/s is less than the mission's 4.
    assert words.endswith(
        "45 degrees of bank; tighter than the mission's limits: climbs of 3 m/s, not 4; less is left to"
        " come back to the slot with"
    )
    assert flown.modes[-1][1] in {Mode.JOINING, Mode.TRACKING}


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (AutopilotResponse(alpha=0.88), f"alpha 0.88 1/s, {LIMITS}; how its speed"),
        (AutopilotResponse(beta=1.5), f"beta 1.50 1/s, {LIMITS}; how it takes up"),
        (AutopilotResponse(), "do not tell how it answers"),
    ],
)
def test_what_the_parameters_leave_open_is_said(asking, told, words):
    assert words in response_sentence(told, asking, flown_by(asking, told))


def test_a_roll_that_the_mission_does_not_declare_is_the_autopilot_s_and_no_other(asking):
    told = AutopilotResponse(
        alpha=0.9, beta=1.5, course_dead_time=0.2, course_lag=0.4, speed_hold="total-energy"
    )
    airframe = flown_by(asking, told).airframe
    assert (airframe.course_dead_time, airframe.course_lag) == (0.2, 0.4)
    assert airframe.speed_hold == "total-energy"
    measured = replace(asking.airframe, course_dead_time=0.3, course_lag=0.6)
    declared = replace(asking, airframe=measured)
    flown = flown_by(declared, told)
    assert (flown.airframe.course_dead_time, flown.airframe.course_lag) == (0.3, 0.6)
    # Nor is it told again.
    sentence = response_sentence(told, declared, flown)
    assert "roll" not in sentence
    assert sentence.endswith("45 degrees of bank; nothing to do")


@pytest.mark.parametrize("known", [{}, {"alpha": 0.9}, {"beta": 0.9}, {"alpha": 0.9, "beta": 0.9}])
def test_a_limit_that_is_tighter_is_told_whatever_else_is_known(asking, known):
    """0.5 rad are 28.6 degrees; the slot beside a straight path takes no bank."""
    told = AutopilotResponse(max_bank=0.5, **known)
    sentence = response_sentence(told, asking, flown_by(asking, told))
    assert sentence.endswith(
        "tighter than the mission's limits: 29 degrees of bank, not 45; less is left to come back to the"
        " slot with"
    )
    assert "nothing to do" not in sentence


def test_an_autopilot_that_cannot_hold_the_slot_is_told_and_speaks_against_taking_off(asking):
    """Its 18 m/s are less than the leader's 20."""
    check = ParameterCheck(asking, adapter_of(shipped("line-calm").vehicles["f1"]))
    check.take(ParameterReport(name="AIRSPEED_MAX", value=18.0, whole=None))
    texts: list[str] = []
    for _ in range(TRIES + 1):
        check.requests(texts.append)
    words = "up to 18 m/s, not 32 (its slot takes 20); the slot cannot be held"
    assert any(words in text for text in texts)
    assert any(words in fault for fault in check.faults())


def test_limits_are_the_tighter_of_both(asking):
    told = AutopilotResponse(
        alpha=0.5,
        beta=0.4,
        airspeed_min=14.0,
        airspeed_max=40.0,
        max_bank=0.5,
        climb_max=2.5,
        sink_max=6.0,
    )
    airframe = flown_by(asking, told).airframe
    assert (airframe.climb_max, airframe.sink_max) == (2.5, asking.airframe.sink_max)
    assert (airframe.alpha, airframe.beta, airframe.max_bank) == (0.5, 0.4, 0.5)
    assert (airframe.airspeed_min, airframe.airspeed_max) == (14.0, asking.airframe.airspeed_max)


@pytest.mark.parametrize("told", [AutopilotResponse(), AutopilotResponse(airspeed_min=50.0)])
def test_what_is_not_told_and_limits_that_exclude_each_other_stay_as_declared(asking, told):
    assert flown_by(asking, told) == replace(asking, asks_response=False)
