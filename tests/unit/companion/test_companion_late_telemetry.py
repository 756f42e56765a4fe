"""What a companion hears late, or not at all: the pilot may have flown meanwhile, and keeps the vehicle."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import (
    HASTY,
    KINDS,
    SET_MODE,
    Flight,
    assert_left_alone,
    heard_from,
    heard_until,
    new_flight,
    without,
)
from tests.kit.wire import spoken


def lost_at_25(**options: object) -> Flight:
    """Make a flight whose leader falls silent at 25 s."""
    return new_flight(link=heard_until(25.0), patience=HASTY, **options)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", ["RTL", "MANUAL"])
@pytest.mark.parametrize("before_s", [0.1, 0.8, 1.8, 2.8])
def test_a_mode_selected_while_telemetry_is_late_is_not_engaged_over(kind, mode, before_s):
    flown = new_flight(kind=kind, link=heard_from(10.0), late_s=3.0, until_s=10.0 - before_s)
    flown.pilot(mode)
    flown.run(20.0)
    assert_left_alone(flown, mode)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("late_s", "before_s"), [(1.5, 0.1), (1.5, 0.9), (2.2, 0.5), (3.0, 0.5)])
def test_a_companion_that_stops_does_not_undo_a_mode_that_it_has_not_heard_of(
    kind, late_s, before_s
):
    flown = new_flight(kind=kind, until_s=20.0)
    flown.late_s = late_s
    flown.run(29.2)
    flown.pilot("RTL", until_s=29.2 + before_s)
    flown.companion.stop(flown.now)
    flown.run(40.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.companion.released


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("after_s", [5.2, 5.6, 6.0, 6.4, 6.8])
def test_a_lost_leader_does_not_undo_a_mode_that_was_not_heard_of(kind, after_s):
    flown = lost_at_25(kind=kind, until_s=20.0)
    flown.late_s = 3.0
    flown.run(25.0 + after_s)
    flown.pilot("RTL", until_s=50.0)
    assert flown.later(SET_MODE, 20.0) == []


def test_the_pilot_hears_that_late_telemetry_keeps_the_companion_from_handing_back():
    flown = lost_at_25(until_s=20.0)
    flown.late_s = 3.0
    flown.run(50.0)
    assert flown.autopilot_mode == "GUIDED"
    late = [text for _, text in flown.texts() if "telemetry comes late" in text]
    assert late == [
        (
            "vfguide f1: telemetry comes late: the autopilot's mode is not changed by this companion;"
            " check the radio, or select a mode by hand"
        )
    ]
    # In time again, it is handed back.
    flown.late_s = 0.0
    flown.run(60.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize(("late_s", "edit"), [(0.2, None), (0.5, None), (0.0, without("TIMESYNC"))])
def test_an_ordinary_radio_is_quick_enough_and_an_autopilot_without_a_time_flown_too(late_s, edit):
    flown = lost_at_25()
    flown.late_s, flown.edit = late_s, edit
    flown.run(20.0)
    assert flown.autopilot_mode == "GUIDED"
    flown.run(40.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("forged", [False, True])
def test_answers_that_stay_away_end_the_right_to_command_modes_and_others_date_nothing(forged):
    flown = lost_at_25(until_s=20.0)
    flown.edit = without("TIMESYNC")
    if forged:
        # Answers to questions that nobody asked.
        flown.forge = lambda now: spoken(
            mavlink.MAVLink_timesync_message(round(now * 1e9), round(now * 1e9) + 1)
        )
    flown.run(40.0)
    assert_left_alone(flown, "GUIDED", since_s=20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_what_waited_while_the_companion_stood_still_for_a_moment_shows_no_mode(kind):
    flown = new_flight(kind=kind, until_s=0.6)
    flown.hang(1.05)
    flown.pilot("MANUAL")
    flown.hang(1.7)
    flown.run(10.0)
    assert_left_alone(flown, "MANUAL")


def by_hand(flown: Flight) -> None:
    """Flying by hand for a moment."""
    flown.pilot("MANUAL")
    flown.pilot("LOITER")


def deaf(flown: Flight, until_s: float) -> None:
    """Nothing is heard for a while in which the pilot flies."""
    flown.deaf = True
    flown.run((flown.now + until_s) / 2.0)
    by_hand(flown)
    flown.run(until_s)
    flown.deaf = False


def hung(flown: Flight, until_s: float) -> None:
    """The companion stands still for a while in which the pilot flies."""
    flown.hang((flown.now + until_s) / 2.0)
    by_hand(flown)
    flown.hang(until_s)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_request_that_nobody_has_answered_is_forgotten_by_one_that_did_not_watch(kind, away):
    flown = new_flight(kind=kind, lose=frozenset({SET_MODE}), until_s=5.5)
    assert flown.times(SET_MODE)
    away(flown, 20.0)
    flown.lose = frozenset()
    flown.run(50.0)
    assert_left_alone(flown, "LOITER", since_s=20.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_vehicle_that_waits_for_its_leader_is_not_engaged_after_it_was_not_watched(kind, away):
    flown = new_flight(kind=kind, link=heard_from(20.0), until_s=4.0)
    away(flown, 14.0)
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    reasons = [text for _, text in flown.texts() if "heartbeats were not heard" in text]
    assert len(reasons) == 1
    assert reasons[0].endswith("to be steered")


def off(message: MAVLink_message, now: float) -> MAVLink_message | None:
    """Positions 5 km off between 4 and 15 s."""
    if message.get_type() == "GLOBAL_POSITION_INT" and 4.0 < now <= 15.0:
        message.lat += 500_000
    return message


def lost(message: MAVLink_message, now: float) -> MAVLink_message | None:
    """No positions between 4 and 15 s."""
    return None if message.get_type() == "GLOBAL_POSITION_INT" and 4.0 < now <= 15.0 else message


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("edit", [off, lost])
def test_flying_by_hand_without_positions_spends_the_right_to_engage(kind, edit):
    flown = new_flight(kind=kind, link=heard_from(18.0), edit=edit, until_s=8.0)
    flown.pilot("MANUAL", until_s=12.0)
    flown.pilot("LOITER", until_s=40.0)
    assert_left_alone(flown, "LOITER")


@pytest.mark.parametrize("kind", KINDS)
def test_one_lost_heartbeat_hides_no_flight(kind):
    flown = new_flight(kind=kind, link=heard_from(10.0), until_s=5.5)
    flown.deaf = True
    flown.run(6.5)
    flown.deaf = False
    flown.run(20.0)
    assert len(flown.times(SET_MODE)) == 1
