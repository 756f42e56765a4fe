"""`vfguide check`: one line for each finding, with file, line, field and remedy."""

import json
import re
from pathlib import Path

import pytest

from vfguide.lab.studies import prediction

MISSIONS = sorted((Path(__file__).parents[3] / "missions").glob("*.yaml"))


FLOWN_BY_CHECK = {"ardupilot-sitl": ("--set", "rehearsal.rate_hz=12.5"), "circle-wind": ()}
"""One at half its rate, in half the time; the other is too quick for that. Both for half as long."""


@pytest.mark.parametrize("mission", MISSIONS, ids=[path.stem for path in MISSIONS])
def test_every_shipped_mission_is_ready_without_a_warning(command, mission, request, monkeypatch):
    monkeypatch.setattr(prediction, "FLOWN_S", 30.0)
    monkeypatch.setattr(prediction, "SHORT_S", 20.0)
    if mission.stem not in FLOWN_BY_CHECK:
        # The missions are flown in tests/closed_loop.
        request.getfixturevalue("unflown")
    outcome = command("check", mission, "--strict", *FLOWN_BY_CHECK.get(mission.stem, ()))
    assert outcome.status == 0
    assert outcome.err == ""
    assert outcome.out.splitlines()[-1] == f"{mission.stem}: ready to fly"


FAULTS = [
    pytest.param(
        ("name: pair", "name: pair\ncolour: red"),
        "colour: unknown field 'colour'; known here: ",
        id="unknown field",
    ),
    pytest.param(
        ("forward_m: -20, right_m: 20", "forward_m: -3, right_m: 0"),
        "followers[0].slot: only 3.0 m from the leader; keep slots acceptance.min_separation_m = 5 m apart",
        id="crowded slots",
    ),
]


@pytest.mark.parametrize(("change", "expected"), FAULTS)
def test_a_fault_is_one_line_with_place_and_remedy(command, pair_with, change, expected):
    path = pair_with(change)
    outcome = command("check", path)
    assert outcome.status == 2
    assert outcome.out == ""
    for line in outcome.lines:
        assert re.match(rf"{re.escape(str(path))}:\d+: ", line)
    (found,) = [line for line in outcome.lines if expected in line]
    number = int(found.removeprefix(f"{path}:").split(":")[0])
    named = expected.split(":", maxsplit=1)[0].rpartition(".")[2].partition("[")[0]
    assert named in path.read_text().splitlines()[number - 1]


WIND = ("rehearsal:", "wind: {type: article}\nrehearsal:")
CROWDED_START = (
    "start: {wing: {forward_m: -5, right_m: 5}}",
    "start: {wing: {forward_m: 18, right_m: -18}}",
)

FINDINGS = [
    pytest.param(
        [WIND, ("forward_m: -20, right_m: 20", "forward_m: 0, right_m: 149")],
        "error: followers[0].slot: this slot needs",
        "move the slot nearer to the leader, widen the turn or the airspeed range",
        id="slot inside the turn is too slow in the wind",
    ),
    pytest.param(
        [WIND, ("forward_m: -20, right_m: 20", "forward_m: 0, right_m: 60")],
        "warning: followers[0].slot: this slot needs",
        "to keep the leader's airspeed, move the slot nearer to it or widen the turn",
        id="slot that the leader gives way to",
    ),
    pytest.param(
        [("radius_m: 150", "radius_m: 15")],
        "error: followers[0].slot.right_m: on the turn this slot lies at or beyond the centre",
        "move the slot nearer to the leader, or to its other side, or widen the path's turns",
        id="slot beyond the centre",
    ),
    pytest.param(
        [("radius_m: 150", "radius_m: 35")],
        "error: path: 'lead' has to bank 49° on the turn",
        "widen the path's turns, fly slower, or move the slot to the inside of the turn",
        id="turn beyond the bank limit",
    ),
    pytest.param(
        [("gain: 0.015", "gain: 0.2")],
        "warning: path.gain: joining the path, the field turns at up to",
        "lower gain to 0.0",
        id="field beyond the bank limit",
    ),
    pytest.param(
        [("acceptance:", "controller: {boundary_layer_factor: 0}\nacceptance:")],
        "error: controller.boundary_layer_factor: at 20 Hz the law crosses 15.0 boundary layers",
        "set boundary_layer_factor to 2 or more (3.5 to 5 are usual), or raise rehearsal.rate_hz",
        id="loop too slow for kappa and epsilon",
    ),
    pytest.param(
        [("duration_s: 20", "duration_s: 20\n  rate_hz: 2")],
        "warning: controller.kappa: at 2 Hz kappa 3 takes a boundary layer of 5.25 rad",
        "raise rehearsal.rate_hz, or lower controller.kappa or boundary_layer_factor",
        id="boundary layer too wide",
    ),
    pytest.param(
        [CROWDED_START],
        "warning: rehearsal.start.wing: begins 2.8 m from leader",
        "keep starts acceptance.min_separation_m = 5 m apart",
        id="crowded starts",
    ),
]


@pytest.mark.usefixtures("unflown")
@pytest.mark.parametrize(("changes", "expected", "remedy"), FINDINGS)
def test_a_finding_is_one_line_with_place_and_remedy(command, pair_with, changes, expected, remedy):
    path = pair_with(*changes)
    outcome = command("check", path)
    strictly = command("check", path, "--strict")
    (found,) = [line for line in outcome.out.splitlines() if expected in line]
    assert re.match(rf"{re.escape(str(path))}:\d+: (error|warning): [\w\[\].]+: .+; .+", found)
    assert f"; {remedy}" in found
    if " error: " in found:
        assert (outcome.status, strictly.status) == (2, 2)
        assert "ready to fly" not in outcome.out
    else:
        assert (outcome.status, strictly.status) == (0, 1)
        assert "ready to fly" in outcome.out
        assert "ready to fly" not in strictly.out


@pytest.mark.usefixtures("unflown")
def test_findings_as_json_say_the_same(command, pair_with):
    path = pair_with(("gain: 0.015", "gain: 0.2"))
    outcome = command("check", path, "--json", "--strict")
    content = json.loads(outcome.out)
    assert outcome.status == 1
    assert content["mission"] == "pair"
    (warning,) = [one for one in content["findings"] if one["severity"] == "warning"]
    assert (warning["file"], warning["line"], warning["field"]) == (str(path), 3, "path.gain")
    assert warning["message"]
    assert warning["remedy"].startswith("lower gain")


def test_a_file_that_is_no_mission_is_told_as_json_too(command, pair_with):
    outcome = command("check", pair_with(("radius_m", "raduis_m")), "--json")
    content = json.loads(outcome.out)
    assert outcome.status == 2
    assert outcome.err == ""
    assert content["mission"] is None
    assert {one["field"] for one in content["findings"]} == {"path.raduis_m", "path.radius_m"}
    assert {one["severity"] for one in content["findings"]} == {"error"}
