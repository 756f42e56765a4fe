"""What flight shows of a response: whether the vehicle slips, how it answers, and the plans that follow."""

import pytest
from msgspec.structs import replace

from tests.kit.missions import plan_of, shipped
from tests.kit.states import reported
from vfguide.companion.learned_response import ResponseLearner
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.own_vehicle import OwnVehicle
from vfguide.companion.plan import FlightPlan, flown_by, turning
from vfguide.guidance.turn_efficiency import TurnEfficiency
from vfguide.mavlink.parameters import AutopilotResponse


def found_out(**changes: str) -> FlightPlan:
    """The part of f1 in a mission that leaves it to be found out."""
    said = shipped("line-calm")
    vehicle = said.vehicles["f1"].model_copy(update={"slips": "auto", **changes})
    return flight_plan(said.model_copy(update={"vehicles": {**said.vehicles, "f1": vehicle}}), "f1")


@pytest.fixture
def finding() -> FlightPlan:
    return found_out()


def known(value: float) -> TurnEfficiency:
    return TurnEfficiency(value=value, variance=0.02**2)


def test_until_it_is_known_it_is_flown_as_one_that_slips(finding):
    assert finding.slips
    assert finding.airframe.speed_hold == "total-energy"
    learner = ResponseLearner()
    assert learner.step(finding, TurnEfficiency(), 0.0, bank_heard=True) == ([], None)


def test_one_that_does_not_slip_is_flown_as_if_the_mission_said_so(finding):
    words, found = ResponseLearner().step(finding, known(1.0), 0.0, bank_heard=True)
    assert words == [
        "it turns 1.00 of what its bank says: it does not slip, and is flown so; nothing to do"
    ]
    assert not found.slips
    assert found.airframe == plan_of().airframe


def test_alpha_is_what_the_bank_gives_times_what_is_turned_of_it(finding):
    told = AutopilotResponse(alpha=0.745, beta=0.5, coordinated_alpha=1.0)
    flown = flown_by(replace(finding, asks_response=True), told)
    assert flown.airframe.alpha == 0.745
    learner = ResponseLearner()
    words, found = learner.step(flown, known(0.8), 0.0, bank_heard=True)
    assert words == [
        "it turns 0.80 of what its bank says: flown as a vehicle that slips; nothing to do"
    ]
    assert found.airframe.alpha == pytest.approx(0.8)
    # 0.01 more changes nothing, 0.03 more the alpha and no word.
    assert learner.step(found, known(0.81), 1.0, bank_heard=True) == ([], None)
    words, later = learner.step(found, known(0.83), 2.0, bank_heard=True)
    assert words == []
    assert later.airframe.alpha == pytest.approx(0.83)


def test_an_alpha_that_is_declared_stays(finding):
    assert turning(finding, 0.8, slips=True) == replace(finding, turn_efficiency=0.8)


@pytest.mark.parametrize(
    ("plan", "value"),
    [
        # Before the autopilot has told its parameters, and where the mission says it.
        (replace(found_out(), asks_response=True), 1.0),
        (replace(plan_of(), finds_slip=False), 0.7),
    ],
)
def test_nothing_changes_before_parameters_are_told_or_where_the_mission_says_it(plan, value):
    assert ResponseLearner().step(plan, known(value), 0.0, bank_heard=True) == ([], None)


def test_without_a_bank_the_pilot_hears_so_once(finding):
    learner = ResponseLearner()
    told = [
        learner.step(finding, TurnEfficiency(), float(now), bank_heard=False)[0]
        for now in range(60)
    ]
    assert [now for now, words in enumerate(told) if words] == [20]
    assert "no ATTITUDE is heard" in str(told[20])


def test_what_holds_course_and_ground_speed_is_not_asked():
    plan = found_out(plant="course-hold")
    assert (plan.slips, plan.finds_slip, plan.airframe.speed_hold) == (False, False, "first-order")


def test_what_was_learned_outlasts_another_response(finding):
    own = OwnVehicle(finding)
    own.air.by_nose = own.air.by_path = known(1.0)
    calibration = own.air.calibration
    first = own.take(reported(0.0), 0.0)
    assert first.delay_compensator is not None
    own.retune(turning(finding, 1.0, slips=False))
    assert own.air.turn_efficiency == known(1.0)
    assert own.air.calibration is calibration
    # The mission's holds are ideal: setpoints take effect at once.
    second = own.take(reported(0.1, 2.0), 0.1)
    assert second.delay_compensator is None
    assert second.interval == pytest.approx(0.1)
