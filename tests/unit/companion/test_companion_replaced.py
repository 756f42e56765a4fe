"""A companion that takes the place of one that has steered, or finds another of its name on the link."""

import pytest

from tests.kit.companion import (
    KINDS,
    MESSAGE_INTERVAL,
    SET_MODE,
    Flight,
    heard_until,
    new_flight,
)
from vfguide.companion.consent import FileStore, MemoryStore
from vfguide.companion.supervisor import Mode

BACK = "nothing to steer by: handed back to the autopilot, watch that it loiters"


def replaced(flown: Flight, gap_s: float) -> None:
    """The process is killed, and for some time nobody hears the autopilot or speaks to it."""
    flown.hang(flown.now + gap_s)
    flown.waiting = b""
    flown.restart()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("gap_s", [0.5, 2.0, 3.5])
def test_a_vehicle_whose_new_companion_hears_no_leader_is_handed_back(kind, gap_s):
    flown = new_flight(kind=kind, link=heard_until(15.0), until_s=15.0)
    replaced(flown, gap_s)
    flown.run(40.0)
    assert flown.autopilot_mode == "LOITER"
    (time,) = flown.later(SET_MODE, 15.0)
    assert 25.0 + gap_s < time < 29.0 + gap_s
    assert sum(BACK in text for _, text in flown.texts()) == 1
    # No pilot is named who does not fly.
    later = [text for said_s, text in flown.texts() if said_s > 15.0]
    assert [text for text in later if "the pilot flies" in text or "by hand" in text] == []
    # It is the pilot's from then on.
    flown.run(60.0)
    assert flown.later(SET_MODE, time) == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_vehicle_whose_new_companion_hears_no_positions_is_handed_back(kind):
    flown = new_flight(kind=kind, until_s=15.0)
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.lose = frozenset({MESSAGE_INTERVAL, "REQUEST_DATA_STREAM"})
    replaced(flown, 2.0)
    flown.run(40.0)
    assert flown.autopilot_mode == "LOITER"
    assert sum(BACK in text for _, text in flown.texts()) == 1


def test_a_vehicle_that_does_not_obey_its_new_companion_is_handed_back_three_times():
    flown = new_flight(link=heard_until(15.0), until_s=15.0)
    flown.lose = frozenset({SET_MODE})
    replaced(flown, 2.0)
    flown.run(60.0)
    assert len(flown.later(SET_MODE, 15.0)) == 3
    assert any("although it was handed back 3 times" in text for _, text in flown.texts())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("gap_s", [0.0, 2.0])
def test_a_new_companion_that_hears_everything_steers_on(kind, gap_s):
    flown = new_flight(kind=kind, until_s=20.0)
    replaced(flown, gap_s)
    flown.run(50.0)
    assert flown.autopilot_mode == "GUIDED"
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.companion.snapshot.mode.steers


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_companion_that_is_stopped_hands_back(kind):
    flown = new_flight(kind=kind, link=heard_until(15.0), until_s=15.0)
    replaced(flown, 2.0)
    flown.run(20.0)
    flown.companion.stop(flown.now)
    flown.run(25.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("kind", KINDS)
def test_guided_that_the_pilot_gave_after_taking_over_is_not_handed_back_by_a_new_companion(kind):
    flown = new_flight(kind=kind, link=heard_until(15.0), until_s=15.0)
    flown.pilot("LOITER", until_s=18.0)
    flown.pilot("GUIDED", until_s=18.5)
    flown.pilot("LOITER", until_s=20.0)
    replaced(flown, 2.0)
    flown.run(25.0)
    flown.pilot("GUIDED", until_s=60.0)
    assert flown.autopilot_mode == "GUIDED"
    assert flown.later(SET_MODE, 15.0) == []


def test_who_steers_is_on_the_disk(tmp_path):
    store = FileStore(tmp_path, "f1")
    flown = new_flight(store=store, engage=False, until_s=5.0)
    assert not store.load().steered
    flown.pilot("GUIDED", until_s=10.0)
    store.close()
    kept = FileStore(tmp_path, "f1")
    assert kept.load().steered
    kept.close()


def test_nobody_steers_once_the_pilot_has_taken_over():
    store = MemoryStore()
    flown = new_flight(store=store, until_s=10.0)
    assert store.load().steered
    flown.pilot("LOITER", until_s=12.0)
    assert not store.load().steered
    assert store.load().is_spent


def test_the_younger_hands_back_the_vehicle_that_it_steers_and_says_why():
    one = new_flight(until_s=10.0)
    assert one.modes[-1][1].steers
    out = one.companion.stand_back(one.now, twin=True)
    assert "another companion of this name was here before" in out.events[0].text
    assert not one.companion.stand_back(one.now, twin=True).events
    one.run(15.0)
    assert not one.modes[-1][1].steers
    assert one.autopilot_mode == "LOITER"
    assert one.companion.obstacle(one.now) is not None


def test_the_younger_that_has_not_steered_commands_nothing_until_the_other_is_silent():
    """The other one may steer this very vehicle."""
    one = new_flight()
    one.companion.stand_back(0.0, twin=True)
    one.run(10.0)
    assert {mode for _, mode in one.modes} == {Mode.WAITING}
    assert one.autopilot_mode == "LOITER"
    one.companion.stand_back(one.now, twin=False)
    one.run(20.0)
    assert one.modes[-1][1].steers
    assert one.autopilot_mode == "GUIDED"
