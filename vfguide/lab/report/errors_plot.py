"""Plots of formation errors, heights and height errors over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.elementwise import FloatArray
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.figures import errors_that_count, in_window, settling_time, slot_error
from vfguide.lab.report.style import (
    LIMIT_COLOUR,
    NARROW_INCH,
    QUIET_COLOUR,
    SMALL_SIZE,
    dress,
    extent,
    halo,
    legend_above,
    new_figure,
    plain_text,
    set_log_scale,
    shade_window,
    show_whole_flight,
)
from vfguide.record.flight import FlightRecord

LEAST_DRAWN_M = 1e-3
"""Lower limit of the errors drawn: a logarithm has no zero."""


def errors_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Draw distances from the slot on a log scale, and errors along and across for flight and window."""
    if narrow:
        figure = new_figure(NARROW_INCH, 10.5)
        grid = figure.add_gridspec(5, 1, height_ratios=[1.5, 1.0, 1.0, 1.0, 1.0])
        distance = figure.add_subplot(grid[0])
        places = ((grid[1], grid[2]), (grid[3], grid[4]))
    else:
        figure = new_figure(12.0, 9.5)
        grid = figure.add_gridspec(3, 2, height_ratios=[1.35, 1.0, 1.0], width_ratios=[1.25, 1.0])
        distance = figure.add_subplot(grid[0, :])
        places = ((grid[1, 0], grid[1, 1]), (grid[2, 0], grid[2, 1]))
    draw_distance(distance, record)
    errors = {f.name: slot_error(record.reference, f) for f in record.followers}
    along = {name: error.along_track_m for name, error in errors.items()}
    cross = {name: error.cross_track_m for name, error in errors.items()}
    components = (
        ("Along track", "+ slot ahead", along),
        ("Cross track", "+ slot to the right", cross),
    )
    for (name, sign, values), (left, right) in zip(components, places, strict=True):
        whole, zoomed = figure.add_subplot(left), figure.add_subplot(right)
        draw_component(whole, record, values)
        dress(whole, title=f"{name} ({sign})", across="time, s", up="error, m")
        show_whole_flight(whole, record)
        draw_component(zoomed, record, values)
        dress(zoomed, title=f"{name}, window only", across="time, s", up="error, m")
        zoom_to_window(zoomed, record, values)
    figure.align_ylabels()
    legend_above(figure, [distance], columns=len(record.followers) + 1)
    return figure


def draw_distance(axes: Axes, record: FlightRecord) -> None:
    """Draw each follower's formation error with the limits and settling times."""
    colours = vehicle_colours(record)
    errors = np.array([slot_error(record.reference, f).distance_m for f in record.followers])
    for follower, error in zip(record.followers, errors, strict=True):
        axes.plot(
            record.time_s,
            np.maximum(error, LEAST_DRAWN_M),
            color=colours[follower.name],
            linewidth=1.1,
            label=plain_text(follower.name),
        )
    limits = (("mean", record.acceptance.mean_error_m), ("greatest", record.acceptance.max_error_m))
    # The label of a limit out of sight would leave no room for the axes.
    shown = np.array([required for _, required in limits if required is not None])
    low, high = extent([np.maximum(np.append(errors, shown), LEAST_DRAWN_M)])
    set_log_scale(axes, max(low / 1.5, LEAST_DRAWN_M), max(high * 2.0, 20.0))
    show_whole_flight(axes, record)
    shade_window(axes, record)
    for limit in (10.0, 1.0):
        mark_settling(axes, record, errors, limit)
    # Two limits may be too close for two labels between them.
    both = all(required is not None for _, required in limits)
    for name, required in limits:
        if required is not None:
            below = both and name == "mean"
            axes.axhline(required, color=LIMIT_COLOUR, linewidth=1.1, linestyle=(0, (6, 3)))
            axes.annotate(
                f"required {name} {required:g} m",
                xy=(1.0, required),
                xycoords=("axes fraction", "data"),
                xytext=(-4, -3 if below else 3),
                textcoords="offset points",
                ha="right",
                va="top" if below else "bottom",
                fontsize=SMALL_SIZE,
                color=LIMIT_COLOUR,
                path_effects=halo(),
            )
    dress(
        axes,
        title="Distance from the slot (shaded: the window that counts)",
        across="time, s",
        up="formation error, m",
    )


def mark_settling(axes: Axes, record: FlightRecord, errors: FloatArray, limit_m: float) -> None:
    """Draw a line at a distance, and mark when the last follower came within it for good."""
    axes.axhline(limit_m, color=QUIET_COLOUR, linewidth=0.9, linestyle=":")
    settled = settling_time(record.time_s, errors_that_count(record, errors), limit_m)
    begin = float(record.time_s[0])
    text = f"not within {limit_m:g} m at the end"
    if settled is not None:
        text = f"all within {limit_m:g} m after {settled:.1f} s"
        axes.plot([settled], [limit_m], "o", color="#333333", markersize=5, zorder=5)
    axes.annotate(
        text,
        xy=(begin if settled is None else settled, limit_m),
        xytext=(7, 4),
        textcoords="offset points",
        fontsize=SMALL_SIZE,
        color="#333333",
        path_effects=halo(),
        zorder=6,
    )


def draw_component(axes: Axes, record: FlightRecord, values: dict[str, FloatArray]) -> None:
    """Draw one component of every follower's error."""
    colours = vehicle_colours(record)
    shade_window(axes, record)
    axes.axhline(0.0, color="#b0b0b0", linewidth=0.8)
    for name, value in values.items():
        axes.plot(record.time_s, value, color=colours[name], linewidth=1.0)


def zoom_to_window(axes: Axes, record: FlightRecord, values: dict[str, FloatArray]) -> None:
    """Show only the window, with zero in the middle of its own scale."""
    window = in_window(record)
    low, high = extent([value[window] for value in values.values()])
    reach = max(1.1 * max(abs(low), abs(high)), LEAST_DRAWN_M)
    axes.set_ylim(-reach, reach)
    if np.count_nonzero(window) > 1:
        axes.set_xlim(float(record.time_s[window][0]), float(record.time_s[window][-1]))


LEAST_SPAN_M = 0.1
"""Smallest error that the height scale adapts to; smaller ones are not drawn larger."""


def heights_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Draw altitudes above the mission's origin, and each follower's height error."""
    figure = new_figure(NARROW_INCH, 7.0) if narrow else new_figure(12.0, 6.5)
    profile, errors = figure.subplots(2, 1)
    ground = 0.0 if record.origin is None else record.origin.altitude_amsl_m
    colours = vehicle_colours(record)
    for vehicle in record.vehicles:
        height = vehicle.altitude_amsl_m - ground
        label = plain_text(vehicle.name)
        profile.plot(record.time_s, height, color=colours[vehicle.name], linewidth=1.2, label=label)
    above = "sea level" if record.origin is None else "the origin"
    dress(profile, title="Height profile", across="time, s", up=f"m above {above}")
    show_whole_flight(profile, record)
    found = {one.name: slot_error(record.reference, one).up_m for one in record.followers}
    for name, error in found.items():
        errors.plot(record.time_s, error, color=colours[name], linewidth=1.1)
    window = in_window(record)
    low, high = extent([error[window] for error in found.values()])
    size = 1.3 * max(abs(low), abs(high), LEAST_SPAN_M)
    errors.set_ylim(-size, size)
    title = "Height of the slot above its follower (scale: the shaded window)"
    dress(errors, title=title, across="time, s", up="error, m")
    show_whole_flight(errors, record)
    shade_window(errors, record)
    legend_above(figure, [profile], columns=len(record.vehicles))
    return figure
