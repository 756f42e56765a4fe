"""All plots of a flight, as PNG files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.elementwise import BoolArray, FloatArray, wrap_angle, wrap_course
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.errors_plot import errors_figure, heights_figure
from vfguide.lab.report.figures import PairSeparation, pair_separations
from vfguide.lab.report.style import (
    LIMIT_COLOUR,
    NARROW_DOTS_PER_INCH,
    NARROW_INCH,
    SMALL_SIZE,
    STILL_AIR_M_S,
    TEXT_SIZE,
    TITLE_SIZE,
    WIND_COLOUR,
    dress,
    extent,
    fitted,
    halo,
    legend_above,
    mark_samples,
    new_figure,
    picture_of,
    plain_text,
    save_figure,
    set_log_scale,
    shade_window,
    show_whole_flight,
)
from vfguide.lab.report.tracks_plot import tracks_figure
from vfguide.lab.report.wording import in_digits
from vfguide.record.archive import writing_to
from vfguide.record.flight import FlightRecord, VehicleRecord

CLOSE_UP_S = 20.0
"""Length of the close-up at the end of the flight."""

SETPOINT_COLOUR = "#e6007e"


def setpoints_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Draw course and speed of each vehicle, for the whole flight and for its last seconds."""
    rows = len(record.vehicles)
    if narrow:
        figure = new_figure(NARROW_INCH, 1.2 + 2.7 * rows)
        panels = figure.subplots(2 * rows, 2, squeeze=False)
        grid = panels.reshape(rows, 4)
    else:
        figure = new_figure(15.0, 1.0 + (2.3 if rows <= 5 else 1.7) * rows)
        grid = figure.subplots(rows, 4, squeeze=False, sharex="col")
    colours = vehicle_colours(record)
    end = record.time_s >= record.time_s[-1] - CLOSE_UP_S
    whole = np.ones_like(end)
    for vehicle, (course, speed, late_course, late_speed) in zip(
        record.vehicles, grid, strict=True
    ):
        colour = colours[vehicle.name]
        draw_course_lead(course, record, vehicle, colour)
        draw_speeds(speed, record, vehicle, colour, whole)
        draw_courses(late_course, record, vehicle, colour, end)
        draw_speeds(late_speed, record, vehicle, colour, end)
        for axes in (course, speed):
            show_whole_flight(axes, record)
            mark_samples(axes, record.time_s, vehicle.limited, LIMIT_COLOUR)
        course.set_ylabel(
            plain_text(vehicle.name), fontsize=TITLE_SIZE, weight="bold", color=colour
        )
    seconds = f"last {CLOSE_UP_S:g} s"
    titles = (
        "Course setpoint less course, degrees",
        "Speed, m/s",
        f"Course, degrees, {seconds}",
        f"Speed, m/s, {seconds}",
    )
    for axes, title in zip(grid[0], titles, strict=True):
        axes.set_title(fitted(axes, title), fontsize=TITLE_SIZE, loc="left")
    for axes in grid[-1]:
        axes.set_xlabel("time, s", fontsize=TITLE_SIZE - 1)
    figure.align_ylabels()
    explain_lines(grid[0][1])
    legend_above(figure, [grid[0][1]], columns=6)
    return figure


def draw_course_lead(axes: Axes, record: FlightRecord, vehicle: VehicleRecord, colour: str) -> None:
    """Draw the course setpoint less the true course, degrees, positive to the right."""
    lead = np.degrees(wrap_angle(vehicle.course_setpoint_rad - vehicle.course_rad))
    axes.axhline(0.0, color="#b0b0b0", linewidth=0.8)
    axes.plot(record.time_s, lead, color=colour, linewidth=0.9)
    dress(axes)


def draw_courses(
    axes: Axes, record: FlightRecord, vehicle: VehicleRecord, colour: str, shown: BoolArray
) -> None:
    """Draw course and course setpoint, degrees, without jumps at north."""
    time_s = record.time_s[shown]
    course = np.unwrap(vehicle.course_rad[shown])
    # The setpoint is drawn on the same turn as its course.
    setpoint = course + wrap_angle(vehicle.course_setpoint_rad[shown] - course)
    axes.plot(time_s, np.degrees(course), color=colour, linewidth=1.8)
    axes.plot(time_s, np.degrees(setpoint), color=SETPOINT_COLOUR, linewidth=0.9)
    dress(axes)
    give_room(axes, np.degrees(np.concatenate([course, setpoint])), 4.0)


