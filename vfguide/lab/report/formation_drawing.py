"""Formations drawn from above: aircraft glyphs, and thin lines that show the shape."""

import math
from collections.abc import Sequence
from itertools import combinations

from matplotlib.axes import Axes
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path as Outline
from matplotlib.transforms import Affine2D

from vfguide.lab.report.style import QUIET_COLOUR

Point = tuple[float, float]

HALF_AIRCRAFT: tuple[Point, ...] = (
    (0.0, 1.0),
    (0.12, 0.72),
    (0.12, 0.30),
    (1.0, -0.02),
    (1.0, -0.22),
    (0.12, -0.10),
    (0.09, -0.62),
    (0.42, -0.82),
    (0.42, -0.98),
    (0.0, -0.90),
)
"""Right half of an aircraft that points up, nose first, (right, forward)."""


def aircraft_outline() -> Outline:
    """The whole aircraft, pointing up."""
    left = [(-right, forward) for right, forward in reversed(HALF_AIRCRAFT[1:-1])]
    return Outline([*HALF_AIRCRAFT, *left, HALF_AIRCRAFT[0]], closed=True)


def draw_aircraft(
    axes: Axes, east_m: float, north_m: float, course_rad: float, *, colour: str, size: float = 11.0
) -> None:
    """One aircraft glyph of a size in points, its nose along the course."""
    turned = Affine2D().rotate(-course_rad)
    axes.plot(
        [east_m],
        [north_m],
        marker=MarkerStyle(aircraft_outline(), transform=turned),
        markersize=size,
        markerfacecolor=colour,
        markeredgecolor="white",
        markeredgewidth=0.6,
        linestyle="none",
        zorder=5,
    )


def formation_links(places: Sequence[Point]) -> tuple[tuple[int, int], ...]:
    """Which vehicles to join so that the shape shows.

    The relative neighbourhood graph (Toussaint, 1980): two are joined unless a third is nearer to both than
    they are to each other. It joins them all, draws a diamond as four sides and a V as two arms.
    """

    def linked(first: Point, second: Point) -> bool:
        # A third at just the same distance, as in an equilateral triangle, does not part them.
        reach = math.dist(first, second) * (1.0 - 1e-6)
        return not any(
            max(math.dist(first, third), math.dist(second, third)) < reach
            for third in places
            if third not in (first, second)
        )

    return tuple(
        (i, j) for i, j in combinations(range(len(places)), 2) if linked(places[i], places[j])
    )


def draw_links(axes: Axes, places: Sequence[Point], links: Sequence[tuple[int, int]]) -> None:
    """Thin lines between vehicles at (east, north), or (right, forward)."""
    for first, second in links:
        axes.plot(
            [places[first][0], places[second][0]],
            [places[first][1], places[second][1]],
            color=QUIET_COLOUR,
            linewidth=0.8,
            zorder=4,
        )
