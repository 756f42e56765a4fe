"""Other paths of a mission, easements and fences, with rooms worked out by hand."""

import json
import math
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from tests.kit.missions import (
    MISSIONS,
    content_of,
    faults_of,
    line_of,
    loaded,
    mission_with,
    replaced,
    shipped,
    text_of,
)
from vfguide.companion.mission_plan import flight_plan
from vfguide.errors import InputError
from vfguide.formation.arrangement import Manoeuvre, Point
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab.studies.prediction import flown_s
from vfguide.mission import Mission, check_mission
from vfguide.mission.finding import Finding
from vfguide.mission.flight_limits import beyond_the_fence, conditions_of
from vfguide.mission.flight_path import PathShape, curve_check, height_span, path_of
from vfguide.mission.load import load_mission
from vfguide.mission.order_plan import LeaderPlace, formation_of_mission, resolve, timetable
from vfguide.mission.place import Fence, FenceCircle, FencePolygon, least_radius
from vfguide.paths.racetrack import RacetrackShape

WIDE = {"type": "circle", "centre": {"north_m": 500, "east_m": 0}, "radius_m": 300}
TIGHT = {**WIDE, "radius_m": 30}
HERE = LeaderPlace(0.0, 0.0, 0.0)


def mission(paths: dict[str, Any], *orders: dict[str, Any], **sections: Any) -> Mission:
    """Four aircraft along a line to the north-east, with other paths."""
    paths = {
        name: {"direction": "clockwise", **one} if one["type"] == "circle" else one
        for name, one in paths.items()
    }
    return replaced("shapes", paths=paths, orders=orders, **sections)


def ordered(
    one: Mission, order: Order, leader: LeaderPlace | None = HERE, time_s: float = 30
) -> Any:
    """The arrangement of an order from the beginning."""
    formation = formation_of_mission(one)
    return resolve(one, order, formation, number=1, time_s=time_s, leader=leader)[0]


def test_every_companion_knows_all_paths_and_check_says_which_cannot_be_flown():
    one = mission({"wide": WIDE, "tight": TIGHT})
    for name in ("leader", "f3"):
        assert set(flight_plan(one, name).paths) == {"main", "wide", "tight"}
    errors = [found for found in check_mission(one) if found.severity == "error"]
    assert errors
    assert all("on the path 'tight': " in found.message for found in errors)


def test_the_turns_onto_a_path_suit_every_slot():
    found = ordered(mission({"wide": WIDE}), Order(path="wide"))
    assert (found.path, found.flown) == ("wide", Manoeuvre.FORMATION)
    # At 20 + 8 m/s over ground and two thirds of 45 degrees r = 28² / (g tan 30°) = 138.5 m; f3 is 40 m
    # outside, so that R² - r R - 40 r = 0: R = 170.9 m.
    assert found.turn_radius_m == pytest.approx(171.0)


KEPT_IN = {"circles": [{"inclusion": True, "centre": {"north_m": 0, "east_m": 0}, "radius_m": 700}]}


@pytest.mark.parametrize(
    ("path", "sections", "sentence"),
    [
        (TIGHT, {}, "^f3: on the turn this slot lies at or beyond the centre"),
        (WIDE, {"fence": KEPT_IN}, "leaves the fence"),
    ],
)
def test_an_order_of_a_path_that_cannot_be_flown_is_refused_in_a_sentence(path, sections, sentence):
    with pytest.raises(RefusedOrderError, match=sentence):
        ordered(mission({"other": path}, **sections), Order(path="other"))


def test_a_hold_in_the_time_table_is_where_the_other_path_has_led():
    one = mission({"wide": WIDE}, {"at_s": 20, "path": "wide"}, {"at_s": 90, "action": "hold"})
    (first, _), (held, _) = timetable(one)
    assert (first.path, held.path) == ("wide", "wide")
    hold = held.circle
    # Along the line it would be 1270 m north; round the circle no more than 800 m and the hold's width.
    north, _ = flight_plan(one, "leader").frame.to_local(hold.latitude_deg, hold.longitude_deg)
    assert -100.0 < north < 1100.0