def draw_speeds(
    axes: Axes, record: FlightRecord, vehicle: VehicleRecord, colour: str, shown: BoolArray
) -> None:
    """Draw airspeed, ground speed and the setpoints that were sent."""
    time_s = record.time_s[shown]
    lines = (
        (vehicle.ground_speed_m_s, "#b8b8b8", 1.2, "-"),
        (vehicle.airspeed_m_s, colour, 1.8, "-"),
        (vehicle.airspeed_setpoint_m_s, SETPOINT_COLOUR, 0.9, "-"),
        (vehicle.ground_speed_setpoint_m_s, SETPOINT_COLOUR, 0.9, ":"),
    )
    for values, line_colour, width, style in lines:
        axes.plot(time_s, values[shown], color=line_colour, linewidth=width, linestyle=style)
    dress(axes)
    give_room(axes, np.concatenate([values[shown] for values, *_ in lines]), 2.0)


def give_room(axes: Axes, values: FloatArray, least: float) -> None:
    """Set a vertical range that holds the values and spans at least `least`, so that noise stays small."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return
    low, high = float(np.min(finite)), float(np.max(finite))
    half = max(0.55 * (high - low), least / 2.0)
    axes.set_ylim((low + high) / 2.0 - half, (low + high) / 2.0 + half)


def explain_lines(axes: Axes) -> None:
    """Add legend entries for lines that all vehicles share."""
    axes.plot([], [], color="#333333", linewidth=1.8, label="course, airspeed (true)")
    axes.plot([], [], color=SETPOINT_COLOUR, linewidth=1.2, label="setpoint")
    axes.plot(
        [], [], color=SETPOINT_COLOUR, linewidth=1.2, linestyle=":", label="ground speed setpoint"
    )
    axes.plot([], [], color="#b8b8b8", linewidth=1.4, label="ground speed (true)")
    axes.plot([], [], color=LIMIT_COLOUR, linewidth=4, label="cut by a limit")


MOST_PAIRS = 12
"""Largest number of pairs drawn; the nearest ones are."""

WIDE_RANGE = 8.0
"""Ratio of distances above which a log scale is easier to read."""


def separation_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Draw the distance of each pair over time, with the smallest marked."""
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
    """Draw a pair in both vehicles' colours; a follower and the leader in the follower's alone."""
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
    """Scale distances from zero if they are alike, or logarithmically if they span a wide range."""
    low, high = extent([pair.distance_m for pair in pairs]) if pairs else (0.0, 0.0)
    required = record.acceptance.min_separation_m
    if low > 0.0 and high > WIDE_RANGE * low:
        low = min(low, required) if required > 0.0 else low
        set_log_scale(axes, low / 2.0, high * 1.3)
        axes.grid(visible=True, which="minor", color="#f0f0f0", linewidth=0.5)
    else:
        axes.set_ylim(0.0, max(1.08 * high, 1.3 * required, 1.0))


def draw_required(axes: Axes, least_m: float) -> None:
    """Draw the required separation."""
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
    """Mark and label the closest approach of the nearest pair."""
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


LEAST_DRAWN = 1e-6
"""Lower limit of the Lyapunov functions drawn: a logarithm has no zero."""


def wind_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Draw wind speed and direction and, with followers, their Lyapunov functions."""
    tall = 8.2 if record.followers else 5.5
    figure = new_figure(NARROW_INCH, 0.85 * tall) if narrow else new_figure(12.0, tall)
    panels = figure.subplots(3 if record.followers else 2, 1, sharex=True)
    winds = winds_to_draw(record)
    for wind in winds:
        panels[0].plot(
            record.time_s,
            np.hypot(wind.north_m_s, wind.east_m_s),
            color=wind.colour,
            linewidth=1.3,
            label=wind.label,
        )
        toward = direction_for_drawing(wind.north_m_s, wind.east_m_s)
        panels[1].plot(record.time_s, toward, color=wind.colour, linewidth=1.3)
    dress(panels[0], title="Wind speed", up="m/s")
    panels[0].set_ylim(0.0, max(1.1 * panels[0].get_ylim()[1], 1.0))
    dress(panels[1], title="Wind direction, toward", up="degrees")
    panels[1].set_ylim(0.0, 360.0)
    panels[1].set_yticks([0, 90, 180, 270, 360], ["N 0", "E 90", "S 180", "W 270", "N 360"])
    if record.followers:
        draw_lyapunov(panels[2], record)
    show_whole_flight(panels[0], record)
    panels[-1].set_xlabel("time, s", fontsize=TEXT_SIZE)
    figure.align_ylabels()
    legend_above(figure, panels, columns=len(record.vehicles) + 1)
    return figure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrawnWind:
    """One line of the wind panels, with the air's velocity."""

    label: str
    colour: str
    north_m_s: FloatArray
    east_m_s: FloatArray


