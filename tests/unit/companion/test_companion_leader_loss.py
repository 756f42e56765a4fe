"""The leader is not heard any more, the vehicle handed back, and then it is heard again."""

import math

import pytest

from tests.kit.companion import (
    HASTY,
    HEADING,
    KINDS,
    MESSAGE_INTERVAL,
    SET_MODE,
    SPEED,
    assert_left_alone,
    heard_until,
    leader_bytes,
    new_flight,
)
from vfguide.companion.supervisor import Mode

PATIENCE = {"prediction_s": 5.0, "breakaway_s": 3.0}
"""The leader is lost 8 s after it was heard last; 5 s where patience is `HASTY`."""


def test_a_silent_leader_is_predicted_then_left_and_then_lost():
    flown = new_flight(link=heard_until(40.0), patience=PATIENCE, until_s=60.0)
    assert flown.mode_at(40.55) is Mode.TRACKING
    assert flown.mode_at(40.65) is Mode.PREDICTING
    assert flown.mode_at(45.0) is Mode.PREDICTING
    assert flown.mode_at(45.1) is Mode.BREAKAWAY
    assert flown.mode_at(48.0) is Mode.BREAKAWAY
    assert flown.mode_at(48.1) is Mode.LOST
    assert flown.mode_at(60.0) is Mode.LOST
    changes = [text for time, text in flown.events if time > 40.0 and "->" in text]
    assert changes == ["tracking -> predicting", "predicting -> breakaway", "breakaway -> lost"]


def test_half_a_minute_of_silence_is_borne_in_its_slot_unless_the_mission_says_otherwise():
    flown = new_flight(link=heard_until(30.0), until_s=50.0)
    # The leader would be at (1000, 0), and the slot 20 m behind and 20 m left of it.
    assert flown.place() == pytest.approx((980.0, -20.0), abs=1.0)
    assert flown.times(HEADING)[-1] > 49.5
    flown.run(86.0)
    assert flown.mode_at(60.0) is Mode.PREDICTING
    assert flown.mode_at(60.1) is Mode.BREAKAWAY
    assert flown.mode_at(85.0) is Mode.BREAKAWAY
    assert flown.mode_at(85.1) is Mode.LOST


def test_a_gap_in_telemetry_does_not_bend_the_way_of_a_silent_leader():
    flown = new_flight(link=heard_until(39.95), until_s=39.95)
    # Its last words are of a moment in which it turned.
    flown.companion.receive_link(leader_bytes(40.0, turn_rate=0.2), 40.0)
    flown.run(50.0)
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.lose = frozenset({MESSAGE_INTERVAL})
    flown.run(52.0)
    assert flown.mode_at(52.0) is Mode.WAITING
    flown.lose = frozenset()
    flown.run(65.0)
    assert flown.mode_at(65.0) is Mode.PREDICTING
    # A leader that went on turning would by now be going round in circles of 100 m.
    assert flown.place() == pytest.approx((1280.0, -20.0), abs=5.0)


def test_breaking_away_it_turns_to_the_side_of_its_slot():
    flown = new_flight(
        link=heard_until(30.0), patience={"prediction_s": 2.0, "breakaway_s": 20.0}, until_s=50.0
    )
    assert flown.mode_at(50.0) is Mode.BREAKAWAY
    truth = flown.autopilot.truth()
    assert math.remainder(truth.course_rad, math.tau) == pytest.approx(
        math.radians(-60.0), abs=0.01
    )
    assert truth.airspeed_m_s == pytest.approx(20.0, abs=0.1)
    assert min(flown.times(HEADING)[-1], flown.times(SPEED)[-1]) > 49.5


@pytest.mark.parametrize("kind", KINDS)
def test_a_vehicle_whose_leader_is_lost_goes_back_to_its_autopilot(kind):
    flown = new_flight(kind=kind, link=heard_until(20.0), patience=PATIENCE, until_s=28.95)
    assert flown.autopilot_mode == "GUIDED"
    flown.run(29.0)
    assert flown.autopilot_mode == "LOITER"
    flown.run(60.0)
    assert flown.autopilot_mode == "LOITER"
    assert flown.mode_at(40.0) is Mode.LOST
    for command in (HEADING, SPEED if kind == "ardupilot" else 178):
        assert 27.5 < flown.times(command)[-1] <= 28.0


def test_handing_back_is_commanded_three_times_on_heartbeats_that_show_guided():
    flown = new_flight(link=heard_until(20.0), patience=PATIENCE, until_s=28.0)
    flown.lose = frozenset({SET_MODE})
    flown.run(40.0)
    assert flown.mode_at(40.0) is Mode.LOST
    assert flown.later(SET_MODE, 20.0) == [29.0, 30.0, 31.0]
    assert [text for _, text in flown.events if "take it by hand" in text] == [
        "the autopilot stays in GUIDED although it was handed back 3 times: take it by hand"
    ]


