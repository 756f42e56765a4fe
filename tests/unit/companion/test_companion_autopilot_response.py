"""A vehicle's response and limits, as its autopilot tells them and flight shows them, and what that costs."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.companion import Flight, companion_of, new_flight
from tests.kit.flight import fly
from tests.kit.missions import plan_of, shipped, with_vehicle
from tests.kit.states import reported
from vfguide.commands.check import lowered_in
from vfguide.companion.guided_vehicle import lowered_gains
from vfguide.companion.learned_response import ResponseLearner
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.own_vehicle import OwnVehicle
from vfguide.companion.parameter_check import (
    TRIES,
    NarrowedLimits,
    ParameterCheck,
    narrowed_limits,
    response_sentence,
)
from vfguide.companion.plan import FlightPlan, bandwidth_for, flown_by, follower_law, turning
from vfguide.companion.supervisor import Mode
from vfguide.guidance.air_data import TurnEfficiency
from vfguide.guidance.response import AS_DECLARED, UNKNOWN
from vfguide.mavlink.parameters import AutopilotResponse
from vfguide.mavlink.reports import ParameterReport
from vfguide.mission import Mission
from vfguide.mission.load import with_overrides
from vfguide.mission.overrides import Overrides, parse_settings

WORDS = "flown by the autopilot's own parameters"
LIMITS = "12 to 32 m/s, 45 degrees of bank"


@pytest.fixture
def asking() -> FlightPlan:
    """A plan whose alpha is far from what the emulated autopilot does."""
    declared = plan_of()
    slow = replace(declared.airframe, alpha=0.3, beta=0.3)
    return replace(declared, airframe=slow, asks_response=True)


def flight_by(plan: FlightPlan, until_s: float, kind: str = "ardupilot") -> Flight:
    companion = companion_of(plan=plan, autopilot=kind)
    return new_flight(kind=kind, companion=companion, until_s=until_s)


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
    roll = {"course_dead_time": 0.2, "course_lag": 0.4}
    told = AutopilotResponse(alpha=0.9, beta=1.5, speed_hold="total-energy", **roll)
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
    limits = "tighter than the mission's limits: 29 degrees of bank, not 45"
    assert sentence.endswith(f"{limits}; less is left to come back to the slot with")
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
    limits = {"airspeed_min": 14.0, "airspeed_max": 40.0, "climb_max": 2.5, "sink_max": 6.0}
    told = AutopilotResponse(alpha=0.5, beta=0.4, max_bank=0.5, **limits)
    airframe = flown_by(asking, told).airframe
    assert (airframe.climb_max, airframe.sink_max) == (2.5, asking.airframe.sink_max)
    assert (airframe.alpha, airframe.beta, airframe.max_bank) == (0.5, 0.4, 0.5)
    assert (airframe.airspeed_min, airframe.airspeed_max) == (14.0, asking.airframe.airspeed_max)


@pytest.mark.parametrize("told", [AutopilotResponse(), AutopilotResponse(airspeed_min=50.0)])
def test_what_is_not_told_and_limits_that_exclude_each_other_stay_as_declared(asking, told):
    assert flown_by(asking, told) == replace(asking, asks_response=False)


def found_out(**changes: str) -> FlightPlan:
    """The part of f1 in a mission that leaves it to be found out."""
    return flight_plan(with_vehicle("line-calm", "f1", slips="auto", **changes), "f1")


@pytest.fixture
def finding() -> FlightPlan:
    return found_out()


def turns(value: float) -> TurnEfficiency:
    return TurnEfficiency(value=value, variance=0.02**2)


def test_until_it_is_known_it_is_flown_as_one_that_slips_and_a_declared_alpha_stays(finding):
    assert turning(finding, 0.8, slips=True) == replace(finding, turn_efficiency=0.8)
    assert finding.slips
    assert finding.airframe.speed_hold == "total-energy"
    learner = ResponseLearner()
    assert learner.step(finding, TurnEfficiency(), 0.0, bank_heard=True) == ([], None)


def test_one_that_does_not_slip_is_flown_as_if_the_mission_said_so(finding):
    (words,), found = ResponseLearner().step(finding, turns(1.0), 0.0, bank_heard=True)
    assert words == (
        "it turns 1.00 of what its bank says: it does not slip, and is flown so; nothing to do"
    )
    assert not found.slips
    assert found.airframe == plan_of().airframe


def test_alpha_is_what_the_bank_gives_times_what_is_turned_of_it(finding):
    told = AutopilotResponse(alpha=0.745, beta=0.5, coordinated_alpha=1.0)
    flown = flown_by(replace(finding, asks_response=True), told)
    assert flown.airframe.alpha == 0.745
    learner = ResponseLearner()
    words, found = learner.step(flown, turns(0.8), 0.0, bank_heard=True)
    assert words == [
        "it turns 0.80 of what its bank says: flown as a vehicle that slips; nothing to do"
    ]
    assert found.airframe.alpha == pytest.approx(0.8)
    # 0.01 more changes nothing, 0.03 more the alpha and no word.
    assert learner.step(found, turns(0.81), 1.0, bank_heard=True) == ([], None)
    words, later = learner.step(found, turns(0.83), 2.0, bank_heard=True)
    assert words == []
    assert later.airframe.alpha == pytest.approx(0.83)


@pytest.mark.parametrize(
    ("plan", "value"),
    [
        # Before the autopilot has told its parameters, and where the mission says it.
        (replace(found_out(), asks_response=True), 1.0),
        (replace(plan_of(), finds_slip=False), 0.7),
    ],
)
def test_nothing_changes_before_parameters_are_told_or_where_the_mission_says_it(plan, value):
    assert ResponseLearner().step(plan, turns(value), 0.0, bank_heard=True) == ([], None)


def test_without_a_bank_the_pilot_hears_so_once(finding):
    learner, silence = ResponseLearner(), TurnEfficiency()
    told = [learner.step(finding, silence, float(now), bank_heard=False)[0] for now in range(60)]
    assert [now for now, words in enumerate(told) if words] == [20]
    assert "no ATTITUDE is heard" in str(told[20])


def test_what_holds_course_and_ground_speed_is_not_asked():
    plan = found_out(plant="course-hold")
    assert (plan.slips, plan.finds_slip, plan.airframe.speed_hold) == (False, False, "first-order")


def test_what_was_learned_outlasts_another_response(finding):
    own = OwnVehicle(finding)
    own.air.by_nose = own.air.by_path = turns(1.0)
    calibration = own.air.calibration
    first = own.take(reported(0.0), 0.0)
    assert first.delay_compensator is not None
    own.retune(turning(finding, 1.0, slips=False))
    assert own.air.turn_efficiency == turns(1.0)
    assert own.air.calibration is calibration
    # The mission's holds are ideal: setpoints take effect at once.
    second = own.take(reported(0.1, 2.0), 0.1)
    assert second.delay_compensator is None
    assert second.interval == pytest.approx(0.1)


BANK_30 = math.radians(30.0)
CLIMBS = {"climb_max": 3.0, "sink_max": 2.0}


def circling(name: str) -> FlightPlan:
    """A vehicle of circle-wind: clockwise, 150 m, 20 m/s: 0.1333 rad/s."""
    return plan_of("circle-wind", name)


def narrowed(declared: FlightPlan, **autopilot: float) -> NarrowedLimits:
    return narrowed_limits(declared, flown_by(declared, AutopilotResponse(**autopilot)))


WIDE = {"airspeed_min": 10.0, "airspeed_max": 40.0, "max_bank": 1.0}


@pytest.mark.parametrize("autopilot", [{}, WIDE | {"climb_max": 20.0, "sink_max": 20.0}])
def test_limits_that_are_no_tighter_cost_nothing(autopilot):
    assert narrowed(circling("f1"), **autopilot).sentence == ""


@pytest.mark.parametrize(
    ("name", "autopilot", "words"),
    [
        # Outer slot, 20 m behind: (20 + 0.1333 * 20, 0.1333 * 20) = 22.82 m/s, whose bank is
        # atan(22.82 * 0.1333 / 9.80665) = 17.2 degrees; the leader's atan(20 * 0.1333 / 9.80665) = 15.2.
        ("f1", {"max_bank": BANK_30}, "30 degrees of bank, not 45 (its slot takes 17.2)"),
        ("leader", {"max_bank": BANK_30}, "30 degrees of bank, not 45 (its path takes 15.2)"),
        ("f1", {"airspeed_max": 24.0}, "up to 24 m/s, not 32 (its slot takes 22.8)"),
        # Inner slot: (20 - 0.1333 * 20, 0.1333 * 20) = 17.54 m/s.
        ("f2", {"airspeed_min": 15.0}, "down to 15 m/s, not 12 (its slot takes 17.5)"),
        ("f1", CLIMBS, "climbs of 3 m/s, not 4, descents of 2 m/s, not 3"),
    ],
)
def test_what_is_narrowed_is_told_with_what_the_flight_takes(name, autopilot, words):
    found = narrowed(circling(name), **autopilot)
    assert words in found.sentence
    assert "less is left" in found.sentence
    assert not found.too_tight


@pytest.mark.parametrize("autopilot", [{"max_bank": math.radians(17.0)}, {"airspeed_max": 22.0}])
def test_limits_that_the_slot_exceeds_are_called_too_tight(autopilot):
    found = narrowed(circling("f1"), **autopilot)
    assert found.too_tight
    assert "the slot cannot be held" in found.sentence


def test_a_path_that_climbs_is_held_against_the_climb():
    """climb-and-turn: 8.5 degrees at 20 m/s are 20 tan 8.5 = 2.99 m/s."""
    declared = plan_of("climb-and-turn", "leader")
    words = "climbs of 5 m/s, not 6 (its path takes 2.99)"
    assert words in narrowed(declared, climb_max=5.0).sentence
    assert narrowed(declared, climb_max=2.0).too_tight


def test_behind_a_leader_without_a_path_the_tightest_circle_is_told():
    """V² / (g tan 20 degrees)."""
    declared = plan_of("foreign-leader")
    radius = declared.airframe.cruise**2 / (9.80665 * math.tan(math.radians(20.0)))
    found = narrowed(declared, max_bank=math.radians(20.0))
    assert f"no turn tighter than {radius:.0f} m" in found.sentence
    assert not found.too_tight


SETTINGS = [
    "controller.k_y=0.2",
    "controller.k_x=0.01",
    "vehicles.defaults.course_dead_time_s=0.5",
    "vehicles.defaults.alpha_1_s=0.5",
    "vehicles.defaults.beta_1_s=0.5",
]


def mission_of(*settings: str, controller: str | None = None) -> Mission:
    given = Overrides(controller=controller, settings=parse_settings([*SETTINGS, *settings]))
    return with_overrides(shipped("line-calm"), given)


def test_what_is_flown_in_the_place_of_a_gain_is_said_with_both_numbers():
    # The gain of the path is one, too.
    plan = flight_plan(mission_of("path.gain=0.5"), "leader")
    assert [one.name for one in lowered_gains(plan)] == ["path.gain"]
    plan = flight_plan(mission_of("controller.integral_s=0"), "f1")
    (k_y,) = lowered_gains(plan)
    # Half of what the course loop bears, over (2/pi) chi_inf V.
    slope = 2.0 / math.pi * math.radians(plan.gains.chi_inf_deg) * plan.airframe.cruise
    assert k_y.flown == pytest.approx(bandwidth_for(plan).course_field / slope)
    assert k_y.sentence() == (
        f"k_y 0.2 is more than this aircraft bears ({k_y.flown:.2g}): {k_y.flown:.2g} is flown"
    )


def test_defaults_are_nobody_s_choice_and_an_unknown_response_is_waited_for():
    plan = flight_plan(mission_of(), "f1")
    assert lowered_gains(plan)
    unwritten = replace(plan, gains=type(plan.gains)())
    assert lowered_gains(unwritten) == []
    unknown = replace(plan, certainty=replace(AS_DECLARED, course=UNKNOWN))
    assert lowered_gains(unknown) == []


def test_check_says_which_vehicles_do_not_bear_it_and_the_pilot_hears_it_once():
    (found,) = lowered_in(mission_of("controller.integral_s=0"))
    assert (found.severity, found.field) == ("note", "controller.k_y")
    assert found.message.startswith("k_y 0.2 is more than f1, f2, f3 bear (")
    flight = fly(mission_of("rehearsal.duration_s=12"))
    texts = [event.text for event in flight.events["f1"]]
    assert len([text for text in texts if text.startswith("k_y 0.2 is more than")]) == 1


def test_the_article_s_law_is_flown_as_printed_where_it_is_to_be_exact():
    bounded = flight_plan(mission_of(controller="article"), "f1")
    exact = flight_plan(mission_of(controller="article exact"), "f1")
    assert follower_law(bounded).gains.k_y < 0.2
    law = follower_law(exact)
    assert (law.gains.k_y, law.for_speed().gains.k_x) == (0.2, 0.01)
    assert law.settings == exact.settings
    assert lowered_gains(exact) == []
