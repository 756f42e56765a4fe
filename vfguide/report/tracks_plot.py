"""The flight from above, and the formation as the leader sees it."""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.elementwise import FloatArray
from vfguide.record.flight import FlightRecord
from vfguide.report.figures import in_window
from vfguide.report.formation_drawing import Point, draw_aircraft, draw_links, formation_links
from vfguide.report.geometry import seen_from_leader
from vfguide.report.style import (
    QUIET_COLOUR,
    SMALL_SIZE,
    TEXT_SIZE,
    WIND_COLOUR,
    dress,
    extent,
    halo,
    legend_above,
    new_figure,
    plain_text,
    vehicle_colours,
)

SNAPSHOTS = 7
"""How many formations are drawn at most."""

LEAST_SHARE = 0.09
"""Of the view that a formation is to span: smaller ones are drawn larger than they are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A square piece of ground."""

    east_m: float
    """Its middle."""
    north_m: float
    """Its middle."""
    side_m: float
    """Length of a side."""


def tracks_figure(record: FlightRecord) -> Figure:
    """Top view of the whole flight; with followers, beside it the formation in the leader's course frame."""
    if not record.followers:
        figure = new_figure(7.2, 7.2)
        above = figure.subplots(1, 1)
        draw_top_view(above, record)
    else:
        figure = new_figure(13.0, 7.2)
        above, relative = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
        draw_top_view(above, record)
        draw_leader_view(relative, record)
    legend_above(figure, above, columns=len(record.vehicles) + 4)
    return figure


def draw_top_view(axes: Axes, record: FlightRecord) -> None:
    """Path, tracks, formations at intervals, starts, and the wind; true to scale but for what it says."""
    view = choose_view(record)
    samples = choose_snapshots(record, 0.2 * view.side_m)
    magnification = choose_magnification(record, view)
    colours = vehicle_colours(record)
    axes.plot(
        record.path_east_m,
        record.path_north_m,
        color=QUIET_COLOUR,
        linestyle=(0, (5, 4)),
        linewidth=1.2,
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
    for sample in samples:
        draw_formation(axes, record, sample, magnification)
    draw_wind(axes, record, samples, view)
    title = "From above"
    if magnification > 1.0:
        title += f" (formations drawn {magnification:.0f} times their size)"
    dress(axes, title=title, across="east, m", up="north, m")
    axes.set_xlim(view.east_m - view.side_m / 2, view.east_m + view.side_m / 2)
    axes.set_ylim(view.north_m - view.side_m / 2, view.north_m + view.side_m / 2)
    axes.set_aspect("equal")


def choose_view(record: FlightRecord) -> View:
    """The square that holds all tracks and the path, with a margin."""
    west, east = extent([record.path_east_m, *(v.east_m for v in record.vehicles)])
    south, north = extent([record.path_north_m, *(v.north_m for v in record.vehicles)])
    side = max(east - west, north - south, 50.0)
    return View(east_m=(west + east) / 2, north_m=(south + north) / 2, side_m=1.16 * side)


def choose_snapshots(record: FlightRecord, spacing_m: float) -> tuple[int, ...]:
    """Samples at which to draw the formation: back from the end, each leader clear of those drawn before."""
    leader = record.leader
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


def choose_magnification(record: FlightRecord, view: View) -> float:
    """How many times its size a formation is drawn: 1 if it can be seen as it is."""
    places = [(0.0, 0.0), *((v.slot_forward_m, v.slot_right_m) for v in record.followers)]
    size = max(math.dist(first, second) for first in places for second in places)
    if size == 0.0:
        return 1.0
    wanted = LEAST_SHARE * view.side_m / size
    return float(math.ceil(wanted)) if wanted > 1.0 else 1.0


def draw_formation(axes: Axes, record: FlightRecord, sample: int, magnification: float) -> None:
    """All vehicles at one sample, spread about the leader by the magnification, with the time beside them."""
    leader = record.leader
    colours = vehicle_colours(record)
    origin = np.array([leader.east_m[sample], leader.north_m[sample]])
    places: list[Point] = []
    for vehicle in record.vehicles:
        place = np.array([vehicle.east_m[sample], vehicle.north_m[sample]])
        east, north = origin + magnification * (place - origin)
        places.append((float(east), float(north)))
    draw_links(axes, places, formation_links(places))
    for vehicle, (east, north) in zip(record.vehicles, places, strict=True):
        draw_aircraft(
            axes, east, north, float(vehicle.course_rad[sample]), colour=colours[vehicle.name]
        )
    course = float(leader.course_rad[sample])
    axes.annotate(
        f"{record.time_s[sample]:.0f} s",
        xy=places[0],
        xytext=(16.0 * math.sin(course), 14.0 * math.cos(course)),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=SMALL_SIZE,
        color="#333333",
        path_effects=halo(),
        zorder=6,
    )


def draw_wind(axes: Axes, record: FlightRecord, samples: tuple[int, ...], view: View) -> None:
    """At each formation an arrow beside the path: where the air moves to, and how fast."""
    leader = record.leader
    chosen = list(samples)
    speeds = np.hypot(leader.wind_north_m_s, leader.wind_east_m_s)
    strongest = float(np.max(speeds, initial=0.0))
    if strongest < 0.1:
        return
    places = [clear_side(record, sample, 0.14 * view.side_m) for sample in chosen]
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
        zorder=3,
    )
    unit = max(1.0, float(round(strongest)))
    axes.quiverkey(
        arrows,
        0.86,
        0.03,
        unit,
        f"wind {unit:.0f} m/s",
        labelpos="E",
        coordinates="axes",
        fontproperties={"size": TEXT_SIZE},
    )


def clear_side(record: FlightRecord, sample: int, away_m: float) -> Point:
    """(east, north) of a place abreast of the leader, on the side that is farther from the path."""
    leader = record.leader
    course = float(leader.course_rad[sample])
    sides = [
        (
            float(leader.east_m[sample]) + side * away_m * math.cos(course),
            float(leader.north_m[sample]) - side * away_m * math.sin(course),
        )
        for side in (1.0, -1.0)
    ]
    return max(sides, key=lambda side: round(distance_from_path(record, side), 1))


def distance_from_path(record: FlightRecord, place: Point) -> float:
    """Distance of (east, north) from the nearest drawn point of the path, m."""
    if record.path_east_m.size == 0:
        return 0.0
    return float(np.min(np.hypot(record.path_east_m - place[0], record.path_north_m - place[1])))


def draw_leader_view(axes: Axes, record: FlightRecord) -> None:
    """Each follower's way to its slot in the leader's course frame: forward is up."""
    colours = vehicle_colours(record)
    window = in_window(record)
    slots: list[Point] = [(0.0, 0.0)]
    drawn: list[tuple[FloatArray, FloatArray]] = []
    for follower in record.followers:
        forward, right = seen_from_leader(record.leader, follower)
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
    """A square that holds every follower's way and the leader, with a margin."""
    left, right = extent([*(way[1] for way in drawn), np.array([slot[0] for slot in slots])])
    rear, front = extent([*(way[0] for way in drawn), np.array([slot[1] for slot in slots])])
    half = 0.58 * max(right - left, front - rear, 10.0)
    axes.set_xlim((left + right) / 2 - half, (left + right) / 2 + half)
    axes.set_ylim((rear + front) / 2 - half, (rear + front) / 2 + half)
    axes.set_aspect("equal")