def read(paths: str, orders: str = "[]") -> list[str]:
    """What is wrong with a mission's file."""
    head, _, rest = text_of("shapes").partition("# One shape a minute")
    tail = rest[rest.index("wind:") :]
    return faults_of(f"{head}paths: {paths}\norders: {orders}\n{tail}")


@pytest.mark.parametrize(
    ("paths", "text"),
    [
        ("main: {type: line, course_deg: 0}", "paths.main: `main` is the name of `path`"),
        ("Survey: {type: line, course_deg: 0}", "'Survey' cannot be a name"),
        ("survey: {type: ring}", "paths.survey.type: 'ring' is not known"),
        ("survey: {type: line, course_deg: north}", "paths.survey.course_deg: 'north' is not"),
        ("survey: {type: plan, file: none.plan}", "paths.survey.file"),
    ],
)
def test_a_faulty_path_is_told_with_its_place(paths, text):
    (line,) = read(f"{{{paths}}}")
    assert text in line


@pytest.mark.parametrize(
    ("first", "second", "text"),
    [
        (
            "shape: vee",
            "action: hold",
            "[1].at_s: 30 s is no later than the 30 s of the order before",
        ),
        ("leave: [f1]", "leave: [f1]", "[1].leave: 'f1' has left the formation"),
        ("leave: [f2]", "swap: [f1, f2]", "[1].swap: 'f2' has left the formation"),
        ("join: [f1]", None, "[0].join: 'f1' is in the formation already"),
        ("swap: [f1, f9]", None, "[0].swap: 'f9' is no follower"),
        ("action: abort, shape: vee", None, "an abort stands alone"),
    ],
)
def test_orders_that_contradict_each_other_are_refused_with_their_place(first, second, text):
    later = 30 if "no later" in text else 60
    orders = [f"{{at_s: 30, {first}}}", *([f"{{at_s: {later}, {second}}}"] if second else [])]
    (line,) = read("{}", f"[{', '.join(orders)}]")
    assert text in line


def check_of(paths: dict[str, Any], **sections: Any) -> int:
    """By which the path `wide` of a mission is told from others of its name."""
    return formation_of_mission(mission(paths, **sections)).paths["wide"]


ORIGIN = {"latitude_deg": 47.397752, "longitude_deg": 8.545594, "altitude_amsl_m": 488}


@pytest.mark.parametrize(
    ("change", "sections", "is_same"),
    [
        # The same, however it is written.
        ({"radius_m": 300.0, "gain": 0.03, "direction": "clockwise"}, {}, True),
        ({"radius_m": 301}, {}, False),
        ({"direction": "counterclockwise"}, {}, False),
        ({"gain": 0.02}, {}, False),
        # The same numbers, from elsewhere.
        ({}, {"origin": ORIGIN}, False),
    ],
)
def test_another_curve_has_another_check(change, sections, is_same):
    other = check_of({"wide": {**WIDE, **change}}, **sections)
    assert (other == check_of({"wide": WIDE})) is is_same
    # A mission in which no path can be ordered compares none.
    assert set(shipped("circle-wind").path_checks.values()) == {0}


def test_a_plan_is_told_by_its_route_and_not_by_the_name_of_its_file(tmp_path):
    shipped = (MISSIONS / "survey.plan").read_text(encoding="utf-8")
    same, other = tmp_path / "same.plan", tmp_path / "other.plan"
    same.write_text(shipped, encoding="utf-8")
    content = json.loads(shipped)
    waypoints = [one for one in content["mission"]["items"] if one.get("command") == 16]
    waypoints[0]["params"][4] += 1e-4
    other.write_text(json.dumps(content), encoding="utf-8")
    first, second, third = (
        check_of({"wide": {"type": "plan", "file": str(file), "radius_m": 150}})
        for file in (MISSIONS / "survey.plan", same, other)
    )
    assert first == second
    assert first != third


