"""An autopilot that starts anew in the middle of a flight."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.companion.core import Companion
from vfguide.companion.plan import FlightPlan, adapter_of
from vfguide.companion.supervisor import Mode
from vfguide.mission.model import Mission

Make = Callable[..., Any]

SET_MODE, HEADING, ALTITUDE = 176, 43_002, 43_001
GUIDED, LOITER, MANUAL = 15, 12, 0


def test_an_autopilot_that_reboots_while_it_is_steered_is_engaged_again(flight: Make) -> None:
    flown = flight()
    flown.run(40.0)
    assert flown.mode_at(40.0) is Mode.TRACKING
    flown.reboot()
    flown.run(50.0)
    assert flown.autopilot.truth().mode == "GUIDED"
    assert flown.times(HEADING)[-1] > 49.5
    assert [text for _, text in flown.events].count("the autopilot has rebooted") == 1
    # What it has forgotten is told at once.
    told = next(time for time in flown.times(ALTITUDE) if time > 40.0)
    assert told <= next(time for time in flown.times(HEADING) if time > 41.5) + 0.1


@pytest.mark.parametrize("mode", [LOITER, MANUAL])
def test_an_autopilot_that_reboots_in_a_pilots_hands_stays_there(flight: Make, mode: int) -> None:
    flown = flight()
    flown.run(20.0)
    flown.pilot(mode)
    flown.run(30.0)
    flown.reboot()
    flown.run(50.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.mode_at(50.0) is Mode.PILOT
    assert flown.autopilot.truth().mode == "LOITER"


def test_what_the_operator_did_not_allow_is_not_engaged_after_a_reboot(flight: Make) -> None:
    flown = flight(engage=False)
    flown.run(2.0)
    flown.pilot(GUIDED)
    flown.run(20.0)
    assert flown.mode_at(20.0).steers
    flown.reboot()
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    assert flown.times(HEADING)[-1] < 20.1


def test_a_vehicle_that_reboots_while_its_leader_is_lost_waits_for_it(
    flight: Make, until: Make
) -> None:
    flown = flight(link=until(10.0, 30.0), patience={"prediction_s": 2.0, "breakaway_s": 1.0})
    flown.run(20.0)
    assert flown.mode_at(20.0) is Mode.LOST
    flown.reboot()
    flown.run(29.0)
    assert flown.mode_at(29.0) is Mode.WAITING
    assert flown.later(SET_MODE, 15.0) == []
    flown.run(35.0)
    assert flown.autopilot.truth().mode == "GUIDED"


def beat(custom_mode: int) -> mavlink.MAVLink_heartbeat_message:
    return mavlink.MAVLink_heartbeat_message(1, 3, 129, custom_mode, 4, 3)


def position(boot_time_s: float) -> mavlink.MAVLink_global_position_int_message:
    return mavlink.MAVLink_global_position_int_message(
        round(boot_time_s * 1e3), 473_977_420, 85_455_940, 588_000, 100_000, 2000, 0, 0, 0
    )


@pytest.fixture
def commanded(
    plan: Callable[..., FlightPlan],
    mission: Callable[[str], Mission],
    leader_bytes: Make,
    spoken: Make,
    parsed: Make,
) -> Callable[[float, bool], list[float]]:
    """When GUIDED was commanded after the reboot of an autopilot that was steered.

    It left GUIDED some seconds before the reboot shows, or is heard first by its position.
    """

    def fly(left_s: float, position_first: bool) -> list[float]:
        companion = Companion(plan(), adapter_of(mission("line-calm").vehicles["f1"]), engage=True)
        times = []
        for step in range(600):
            now = step / 20
            boot_time_s = now + 50.0 if now < 20.0 else now - 19.0
            heard_mode = GUIDED if now < 20.0 - left_s else LOITER
            messages = [position(boot_time_s)]
            beats = now < 20.0 or now > 20.4 or not position_first
            if beats and step % 4 == 0:
                messages.insert(0, beat(heard_mode))
            companion.receive_link(leader_bytes(now), now)
            sent = parsed(companion.receive_mavlink(spoken(*messages), now).to_autopilot)
            times += [now for one in sent if getattr(one, "command", 0) == SET_MODE]
        return [time for time in times if time > 10.0]

    return fly


@pytest.mark.parametrize("position_first", [False, True])
def test_a_reboot_may_show_in_the_heartbeat_or_in_the_position_first(
    commanded: Make, *, position_first: bool
) -> None:
    assert commanded(0.0, position_first)[:3] == [21.0, 22.0, 23.0]


@pytest.mark.parametrize(("left_s", "engages"), [(1.0, True), (4.8, True), (5.4, False)])
def test_a_guided_mode_left_within_five_seconds_was_left_by_the_reboot(
    commanded: Make, left_s: float, *, engages: bool
) -> None:
    assert bool(commanded(left_s, position_first=False)) is engages
