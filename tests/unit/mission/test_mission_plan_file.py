"""Plans of QGroundControl: what is read from them, and that a broken one is refused in one sentence."""

import copy
import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kit.missions import LEAST, MISSIONS, shipped
from vfguide.errors import InputError
from vfguide.mission.feasibility import far_from_home
from vfguide.mission.load import parse_mission
from vfguide.mission.plan_file import MAX_BYTES, parse_plan, read_plan

SHIPPED = json.loads((MISSIONS / "survey.plan").read_text(encoding="utf-8"))


def waypoint(
    latitude: float, longitude: float, altitude: float, **fields: object
) -> dict[str, Any]:
    parameters = [0, 0, 0, None, latitude, longitude, altitude]
    return {"type": "SimpleItem", "command": 16, "frame": 3, "params": parameters} | fields


def plan(*items: object, **fields: object) -> bytes:
    mission = {"items": list(items), "plannedHomePosition": [47.0, 8.0, 500.0]}
    return json.dumps({"fileType": "Plan", "mission": mission} | fields).encode()


TWO = (waypoint(47.0, 8.0, 100.0, doJumpId=1), waypoint(47.01, 8.0, 120.0, doJumpId=2))


def test_altitudes_relative_to_the_launch_count_from_its_own():
    found = parse_plan(plan(*TWO))["waypoints"]
    assert [one["altitude_amsl_m"] for one in found] == [600.0, 620.0]
    absolute = parse_plan(plan(waypoint(47.0, 8.0, 700.0, frame=0), TWO[1]))["waypoints"]
    assert absolute[0] == {"latitude_deg": 47.0, "longitude_deg": 8.0, "altitude_amsl_m": 700.0}


def test_the_waypoints_of_a_survey_stand_in_its_place():
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": [waypoint(47.02, 8.0, 90.0), {"command": 206}]},
    }
    found = parse_plan(plan(TWO[0], survey, TWO[1]))
    assert [one["latitude_deg"] for one in found["waypoints"]] == [47.0, 47.02, 47.01]
    assert found["left_out"] == ["command 206"]


@pytest.mark.parametrize(
    ("last", "end", "radius_m"),
    [
        ({"command": 20}, "hand-back", None),
        ({"type": "ComplexItem", "complexItemType": "fwLandingPattern"}, "hand-back", None),
        ({"command": 177, "params": [1, -1, 0, 0, 0, 0, 0]}, "repeat", None),
        ({"command": 177, "params": [2, -1, 0, 0, 0, 0, 0]}, "loiter", None),
        ({"command": 178, "params": [1, 20, -1, 0, 0, 0, 0]}, "loiter", None),
        (
            waypoint(47.02, 8.0, 90.0, command=17, params=[0, 0, -80.0, None, 47.02, 8.0, 90.0]),
            "loiter",
            -80.0,
        ),
    ],
)
def test_the_last_item_says_what_comes_at_the_end(last, end, radius_m):
    found = parse_plan(plan(*TWO, last))
    assert found["end"] == end
    assert found.get("loiter_radius_m") == radius_m


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"{", "is no JSON at line 1; save it again"),
        (b"[" * 100_000, "is no JSON"),
        (b"\xff\xfe", "is no JSON"),
        (b"[]", "is no plan"),
        (plan(), "has 0 waypoints that can be flown; draw two or more"),
        (plan(TWO[0]), "has 1 waypoints"),
        (plan(7), "has an item that is no group of fields"),
        (plan(*TWO, {"type": "ComplexItem", "complexItemType": "survey"}), "(survey) without its"),
        (plan(waypoint(47.0, 8.0, 9.0, frame=10), TWO[1]), "from the terrain"),
        (plan(waypoint(0.0, 0.0, 9.0), TWO[1]), "item 1 has no position"),
        (plan(waypoint(97.0, 8.0, 9.0), TWO[1]), "nowhere to fly"),
        (plan(waypoint(47.0, 8.0, float("nan")), TWO[1]), "item 1 has no position"),
        (plan(waypoint(47.0, 8.0, 9.0, command="waypoint"), TWO[1]), "item 1 has no command"),
        (plan(*TWO, geoFence="none"), "its geoFence is none; save it again"),
        (plan(*TWO, geoFence={"circles": [{}]}), "a circle of the fence has no radius"),
        (plan(*TWO, geoFence={"polygons": [{"polygon": [[1, 2], [3]]}]}), "without a place"),
        (plan(*TWO, geoFence={"polygons": [{"polygon": [[1, 2]]}]}), "fewer than three corners"),
    ],
)
def test_a_broken_plan_is_refused_in_one_sentence(content, sentence):
    with pytest.raises(InputError, match=re.escape(sentence)) as caught:
        parse_plan(content)
    assert "\n" not in str(caught.value)