@pytest.mark.parametrize("change", [{"wind": {"type": "calm"}}, {"leader": {"airspeed_m_s": 22.0}}])
def test_a_route_whose_turns_the_mission_gives_is_another_curve_in_another_mission(change):
    corners = [{"north_m": north, "east_m": east} for north, east in ((0, 0), (900, 0), (900, 900))]
    first = mission({"wide": {"type": "waypoints", "waypoints": corners}})
    other = mission_with(first, **change)
    assert first.paths["wide"].bend.radius != other.paths["wide"].bend.radius
    assert first.path_checks["wide"] != other.path_checks["wide"]


def test_sets_have_no_order_and_what_is_no_plain_data_is_an_error_with_its_remedy():
    origin = mission({}).origin

    class Own(PathShape):
        type: str = "own"
        what: object = None

    first = curve_check(Own(what=frozenset("abcdefgh")), origin, 100.0)
    assert first == curve_check(Own(what=frozenset("hgfedcba")), origin, 100.0)
    assert first != curve_check(Own(what=frozenset("abcdefg")), origin, 100.0)
    with pytest.raises(InputError, match="let its `curve` give numbers"):
        curve_check(Own(what=object()), origin, 100.0)


@pytest.mark.parametrize(("at_s", "severity"), [(410, "warning"), (420, "error"), (500, "error")])
def test_an_order_that_the_rehearsal_never_comes_to_is_an_error(at_s, severity):
    # It lasts 420 s; one that begins in it and does not end in it is worth a warning.
    findings = check_mission(mission({}, {"at_s": at_s, "shape": "trail", "spacing_m": 20}))
    (found,) = [one for one in findings if "orders" in one.location]
    assert (found.severity, "lengthen rehearsal.duration_s" in found.remedy) == (severity, True)


def test_a_time_table_is_flown_until_its_last_order_has_settled():
    last, _ = timetable(shapes := shipped("shapes"))[-1]
    assert flown_s(shapes) == pytest.approx(360.0 + last.duration_s + 15.0)
    assert flown_s(mission({})) == 60.0
    assert flown_s(mission({}, {"at_s": 900, "shape": "trail", "spacing_m": 20})) == 600.0


def test_a_time_table_is_flown_until_all_have_come_to_the_height_of_another_path():
    high = {"type": "line", "course_deg": 0}
    high |= {"point": {"north_m": 0, "east_m": 100}, "climb_deg": 5, "end_height_m": 60}
    found = mission({"high": high}, {"at_s": 50, "path": "high"})
    low, top = height_span(path_of(found.paths["high"]))
    assert (low, top) == (pytest.approx(0.0), pytest.approx(60.0))
    # 30 s at half of 4 m/s, 5 s to begin and to end it, 5 s for the last decimetres, and 15 s more.
    assert flown_s(found) == pytest.approx(50.0 + 30.0 + 5.0 + 5.0 + 15.0)


CIRCLE = text_of("circle-calm")
FIELDS = "  type: racetrack\n  centre: {north_m: 0, east_m: 0}\n  course_deg: 0\n"


def file_with(leg_m: float, radius_m: float, easement: str = "") -> str:
    (circle,) = [line for line in CIRCLE.split("\n") if line.startswith("path: ")]
    racetrack = f"path:\n{FIELDS}  leg_m: {leg_m}\n  radius_m: {radius_m}\n{easement}"
    return CIRCLE.replace(circle, racetrack)


@pytest.mark.parametrize(
    ("leg_m", "radius_m", "given_m", "easement_m"),
    [
        *((600, 150, None, 100.0), (60, 150, None, 60.0), (600, 80, None, 80.0)),
        *((70, 80, None, 70.0), (100.5, 100.5, None, 100.0)),
        *((60, 150, 0.0, 0.0), (60, 150, 30.0, 30.0), (60, 150, 60.0, 60.0)),
    ],
)
def test_an_easement_is_the_given_one_or_as_long_as_fits_up_to_a_hundred_metres(
    leg_m, radius_m, given_m, easement_m
):
    given = "" if given_m is None else f"  easement_m: {given_m}\n"
    path = loaded(file_with(leg_m, radius_m, given)).mission.path
    assert isinstance(path, RacetrackShape)
    assert path.easement_m == easement_m


