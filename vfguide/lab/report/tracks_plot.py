"""Plots of the flight from above, and of the formation in the leader's course frame."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path as Outline
from matplotlib.transforms import Affine2D

from vfguide.elementwise import FloatArray
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.figures import in_window, seen_from_leader
from vfguide.lab.report.style import (
    NARROW_INCH,
    QUIET_COLOUR,
    SMALL_SIZE,
    STILL_AIR_M_S,
    TEXT_SIZE,
    WIND_COLOUR,
    dress,
    extent,
    halo,
    legend_above,
    new_figure,
    plain_text,
)
from vfguide.record.flight import FlightRecord, OutlineKind, VehicleRecord

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
"""Right half of an aircraft that points up, from the nose, (right, forward)."""


def aircraft_outline() -> Outline:
    """Return the outline of an aircraft that points up."""
    left = [(-right, forward) for right, forward in reversed(HALF_AIRCRAFT[1:-1])]
    return Outline([*HALF_AIRCRAFT, *left, HALF_AIRCRAFT[0]], closed=True)


def draw_aircraft(
    axes: Axes, east_m: float, north_m: float, course_rad: float, *, colour: str, size: float = 11.0
) -> None:
    """Draw an aircraft with its nose along the course; `size` is in points."""
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
    """Return the pairs of vehicles to join so that the formation's shape shows.

    The pairs form the relative neighbourhood graph (Toussaint, 1980): two vehicles are joined unless a third
    is nearer to both than they are to each other. The graph is connected; a diamond gets four sides and a V
    two arms.
    """

    def linked(first: Point, second: Point) -> bool:
        # The margin keeps a link where a third is just as far away, as in an equilateral triangle.
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
    """Draw thin lines between vehicles at (east, north), or (right, forward)."""
    for first, second in links:
        axes.plot(
            [places[first][0], places[second][0]],
            [places[first][1], places[second][1]],
            color=QUIET_COLOUR,
            linewidth=0.8,
            zorder=4,
        )


LOST_M = 10.0
"""A leader farther than this from its deputy's continuation of its track is out of the formation."""


def draw_leader_view(axes: Axes, record: FlightRecord) -> None:
    """Draw each follower's track to its slot in the leader's course frame, forward up."""
    colours = vehicle_colours(record)
    window = in_window(record)
    slots: list[Point] = [(0.0, 0.0)]
    drawn: list[tuple[FloatArray, FloatArray]] = []
    for follower in record.followers:
        # Vehicles ordered out of the formation fly far from it.
        forward, right = (
            np.where(follower.in_formation, way, np.nan)
            for way in seen_from_leader(record.reference, follower)
        )
        drawn.append((forward, right))
        colour = colours[follower.name]
        axes.plot(right, forward, color=colour, linewidth=1.0, alpha=0.6)
        axes.plot(right[window], forward[window], color=colour, linewidth=2.4)
        axes.plot(
            right[:1], forward[:1], "o", markerfacecolor="white", markeredgecolor=colour, zorder=4
        )
        slots.append((follower.slot_right_m, follower.slot_forward_m))
        axes.plot(
            [follower.slot_right_m],
            [follower.slot_forward_m],
            marker="x",
            markersize=11,
            markeredgewidth=1.2,
            color="#333333",
            linestyle="none",
            zorder=6,
        )
        axes.annotate(
            plain_text(follower.name),
            xy=(follower.slot_right_m, follower.slot_forward_m),
            xytext=(9.0, 7.0),
            textcoords="offset points",
            fontsize=TEXT_SIZE,
            color=colour,
            weight="bold",
            path_effects=halo(),
            zorder=7,
        )
    draw_links(axes, slots, formation_links(slots))
    draw_aircraft(axes, 0.0, 0.0, 0.0, colour=colours[record.leader.name], size=17.0)
    dress(
        axes,
        title="Seen from the leader (slots crossed, window thick)",
        across="right of the leader, m",
        up="ahead of the leader, m",
    )
    frame_leader_view(axes, drawn, slots)


