"""What `vfguide status` makes of the presences: ready or not, in one line, and who has fallen silent."""

import pytest
from msgspec.structs import replace

from tests.kit.missions import shipped
from vfguide.commands.status import Freshness, Seen, flies, readiness, status_json
from vfguide.companion.supervisor import (
    DOUBTED,
    NO_LEADER,
    NO_TIME,
    NOTHING_HEARD,
    ModeTimeouts,
    obstacle,
)
from vfguide.link.presence import Presence

MISSION = shipped("line-calm")
READY = Presence(status="online", mode="waiting", time_s=1.0, version="1", signed=True)
UNSAFE = "FS_GCS_ENABL is 0: should this companion fall silent, the aircraft flies on; set it to 1"
NO_FIX = "the GPS has no fix: wait, or see that its antenna has a clear sky"
ALL = dict.fromkeys(("leader", "f1", "f2", "f3"), READY)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, ""),
        ({"f1": None}, "f1: no companion is heard"),
        ({"f1": replace(READY, status="offline")}, "f1: its companion is offline"),
        ({"f1": replace(READY, obstacle=NO_LEADER)}, f"f1: {NO_LEADER}"),
        ({"f1": replace(READY, signed=False)}, "f1: its messages are not signed (--insecure)"),
        ({"f1": replace(READY, figures={"links_lost": 1.0})}, "f1: 1 of its links is lost"),
        ({"f1": replace(READY, figures={"links_lost": 2.0})}, "f1: 2 of its links are lost"),
        ({"f1": replace(READY, findings=(UNSAFE,))}, f"f1: {UNSAFE}"),
        (
            {"f1": replace(READY, obstacle=NO_FIX, findings=(UNSAFE,))},
            f"f1: {NO_FIX}; f1: {UNSAFE}",
        ),
        ({"f1": replace(READY, version="2")}, "companions of different versions: 1, 2"),
    ],
)
def test_whatever_speaks_against_it_is_said(change, said):
    found = {name: one for name, one in {**ALL, **change}.items() if one is not None}
    go = "GO  line-calm: all 4 companions are ready"
    assert readiness(MISSION, Seen(found=found)) == (f"NO-GO  {said}" if said else go)


def test_everything_that_speaks_against_it_stands_in_one_line():
    line = readiness(MISSION, Seen(found={"f1": replace(READY, obstacle=NOTHING_HEARD)}))
    assert line.count("no companion is heard") == 3
    assert NOTHING_HEARD in line
    assert "\n" not in line


def test_the_deputy_that_leads_and_the_order_that_is_flown_are_told():
    """Of the terms of three who may lead f2 has 1, f1 2 and the leader 3."""
    mission = MISSION.model_copy(update={"deputies": ("f1", "f2")})

    def told(**found: Presence) -> str:
        return flies(mission, Seen(found=found))

    usual = "leader leads; the mission's formation is flown"
    assert told() == usual
    succeeded = replace(READY, figures={"term": 2.0, "order": 77.0})
    behind = replace(READY, figures={"term": 0.0})
    found = told(leader=behind, f1=succeeded, f2=succeeded)
    assert found == "f1 leads in the leader's place (term 2); order 77 is flown"
    # One alone that is not the leader is not believed where another says something else.
    assert told(leader=behind, f1=replace(READY, figures={"order": 77.0})) == usual
    assert told(f1=replace(succeeded, status="offline")) == usual


def test_a_kept_presence_is_of_a_companion_that_may_be_gone_until_it_speaks_again():
    freshness = Freshness()
    later = replace(READY, time_s=2.0)
    kept = {"f1": READY, "f2": READY, "f3": replace(READY, status="offline")}
    judged = freshness.judge(kept, 10.0)
    assert freshness.missing(kept) == ["f1", "f2"]
    assert judged["f1"].status == "offline"
    assert judged["f3"] == kept["f3"]
    # f2 speaks again, f1 is what a broker has kept.
    judged = freshness.judge({**kept, "f2": later}, 13.0)
    assert judged["f2"] == later
    line = readiness(MISSION, Seen(found={**judged, "leader": later, "f3": later}))
    assert line == "NO-GO  f1: nothing new of its companion in 3 s: it may be gone"


