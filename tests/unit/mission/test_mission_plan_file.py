"""Plans of QGroundControl: what is read from them, and that a broken one is refused in one sentence."""

import copy
import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
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


def item(command: int, *params: float, **fields: object) -> dict[str, Any]:
    return {"command": command, "params": list(params), **fields}


TWO = (waypoint(47.0, 8.0, 100.0, doJumpId=1), waypoint(47.01, 8.0, 120.0, doJumpId=2))
JUMP, TAG, TO_TAG = 177, 600, 601


def test_altitudes_relative_to_the_launch_count_from_its_own():
    found = parse_plan(plan(*TWO))["waypoints"]
    assert [one["altitude_amsl_m"] for one in found] == [600.0, 620.0]
    absolute = parse_plan(plan(waypoint(47.0, 8.0, 700.0, frame=0), TWO[1]))["waypoints"]
    assert absolute[0] == {"latitude_deg": 47.0, "longitude_deg": 8.0, "altitude_amsl_m": 700.0}


def test_the_waypoints_of_a_survey_stand_in_its_place():
    survey = {"type": "ComplexItem", "complexItemType": "survey"}
    survey["TransectStyleComplexItem"] = {"Items": [waypoint(47.02, 8.0, 90.0), {"command": 206}]}
    found = parse_plan(plan(TWO[0], survey, TWO[1]))
    assert [one["latitude_deg"] for one in found["waypoints"]] == [47.0, 47.02, 47.01]
    assert found["left_out"] == ["cameras"]


@pytest.mark.parametrize(
    ("last", "end", "radius_m"),
    [
        ({"command": 20}, "hand-back", None),
        ({"type": "ComplexItem", "complexItemType": "fwLandingPattern"}, "hand-back", None),
        (item(JUMP, 1, -1, 0, 0, 0, 0, 0), "repeat", None),
        (item(178, 1, 20, -1, 0, 0, 0, 0), "loiter", None),
        (item(17, 0, 0, -80.0, 0, 47.02, 8.0, 90.0, type="SimpleItem", frame=3), "loiter", -80.0),
    ],
)
def test_the_last_item_says_what_comes_at_the_end(last, end, radius_m):
    found = parse_plan(plan(*TWO, last))
    assert found["end"] == end
    assert found.get("loiter_radius_m") == radius_m


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"{", "is no JSON at line 1, nor a list of waypoints; save it again"),
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
        ([1, 0], "loiter", ["a jump that is taken never"]),
        ([1], "loiter", ["a jump that is taken never"]),
    ],
)
def test_only_a_jump_that_is_always_taken_ends_a_route(jump, end, left_out):
    found = parse_plan(plan(*TWO, item(JUMP, *jump), waypoint(47.02, 8.0, 130.0)))
    assert (found["end"], found["left_out"]) == (end, left_out)
    assert len(found["waypoints"]) == (2 if end == "repeat" else 3)


def latitudes(content: bytes) -> list[float]:
    return [one["latitude_deg"] for one in parse_plan(content)["waypoints"]]


@pytest.mark.parametrize(
    ("items", "flown"),
    [
        # Twice more, then on.
        ((*TWO, item(JUMP, 1, 2)), [47.0, 47.01] * 3),
        ((item(TAG, 7), *TWO, item(TO_TAG, 7, 1)), [47.0, 47.01] * 2),
        ((TWO[0], item(JUMP, 9, 1), TWO[1]), [47.0]),
        ((TWO[0], item(JUMP, 9, -1), TWO[1]), [47.0]),
    ],
)
def test_counted_jumps_and_tags_are_flown(items, flown):
    last = waypoint(47.02, 8.0, 130.0, doJumpId=9)
    assert latitudes(plan(*items, last)) == [*flown, 47.02]


CORNERS = [[47.0, 8.0], [47.1, 8.0], [47.1, 8.1]]
SCAN = {"type": "ComplexItem", "complexItemType": "StructureScan", "polygon": CORNERS}
FOR_EVER = "jumps back for ever, and not to the first waypoint; let it jump there, or so many"


@pytest.mark.parametrize(
    ("items", "sentence"),
    [
        ([*TWO, item(JUMP, 2, -1)], f"item 3 {FOR_EVER}"),
        ([*TWO, item(JUMP, 44, 1)], "item 3 jumps to item 44, which there is not;"),
        ([*TWO, item(TO_TAG, 7, 1)], "item 3 jumps to tag 7, which there is not;"),
        ([*TWO, item(JUMP, 1, 1e9)], "has more than 2000 waypoints"),
        ([item(JUMP, 1, 1e9, doJumpId=1), *TWO], "jumps too often; draw"),
        ([*TWO, *(item(JUMP, 1, 1),) * 2], "item 3 is a counted jump within another"),
        ([item(36, 0, 0, 0, 0, 47, 8, 9), *TWO], "(command 36) is flown in a way"),
        ([*TWO, SCAN], "draw waypoints round the structure instead"),
    ],
)
def test_what_no_route_can_do_is_refused_with_what_to_draw_instead(items, sentence):
    with pytest.raises(InputError, match=re.escape(sentence)):
        parse_plan(plan(*items))
    assert latitudes(plan(SCAN | {"Items": [*TWO]})) == [47.0, 47.01]