def frame_leader_view(
    axes: Axes, drawn: list[tuple[FloatArray, FloatArray]], slots: list[Point]
) -> None:
    """Set square limits that hold every follower's track, the slots and the leader, with a margin."""
    left, right = extent([*(way[1] for way in drawn), np.array([slot[0] for slot in slots])])
    rear, front = extent([*(way[0] for way in drawn), np.array([slot[1] for slot in slots])])
    half = 0.58 * max(right - left, front - rear, 10.0)
    axes.set_xlim((left + right) / 2 - half, (left + right) / 2 + half)
    axes.set_ylim((rear + front) / 2 - half, (rear + front) / 2 + half)
    axes.set_aspect("equal")


SNAPSHOTS = 7
"""Largest number of formations drawn."""

LEAST_SHARE = 0.05
"""Smallest share of the view that a formation drawn to scale may span."""

DRAWN_SHARE = 0.09
"""Share of the view to which a smaller formation is enlarged."""


OUTLINE_SHARE = 0.3
"""Distance beyond the flight at which outlines are cut off, as a share of the flight's extent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutlineStyle:
    """Style of one kind of outline."""

    label: str
    colour: str
    dashes: str | tuple[int, tuple[int, int]]
    """Matplotlib line style."""
    marker: str | None = None
    """Mark of each point; None to join the points by a line."""


OUTLINES: dict[OutlineKind, OutlineStyle] = {
    "fence": OutlineStyle(label="fence", colour="#c1121f", dashes=(0, (5, 3))),
    "path": OutlineStyle(label="other paths", colour="#9a9a9a", dashes="-"),
    "rally": OutlineStyle(label="rally points", colour="#555555", dashes="none", marker="P"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlotView:
    """Square piece of ground to show: centre and side."""

    east_m: float
    north_m: float
    side_m: float


def tracks_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Draw the flight from above and, with followers, the formation in the leader's course frame."""
    if not record.followers:
        figure = new_figure(NARROW_INCH, 4.2) if narrow else new_figure(7.2, 7.2)
        above = figure.subplots(1, 1)
        draw_top_view(above, record)
    else:
        figure = new_figure(NARROW_INCH, 8.2) if narrow else new_figure(13.0, 6.9)
        above, relative = figure.subplots(2, 1) if narrow else figure.subplots(1, 2)
        draw_top_view(above, record)
        draw_leader_view(relative, record)
    legend_above(figure, [above], columns=len(record.vehicles) + 6)
    return figure


def draw_top_view(axes: Axes, record: FlightRecord) -> None:
    """Draw path, tracks, starts, wind, and formations at intervals, enlarged if too small to see."""
    view = choose_view(record)
    samples = choose_snapshots(record, 0.2 * view.side_m)
    magnification = choose_magnification(record, view)
    colours = vehicle_colours(record)
    draw_outlines(axes, record)
    axes.plot(
        record.path_east_m,
        record.path_north_m,
        color="#bdbdbd",
        linestyle=(0, (2, 1)),
        linewidth=2.8,
        label="path",
    )
    for vehicle in reversed(record.vehicles):
        colour = colours[vehicle.name]
        axes.plot(vehicle.east_m, vehicle.north_m, color=colour, linewidth=0.9, alpha=0.55)
        axes.plot(
            vehicle.east_m[:1],
            vehicle.north_m[:1],
            marker="o",
            markersize=6,
            markerfacecolor="white",
            markeredgecolor=colour,
            linestyle="none",
            zorder=4,
        )
    for vehicle in record.vehicles:
        axes.plot([], [], color=colours[vehicle.name], linewidth=2, label=plain_text(vehicle.name))
    axes.plot([], [], "o", markerfacecolor="white", markeredgecolor=QUIET_COLOUR, label="start")
    side = choose_side(record, samples, view)
    for sample in samples:
        draw_formation(axes, record, sample, magnification)
        draw_time(axes, record, sample, -side)
    reach = max(side * vehicle.slot_right_m for vehicle in record.vehicles)
    away = max(0.12 * view.side_m, magnification * reach + 0.08 * view.side_m)
    draw_wind(axes, record, samples, view, side * away)
    title = "From above"
    if magnification > 1.0:
        title += f" (formations drawn {magnification:.0f} times their size)"
    dress(axes, title=title, across="east, m", up="north, m")
    axes.set_xlim(view.east_m - view.side_m / 2, view.east_m + view.side_m / 2)
    axes.set_ylim(view.north_m - view.side_m / 2, view.north_m + view.side_m / 2)
    axes.set_aspect("equal")