def winds_to_draw(record: FlightRecord) -> tuple[DrawnWind, ...]:
    """Return the wind at each vehicle, or a single wind if all vehicles had the same."""
    leader = record.leader
    alike = all(
        np.allclose(vehicle.wind_north_m_s, leader.wind_north_m_s, atol=0.01)
        and np.allclose(vehicle.wind_east_m_s, leader.wind_east_m_s, atol=0.01)
        for vehicle in record.followers
    )
    colours = vehicle_colours(record)
    return tuple(
        DrawnWind(
            label="wind at all vehicles" if alike else f"wind at {plain_text(vehicle.name)}",
            colour=WIND_COLOUR if alike else colours[vehicle.name],
            north_m_s=vehicle.wind_north_m_s,
            east_m_s=vehicle.wind_east_m_s,
        )
        for vehicle in ((leader,) if alike else record.vehicles)
    )


def direction_for_drawing(north_m_s: FloatArray, east_m_s: FloatArray) -> FloatArray:
    """Return a wind's direction, 0 to 360 degrees; NaN in still air and where the line would wrap."""
    toward = np.degrees(wrap_course(np.arctan2(east_m_s, north_m_s)))
    toward[np.hypot(north_m_s, east_m_s) < STILL_AIR_M_S] = np.nan
    jumps = np.flatnonzero(np.abs(np.diff(toward)) > 180.0)
    toward[jumps] = np.nan
    return toward


def draw_lyapunov(axes: Axes, record: FlightRecord) -> None:
    """Draw each follower's W: it falls while the law reduces the error, and rests while it only holds it."""
    colours = vehicle_colours(record)
    shade_window(axes, record)
    values = [np.maximum(follower.lyapunov, LEAST_DRAWN) for follower in record.followers]
    for follower, value in zip(record.followers, values, strict=True):
        axes.plot(
            record.time_s,
            value,
            color=colours[follower.name],
            linewidth=1.0,
            label=f"W of {plain_text(follower.name)}",
        )
    dress(axes, title="Lyapunov function W (shaded: the window that counts)", up="m²")
    low, high = extent(values)
    if high > 0.0:
        set_log_scale(axes, low / 2.0, high * 2.0)


class Draw(Protocol):
    """Function that draws a plot."""

    def __call__(self, record: FlightRecord, *, narrow: bool = False) -> Figure:
        """Draw the figure for a wide or a narrow screen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """One plot of a report."""

    name: str
    """Name of the file, without its extension."""
    title: str
    caption: str
    """One sentence on what to look for."""
    draw: Draw
    needs_followers: bool
    """Whether the plot is empty for a lone leader."""


PLOTS = (
    Plot(
        name="tracks",
        title="Tracks",
        caption="The formation should keep one shape all along the dashed path, and seen from the "
        "leader each line should end in its cross and stay there.",
        draw=tracks_figure,
        needs_followers=False,
    ),
    Plot(
        name="errors",
        title="Formation errors",
        caption="The distance from the slot should fall below the dotted lines early and stay below the "
        "red one in the shaded window; below it, an error that keeps one sign is a bias, one that "
        "swings is a disturbance.",
        draw=errors_figure,
        needs_followers=True,
    ),
    Plot(
        name="setpoints",
        title="Setpoints",
        caption="The setpoint should be a smooth line just ahead of what the vehicle does: a band instead "
        "of a line is chatter, and red strips show where a limit of the vehicle cut it.",
        draw=setpoints_figure,
        needs_followers=False,
    ),
    Plot(
        name="heights",
        title="Heights",
        caption="In a climb all lines should bend at one time; below, an error that keeps one sign while "
        "they climb is a height delay that the mission tells wrong.",
        draw=heights_figure,
        needs_followers=True,
    ),
    Plot(
        name="separation",
        title="Separation",
        caption="No pair may come under the red line; look first at the time when the vehicles join.",
        draw=separation_figure,
        needs_followers=True,
    ),
    Plot(
        name="wind",
        title="Wind and Lyapunov function",
        caption="W should fall steeply while the vehicles join; where it rises again later, look for a "
        "change of wind or a cut setpoint at that time.",
        draw=wind_figure,
        needs_followers=False,
    ),
)


def plots_for(record: FlightRecord) -> tuple[Plot, ...]:
    """Return the plots with something to show; none for a flight that ended at once."""
    if record.time_s.size < 2 or record.time_s[-1] <= record.time_s[0]:
        return ()
    return tuple(plot for plot in PLOTS if record.followers or not plot.needs_followers)


def draw_narrow(plot: Plot, record: FlightRecord) -> bytes:
    """Return a plot for a narrow screen, as PNG."""
    return picture_of(plot.draw(record, narrow=True), NARROW_DOTS_PER_INCH)


def write_plots(record: FlightRecord, directory: Path) -> tuple[Path, ...]:
    """Draw all plots of a flight into a directory, which is created if absent.

    Raises:
        InputError: the directory cannot be written to.
    """
    with writing_to(directory):
        directory.mkdir(parents=True, exist_ok=True)
        return tuple(
            save_figure(plot.draw(record), directory / f"{plot.name}.png")
            for plot in plots_for(record)
        )