def test_gates_have_a_place_and_without_an_altitude_the_one_before():
    gate = waypoint(47.02, 8.0, 90.0, command=4501)
    level = {**gate, "params": [0, 0, 0, 0, 47.03, 8.0, None]}
    found = parse_plan(plan(TWO[0], gate, level))["waypoints"]
    assert [one["latitude_deg"] for one in found] == [47.0, 47.02, 47.03]
    assert [one["altitude_amsl_m"] for one in found] == [600.0, 590.0, 590.0]


def test_a_loiter_here_is_at_the_waypoint_before_it():
    here = item(18, 3, 0, -90, 0, 0, 0, 0, frame=3)
    found = parse_plan(plan(here, *TWO, here))
    assert [one["latitude_deg"] for one in found["waypoints"]] == [47.0, 47.01]
    assert found["waypoints"][-1]["altitude_amsl_m"] == 620.0
    assert (found["loiter_radius_m"], found["left_out"]) == (-90.0, ["loitering on the way"])


def test_a_loiter_without_end_is_the_end_and_others_are_flown_past():
    endless = waypoint(47.02, 8.0, 90.0, command=17)
    timed = waypoint(47.005, 8.0, 90.0, command=19)
    found = parse_plan(plan(TWO[0], timed, TWO[1], endless, waypoint(47.03, 8.0, 90.0)))
    assert [one["latitude_deg"] for one in found["waypoints"]] == [47.0, 47.005, 47.01, 47.02]
    assert found["left_out"] == ["loitering on the way", "what comes after a loiter without end"]


@pytest.mark.parametrize(
    "fence",
    [
        {"version": 1, "polygon": CORNERS, "breachReturn": [47.05, 8.05]},
        {"polygon": CORNERS},
        {"version": 2, "polygons": [{"polygon": CORNERS, "inclusion": True, "version": 1}]},
    ],
)
def test_a_fence_of_every_version_is_read(fence):
    (area,) = parse_plan(plan(*TWO, geoFence=fence))["fence"]["polygons"]
    assert area["inclusion"] is True
    points = area["points"]
    assert [[one["latitude_deg"], one["longitude_deg"]] for one in points] == CORNERS


def fence(**area: object) -> dict[str, Any]:
    return {"geoFence": {"polygons": [area]}}


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ({"geoFence": {"version": 3}}, "has a geoFence of version 3, which is not known here"),
        ({"geoFence": {"version": 2, "ellipses": [1]}}, "has a geoFence with 'ellipses'"),
        ({"geoFence": {"polygons": {"a": CORNERS}}}, "has polygons that are no list"),
        (fence(polygon=CORNERS, version=9), "an area of the fence of"),
        (fence(polygon=CORNERS, inclusion=0), "stay in or out"),
        (fence(polygon=[[1, 2], [3]]), "without a place"),
        (fence(polygon=[[1, 2]]), "fewer than three corners"),
        ({"geoFence": {"circles": [{}]}}, "a circle of the fence has no radius"),
        ({"geoFence": {"polygon": [[47.0, 8.0]]}}, "fewer than three corners"),
        ({"geoFence": []}, "its geoFence is none"),
        ({"geoFence": "none"}, "its geoFence is none; save it again"),
        ({"rallyPoints": [[47.0, 8.0, 9.0]]}, "its rallyPoints are none"),
        ({"rallyPoints": {"points": {"a": 1}}}, "its rallyPoints are none"),
        ({"rallyPoints": {"points": [[47.0, None, 9.0]]}}, "a rally point has"),
        ({"rallyPoints": {"points": [], "version": 5}}, "has rally points of version 5"),
        ({"version": 4}, "has a plan of version 4"),
    ],
)
def test_a_fence_or_rally_point_that_is_not_understood_is_never_nothing(parts, sentence):
    with pytest.raises(InputError, match=re.escape(sentence)) as caught:
        parse_plan(plan(*TWO, **parts))
    assert "\n" not in str(caught.value)


