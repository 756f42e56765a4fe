"""Every slot is held against the fence along the whole path, and rooms are those worked out by hand."""

import math
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
import yaml

from tests.kit.missions import replaced, shipped
from vfguide.formation.arrangement import Point
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
from vfguide.mission.conditions import conditions_of
from vfguide.mission.fence_check import beyond_the_fence
from vfguide.mission.finding import Finding
from vfguide.mission.load import load_mission
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import LeaderPlace, formation_of_mission, resolve
from vfguide.mission.path_frame import least_radius
from vfguide.mission.place import Fence, FenceCircle, FencePolygon

SQUARE = [
    {"north_m": north, "east_m": east}
    for north, east in ((-100, -100), (100, -100), (100, 100), (-100, 100))
]


def room(fence: dict[str, Any], north: float, east: float) -> float:
    found = Fence.model_validate(fence).room(np.array([north]), np.array([east]), None)
    return float(found[0])


def findings_of(mission: Mission) -> list[Finding]:
    return [*beyond_the_fence(mission, conditions_of(mission.path, mission.wind))]


def test_the_room_in_a_polygon_is_that_to_its_nearest_edge():
    square = {"polygons": [{"points": SQUARE}]}
    assert room(square, 0.0, 70.0) == pytest.approx(30.0)
    assert room(square, 0.0, 130.0) == pytest.approx(-30.0)
    assert room(square, 130.0, 140.0) == pytest.approx(-50.0)
    keep_out = {"polygons": [{"points": SQUARE, "inclusion": False}]}
    assert room(keep_out, 0.0, 70.0) == pytest.approx(-30.0)
    assert room(keep_out, 130.0, 140.0) == pytest.approx(50.0)


def test_the_notch_of_a_polygon_is_outside():
    notched = [*SQUARE[:2], {"north_m": 0, "east_m": 0}, *SQUARE[2:]]
    fence = {"polygons": [{"points": notched}]}
    assert room(fence, 60.0, 0.0) == pytest.approx(-60.0 / math.sqrt(2.0))
    assert room(fence, -50.0, 0.0) == pytest.approx(50.0)


def test_of_all_areas_the_one_with_the_least_room_counts():
    circles = [
        {"centre": {"north_m": 0, "east_m": 0}, "radius_m": 500},
        {"centre": {"north_m": 0, "east_m": 100}, "radius_m": 20, "inclusion": False},
    ]
    assert room({"circles": circles}, 0.0, 50.0) == pytest.approx(30.0)
    assert room({"circles": circles}, 0.0, -460.0) == pytest.approx(40.0)


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
    told = findings_of(mission)
    assert len(told) == len(found)
    for one, words in zip(told, found, strict=True):
        assert f"{one.severity}: {one.field}: {one.message}".find(words) >= 0


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
    content = shipped("circle-calm").model_dump(mode="json", exclude_unset=True)
    origin = content["origin"]
    centre = {name: origin[name] for name in ("latitude_deg", "longitude_deg")}
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
    mission = replaced("circle-calm", fence=fence)
    formation = formation_of_mission(mission)
    refusal = pytest.raises(RefusedOrderError, match=sentence) if sentence else nullcontext()
    with refusal:
        resolve(mission, order, formation, number=1, time_s=5.0, leader=leader)


def test_the_edge_of_an_area_is_closed():
    corners = [{"north_m": north, "east_m": east} for north, east in ((0, 0), (90, 0), (90, 80))]
    north, east = FencePolygon.model_validate({"points": corners}).edge(None)
    assert (north.tolist(), east.tolist()) == ([0.0, 90.0, 90.0, 0.0], [0.0, 0.0, 80.0, 0.0])
    around = {"centre": {"north_m": 10, "east_m": 20}, "radius_m": 5}
    north, east = FenceCircle.model_validate(around).edge(None)
    assert (north[0], east[0]) == pytest.approx((north[-1], east[-1]))
    assert np.hypot(north - 10.0, east - 20.0) == pytest.approx(5.0)