@pytest.mark.parametrize(
    ("leg_m", "radius_m", "easement_m", "longest"), [(60, 150, 61, "60"), (600, 82.5, 100, "82.5")]
)
def test_one_that_is_too_long_is_a_fault_of_its_own_line(leg_m, radius_m, easement_m, longest):
    text = file_with(leg_m, radius_m, f"  easement_m: {easement_m}\n")
    (fault,) = faults_of(text)
    assert fault == (
        f"m.yaml:{line_of('easement_m', text)}: path.easement_m: is longer than the leg or the radius; "
        f"{longest} m is the most; shorten it, or leave it out"
    )


def test_a_radius_that_is_no_number_is_the_only_fault_and_a_remedy_from_a_description_one_line():
    text = file_with(60, 150)
    faults = faults_of(text.replace("radius_m: 150", "radius_m: wide"))
    assert [fault.split(": ")[1] for fault in faults] == ["path.radius_m"]
    faults = "\n".join(faults_of(text.replace("  leg_m: 60\n", "")))
    assert "path.leg_m: is missing; add it: " in faults
    assert "\\u000a" not in faults


CORNERS = ((-100, -100), (100, -100), (100, 100), (-100, 100))
SQUARE = [{"north_m": north, "east_m": east} for north, east in CORNERS]
NOTCHED = [*SQUARE[:2], {"north_m": 0, "east_m": 0}, *SQUARE[2:]]
IN, OUT, NOTCH = (
    {"polygons": [one]}
    for one in ({"points": SQUARE}, {"points": SQUARE, "inclusion": False}, {"points": NOTCHED})
)
CIRCLES = {
    "circles": [
        {"centre": {"north_m": 0, "east_m": 0}, "radius_m": 500},
        {"centre": {"north_m": 0, "east_m": 100}, "radius_m": 20, "inclusion": False},
    ]
}


@pytest.mark.parametrize(
    ("fence", "north", "east", "room"),
    [
        # To the nearest edge.
        *((IN, 0.0, 70.0, 30.0), (IN, 0.0, 130.0, -30.0), (IN, 130.0, 140.0, -50.0)),
        *((OUT, 0.0, 70.0, -30.0), (OUT, 130.0, 140.0, 50.0)),
        # The notch of a polygon is outside.
        *((NOTCH, 60.0, 0.0, -60.0 / math.sqrt(2.0)), (NOTCH, -50.0, 0.0, 50.0)),
        # Of all areas the one with the least room counts.
        *((CIRCLES, 0.0, 50.0, 30.0), (CIRCLES, 0.0, -460.0, 40.0)),
    ],
)
def test_the_room_in_a_fence_is_that_to_the_nearest_edge_of_its_areas(fence, north, east, room):
    found = Fence.model_validate(fence).room(np.array([north]), np.array([east]), None)
    assert found[0] == pytest.approx(room)


def findings_of(mission: Mission) -> list[Finding]:
    return [*beyond_the_fence(mission, conditions_of(mission.path, mission.wind))]


@pytest.mark.parametrize(
    ("radius_m", "max_height_m", "found"),
    [
        (260.0, None, []),
        (245.0, None, ["warning: followers[0].slot: 'f1' comes within 5 m of the fence"]),
        (225.0, None, ["error: followers[0].slot: 'f1' leaves the fence by 15 m near north"]),
        (300.0, 105.0, ["error: followers[0].slot: 'f1' flies 110 m above the origin"]),
    ],
)
def test_a_fence_that_the_leader_keeps_to_is_left_by_the_outermost_slot(
    radius_m, max_height_m, found
):
    fence = {"circles": [{"centre": {"north_m": 0, "east_m": 0}, "radius_m": radius_m}]}
    mission = replaced(
        "circle-calm",
        path={"type": "circle", "centre": {}, "radius_m": 200.0, "direction": "clockwise"},
        followers=[{"vehicle": "f1", "slot": {"forward_m": 0, "right_m": -40, "up_m": 10}}],
        vehicles={"leader": {"system_id": 1}, "f1": {"system_id": 2}},
        rehearsal={},
        fence=fence if max_height_m is None else {**fence, "max_height_m": max_height_m},
    )
    for one, words in zip(findings_of(mission), found, strict=True):
        assert words in f"{one.severity}: {one.field}: {one.message}"