def test_a_fence_among_the_items_is_the_fence():
    corners = [waypoint(*one, 0.0, command=5002, params=[3, 0, 0, 0, *one, 0]) for one in CORNERS]
    circle = waypoint(47.0, 8.0, 0.0, command=5003, params=[900, 0, 0, 0, 47.0, 8.0, 0.0])
    found = parse_plan(plan(*TWO, *corners, circle, waypoint(47.1, 8.1, 90.0, command=5100)))
    (polygon,), (round_one,) = found["fence"]["polygons"], found["fence"]["circles"]
    assert (polygon["inclusion"], len(polygon["points"])) == (False, 3)
    assert (round_one["inclusion"], round_one["radius_m"]) == (True, 900.0)
    assert found["rally_points"] == [{"latitude_deg": 47.1, "longitude_deg": 8.1}]
    assert "left_out" not in found
    with pytest.raises(InputError, match="a polygon of the fence has corners missing"):
        parse_plan(plan(*TWO, *corners[:2]))


WITH_HOME = (
    "QGC WPL 110\r\n"
    "0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t500\t1\r\n"
    "1\t0\t3\t22\t15\t0\t0\t0\t0\t0\t60\t1\r\n"
    "2\t0\t3\t16\t0\t0\t0\t0\t47.0\t8.0\t100\t1\r\n"
    "3\t0\t3\t16\t0\t0\t0\t0\t47.01\t8.0\t120\t1\r\n"
    "4\t0\t3\t177\t2\t-1\t0\t0\t0\t0\t0\t1\r\n"
)


def test_a_list_of_waypoints_as_text_is_read_with_its_home():
    found = parse_plan(WITH_HOME.encode())
    assert [tuple(one.values()) for one in found.pop("waypoints")] == [
        (47.0, 8.0, 600.0),
        (47.01, 8.0, 620.0),
    ]
    home = {"latitude_deg": 47.0, "longitude_deg": 8.0}
    assert found == {"end": "repeat", "home": home, "left_out": ["take-off"]}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        # Version 120 has no home: its item 0 is the first waypoint.
        (WITH_HOME.replace("110", "120"), "item 2 counts its altitude from the launch"),
        (WITH_HOME.replace("110", "100"), "of version 100, which is not known here"),
        (WITH_HOME.replace("47.01", "north"), "is no list of waypoints at line 5; save it again"),
        (WITH_HOME.replace("\t500\t1", ""), "is no list of waypoints at line 2"),
        ("QGC WPL", "of version WPL"),
    ],
)
def test_a_list_of_waypoints_that_is_not_understood_is_refused(text, sentence):
    with pytest.raises(InputError, match=re.escape(sentence)):
        parse_plan(text.encode())


@settings(max_examples=60, deadline=None)
@given(place=st.integers(0, len(WITH_HOME) - 1), text=st.text("0123456789.-e\t\nnaif", max_size=6))
def test_whatever_stands_in_a_list_of_waypoints_it_is_a_mission_or_one_sentence(place, text):
    try:
        found = parse_plan((WITH_HOME[:place] + text + WITH_HOME[place + 2 :]).encode())
    except InputError:
        return
    assert len(found["waypoints"]) >= 2


def test_the_json_of_old_missions_is_read_in_both_of_its_versions():
    def old(latitude: float, altitude: float, number: int) -> dict[str, Any]:
        place = {"coordinate": [latitude, 8.0, altitude], "id": number, "type": "missionItem"}
        return {"command": 16, "frame": 3, "param1": 0, "param2": 0} | place

    items = [old(47.0, 100.0, 1), old(47.01, 120.0, 2)]
    jump = {"command": JUMP, "id": 3, "param1": 1, "param2": -1}
    first = {"MAV_AUTOPILOT": 3, "complexItems": [], "version": "1.0", "items": [*items, jump]}
    first["plannedHomePosition"] = old(47.0, 500.0, 0)
    home = [47.0, 8.0, 500.0]
    second = {"fileType": "Mission", "version": 2, "items": items, "plannedHomePosition": home}
    for content, end in ((first, "repeat"), (second, "loiter")):
        found = parse_plan(json.dumps(content).encode())
        assert [one["altitude_amsl_m"] for one in found["waypoints"]] == [600.0, 620.0]
        assert (found["end"], found["home"]["latitude_deg"]) == (end, 47.0)
    with pytest.raises(InputError, match="has surveys in an old form, without their waypoints"):
        parse_plan(json.dumps(first | {"complexItems": [{"id": 3}]}).encode())


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


def test_the_shipped_plan_has_eight_corners_a_fence_and_a_rally_point_and_is_needed_no_more(
    tmp_path,
):
    mission = shipped("survey-plan")
    contents = mission.path.contents  # type: ignore[attr-defined]
    assert len(contents.waypoints) == 8
    assert contents.end == "repeat"
    assert [one.inclusion for one in contents.fence.polygons] == [True]
    assert [one.inclusion for one in contents.fence.circles] == [False]
    assert len(contents.rally_points) == 1
    assert contents.left_out == ("cameras", "changes of speed", "take-off")
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
