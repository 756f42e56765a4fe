"""What the console draws on the ground, and which path it draws as the one that is flown."""

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.missions import replaced, shipped
from vfguide.formation.arrangement import Arrangement
from vfguide.lab.console.model import FormationModel, describe_ground
from vfguide.lab.rehearsal.recorder import rally_points
from vfguide.mission import Mission


@pytest.fixture(scope="module")
def mission() -> Mission:
    """A circle of 300 m, another of 250 m round a place 50 m north, and a fence of 900 m."""
    here, north = ({"north_m": north_m, "east_m": 0.0} for north_m in (0.0, 50.0))
    return replaced(
        "circle-wind",
        path={"type": "circle", "centre": here, "radius_m": 300.0},
        paths={"near": {"type": "circle", "centre": north, "radius_m": 250.0}},
        fence={"circles": [{"centre": here, "radius_m": 900.0}]},
    )


def order(path: str) -> Arrangement:
    return Arrangement(number=3, time_s=0.0, across_s=0.0, places=(), path=path)


def test_all_paths_and_the_fence_are_drawn_where_they_are(mission):
    ground = describe_ground(mission)
    for name, north_m, radius_m in (("main", 0.0, 300.0), ("near", 50.0, 250.0)):
        line = ground["paths"][name]
        away_m = np.hypot(np.array(line["north_m"]) - north_m, line["east_m"])
        assert away_m == pytest.approx(radius_m, abs=0.02)
    (fence,) = ground["outlines"]
    assert fence["kind"] == "fence"
    assert max(fence["north_m"]) == pytest.approx(900.0, abs=0.5)


def test_rally_points_of_a_plan_are_drawn():
    mission = shipped("survey-plan")
    kinds = [one["kind"] for one in describe_ground(mission)["outlines"]]
    north, _ = rally_points(mission)
    assert north.size == len(mission.path.rally_points) > 0
    assert kinds.count("rally") == 1
    assert "fence" in kinds


def test_what_was_flown_is_kept_with_the_time_from_which_on_it_was(mission):
    formation = FormationModel(mission)
    for tenths in range(30):
        if tenths >= 10:
            formation.take_order(3, order("near"), leads=formation.names[0])
        formation.sample(0.1 * tenths)
    kept = [(one["t"], one["number"], one["path"]) for one in formation.describe()["flown"]]
    assert kept == [(0.0, 0, "main"), (pytest.approx(0.9), 3, "near")]


def test_the_path_of_the_order_that_is_flown_is_drawn(mission):
    formation = FormationModel(mission)
    assert formation.flies()["path"] == "main"
    formation.take_order(3, order("near"), leads="leader")
    assert formation.flies()["path"] == "near"
    # What follows was not heard: the path stays until it is known.
    formation.take_order(4, None, leads="leader")
    assert formation.flies()["path"] == "near"
    formation.take_order(5, replace(order("main"), number=5), leads="leader")
    assert formation.flies()["path"] == "main"
