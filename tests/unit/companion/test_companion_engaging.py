"""When a companion engages its vehicle, what it sends from then on and when, and what ends that."""

from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import (
    ALTITUDE,
    HEADING,
    MANUAL,
    MESSAGE_INTERVAL,
    SET_MODE,
    SPEED,
    companion_of,
    leader_bytes,
    new_flight,
)
from tests.kit.wire import heartbeat, parsed, position_report, spoken
from vfguide.companion.role import Outgoing
from vfguide.companion.supervisor import Mode


def gaps_of(times: list[float]) -> list[float]:
    return [later - earlier for earlier, later in pairwise(times)]


def test_a_companion_that_may_engages_and_flies_to_its_slot():
    flown = new_flight(until_s=40.0)
    assert flown.autopilot_mode == "GUIDED"
    assert flown.mode_at(40.0) is Mode.TRACKING
    changes = [text for _, text in flown.events if "->" in text]
    assert changes == ["waiting -> joining", "joining -> tracking"]
    assert len(flown.times(SET_MODE)) == 1
    # What does not change is repeated at least twice a second, altitudes every five seconds.
    for command in (HEADING, SPEED):
        late = flown.later(command, 20.0)
        assert max(gaps_of(late)) <= 0.5 + 1e-6
        assert len(late) < 190
    assert gaps_of(flown.times(ALTITUDE)) == pytest.approx([5.0] * 7)


def test_each_position_leads_to_a_course_and_a_speed_while_they_change():
    flown = new_flight(until_s=3.5)
    steps = pytest.approx([1.6 + 0.1 * k for k in range(20)])
    assert flown.times(HEADING)[-20:] == steps
    assert flown.times(SPEED)[-20:] == steps


def test_a_companion_that_may_not_engage_steers_once_the_pilot_selects_guided():
    flown = new_flight(engage=False, until_s=20.0)
    assert flown.times(SET_MODE) == []
    assert flown.times(HEADING) == flown.times(SPEED) == flown.times(ALTITUDE) == []
    assert flown.mode_at(20.0) is Mode.WAITING
    flown.pilot("GUIDED", until_s=85.0)
    # The mode is heard with the next datagram, and one position report later setpoints go out.
    assert flown.times(HEADING)[0] == pytest.approx(20.1)
    assert flown.mode_at(85.0) is Mode.TRACKING
    assert flown.times(SET_MODE) == []


@pytest.mark.parametrize("mode", ["LOITER", "MANUAL"])
def test_setpoints_stop_at_once_when_the_pilot_takes_over_and_it_is_not_taken_back(mode):
    flown = new_flight(until_s=10.0)
    flown.pilot(mode, until_s=30.0)
    for command in (HEADING, SPEED, ALTITUDE):
        assert flown.times(command)
        assert flown.later(command, 10.0) == []
    assert flown.later(SET_MODE, 10.0) == []
    assert flown.autopilot_mode == mode
    assert flown.mode_at(10.1) is Mode.PILOT
    assert flown.mode_at(30.0) is Mode.PILOT


def test_setpoints_resume_when_guided_comes_back():
    flown = new_flight(until_s=10.0)
    flown.pilot("LOITER", until_s=20.0)
    flown.pilot("GUIDED", until_s=85.0)
    assert flown.later(HEADING, 10.0)[0] == pytest.approx(20.1)
    assert flown.later(ALTITUDE, 10.0)[0] == pytest.approx(20.1)
    assert flown.mode_at(85.0) is Mode.TRACKING
    # Taken again, it stays with the pilot again.
    flown.pilot("LOITER", until_s=95.0)
    assert flown.mode_at(95.0) is Mode.PILOT
    assert len(flown.times(SET_MODE)) == 1


def test_an_autopilot_that_forgot_its_altitude_is_told_it_at_once():
    flown = new_flight(until_s=12.0)
    assert flown.times(ALTITUDE)[-1] == pytest.approx(11.1)
    flown.pilot("LOITER", until_s=13.0)
    flown.pilot("GUIDED", until_s=14.0)
    assert flown.times(ALTITUDE)[-1] == pytest.approx(13.1)


def test_the_pilot_keeps_what_he_took_while_telemetry_was_out():
    flown = new_flight(until_s=10.0)
    # Somebody switches the position stream off: nothing to steer by, still in GUIDED.
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.lose = frozenset({MESSAGE_INTERVAL})
    flown.run(15.0)
    assert flown.mode_at(15.0) is Mode.WAITING
    flown.pilot("LOITER")
    flown.lose = frozenset()
    flown.run(40.0)
    assert flown.autopilot_mode == "LOITER"
    assert flown.later(SET_MODE, 10.0) == []


@pytest.mark.parametrize("heard", [[], [leader_bytes(-20.0)]])
def test_a_companion_that_hears_no_leader_or_heard_it_long_ago_does_not_engage(heard):
    flown = new_flight(link=lambda now: heard if now == 0.0 else [], until_s=20.0)
    assert flown.times(SET_MODE) == []
    assert flown.mode_at(20.0) is Mode.WAITING
    assert not any("->" in text for _, text in flown.events)


def test_engaging_is_tried_again_until_it_is_obeyed():
    flown = new_flight(lose=frozenset({SET_MODE}), until_s=10.5)
    # After 1, 2, 4, ... seconds, on the next heartbeat.
    assert flown.times(SET_MODE) == [1.0, 2.0, 4.0, 8.0]
    assert sum("although it was asked" in text for _, text in flown.events) == 1
    flown.lose = frozenset()
    flown.run(17.0)
    assert flown.times(SET_MODE)[-1] == 16.0
    assert flown.autopilot_mode == "GUIDED"


