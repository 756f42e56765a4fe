"""What `vfguide status` makes of the presences: ready or not, in one line, and who has fallen silent."""

from dataclasses import replace
from pathlib import Path

import pytest

from vfguide.commands.status import Beats, Freshness, flies, readiness, status_json
from vfguide.companion.supervisor import (
    DOUBTED,
    NO_LEADER,
    NO_TIME,
    NOTHING_HEARD,
    Timeouts,
    obstacle,
)
from vfguide.link.presence import Presence
from vfguide.mission import load_mission

MISSION = load_mission(Path(__file__).parents[3] / "missions" / "line-calm.yaml")
READY = Presence(status="online", mode="waiting", time_s=1.0, version="1", signed=True)
ALL = dict.fromkeys(("leader", "f1", "f2", "f3"), READY)


def test_a_formation_whose_companions_are_all_ready_may_go() -> None:
    assert readiness(MISSION, ALL) == "GO  line-calm: all 4 companions are ready"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"f1": None}, "f1: no companion is heard"),
        ({"f1": replace(READY, status="offline")}, "f1: its companion is offline"),
        ({"f1": replace(READY, obstacle=NO_LEADER)}, f"f1: {NO_LEADER}"),
        ({"f1": replace(READY, signed=False)}, "f1: its messages are not signed (--insecure)"),
        ({"f1": replace(READY, figures={"links_lost": 1.0})}, "f1: 1 of its links is lost"),
        ({"f1": replace(READY, version="2")}, "companions of different versions: 1, 2"),
    ],
)
def test_whatever_speaks_against_it_is_said(change: dict[str, Presence | None], said: str) -> None:
    found = {name: one for name, one in {**ALL, **change}.items() if one is not None}
    assert readiness(MISSION, found) == f"NO-GO  {said}"


def test_everything_that_speaks_against_it_stands_in_one_line() -> None:
    line = readiness(MISSION, {"f1": replace(READY, obstacle=NOTHING_HEARD)})
    assert line.count("no companion is heard") == 3
    assert NOTHING_HEARD in line
    assert "\n" not in line


def test_the_deputy_that_leads_and_the_order_that_is_flown_are_told() -> None:
    """Of the terms of three who may lead f2 has 1, f1 2 and the leader 3."""
    mission = MISSION.model_copy(update={"deputies": ("f1", "f2")})
    assert flies(mission, {}) == "leader leads; the mission's formation is flown"
    succeeded = replace(READY, figures={"term": 2.0, "order": 77.0})
    behind = replace(READY, figures={"term": 0.0})
    found = {"leader": behind, "f1": succeeded, "f2": succeeded}
    assert flies(mission, found) == "f1 leads in the leader's place (term 2); order 77 is flown"
    # One alone that is not the leader is not believed where another says something else.
    alone = {"leader": behind, "f1": replace(READY, figures={"order": 77.0})}
    assert flies(mission, alone) == "leader leads; the mission's formation is flown"
    gone = replace(succeeded, status="offline")
    assert flies(mission, {"f1": gone}) == "leader leads; the mission's formation is flown"


def test_a_kept_presence_that_does_not_change_is_a_companion_that_is_gone() -> None:
    freshness = Freshness()
    assert freshness.judge({"f1": READY}, 10.0)["f1"] == READY
    assert freshness.judge({"f1": READY}, 15.0)["f1"].status == "online"
    gone = freshness.judge({"f1": READY}, 16.0)["f1"]
    assert (gone.status, gone.obstacle) == ("offline", "its companion has been silent for 6 s")
    # On a radio everybody's turn to say so comes more rarely.
    slow = Freshness(10.0)
    slow.judge({"f1": READY}, 10.0)
    assert slow.judge({"f1": READY}, 19.0)["f1"].status == "online"
    assert slow.judge({"f1": READY}, 21.0)["f1"].status == "offline"
    # Heard anew, it counts from then on.
    again = replace(READY, time_s=2.0)
    assert freshness.judge({"f1": again}, 17.0)["f1"] == again


def test_a_presence_that_comes_only_once_is_of_a_companion_that_may_be_gone() -> None:
    beats = Beats()
    later = replace(READY, time_s=2.0)
    assert beats.missing({"f1": READY, "f2": READY}) == ["f1", "f2"]
    # f2 beats again, f1 is what a broker has kept; f3 has said itself that it goes.
    found = {"f1": READY, "f2": later, "f3": replace(READY, status="offline")}
    judged = beats.judge(found, 5.0)
    assert judged["f2"] == later
    assert judged["f3"] == found["f3"]
    assert judged["f1"].status == "offline"
    everybody = {**judged, "leader": later, "f3": later}
    assert (
        readiness(MISSION, everybody)
        == "NO-GO  f1: nothing new of its companion in 5 s: it may be gone"
    )


@pytest.mark.parametrize(
    ("telemetry_age", "doubts", "leader_age", "time_known", "expected"),
    [
        (0.1, False, 0.1, True, None),
        (float("inf"), False, 0.1, True, NOTHING_HEARD),
        (float("nan"), False, 0.1, True, NOTHING_HEARD),
        (0.1, True, 0.1, True, DOUBTED),
        (0.1, False, float("inf"), True, NO_LEADER),
        (1.1, True, 9.0, True, NOTHING_HEARD),
        (0.1, False, 0.1, False, NO_TIME),
    ],
)
def test_the_first_obstacle_is_told(
    telemetry_age: float, leader_age: float, expected: str | None, *, doubts: bool, time_known: bool
) -> None:
    found = obstacle(
        Timeouts(),
        telemetry_age=telemetry_age,
        doubts=doubts,
        leader_age=leader_age,
        time_known=time_known,
    )
    assert found == expected


def test_the_json_holds_what_keeps_each_from_steering() -> None:
    content = status_json(MISSION, {"f1": replace(READY, obstacle=NO_LEADER)})
    assert content["f1"] == {
        "status": "online",
        "mode": "waiting",
        "version": "1",
        "signed": True,
        "obstacle": NO_LEADER,
    }
    assert content["leader"] == {"status": "never seen"}