def draw_outlines(axes: Axes, record: FlightRecord) -> None:
    """Draw other paths, fence edges and rally points, with one legend entry per kind."""
    named: set[str] = set()
    for outline in record.outlines:
        line = OUTLINES[outline.kind]
        axes.plot(
            outline.east_m,
            outline.north_m,
            color=line.colour,
            linestyle=line.dashes,
            linewidth=1.0,
            marker=line.marker,
            label=None if outline.kind in named else line.label,
        )
        named.add(outline.kind)


def choose_view(record: FlightRecord) -> PlotView:
    """Return a square that holds all tracks and the path, with a margin, and nearby outlines."""
    # A lost leader may be far away.
    shown = (record.reference, *record.followers)
    west, east = extent([record.path_east_m, *(v.east_m for v in shown)])
    south, north = extent([record.path_north_m, *(v.north_m for v in shown)])
    side = max(east - west, north - south, 50.0)
    # A fence around a whole county would leave no flight to see.
    far = OUTLINE_SHARE * side
    easts = [np.clip(one.east_m, west - far, east + far) for one in record.outlines]
    norths = [np.clip(one.north_m, south - far, north + far) for one in record.outlines]
    west, east = extent([np.array([west, east]), *easts])
    south, north = extent([np.array([south, north]), *norths])
    side = max(east - west, north - south, side)
    return PlotView(east_m=(west + east) / 2, north_m=(south + north) / 2, side_m=1.22 * side)


