"""A route is at its end once its leader has flown a quarter of the circle there, and no sooner."""

import math

import pytest

from tests.kit.missions import content_of
from vfguide.companion.ordered_flight import RouteEnd
from vfguide.guidance.path import PathPoint
from vfguide.mission.feasibility import hand_back_at_the_end
from vfguide.mission.model import Mission
from vfguide.paths.waypoints import Waypoints, WaypointsShape

RADIUS_M = 100.0


def route(end: str = "hand-back") -> Waypoints:
    """1000 m north, and round a circle of 100 m without easements."""
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 1000, "east_m": 0}]
    return Waypoints.of(
        WaypointsShape.model_validate(
            {"type": "waypoints", "waypoints": corners, "end": end, "radius_m": RADIUS_M}
            | {"easement_m": 0}
        )
    )


@pytest.fixture
def path() -> Waypoints:
    return route()


def passed(
    end: RouteEnd, path: Waypoints, run: float, *, off: float = 0.0, steered: bool = True
) -> bool:
    """Of a leader that is so far (m) round the circle."""
    assert path.last_circle is not None
    point = PathPoint(0.0, off, 0.01, path.last_circle + run)
    return end.passed(path, point, steered=steered)


def test_a_quarter_of_the_circle_is_157_m(path):
    end = RouteEnd()
    assert not any(passed(end, path, float(run)) for run in range(-500, 157))
    assert passed(end, path, 157.1)


def test_a_path_that_does_not_hand_back_has_no_end():
    assert route("loiter").last_circle is None
    point = PathPoint(0.0, 0.0, 0.01, 1500.0)
    assert not RouteEnd().passed(route("loiter"), point, steered=True)


def test_a_leg_that_touches_the_circle_is_no_end(path):
    end = RouteEnd()
    for _ in range(3):
        assert not any(passed(end, path, float(run)) for run in range(100))
        assert not passed(end, path, -300.0)


def test_a_leader_far_beside_the_circle_does_not_fly_it(path):
    end = RouteEnd()
    assert not any(passed(end, path, float(run), off=31.0) for run in range(300))


def test_a_leader_that_loiters_there_before_the_start_ends_nothing(path):
    end = RouteEnd()
    assert not any(passed(end, path, float(run), steered=False) for run in range(300))


def test_who_sees_the_leader_handed_back_first_goes_on_to_the_end(path):
    end = RouteEnd()
    assert not any(passed(end, path, float(run)) for run in range(150))
    assert passed(end, path, 158.0, steered=False)


def test_who_begins_midway_flies_a_quarter_from_there(path):
    end = RouteEnd()
    assert not passed(end, path, 550.0)
    # 550 m, 628 m round to 0, and a quarter from there.
    assert not passed(end, path, 627.0)
    assert not passed(end, path, 1.0)
    assert not passed(end, path, 157.0)
    assert passed(end, path, 159.0)


def test_a_place_that_is_not_known_is_not_on_the_circle(path):
    end = RouteEnd()
    assert not passed(end, path, math.nan)
    assert not passed(end, path, 10.0, off=math.nan)


def test_check_says_when_a_rehearsal_outlasts_its_route():
    content = content_of("line-calm")
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 1000, "east_m": 0}]
    content["path"] = {"type": "waypoints", "waypoints": corners, "end": "hand-back"}
    content["path"] |= {"radius_m": 200, "easement_m": 0}
    # To where the last leg touches the circle and a quarter round it, 20 m/s.
    given = Mission.model_validate(content)
    (finding,) = hand_back_at_the_end(given)
    assert finding.severity == "warning"
    assert "hands all vehicles back after about" in finding.message
    content["rehearsal"]["duration_s"] = 40
    assert not [*hand_back_at_the_end(Mission.model_validate(content))]