def test_the_radius_of_fillets_leaves_every_slot_bank_and_airspeed():
    mission = {
        "leader": {"vehicle": "a", "airspeed_m_s": 20.0},
        "vehicles": {"a": {"max_bank_deg": 45.0}, "b": {"airspeed_range_m_s": [12.0, 32.0]}},
    }
    # 20² / (g tan 30°) = 70.6 m
    assert least_radius(mission) == 71.0
    # an inner slot 40 m aside loses V y / R: 20 * 40 / (8 - 1) = 114.3 m
    followers = [{"vehicle": "b", "slot": {"forward_m": 0.0, "right_m": 40.0}}]
    assert least_radius(mission | {"followers": followers}) == 115.0
    # at 28 m/s with the wind from behind 28² / (g tan 30°) = 138.5 m; the outer slot is faster and takes
    # the root of R² = 138.5 (R + 40)
    assert least_radius(mission | {"followers": followers, "wind": {"type": "article"}}) == 171.0


def test_a_mission_file_can_hold_a_fence_by_latitude_and_longitude(tmp_path):
    content = content_of("circle-calm", "json")
    centre = {name: content["origin"][name] for name in ("latitude_deg", "longitude_deg")}
    content["fence"] = {"circles": [{"centre": centre, "radius_m": 50}]}
    file = tmp_path / "fenced.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    mission = load_mission(file)
    found = findings_of(mission)
    assert {one.severity for one in found} == {"error"}
    assert len(found) == 1 + len(mission.followers)


@pytest.mark.parametrize(
    ("order", "leader", "sentence"),
    [
        # A circle of 150 m about (150, 0), and its fence of 205 m: 45 m to the left are inside, 60 not.
        (Order(slots={"f1": Point(0.0, -45.0)}), None, None),
        (Order(slots={"f1": Point(0.0, -60.0)}), None, "'f1' leaves the fence by 5 m"),
        # A hold is 200 m wide: about the fence's own centre f1 is outside, 20 m behind and 20 m to the left.
        (Order(action="hold"), LeaderPlace(150.0, 0.0, 0.0), "leaves the fence by"),
        (Order(action="hold"), LeaderPlace(150.0, -200.0, 0.0), "'f1' leaves the fence by 16 m"),
    ],
)
def test_an_order_that_leads_out_of_the_fence_is_refused(order, leader, sentence):
    fence = {"circles": [{"centre": {"north_m": 150, "east_m": 0}, "radius_m": 205}]}
    refusal = pytest.raises(RefusedOrderError, match=sentence) if sentence else nullcontext()
    with refusal:
        ordered(replaced("circle-calm", fence=fence), order, leader, time_s=5.0)


def test_the_edge_of_an_area_is_closed():
    north, east = FencePolygon.model_validate({"points": SQUARE[:3]}).edge(None)
    assert (north.tolist(), east.tolist()) == ([-100, 100, 100, -100], [-100, -100, 100, -100])
    around = {"centre": {"north_m": 10, "east_m": 20}, "radius_m": 5}
    north, east = FenceCircle.model_validate(around).edge(None)
    assert (north[0], east[0]) == pytest.approx((north[-1], east[-1]))
    assert np.hypot(north - 10.0, east - 20.0) == pytest.approx(5.0)


@pytest.mark.parametrize("height", [{}, {"altitude_amsl_m": 600.0}])
def test_a_wrong_origin_is_all_that_is_wrong_with_the_waypoints_that_need_it(height):
    waypoints = [
        {"latitude_deg": 47.4 + step, "longitude_deg": 8.5, **height} for step in (0, 0.01)
    ]
    path = {"type": "waypoints", "waypoints": waypoints, "radius_m": 200.0}
    origin = {"latitude_deg": 100.0, "longitude_deg": 8.5, "altitude_amsl_m": 488.0}
    with pytest.raises(ValidationError) as refused:
        replaced("circle-calm", path=path, origin=origin)
    first, second = refused.value.errors()
    assert first["loc"] == ("origin", "latitude_deg")
    assert second["msg"] == "needs the mission's origin, which is missing or invalid"
