"""What disturbed the flight, and how fast the disturbance died out."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.angles import wrap_course
from vfguide.elementwise import FloatArray
from vfguide.record.flight import FlightRecord
from vfguide.report.style import (
    TEXT_SIZE,
    dress,
    extent,
    legend_above,
    new_figure,
    plain_text,
    shade_window,
    show_whole_flight,
    vehicle_colours,
)

STILL_AIR_M_S = 0.05
"""Wind below this has no direction worth drawing."""

LEAST_DRAWN = 1e-6
"""Lyapunov functions below this are drawn as this: a logarithm has no zero."""


def wind_figure(record: FlightRecord) -> Figure:
    """Wind speed and direction at each vehicle; with followers, their Lyapunov functions below."""
    figure = new_figure(12.0, 8.2 if record.followers else 5.5)
    panels = figure.subplots(3 if record.followers else 2, 1, sharex=True)
    draw_wind_speed(panels[0], record)
    draw_wind_direction(panels[1], record)
    if record.followers:
        draw_lyapunov(panels[2], record)
    show_whole_flight(panels[0], record)
    panels[-1].set_xlabel("time, s", fontsize=TEXT_SIZE)
    legend_above(figure, panels[0], columns=len(record.vehicles))
    return figure


def draw_wind_speed(axes: Axes, record: FlightRecord) -> None:
    """How fast the air moved where each vehicle was."""
    colours = vehicle_colours(record)
    for vehicle in reversed(record.vehicles):
        axes.plot(
            record.time_s,
            np.hypot(vehicle.wind_north_m_s, vehicle.wind_east_m_s),
            color=colours[vehicle.name],
            linewidth=1.3,
        )
    for vehicle in record.vehicles:
        axes.plot([], [], color=colours[vehicle.name], label=plain_text(vehicle.name))
    dress(axes, title="Wind speed", up="m/s")
    axes.set_ylim(0.0, max(1.1 * axes.get_ylim()[1], 1.0))


def draw_wind_direction(axes: Axes, record: FlightRecord) -> None:
    """Where the air moved to, as a compass tells it."""
    colours = vehicle_colours(record)
    for vehicle in reversed(record.vehicles):
        toward = direction_for_drawing(vehicle.wind_north_m_s, vehicle.wind_east_m_s)
        axes.plot(record.time_s, toward, color=colours[vehicle.name], linewidth=1.3)
    dress(axes, title="Wind direction, toward", up="degrees")
    axes.set_ylim(0.0, 360.0)
    axes.set_yticks([0, 90, 180, 270, 360], ["N 0", "E 90", "S 180", "W 270", "N 360"])


def direction_for_drawing(north_m_s: FloatArray, east_m_s: FloatArray) -> FloatArray:
    """Direction of a wind in degrees, 0 to 360; NaN in still air and where the line would cross the plot."""
    toward = np.degrees(wrap_course(np.arctan2(east_m_s, north_m_s)))
    toward[np.hypot(north_m_s, east_m_s) < STILL_AIR_M_S] = np.nan
    jumps = np.flatnonzero(np.abs(np.diff(toward)) > 180.0)
    toward[jumps] = np.nan
    return toward


def draw_lyapunov(axes: Axes, record: FlightRecord) -> None:
    """W of each follower: it falls while the law wins, and rests where it only holds."""
    colours = vehicle_colours(record)
    shade_window(axes, record)
    values = [np.maximum(follower.lyapunov, LEAST_DRAWN) for follower in record.followers]
    for follower, value in zip(record.followers, values, strict=True):
        axes.plot(record.time_s, value, color=colours[follower.name], linewidth=1.0)
    dress(axes, title="Lyapunov function W", up="m²")
    low, high = extent(values)
    if high > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(low / 2.0, high * 2.0)