def test_a_companion_that_falls_silent_is_gone_after_five_seconds_or_its_turns():
    later = replace(READY, time_s=2.0)
    for silent_s in (5.0, 10.0):
        freshness = Freshness(silent_s)
        freshness.judge({"f1": READY}, 9.0)
        assert freshness.judge({"f1": later}, 10.0)["f1"] == later
        assert freshness.judge({"f1": later}, 10.0 + silent_s)["f1"] == later
        gone = freshness.judge({"f1": later}, 11.0 + silent_s)["f1"]
        said = f"its companion has been silent for {silent_s + 1.0:.0f} s"
        assert (gone.status, gone.obstacle) == ("offline", said)
        # Heard anew, it counts from then on.
        again = replace(READY, time_s=3.0)
        assert freshness.judge({"f1": again}, 12.0 + silent_s)["f1"] == again


def test_after_a_lost_link_what_a_broker_kept_does_not_count_though_it_is_new():
    """A companion that spoke and died meanwhile has left a later word than the one that was heard."""
    freshness = Freshness()
    words = [{"f1": replace(READY, time_s=time_s)} for time_s in (1.0, 2.0, 3.0, 4.0)]
    freshness.judge(words[0], 9.0)
    assert freshness.judge(words[1], 10.0) == words[1]
    freshness.lose(words[1])
    old = freshness.judge(words[1], 11.0)["f1"]
    said = "not heard since the link was lost: it may be gone"
    assert (old.status, old.obstacle) == ("offline", said)
    assert freshness.judge(words[2], 12.0)["f1"].status == "offline"
    assert freshness.judge(words[3], 13.0) == words[3]


def test_while_no_link_stands_nothing_is_said_of_the_vehicles():
    why = "link mqtt://ground:1883: connection refused"
    seen = Seen(found=ALL, complaint=why, deaf=True)
    line = readiness(MISSION, seen)
    assert line.startswith(f"NO-GO  {why}: nothing is known of the vehicles")
    assert "companion" not in line
    assert "not known" in flies(MISSION, seen)
    content = status_json(MISSION, seen)
    assert content["f1"] == {"status": "not heard", "obstacle": line.removeprefix("NO-GO  ")}
    # One of two: the other still tells.
    one = Seen(found=ALL, complaint=why)
    assert readiness(MISSION, one) == f"NO-GO  {why}: see that it stands again"


@pytest.mark.parametrize(
    ("telemetry_age", "doubts", "fault", "leader_age", "time_known", "expected"),
    [
        (0.1, False, None, 0.1, True, None),
        (float("inf"), False, None, 0.1, True, NOTHING_HEARD),
        (float("nan"), False, None, 0.1, True, NOTHING_HEARD),
        (float("inf"), False, NO_FIX, 0.1, True, NO_FIX),
        (0.1, True, None, 0.1, True, DOUBTED),
        (0.1, True, NO_FIX, 0.1, True, NO_FIX),
        # Believed again, whatever was wrong a moment ago.
        (0.1, False, NO_FIX, 0.1, True, None),
        (0.1, False, None, float("inf"), True, NO_LEADER),
        (1.1, True, None, 9.0, True, NOTHING_HEARD),
        (0.1, False, None, 0.1, False, NO_TIME),
    ],
)
def test_the_first_obstacle_is_told(telemetry_age, leader_age, fault, expected, doubts, time_known):
    found = obstacle(
        ModeTimeouts(),
        telemetry_age=telemetry_age,
        doubts=doubts,
        fault=fault,
        leader_age=leader_age,
        time_known=time_known,
    )
    assert found == expected


def test_the_json_holds_what_keeps_each_from_steering():
    content = status_json(MISSION, Seen(found={"f1": replace(READY, obstacle=NO_LEADER)}))
    assert content["f1"] == {
        "status": "online",
        "mode": "waiting",
        "version": "1",
        "signed": True,
        "obstacle": NO_LEADER,
        "findings": [],
        "warning": "",
    }
    assert content["leader"] == {"status": "never seen"}
