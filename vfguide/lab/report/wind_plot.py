"""What disturbed the flight, and how fast the disturbance died out."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.elementwise import FloatArray, wrap_course
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.style import (
    NARROW_INCH,
    STILL_AIR_M_S,
    TEXT_SIZE,
    WIND_COLOUR,
    dress,
    extent,
    legend_above,
    new_figure,
    plain_text,
    set_log_scale,
    shade_window,
    show_whole_flight,
)
from vfguide.record.flight import FlightRecord

LEAST_DRAWN = 1e-6
"""Lyapunov functions below this are drawn as this: a logarithm has no zero."""


def wind_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Wind speed and direction; with followers, their Lyapunov functions below."""
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
    """One line of the wind panels."""

    label: str
    """For the legend."""
    colour: str
    """Colour of the line."""
    north_m_s: FloatArray
    """Toward."""
    east_m_s: FloatArray
    """Toward."""


def winds_to_draw(record: FlightRecord) -> tuple[DrawnWind, ...]:
    """The wind at each vehicle; a single one where all vehicles had the same."""
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
