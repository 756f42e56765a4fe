"""Rehearsals of aircraft that answer otherwise than their mission says, and the words about them."""

import pytest

from tests.kit.flight import fly
from tests.kit.missions import content_of, mission_with, shipped
from vfguide.companion.alerts import Event
from vfguide.companion.strain_guard import HANDED_BACK
from vfguide.lab.rehearsal.aircraft import emulator_of
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.studies import prediction
from vfguide.lab.studies.prediction import (
    SHORT_S,
    UnlikeDeclared,
    answering_by,
    losses_found,
    lost_of,
    worst_in_words,
)
from vfguide.mission import Mission


def undeclared() -> Mission:
    """Return circle-calm without a word of how its aircraft answer."""
    content = content_of("circle-calm")
    for vehicle in content["vehicles"].values():
        vehicle.pop("alpha_1_s", None)
        vehicle.pop("beta_1_s", None)
    return Mission.model_validate(content)


def flown(how: str, error_m: float | None, *lost: str) -> UnlikeDeclared:
    return UnlikeDeclared(how=how, error_m=error_m, lost=lost)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_both_holds_of_every_aircraft_answer_otherwise_and_companions_are_told_nothing(factor):
    mission = shipped("circle-wind")
    unlike = answering_by(mission, factor)
    for name in mission.vehicles:
        plant = emulator_of(unlike, name).config.plant
        assert (plant.alpha_1_s, plant.beta_1_s) == (factor * 1.2, factor * 0.8)
    assert unlike.vehicles == mission.vehicles
    assert unlike.rehearsal.duration_s == SHORT_S
    assert unlike.wind == mission.wind


def test_an_aircraft_that_turns_by_its_bank_has_another_gain():
    unlike = answering_by(shipped("ardupilot-sitl"), 0.5)
    plant = emulator_of(unlike, "f1").config.plant
    assert plant.guided_p_cdeg_rad == 6000.0
    # The rest of what the mission knows of the aircraft stays.
    assert plant.turn_efficiency == 0.745


def test_what_an_aircraft_really_is_counts_and_not_what_is_declared():
    real = {"alpha_1_s": 0.4, "vehicles": {"f2": {"alpha_1_s": 3.0}}}
    unlike = answering_by(mission_with("circle-wind", rehearsal={"emulator": real}), 2.0)
    alphas = {name: emulator_of(unlike, name).config.plant.alpha_1_s for name in ("f1", "f2")}
    assert alphas == {"f1": 0.8, "f2": 6.0}


def test_no_hold_is_quicker_than_a_rehearsal_has_it():
    quick = mission_with("circle-wind", rehearsal={"emulator": {"alpha_1_s": 15.0}})
    assert emulator_of(answering_by(quick, 2.0), "f1").config.plant.alpha_1_s == 20.0


def test_the_worst_of_all_responses_is_told():
    worse = (flown("half as fast", 0.8), flown("twice as fast", 0.3))
    assert worst_in_words(shipped("circle-wind"), 0.2, worse) == "0.80 m if it answers half as fast"
    better = (flown("half as fast", 0.19), flown("twice as fast", None))
    assert "no more" in worst_in_words(shipped("circle-wind"), 0.2, better)


def test_a_response_that_nobody_declared_is_said_to_be_learned():
    flight = fly("circle-calm", 5.0)
    found = prediction.precision_of(undeclared(), flight.record, (flown("half as fast", 90.0),))
    assert found.message.startswith(
        "how it answers is not declared: it is learned in flight; expect "
    )
    assert "; 90.00 m at worst: flown for 5 s in calm air" in found.message
    assert "as declared" not in found.message


def test_a_response_by_which_followers_leave_their_slots_is_a_warning_with_a_remedy():
    lost = flown("half as fast", 33.0, "f1 was 33 m from its slot in the last half")
    (found,) = losses_found(shipped("circle-wind"), (lost, flown("twice as fast", 0.2)))
    assert found.severity == "warning"
    assert found.message == (
        "if it answers half as fast: f1 was 33 m from its slot in the last half"
    )
    assert "response: auto" in found.remedy
    assert "vfguide identify" in found.remedy


def test_who_lets_the_response_be_learned_already_is_told_to_measure_it():
    lost = flown("twice as fast", 33.0, "f1 was 33 m from its slot in the last half")
    (found,) = losses_found(undeclared(), (lost,))
    assert "response: auto" not in found.remedy
    assert "vfguide identify" in found.remedy


def test_who_stays_away_from_its_slot_or_is_handed_back_is_named():
    start = {"leader": {"north_m": 0, "east_m": 0}, "f1": {"forward_m": -200}, "f2": {}, "f3": {}}
    away = fly("circle-calm", 5.0, rehearsal={"start": start})
    strained = Event(time_s=3.0, text=HANDED_BACK, warning=True)
    flight = LockstepFlight(
        record=away.record, events={"f2": [strained], "f3": []}, logs={}, interrupted=False
    )
    absent, back = lost_of(flight)
    assert absent.startswith("f1 was ")
    assert absent.endswith(" m from its slot in the last half")
    assert back == "f2 was handed back to its autopilot"
