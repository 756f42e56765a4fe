"""An autopilot that starts anew in the middle of a flight."""

import pytest

from tests.kit.companion import ALTITUDE, HEADING, SET_MODE, new_flight
from tests.kit.wire import position_report, spoken
from vfguide.companion.supervisor import Mode


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
