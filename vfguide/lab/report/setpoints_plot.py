"""What each autopilot was asked for, and what it did."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.elementwise import BoolArray, FloatArray, wrap_angle
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.style import (
    LIMIT_COLOUR,
    NARROW_INCH,
    TITLE_SIZE,
    dress,
    fitted,
    legend_above,
    mark_samples,
    new_figure,
    plain_text,
    show_whole_flight,
)
from vfguide.record.flight import FlightRecord, VehicleRecord

CLOSE_UP_S = 20.0
"""Length of the close-up at the end of the flight, s."""

SETPOINT_COLOUR = "#e6007e"


def setpoints_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """A row for each vehicle: course and speed, whole flight and the last seconds; of two lines if narrow."""
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
    """How far the course setpoint was from the true course, degrees, + to the right."""
    lead = np.degrees(wrap_angle(vehicle.course_setpoint_rad - vehicle.course_rad))
    axes.axhline(0.0, color="#b0b0b0", linewidth=0.8)
    axes.plot(record.time_s, lead, color=colour, linewidth=0.9)
    dress(axes)


def draw_courses(
    axes: Axes, record: FlightRecord, vehicle: VehicleRecord, colour: str, shown: BoolArray
) -> None:
    """Course and its setpoint, degrees, without jumps at north."""
    time_s = record.time_s[shown]
    course = np.unwrap(vehicle.course_rad[shown])
    # The setpoint is drawn on the same turn as the course that it belongs to.
    setpoint = course + wrap_angle(vehicle.course_setpoint_rad[shown] - course)
    axes.plot(time_s, np.degrees(course), color=colour, linewidth=1.8)
    axes.plot(time_s, np.degrees(setpoint), color=SETPOINT_COLOUR, linewidth=0.9)
    dress(axes)
    give_room(axes, np.degrees(np.concatenate([course, setpoint])), 4.0)


def draw_speeds(
    axes: Axes, record: FlightRecord, vehicle: VehicleRecord, colour: str, shown: BoolArray
) -> None:
    """Airspeed, ground speed, and whichever setpoints were sent."""
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
    """A vertical range that holds the values and is never so narrow that noise fills it."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return
    low, high = float(np.min(finite)), float(np.max(finite))
    half = max(0.55 * (high - low), least / 2.0)
    axes.set_ylim((low + high) / 2.0 - half, (low + high) / 2.0 + half)


def explain_lines(axes: Axes) -> None:
    """Entries for the legend, which stand for the same line of every vehicle."""
    axes.plot([], [], color="#333333", linewidth=1.8, label="course, airspeed (true)")
    axes.plot([], [], color=SETPOINT_COLOUR, linewidth=1.2, label="setpoint")
    axes.plot(
        [], [], color=SETPOINT_COLOUR, linewidth=1.2, linestyle=":", label="ground speed setpoint"
    )
    axes.plot([], [], color="#b8b8b8", linewidth=1.4, label="ground speed (true)")
    axes.plot([], [], color=LIMIT_COLOUR, linewidth=4, label="cut by a limit")