def choose_snapshots(record: FlightRecord, spacing_m: float) -> tuple[int, ...]:
    """Return samples at which to draw formations: from the end backwards, each leader clear of the others."""
    leader = record.reference
    step = max(1, record.time_s.size // 2000)
    chosen: list[int] = []
    for sample in range(record.time_s.size - 1, -1, -step):
        gaps = np.hypot(
            leader.north_m[chosen] - leader.north_m[sample],
            leader.east_m[chosen] - leader.east_m[sample],
        )
        if np.all(gaps >= spacing_m):
            chosen.append(sample)
        if len(chosen) == SNAPSHOTS:
            break
    return tuple(chosen)


def choose_magnification(record: FlightRecord, view: PlotView) -> float:
    """Return the magnification of formations: 1 if they are large enough to see."""
    places = [(0.0, 0.0), *((v.slot_forward_m, v.slot_right_m) for v in record.followers)]
    size = max(math.dist(first, second) for first in places for second in places)
    if size == 0.0 or size >= LEAST_SHARE * view.side_m:
        return 1.0
    return float(math.ceil(DRAWN_SHARE * view.side_m / size))


def draw_formation(axes: Axes, record: FlightRecord, sample: int, magnification: float) -> None:
    """Draw all vehicles at one sample, magnified about the leader."""
    leader = record.reference
    colours = vehicle_colours(record)
    origin = np.array([leader.east_m[sample], leader.north_m[sample]])
    places: list[Point] = []
    drawn = [one for one in record.vehicles if is_near(one, leader, sample)]
    for vehicle in drawn:
        place = np.array([vehicle.east_m[sample], vehicle.north_m[sample]])
        east, north = origin + magnification * (place - origin)
        places.append((float(east), float(north)))
    draw_links(axes, places, formation_links(places))
    for vehicle, (east, north) in zip(drawn, places, strict=True):
        draw_aircraft(
            axes, east, north, float(vehicle.course_rad[sample]), colour=colours[vehicle.name]
        )


def is_near(vehicle: VehicleRecord, reference: VehicleRecord, sample: int) -> bool:
    """Check whether a vehicle is drawn with its formation: all are but a lost leader that flew away."""
    away_m = math.hypot(
        vehicle.north_m[sample] - reference.north_m[sample],
        vehicle.east_m[sample] - reference.east_m[sample],
    )
    return vehicle.role == "follower" or away_m <= LOST_M


def draw_time(axes: Axes, record: FlightRecord, sample: int, side: float) -> None:
    """Write the time beside the leader: to its right for a side of 1, to its left for -1."""
    leader = record.reference
    course = float(leader.course_rad[sample])
    axes.annotate(
        f"{record.time_s[sample]:.0f} s",
        xy=(float(leader.east_m[sample]), float(leader.north_m[sample])),
        xytext=(side * 24.0 * math.cos(course), -side * 17.0 * math.sin(course)),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=SMALL_SIZE,
        color="#333333",
        path_effects=halo(),
        zorder=6,
    )


def draw_wind(
    axes: Axes, record: FlightRecord, samples: tuple[int, ...], view: PlotView, right_m: float
) -> None:
    """Draw an arrow of the wind's velocity beside each formation that has none nearby."""
    leader = record.reference
    strongest = extent([np.hypot(leader.wind_north_m_s, leader.wind_east_m_s)])[1]
    if strongest < STILL_AIR_M_S or not samples:
        return
    chosen: list[int] = []
    places: list[Point] = []
    for sample in samples:
        place = abreast(record, sample, right_m)
        if all(math.dist(place, other) > 0.1 * view.side_m for other in places):
            chosen.append(sample)
            places.append(place)
    arrows = axes.quiver(
        [place[0] for place in places],
        [place[1] for place in places],
        leader.wind_east_m_s[chosen],
        leader.wind_north_m_s[chosen],
        angles="xy",
        scale_units="width",
        scale=strongest / 0.085,
        width=0.0045,
        color=WIND_COLOUR,
        pivot="middle",
        clip_on=False,
        zorder=3,
    )
    # An arrow may cross the edge; the axes need not shrink for it.
    arrows.set_in_layout(False)
    unit = max(1.0, float(round(strongest)))
    axes.quiverkey(
        arrows,
        0.93,
        0.03,
        unit,
        f"wind {unit:.0f} m/s",
        labelpos="W",
        coordinates="axes",
        fontproperties={"size": TEXT_SIZE},
    )


def abreast(record: FlightRecord, sample: int, right_m: float) -> Point:
    """Return (east, north) of a place to the right of the leader."""
    leader = record.reference
    course = float(leader.course_rad[sample])
    return (
        float(leader.east_m[sample]) + right_m * math.cos(course),
        float(leader.north_m[sample]) - right_m * math.sin(course),
    )


def choose_side(record: FlightRecord, samples: tuple[int, ...], view: PlotView) -> float:
    """Return the side of the track with more room in the view: 1 for the right, -1 for the left.

    On a circle this is the inside; a straight track gets the side with fewer slots.
    """
    middle = (view.east_m, view.north_m)
    outward = {
        side: sum(
            math.dist(abreast(record, sample, side * 0.12 * view.side_m), middle)
            for sample in samples
        )
        for side in (1.0, -1.0)
    }
    if math.isclose(outward[1.0], outward[-1.0], rel_tol=0.02):
        return 1.0 if sum(vehicle.slot_right_m for vehicle in record.vehicles) <= 0.0 else -1.0
    return 1.0 if outward[1.0] < outward[-1.0] else -1.0
