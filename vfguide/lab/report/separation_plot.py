"""How near vehicles came to each other."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.geometry import PairSeparation, pair_separations
from vfguide.lab.report.style import (
    LIMIT_COLOUR,
    NARROW_INCH,
    SMALL_SIZE,
    TEXT_SIZE,
    dress,
    extent,
    halo,
    new_figure,
    plain_text,
    set_log_scale,
    show_whole_flight,
)
from vfguide.lab.report.wording import in_digits
from vfguide.record.flight import FlightRecord

MOST_PAIRS = 12
"""Pairs drawn at most: those that came nearest."""

WIDE_RANGE = 8.0
"""Ratio of distances above which a log scale reads better."""


def separation_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Distance of each pair over time, the least of all marked."""
    figure = new_figure(NARROW_INCH, 4.6) if narrow else new_figure(12.0, 5.2)
    axes = figure.subplots(1, 1)
    pairs = sorted(pair_separations(record), key=lambda pair: float(np.min(pair.distance_m)))
    shown = pairs[:MOST_PAIRS]
    for pair in shown:
        draw_pair(axes, record, pair)
    title = "Separation"
    if len(pairs) > len(shown):
        title += f" (the {len(shown)} nearest of {len(pairs)} pairs)"
    dress(axes, title=title, across="time, s", up="distance, m")
    scale_distances(axes, record, shown)
    show_whole_flight(axes, record)
    draw_required(axes, record.acceptance.min_separation_m)
    if shown:
        mark_least(axes, record, shown[0])
        figure.legend(
            loc="outside upper center" if narrow else "outside right upper",
            ncols=2 if narrow else 1,
            frameon=False,
            fontsize=TEXT_SIZE,
            handlelength=3.0,
        )
    return figure


def draw_pair(axes: Axes, record: FlightRecord, pair: PairSeparation) -> None:
    """A line in the colours of both vehicles; plain in a follower's own where the other is the leader."""
    colours = vehicle_colours(record)
    label = plain_text(f"{pair.first} to {pair.second}")
    if pair.first == record.leader.name:
        axes.plot(record.time_s, pair.distance_m, color=colours[pair.second], label=label)
        return
    axes.plot(
        record.time_s,
        pair.distance_m,
        color=colours[pair.first],
        gapcolor=colours[pair.second],
        linestyle=(0, (5, 5)),
        label=label,
    )


def scale_distances(axes: Axes, record: FlightRecord, pairs: list[PairSeparation]) -> None:
    """From zero if the distances are alike, logarithmic if they span a wide range."""
    low, high = extent([pair.distance_m for pair in pairs]) if pairs else (0.0, 0.0)
    required = record.acceptance.min_separation_m
    if low > 0.0 and high > WIDE_RANGE * low:
        low = min(low, required) if required > 0.0 else low
        set_log_scale(axes, low / 2.0, high * 1.3)
        axes.grid(visible=True, which="minor", color="#f0f0f0", linewidth=0.5)
    else:
        axes.set_ylim(0.0, max(1.08 * high, 1.3 * required, 1.0))


def draw_required(axes: Axes, least_m: float) -> None:
    """The line that no pair may come under."""
    if least_m <= 0.0:
        return
    axes.axhline(least_m, color=LIMIT_COLOUR, linewidth=1.1, linestyle=(0, (6, 3)))
    axes.annotate(
        f"required {least_m:g} m",
        xy=(1.0, least_m),
        xycoords=("axes fraction", "data"),
        xytext=(-4, 3),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=SMALL_SIZE,
        color=LIMIT_COLOUR,
    )


def mark_least(axes: Axes, record: FlightRecord, pair: PairSeparation) -> None:
    """A mark and words where the nearest pair was nearest."""
    sample = int(np.argmin(pair.distance_m))
    time_s, distance_m = float(record.time_s[sample]), float(pair.distance_m[sample])
    late = time_s > 0.7 * float(record.time_s[-1])
    axes.plot([time_s], [distance_m], "o", color="#333333", markersize=6, zorder=5)
    axes.annotate(
        plain_text(
            f"nearest: {in_digits(distance_m, 'm')} at {time_s:.1f} s ({pair.first} to {pair.second})"
        ),
        xy=(time_s, distance_m),
        xytext=(-8 if late else 8, -8),
        textcoords="offset points",
        ha="right" if late else "left",
        va="top",
        fontsize=SMALL_SIZE,
        path_effects=halo(),
        zorder=6,
    )