def test_files_that_are_none_are_refused(tmp_path):
    large = tmp_path / "large.plan"
    large.write_bytes(b" " * (MAX_BYTES + 1))
    for path, sentence in (
        (large, "larger than 4 MiB"),
        (tmp_path, "is no file"),
        (tmp_path / "none.plan", "there is no such file; give its path relative"),
        (Path("/dev/zero"), "is no file"),
    ):
        with pytest.raises(InputError, match=sentence):
            read_plan(path)


@pytest.mark.parametrize(
    ("jump", "end", "left_out"),
    [
        ([1, -1], "repeat", ["what comes after the jump back to the beginning"]),
        # Twice is not for ever: what comes after it is flown.
        ([1, 2], "loiter", ["a jump that is taken 2 times"]),
        ([1, 0], "loiter", ["a jump that is taken never"]),
        ([2, -1], "loiter", ["a jump that is taken always"]),
        ([1], "loiter", ["a jump that is taken never"]),
    ],
)
def test_only_a_jump_that_is_always_taken_ends_a_route(jump, end, left_out):
    last = waypoint(47.02, 8.0, 130.0)
    found = parse_plan(plan(*TWO, {"command": 177, "params": jump}, last))
    assert (found["end"], found["left_out"]) == (end, left_out)
    assert len(found["waypoints"]) == (2 if end == "repeat" else 3)


LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
TREES = st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=4), max_leaves=6)


def spots(tree: object, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Ways to every value of a tree."""
    pairs = enumerate(tree) if isinstance(tree, list) else ()
    pairs = tree.items() if isinstance(tree, dict) else pairs
    return [way, *(spot for key, value in pairs for spot in spots(value, (*way, key)))]


@settings(max_examples=60, deadline=None)
@given(data=st.data(), value=TREES)
def test_whatever_stands_in_a_plan_it_is_a_mission_or_one_sentence(data, value):
    changed = copy.deepcopy(SHIPPED)
    *way, last = data.draw(st.sampled_from(spots(SHIPPED)[1:]))
    inner = changed
    for step in way:
        inner = inner[step]
    inner[last] = value
    try:
        found = parse_plan(json.dumps(changed).encode())
    except InputError:
        return
    assert len(found["waypoints"]) >= 2


def test_the_shipped_plan_has_eight_corners_a_fence_and_a_rally_point():
    mission = shipped("survey-plan")
    contents = mission.path.contents  # type: ignore[attr-defined]
    assert len(contents.waypoints) == 8
    assert contents.end == "repeat"
    assert [one.inclusion for one in contents.fence.polygons] == [True]
    assert [one.inclusion for one in contents.fence.circles] == [False]
    assert len(contents.rally_points) == 1
    assert contents.left_out == ("command 178", "command 206", "take-off")


def test_a_mission_that_was_read_needs_its_plan_no_more(tmp_path):
    import yaml

    mission = shipped("survey-plan")
    content = yaml.safe_dump(mission.model_dump(mode="json", exclude_unset=True)).encode()
    assert parse_mission(content, file=str(tmp_path / "mission.yaml")).mission == mission


@pytest.mark.parametrize(("moved_deg", "warned"), [(0.0, False), (0.04, False), (0.3, True)])
def test_a_plan_that_takes_off_far_from_the_origin_is_warned_of(tmp_path, moved_deg, warned):
    (tmp_path / "two.plan").write_bytes(plan(*TWO))
    text = LEAST.replace(
        "latitude_deg: 0, longitude_deg: 0", f"latitude_deg: {47 + moved_deg}, longitude_deg: 8"
    )
    text = text.replace("{type: line, course_deg: 90}", "{type: plan, file: two.plan}")
    loaded = parse_mission(text.encode(), file=str(tmp_path / "moved.yaml"))
    found = [str(one) for one in far_from_home(loaded.mission)]
    # 0.3 degrees of latitude are 33.4 km.
    expected = ["33.4 km from the home of its plan", "the plan's home is 47, 8"]
    assert len(found) == warned
    assert all(words in text for text in found for words in expected)
