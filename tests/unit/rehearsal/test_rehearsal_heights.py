"""Rehearsals begin at the heights that vehicles have."""

import numpy as np
import pytest

from tests.kit.missions import mission_with, replaced
from tests.kit.records import with_vehicle
from vfguide.formation.arrangement import Arrangement
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.studies import prediction
from vfguide.lab.studies.prediction import fence_left, from_the_slots
from vfguide.mission import Mission
from vfguide.mission.place import Fence
from vfguide.mission.starts import follower_start, leader_start


def test_a_formation_begins_as_far_above_its_flying_height_as_its_leader():
    start = {"leader": {"north_m": 0, "east_m": 0, "up_m": 150}, "f1": {"up_m": -3}}
    mission = mission_with("climb-and-turn", rehearsal={"start": start})
    assert leader_start(mission).up_m == 150.0
    # f1's slot is 5 m above the leader, f2's 5 m below it.
    assert follower_start(mission, "f1").up_m == pytest.approx(152.0)
    assert follower_start(mission, "f2").up_m == pytest.approx(145.0)
    assert emulator_of(mission, "f1").truth().altitude_amsl_m == pytest.approx(488 + 100 + 152)


def test_check_begins_at_the_height_of_the_path():
    corners = [{"north_m": north, "east_m": 0, "up_m": 40} for north in (0, 3000)]
    mission = replaced("line-calm", path={"type": "waypoints", "waypoints": corners})
    assert leader_start(from_the_slots(mission)).up_m == pytest.approx(40.0)


def test_check_holds_what_was_flown_against_the_fence_of_the_path_flown_then(monkeypatch):
    short = replaced("line-calm", rehearsal={"duration_s": 3.0, "rate_hz": 5.0, "start": {}})
    record = fly_lockstep(short).record
    fenced = replaced(short, fence={"max_height_m": 150})
    assert not [*fence_left(fenced, record)]
    # f1 is found 60 m higher for a moment, 160 m above the origin.
    high = record.followers[0].altitude_amsl_m + np.where(record.time_s >= 2.0, 60.0, 0.0)
    risen = with_vehicle(record, "f1", altitude_amsl_m=high)
    (finding,) = fence_left(fenced, risen)
    assert (finding.severity, finding.location) == ("error", ("fence",))
    assert "in the rehearsal, from 0 s on, 'f1' flies 160 m above the origin" in finding.message
    # Only the first path is that low.
    high_path = Arrangement(number=1, time_s=1.9, across_s=0.0, places=(), path="high")
    shapes = {"high": fenced.path.model_copy(), "main": fenced.path}

    def on_path(one: Mission, name: str) -> Mission:
        fence = Fence(max_height_m=150) if name == "main" else None
        return one.model_copy(update={"path": shapes[name], "fence": fence})

    monkeypatch.setattr(prediction, "timetable", lambda _: [(high_path, None)])
    monkeypatch.setattr(prediction, "on_path", on_path)
    assert not [*fence_left(fenced, risen)]


@pytest.mark.parametrize("plant", ["heading-hold", "course-hold", "bank", "npfg", "six-dof"])
def test_all_begin_at_the_climb_rate_of_the_leader(plant):
    start = {"leader": {"north_m": 0, "east_m": 0, "climb_m_s": 2.0}}
    rehearsal = {"start": start, "emulator": {"plant": plant}}
    for name in ("leader", "f1"):
        emulator = emulator_of(replaced("line-calm", rehearsal=rehearsal), name)
        before = emulator.truth().altitude_amsl_m
        emulator.advance(0.2)
        # 0.4 m, and a little less: its loiter is at the height at which it begins.
        assert emulator.truth().altitude_amsl_m - before == pytest.approx(0.4, abs=0.1)
