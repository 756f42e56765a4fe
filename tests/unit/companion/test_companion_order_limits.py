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


Flown = tuple[float, float, bool]
"""Of a leader: how far round the circle and off it, m, and whether it is steered."""


def along(first: int, last: int, *, off: float = 0.0, steered: bool = True) -> list[Flown]:
    return [(float(run), off, steered) for run in range(first, last)]


@pytest.mark.parametrize(
    ("before", "end"),
    [
        # A quarter of the circle is 157 m.
        (along(-500, 157), (157.1, 0.0, True)),
        # Who begins midway: 550 m, 628 m round to 0, and a quarter from there.
        ([(run, 0.0, True) for run in (550.0, 627.0, 1.0, 157.0)], (159.0, 0.0, True)),
        # Who sees the leader handed back first goes on to the end.
        (along(0, 150), (158.0, 0.0, False)),
        # A leg that touches the circle is no end, nor a leader far beside it, or one that loiters there
        # before the start, nor a place that is not known.
        ([*along(0, 100), *along(-300, -299)] * 3, None),
        (along(0, 300, off=31.0), None),
        (along(0, 300, steered=False), None),
        ([(math.nan, 0.0, True), (10.0, math.nan, True)], None),
    ],
)
def test_a_route_ends_after_a_quarter_of_the_circle(before, end):
    path, ends = route(), RouteEnd()

    def passed(run: float, off: float, steered: bool) -> bool:
        point = PathPoint(0.0, off, 0.01, path.last_circle + run)
        return ends.passed(path, point, steered=steered)

    assert not any(passed(*one) for one in before)
    assert end is None or passed(*end)


def test_a_path_that_does_not_hand_back_has_no_end():
    assert route("loiter").last_circle is None
    point = PathPoint(0.0, 0.0, 0.01, 1500.0)
    assert not RouteEnd().passed(route("loiter"), point, steered=True)


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
