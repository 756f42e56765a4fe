"""How high everybody flew, and how far each was above or below its slot."""

from matplotlib.figure import Figure

from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.figures import in_window
from vfguide.lab.report.geometry import slot_error
from vfguide.lab.report.style import (
    NARROW_INCH,
    dress,
    extent,
    legend_above,
    new_figure,
    plain_text,
    shade_window,
    show_whole_flight,
)
from vfguide.record.flight import FlightRecord

LEAST_SPAN_M = 0.1
"""Smaller errors are not drawn larger than this."""


def heights_figure(record: FlightRecord, *, narrow: bool = False) -> Figure:
    """Altitudes above the mission's origin; below them each follower's height error."""
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