def test_the_leader_engages_steers_and_publishes_with_each_position():
    flown = new_flight("leader", link=lambda _now: [])
    flown.autopilot.counters.clear()
    flown.run(40.0)
    assert flown.autopilot_mode == "GUIDED"
    assert flown.mode_at(40.0) is Mode.TRACKING
    # Two positions in the first second, then one every 100 ms; each is published.
    assert len(flown.published) == pytest.approx(40 * 10, abs=13)
    assert len(flown.times(HEADING)) >= 40 * 2


GREETING_S = 8.0


def greeting(*, heard_s: dict[str, float]) -> float:
    """When f1 is steered first, s, if each of the others is heard from a time on."""
    one = new_flight()
    one.companion = companion_of(greeting_s=GREETING_S)
    for tenth in range(200):
        now = 0.1 * tenth
        one.run(now)
        if one.modes and one.modes[-1][1].steers:
            break
        for name, from_s in heard_s.items():
            if now >= from_s:
                one.companion.receive_neighbour(name, next(iter(one.link(now))), now)
    return one.now


@pytest.mark.parametrize(
    ("heard_s", "joins_s"),
    [
        ({"f2": 0.0, "f3": 0.0}, 1.0),
        # It waits for one that is heard late, and joins without one that is never heard.
        ({"f2": 0.0, "f3": 5.0}, 6.0),
        ({"f2": 0.0}, GREETING_S + 1.0),
    ],
)
def test_it_waits_for_who_is_not_heard_yet_and_not_for_ever(heard_s, joins_s):
    """Heartbeats, to which modes are commanded, come once a second."""
    assert greeting(heard_s=heard_s) == pytest.approx(joins_s, abs=1.1)


def commands(data: bytes) -> set[int]:
    return {one.command for one in parsed(data) if one.get_type() == "COMMAND_INT"}


def test_setpoints_are_in_the_first_half_and_heartbeats_in_the_second():
    whole, halves = new_flight(), new_flight()
    answer, settle = halves.companion.answer, halves.companion.settle
    at_once, later = [], []

    def in_halves(data: bytes, now: float) -> Outgoing:
        out = answer(data, now)
        at_once.append(out.to_autopilot)
        settle(out, now)
        later.append(out.to_autopilot)
        out.to_autopilot = at_once[-1] + later[-1]
        return out

    halves.companion.receive_mavlink = in_halves
    whole.run(10.0)
    halves.run(10.0)
    steering = {SPEED, HEADING}
    assert any(commands(data) >= steering for data in at_once)
    assert not any(commands(data) & steering for data in later)
    assert not any(one.get_type() == "HEARTBEAT" for one in parsed(b"".join(at_once)))
    # Once a second, from 0 to 10 s.
    beats = [one for one in parsed(b"".join(later)) if one.get_type() == "HEARTBEAT"]
    assert len(beats) == 11
    # And both together are what one call says.
    assert halves.sent == whole.sent
    assert halves.events == whole.events


def test_an_airspeed_leads_to_nothing_and_the_pilots_mode_to_something():
    flown = new_flight(until_s=10.0)
    companion, now = flown.companion, flown.now + 0.01
    assert companion.snapshot.mode.steers
    airspeed = mavlink.MAVLink_vfr_hud_message(20.0, 20.0, 0, 50, 588.0, 0.0)
    assert companion.answer(spoken(airspeed), now).is_empty
    out = companion.answer(spoken(heartbeat(MANUAL)), now)
    assert companion.snapshot.mode is Mode.PILOT
    assert not out.is_empty


def test_an_autopilot_that_reboots_while_it_is_steered_stays_where_it_came_up():
    # A reboot gives nobody any right: what looks like one may be injected.
    flown = new_flight(until_s=40.0)
    assert flown.mode_at(40.0) is Mode.TRACKING
    flown.reboot()
    flown.run(50.0)
    assert flown.autopilot_mode == "LOITER"
    assert flown.later(SET_MODE, 40.0) == []
    assert [text for _, text in flown.events if "rebooted" in text] == [
        "the autopilot has rebooted: it is not engaged again by itself; select GUIDED to be steered"
    ]
    flown.pilot("GUIDED", until_s=60.0)
    assert flown.times(HEADING)[-1] > 59.5
    # What it has forgotten is told at once.
    assert flown.later(ALTITUDE, 40.0)[0] <= flown.later(HEADING, 50.0)[0] + 0.1


@pytest.mark.parametrize("mode", ["LOITER", "MANUAL"])
def test_an_autopilot_that_reboots_in_a_pilots_hands_stays_there(mode):
    flown = new_flight(until_s=20.0)
    flown.pilot(mode, until_s=30.0)
    flown.reboot()
    flown.run(50.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.mode_at(50.0) is Mode.PILOT
    assert flown.autopilot_mode == "LOITER"


def test_what_the_operator_did_not_allow_is_not_engaged_after_a_reboot():
    flown = new_flight(engage=False, until_s=2.0)
    flown.pilot("GUIDED", until_s=20.0)
    assert flown.mode_at(20.0).steers
    flown.reboot()
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    assert flown.times(HEADING)[-1] < 20.1


def test_frames_that_look_like_a_reboot_give_nobody_the_guided_mode():
    flown = new_flight(until_s=30.0)
    flown.pilot("RTL")

    def position(now: float) -> bytes:
        """Eight positions whose boot time has fallen, a second after the pilot's hand."""
        place = position_report(time_boot_ms=round((now - 30.0) * 1e3), vx=2000)
        return spoken(place) if 31.0 <= now < 31.4 else b""

    flown.forge = position
    flown.run(60.0)
    assert flown.later(SET_MODE, 30.0) == []
    assert flown.autopilot_mode == "RTL"
