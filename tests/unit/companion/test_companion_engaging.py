from itertools import pairwise

import pytest

from tests.kit.companion import leader_bytes, new_flight
from vfguide.companion.supervisor import Mode

SET_MODE, HEADING, SPEED, ALTITUDE = 176, 43_002, 43_000, 43_001
MESSAGE_INTERVAL = 511
GUIDED, LOITER, MANUAL = 15, 12, 0


def test_a_companion_that_may_engages_and_flies_to_its_slot():
    flown = new_flight(until_s=40.0)
    assert flown.autopilot.truth().mode == "GUIDED"
    assert flown.mode_at(40.0) is Mode.TRACKING
    assert [text for _, text in flown.events if "->" in text] == [
        "waiting -> joining",
        "joining -> tracking",
    ]
    assert len(flown.times(SET_MODE)) == 1


def test_each_position_leads_to_a_course_and_a_speed_while_they_change():
    flown = new_flight(until_s=3.5)
    assert flown.times(HEADING)[-20:] == [pytest.approx(1.6 + 0.1 * k) for k in range(20)]
    assert flown.times(SPEED)[-20:] == [pytest.approx(1.6 + 0.1 * k) for k in range(20)]


def test_what_does_not_change_is_repeated_at_least_twice_a_second():
    flown = new_flight(until_s=40.0)
    for command in (HEADING, SPEED):
        late = flown.later(command, 20.0)
        gaps = [later - earlier for earlier, later in pairwise(late)]
        assert max(gaps) <= 0.5 + 1e-6
        assert len(late) < 190


def test_the_altitude_is_repeated_every_five_seconds():
    flown = new_flight(until_s=20.0)
    assert len(flown.times(ALTITUDE)) == 4
    gaps = [later - earlier for earlier, later in pairwise(flown.times(ALTITUDE))]
    assert gaps == [pytest.approx(5.0)] * 3


def test_a_companion_that_may_not_never_engages():
    flown = new_flight(engage=False, until_s=20.0)
    assert flown.times(SET_MODE) == []
    assert flown.times(HEADING) == flown.times(SPEED) == flown.times(ALTITUDE) == []
    assert flown.mode_at(20.0) is Mode.WAITING


def test_a_companion_that_may_not_engage_steers_once_the_pilot_selects_guided():
    flown = new_flight(engage=False, until_s=10.0)
    flown.pilot(GUIDED)
    flown.run(40.0)
    # The mode is heard with the next datagram, and one position report later setpoints go out.
    assert flown.times(HEADING)[0] == pytest.approx(10.1)
    assert flown.mode_at(40.0) is Mode.TRACKING
    assert flown.times(SET_MODE) == []


@pytest.mark.parametrize("mode", [LOITER, MANUAL])
def test_setpoints_stop_at_once_when_the_pilot_takes_over(mode):
    flown = new_flight(until_s=10.0)
    flown.pilot(mode)
    flown.run(30.0)
    for command in (HEADING, SPEED, ALTITUDE):
        assert flown.times(command)
        assert [time for time in flown.times(command) if time > 10.0] == []
    assert flown.mode_at(10.1) is Mode.PILOT
    assert flown.mode_at(30.0) is Mode.PILOT


def test_the_companion_does_not_take_back_what_the_pilot_took():
    flown = new_flight(until_s=10.0)
    flown.pilot(LOITER)
    flown.run(30.0)
    assert [time for time in flown.times(SET_MODE) if time > 10.0] == []
    assert flown.autopilot.truth().mode == "LOITER"


def test_setpoints_resume_when_guided_comes_back():
    flown = new_flight(until_s=10.0)
    flown.pilot(LOITER)
    flown.run(20.0)
    flown.pilot(GUIDED)
    flown.run(85.0)
    later = [time for time in flown.times(HEADING) if time > 10.0]
    assert later[0] == pytest.approx(20.1)
    assert next(time for time in flown.times(ALTITUDE) if time > 10.0) == pytest.approx(20.1)
    assert flown.mode_at(85.0) is Mode.TRACKING
    # Taken again, it stays with the pilot again.
    flown.pilot(LOITER)
    flown.run(95.0)
    assert flown.mode_at(95.0) is Mode.PILOT
    assert len(flown.times(SET_MODE)) == 1


def test_an_autopilot_that_forgot_its_altitude_is_told_it_at_once():
    flown = new_flight(until_s=12.0)
    assert flown.times(ALTITUDE)[-1] == pytest.approx(11.1)
    flown.pilot(LOITER)
    flown.run(13.0)
    flown.pilot(GUIDED)
    flown.run(14.0)
    assert flown.times(ALTITUDE)[-1] == pytest.approx(13.1)


def test_the_pilot_keeps_what_he_took_while_telemetry_was_out():
    flown = new_flight(until_s=10.0)
    # Somebody switches the position stream off: nothing to steer by, still in GUIDED.
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.lose = frozenset({MESSAGE_INTERVAL})
    flown.run(15.0)
    assert flown.mode_at(15.0) is Mode.WAITING
    flown.pilot(LOITER)
    flown.lose = frozenset()
    flown.run(40.0)
    assert flown.autopilot.truth().mode == "LOITER"
    assert [time for time in flown.times(SET_MODE) if time > 10.0] == []


def test_a_companion_without_a_leader_does_not_engage():
    flown = new_flight(link=lambda _now: [], until_s=20.0)
    assert flown.times(SET_MODE) == []
    assert flown.mode_at(20.0) is Mode.WAITING


def test_a_companion_whose_leader_has_gone_silent_does_not_engage():
    # Heard 20 s ago, before the flight.
    flown = new_flight(link=lambda now: [leader_bytes(-20.0)] if now == 0.0 else [], until_s=10.0)
    assert flown.times(SET_MODE) == []
    assert flown.events == []


def test_engaging_is_tried_again_until_it_is_obeyed():
    flown = new_flight()
    flown.lose = frozenset({SET_MODE})
    flown.run(10.5)
    # After 1, 2, 4, ... seconds, on the next heartbeat.
    assert flown.times(SET_MODE) == [1.0, 2.0, 4.0, 8.0]
    assert sum("although it was asked" in text for _, text in flown.events) == 1
    flown.lose = frozenset()
    flown.run(17.0)
    assert flown.times(SET_MODE)[-1] == 16.0
    assert flown.autopilot.truth().mode == "GUIDED"


def test_the_leader_engages_steers_and_publishes_with_each_position():
    flown = new_flight("leader", link=lambda _now: [])
    flown.autopilot.counters.clear()
    flown.run(40.0)
    assert flown.autopilot.truth().mode == "GUIDED"
    assert flown.mode_at(40.0) is Mode.TRACKING
    # Two positions in the first second, then one every 100 ms; each is published.
    assert len(flown.published) == pytest.approx(40 * 10, abs=13)
    assert len(flown.times(HEADING)) >= 40 * 2
