"""The formation as the leader sees it: each follower's way to its slot."""

import numpy as np
from matplotlib.axes import Axes

from vfguide.elementwise import FloatArray
from vfguide.record.flight import FlightRecord
from vfguide.report.figures import in_window
from vfguide.report.formation_drawing import Point, draw_aircraft, draw_links, formation_links
from vfguide.report.geometry import seen_from_leader
from vfguide.report.style import TEXT_SIZE, dress, extent, halo, plain_text, vehicle_colours


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
