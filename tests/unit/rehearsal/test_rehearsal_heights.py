"""Rehearsals begin at the heights that vehicles have."""

import math
from dataclasses import replace

import pytest

from tests.kit.missions import content_of, shipped
from vfguide.formation.arrangement import Arrangement, Point, SlotMove
from vfguide.formation.orders import Formation
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.studies import prediction
from vfguide.lab.studies.order import starts_of_joining
from vfguide.lab.studies.prediction import fence_left, from_the_slots
from vfguide.mission import Mission
from vfguide.mission.order_plan import LeaderPlace
from vfguide.mission.place import Fence
from vfguide.mission.starts import follower_start, leader_start

SLOT = Point(-20.0, 20.0, 5.0)


def test_a_formation_begins_as_far_above_its_flying_height_as_its_leader():
    mission = shipped("climb-and-turn")
    content = content_of(mission)
    start = {"leader": {"north_m": 0, "east_m": 0, "up_m": 150}, "f1": {"up_m": -3}}
    content["rehearsal"] = {**content["rehearsal"], "start": start}
    mission = Mission.model_validate(content)
    assert leader_start(mission).up_m == 150.0
    # f1's slot is 5 m above the leader, f2's 5 m below it.
    assert follower_start(mission, "f1").up_m == pytest.approx(152.0)
    assert follower_start(mission, "f2").up_m == pytest.approx(145.0)
    assert emulator_of(mission, "f1").truth().altitude_amsl_m == pytest.approx(488 + 100 + 152)


def test_check_begins_at_the_height_of_the_path():
    content = content_of("line-calm")
    corners = [{"north_m": north, "east_m": 0, "up_m": 40} for north in (0, 3000)]
    content["path"] = {"type": "waypoints", "waypoints": corners}
    mission = from_the_slots(Mission.model_validate(content))
    assert leader_start(mission).up_m == pytest.approx(40.0)


def test_one_that_joins_begins_at_its_own_height():
    formation = Formation(leader="leader", home={"f3": SLOT}, slots={})
    order = Arrangement(
        number=1, time_s=8.0, across_s=0.0, places=(SlotMove(vehicle="f3", begin=SLOT, end=SLOT),)
    )
    leader = LeaderPlace(0.0, 0.0, 0.0, height=300.0, climb_rate=0.0)
    here = {"f3": LeaderPlace(-100.0, 0.0, 0.0, height=345.0)}
    (start,) = starts_of_joining(formation, order, leader, here).values()
    assert start.up_m == pytest.approx(40.0)
    unknown = {"f3": LeaderPlace(-100.0, 0.0, 0.0)}
    (start,) = starts_of_joining(formation, order, leader, unknown).values()
    assert (start.up_m, math.isfinite(start.forward_m)) == (0.0, True)


def test_check_holds_what_was_flown_against_the_fence_of_the_path_flown_then(monkeypatch):
    content = content_of("line-calm")
    content["rehearsal"] = {"duration_s": 3.0, "rate_hz": 5.0, "start": {}}
    record = fly_lockstep(Mission.model_validate(content)).record
    fenced = Mission.model_validate({**content, "fence": {"max_height_m": 150}})
    assert not [*fence_left(fenced, record)]
    # f1 is found 60 m higher for a moment, 160 m above the origin.
    f1 = record.followers[0]
    high = f1.altitude_amsl_m.copy()
    high[record.time_s >= 2.0] += 60.0
    risen = replace(
        record,
        vehicles=tuple(
            replace(one, altitude_amsl_m=high) if one.name == "f1" else one
            for one in record.vehicles
        ),
    )
    (finding,) = fence_left(fenced, risen)
    assert (finding.severity, finding.location) == ("error", ("fence",))
    assert "in the rehearsal, from 0 s on, 'f1' flies 160 m above the origin" in finding.message
    # Only the first path is that low.
    monkeypatch.setattr(prediction, "timetable", lambda _: [(arrangement("high", 1.9), None)])
    shapes = {"high": fenced.path.model_copy(), "main": fenced.path}
    low = Fence(max_height_m=150)
    monkeypatch.setattr(
        prediction,
        "on_path",
        lambda one, name: one.model_copy(
            update={"path": shapes[name], "fence": low if name == "main" else None}
        ),
    )
    assert not [*fence_left(fenced, risen)]


def arrangement(path: str, time_s: float) -> Arrangement:
    """By which another path is followed from a time on."""
    return Arrangement(number=1, time_s=time_s, across_s=0.0, places=(), path=path)


@pytest.mark.parametrize("plant", ["heading-hold", "course-hold", "bank", "npfg", "six-dof"])
def test_all_begin_at_the_climb_rate_of_the_leader(plant):
    content = content_of("line-calm")
    start = {"leader": {"north_m": 0, "east_m": 0, "climb_m_s": 2.0}}
    content["rehearsal"] = {"start": start, "emulator": {"plant": plant}}
    for name in ("leader", "f1"):
        emulator = emulator_of(Mission.model_validate(content), name)
        before = emulator.truth().altitude_amsl_m
        emulator.advance(0.2)
        # 0.4 m, and a little less: its loiter is at the height at which it begins.
        assert emulator.truth().altitude_amsl_m - before == pytest.approx(0.4, abs=0.1)
