"""Followers behind an aircraft that has no companion, joined to it by MAVLink bytes alone."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import pytest

from vfguide.companion.supervisor import Mode
from vfguide.mission import Mission
from vfguide.rehearsal.aircraft import Aircraft, ForeignLeader, aircraft_of, step_all
from vfguide.rehearsal.lockstep import fly_lockstep, instants
from vfguide.report.metrics import summarise

if TYPE_CHECKING:
    from vfguide.link.memory import Mail

MissionWith = Callable[..., Mission]


def flown(mission_with: MissionWith, duration_s: float = 100.0, **heard: Any) -> float:  # noqa: ANN401
    """Mean slot error (m) over the second half, with the leader heard in some way."""
    rehearsal = {"duration_s": duration_s, "leader_telemetry": heard}
    mission = mission_with("foreign-leader", rehearsal=rehearsal)
    return summarise(fly_lockstep(mission).record).formation.mean_error_m


@pytest.mark.parametrize(
    ("message", "rate_hz", "greatest_m"),
    [
        ("GLOBAL_POSITION_INT", 10.0, 0.15),
        ("GLOBAL_POSITION_INT", 4.0, 0.3),
        ("GLOBAL_POSITION_INT", 1.0, 0.5),
        ("FOLLOW_TARGET", 10.0, 0.15),
        ("GLOBAL_POSITION_INT_COV", 5.0, 0.3),
        ("HIGH_LATENCY2", 1.0, 1.5),
    ],
)
def test_slots_are_held_by_whatever_message_it_sends(
    message: str, rate_hz: float, greatest_m: float, mission_with: MissionWith
) -> None:
    error_m = flown(mission_with, message=message, rate_hz=rate_hz, delay_s=0.2)
    assert error_m < greatest_m


def test_messages_that_take_now_50_and_now_500_ms_cost_little(mission_with: MissionWith) -> None:
    heard = {"message": "GLOBAL_POSITION_INT", "rate_hz": 5.0, "delay_s": 0.275, "jitter_s": 0.225}
    rehearsal = {"duration_s": 100.0, "leader_telemetry": heard}
    mission = mission_with("foreign-leader", rehearsal=rehearsal, leader={"least_delay_s": 0.05})
    assert summarise(fly_lockstep(mission).record).formation.mean_error_m < 0.3


def test_a_delay_that_nobody_knows_is_flown_behind_the_slot(mission_with: MissionWith) -> None:
    rehearsal = {"duration_s": 100.0, "leader_telemetry": {"delay_s": 0.2}}
    mission = mission_with("foreign-leader", rehearsal=rehearsal, leader={"least_delay_s": None})
    error_m = summarise(fly_lockstep(mission).record).formation.mean_error_m
    # 0.2 s at 20 m/s, in a wind that takes and gives 2 to 8 m/s.
    assert 3.0 < error_m < 5.5


class Formation:
    """A formation whose leader can fall silent, or start its autopilot anew."""

    def __init__(self, mission: Mission) -> None:
        names = [mission.leader.vehicle, *mission.followers_by_name]
        self.aircraft = [aircraft_of(mission, name) for name in names]
        self._instants = instants(mission)
        self._mail: Sequence[Mail] = ()
        self.silent = False
        self.now = 0.0

    @property
    def leader(self) -> ForeignLeader:
        leader = self.aircraft[0]
        assert isinstance(leader, ForeignLeader)
        return leader

    @property
    def followers(self) -> list[Aircraft]:
        return [one for one in self.aircraft if isinstance(one, Aircraft)]

    def fly(self, until_s: float) -> None:
        for now in self._instants:
            self.now = now
            heard = list(self._mail)
            sent = self.leader.step(now, heard)
            mail = heard if self.silent else [*heard, *sent]
            self._mail = step_all(self.followers, now, mail)
            if now >= until_s:
                return

    @property
    def modes(self) -> set[Mode]:
        return {one.companion.snapshot.mode for one in self.followers}


def test_a_leader_that_falls_silent_is_predicted_and_then_left(mission_with: MissionWith) -> None:
    mission = mission_with("foreign-leader", patience={"prediction_s": 8.0, "breakaway_s": 5.0})
    formation = Formation(mission)
    formation.fly(60.0)
    assert formation.modes == {Mode.TRACKING}
    formation.silent = True
    formation.fly(62.0)
    # At one message a second one may be lost: that is no silence.
    assert formation.modes == {Mode.TRACKING}
    formation.fly(64.0)
    assert formation.modes == {Mode.PREDICTING}
    formation.fly(70.0)
    assert formation.modes == {Mode.BREAKAWAY}
    formation.fly(76.0)
    assert formation.modes <= {Mode.LOST, Mode.WAITING}


def test_a_leader_that_comes_back_is_followed_again(mission_with: MissionWith) -> None:
    formation = Formation(mission_with("foreign-leader"))
    formation.fly(60.0)
    formation.silent = True
    formation.fly(66.0)
    formation.silent = False
    formation.fly(90.0)
    assert formation.modes == {Mode.TRACKING}


def test_followers_say_nothing_of_a_leader_that_flies_as_it_should(
    mission_with: MissionWith,
) -> None:
    flight = fly_lockstep(mission_with("foreign-leader", rehearsal={"duration_s": 60.0}))
    told = [event.text for events in flight.events.values() for event in events]
    assert not [text for text in told if text.startswith("the leader")]


def test_any_number_of_processes_flies_the_same(mission_with: MissionWith) -> None:
    mission = mission_with("foreign-leader", rehearsal={"duration_s": 10.0})
    alone, shared = (fly_lockstep(mission, processes=count).record for count in (1, 2))
    for one, other in zip(alone.vehicles, shared.vehicles, strict=True):
        assert one.north_m.tolist() == other.north_m.tolist()