def test_a_pilot_who_selects_guided_without_a_leader_keeps_it_unsteered():
    flown = new_flight(link=heard_until(20.0), patience=PATIENCE, until_s=30.0)
    flown.pilot("GUIDED", until_s=34.0)
    assert flown.autopilot_mode == "GUIDED"
    assert any("stays in GUIDED, unsteered" in text for _, text in flown.texts())
    assert 27.5 < flown.times(HEADING)[-1] <= 28.0


@pytest.mark.parametrize(
    ("back_s", "patience", "before", "then"),
    [
        (60.0, {}, Mode.PREDICTING, {Mode.TRACKING}),
        (47.0, PATIENCE, Mode.BREAKAWAY, {Mode.JOINING, Mode.TRACKING}),
    ],
)
def test_a_leader_that_is_back_in_time_or_during_the_breakaway_is_followed_again(
    back_s, patience, before, then
):
    flown = new_flight(link=heard_until(40.0, back_s), patience=patience, until_s=80.0)
    assert flown.mode_at(back_s - 0.05) is before
    assert flown.mode_at(back_s) in then
    assert flown.mode_at(80.0) is Mode.TRACKING
    assert flown.autopilot_mode == "GUIDED"
    assert len(flown.times(SET_MODE)) == 1


@pytest.mark.parametrize(("silent_s", "taken_s"), [(20.0, 22.0), (5.0, 20.0)])
def test_the_pilot_wins_over_a_silent_leader_and_flies_what_was_handed_back(silent_s, taken_s):
    flown = new_flight(link=heard_until(silent_s), patience=PATIENCE, until_s=taken_s)
    assert flown.autopilot_mode == ("GUIDED" if silent_s == 20.0 else "LOITER")
    flown.pilot("MANUAL", until_s=40.0)
    assert flown.mode_at(40.0) is Mode.PILOT
    assert_left_alone(flown, "MANUAL", since_s=20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_handed_back_is_the_pilots_to_give_again(kind):
    # Engaging by itself happens once in a flight: nobody tells a hand-back from a pilot's LOITER for sure.
    flown = new_flight(kind=kind, link=heard_until(20.0, 30.5), patience=HASTY, until_s=30.45)
    assert flown.mode_at(30.45) is Mode.LOST
    loiter = flown.autopilot_mode
    flown.run(50.0)
    assert flown.mode_at(30.55) is Mode.WAITING
    assert_left_alone(flown, loiter, since_s=26.5)
    assert flown.texts()[-1][1].endswith("steered")
    flown.pilot("GUIDED", until_s=55.0)
    assert flown.mode_at(55.0).steers


@pytest.mark.parametrize(
    ("back_s", "taken_s", "modes"),
    [
        (30.0, 27.0, ["MANUAL"]),
        (30.0, 27.0, ["RTL"]),
        # And back into the loiter before the leader is heard.
        (30.0, 27.0, ["MANUAL", "LOITER"]),
        # Just when the leader is back.
        (30.1, 30.3, ["MANUAL"]),
    ],
)
def test_a_pilot_who_took_over_meanwhile_is_not_overruled(back_s, taken_s, modes):
    flown = new_flight(link=heard_until(20.0, back_s), patience=HASTY, until_s=taken_s)
    assert flown.mode_at(taken_s) is (Mode.LOST if taken_s < back_s else Mode.WAITING)
    assert flown.autopilot_mode == "LOITER"
    for mode in modes:
        flown.pilot(mode, until_s=flown.now + 1.0)
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.PILOT
    assert_left_alone(flown, modes[-1], since_s=26.0)


def test_the_pilot_may_bring_guided_back():
    flown = new_flight(link=heard_until(20.0, 30.0), patience=HASTY, until_s=27.0)
    flown.pilot("MANUAL", until_s=40.0)
    flown.pilot("GUIDED", until_s=90.0)
    assert flown.mode_at(90.0) is Mode.TRACKING


def test_what_the_operator_did_not_allow_is_not_engaged_again():
    flown = new_flight(engage=False, link=heard_until(20.0, 30.0), patience=HASTY, until_s=2.0)
    flown.pilot("GUIDED", until_s=29.0)
    assert flown.mode_at(29.0) is Mode.LOST
    assert flown.autopilot_mode == "LOITER"
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.WAITING
    assert_left_alone(flown, "LOITER", since_s=26.0)


def test_words_that_are_old_when_they_arrive_do_not_end_the_loss():
    flown = new_flight(link=heard_until(20.0), patience=HASTY, until_s=29.95)
    flown.link = lambda now: [leader_bytes(now - 6.0)]
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.LOST
    assert flown.autopilot_mode == "LOITER"
