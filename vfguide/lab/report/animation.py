"""Animation of a flight for a README or a message: the formation from above, its errors below."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, MultipleLocator
from PIL import Image

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.errors_plot import LEAST_DRAWN_M
from vfguide.lab.report.figures import errors_that_count, settling_time, slot_track
from vfguide.lab.report.metrics import slot_distances
from vfguide.lab.report.style import (
    QUIET_COLOUR,
    STILL_AIR_M_S,
    TEXT_SIZE,
    WIND_COLOUR,
    dress,
    extent,
    halo,
    pixels_of,
    plain_text,
    set_log_scale,
)
from vfguide.lab.report.tracks_plot import draw_aircraft
from vfguide.record.flight import FlightRecord

WIDTH, SCENE_HEIGHT, PLOT_HEIGHT = 640, 360, 120
"""Sizes in pixels."""

DOTS_PER_INCH = 100

FRAMES_PER_S = 10.0
MOST_FRAMES = 250
"""Maximum number of frames, to keep the file small."""

USUAL_LENGTH_S = 12.0
"""Usual playing time, s."""

AFTER_SETTLING_S = 8.0
SHORTEST_S, LONGEST_S = 15.0, 60.0
"""Bounds of the default length of the shown part of the flight, s."""

TRAIL_S = 15.0
LEAST_REACH_M = 10.0
"""Smallest half extent of the formation by which the view is scaled, m."""

FORMATS = {".gif": "GIF", ".webp": "WEBP", ".png": "PNG"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Part of a flight that is shown."""

    begin_s: float
    end_s: float


def choose_span(record: FlightRecord, begin_s: float | None, end_s: float | None) -> Span:
    """Return the requested part of a flight, by default until some seconds after all have settled.

    Raises:
        InputError: there is nothing between the two times.
    """
    first, last = float(record.time_s[0]), float(record.time_s[-1])
    begin = first if begin_s is None else max(begin_s, first)
    if end_s is None:
        errors = slot_distances(record, record.reference)
        settled = settling_time(record.time_s, errors_that_count(record, errors), 1.0)
        usual = LONGEST_S if settled is None else settled - begin + AFTER_SETTLING_S
        end_s = begin + min(max(usual, SHORTEST_S), LONGEST_S)
    end = min(end_s, last)
    if end <= begin:
        raise InputError(
            f"from {begin:g} to {end:g} s there is nothing to show; "
            f"the flight is from {first:g} to {last:g} s"
        )
    return Span(begin_s=begin, end_s=end)


def write_animation(
    record: FlightRecord, path: Path, *, begin_s: float | None = None, end_s: float | None = None
) -> Span:
    """Write an animated `.gif`, `.webp` or `.png` of a flight and return the part that it shows.

    By default the part lasts from the begin of the flight until some seconds after all have settled.

    Raises:
        InputError: the file has another suffix, or there is nothing to show.
        OSError: the file cannot be written.
    """
    kind = format_of(path)
    if record.time_s.size < 2:
        raise InputError("the flight broke at once: there is nothing to animate")
    span = choose_span(record, begin_s, end_s)
    pictures = list(draw_frames(record, span))
    save_pictures(pictures, path, kind)
    return span


def format_of(path: Path) -> str:
    """Return the image format of a file's suffix.

    Raises:
        InputError: the suffix is not supported.
    """
    kind = FORMATS.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"{path}: an animation is a .gif, .webp or .png; give such a name")
    return kind


def save_pictures(pictures: list[Image.Image], path: Path, kind: str) -> None:
    """Write pictures as a looping animation that stays on the last one for a while."""
    durations = [round(1000 / FRAMES_PER_S)] * len(pictures)
    durations[-1] = 2500
    palette = common_palette(pictures)
    pictures = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    more = {"lossless": True, "method": 4} if kind == "WEBP" else {"optimize": True}
    pictures[0].save(
        path,
        format=kind,
        save_all=True,
        append_images=pictures[1:],
        duration=durations,
        loop=0,
        **more,
    )


def common_palette(pictures: list[Image.Image]) -> Image.Image:
    """Return a palette of 48 colours, from the first, the middle and the last picture."""
    chosen = [pictures[0], pictures[len(pictures) // 2], pictures[-1]]
    together = Image.new("RGB", (WIDTH, len(chosen) * chosen[0].height))
    for number, picture in enumerate(chosen):
        together.paste(picture, (0, number * picture.height))
    return together.quantize(48, method=Image.Quantize.MAXCOVERAGE)


def draw_frames(record: FlightRecord, span: Span) -> Iterator[Image.Image]:
    """Yield the pictures one by one."""
    times = np.linspace(span.begin_s, span.end_s, frame_count(span))
    latest = record.time_s.size - 1
    samples = np.unique(np.clip(np.searchsorted(record.time_s, times - 1e-9), 0, latest))
    height = SCENE_HEIGHT + (PLOT_HEIGHT if record.followers else 0)
    figure = Figure(figsize=(WIDTH / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH)
    scene = figure.add_axes((0.0, 1.0 - SCENE_HEIGHT / height, 1.0, SCENE_HEIGHT / height))
    plot = figure.add_axes((0.08, 0.05, 0.9, 0.14)) if record.followers else None
    moment = None if plot is None else draw_errors(plot, record, span)
    places = formation_places(record)
    reaches = reach_to_come(places)
    for sample in samples.tolist():
        scene.cla()
        draw_scene(scene, record, places, sample)
        frame_scene(scene, places, sample, float(reaches[sample]))
        if moment is not None:
            moment.set_xdata([record.time_s[sample]] * 2)
        yield pixels_of(figure)


def frame_count(span: Span) -> int:
    """Return the number of frames: the usual playing time's, or five per flight second if that is more."""
    wanted = max(USUAL_LENGTH_S * FRAMES_PER_S, 5.0 * (span.end_s - span.begin_s))
    return round(min(wanted, MOST_FRAMES))


def formation_places(record: FlightRecord) -> tuple[FloatArray, FloatArray]:
    """Return (east, north) of all vehicles and then all slots, m, one row for each."""
    norths = [vehicle.north_m for vehicle in record.vehicles]
    easts = [vehicle.east_m for vehicle in record.vehicles]
    for follower in record.followers:
        north, east = slot_track(record.reference, *follower.slot_m)
        norths.append(north)
        easts.append(east)
    return np.stack(easts), np.stack(norths)


def reach_to_come(places: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the greatest half extent of vehicles and slots from each sample on, m: views only zoom in."""
    reach = np.zeros(places[0].shape[1])
    for rows in places:
        low = np.min(np.where(np.isfinite(rows), rows, np.inf), axis=0)
        high = np.max(np.where(np.isfinite(rows), rows, -np.inf), axis=0)
        reach = np.hypot(reach, np.where(high >= low, high - low, 0.0) / 2.0)
    farthest: FloatArray = np.maximum.accumulate(reach[::-1])[::-1]
    return farthest


def draw_scene(
    axes: Axes, record: FlightRecord, places: tuple[FloatArray, FloatArray], sample: int
) -> None:
    """Draw path, trails, slots, aircraft and wind at one sample, from above."""
    (easts, norths), now = (rows[:, sample].tolist() for rows in places), record.time_s[sample]
    colours, course = vehicle_colours(record), float(record.reference.course_rad[sample])
    axes.plot(record.path_east_m, record.path_north_m, color="#c2c7ce", linewidth=2.0)
    trail = slice(int(np.searchsorted(record.time_s, now - TRAIL_S)), sample + 1)
    for number, vehicle in reversed([*enumerate(record.vehicles)]):
        east, north, colour = easts[number], norths[number], colours[vehicle.name]
        axes.plot(vehicle.east_m[trail], vehicle.north_m[trail], color=colour, alpha=0.5)
        slot = len(record.vehicles) + number - 1
        if number and math.isfinite(easts[slot]):
            axes.plot([east, easts[slot]], [north, norths[slot]], color=colour, linewidth=0.8)
            draw_aircraft(axes, easts[slot], norths[slot], course, colour=f"{colour}60", size=20.0)
        if math.isfinite(east) and math.isfinite(north):
            heading, flown = float(vehicle.heading_rad[sample]), float(vehicle.course_rad[sample])
            nose = heading if math.isfinite(heading) else flown
            draw_aircraft(axes, east, north, nose, colour=colour, size=20.0)
            axes.annotate(
                plain_text(vehicle.name[:14]),
                xy=(east, north),
                xytext=(14.0, 0.0),
                textcoords="offset points",
                va="center",
                color=colour,
                weight="bold",
                fontsize=TEXT_SIZE,
                path_effects=halo(),
                annotation_clip=True,
            )
    draw_wind(axes, record, sample)
    axes.text(
        *(0.98, 0.95),
        plain_text(f"{record.mission}, {now:.1f} s"),
        transform=axes.transAxes,
        ha="right",
        fontsize=TEXT_SIZE,
        path_effects=halo(),
    )


def draw_wind(axes: Axes, record: FlightRecord, sample: int) -> None:
    """Draw the wind at the leader: an arrow downwind and the wind speed."""
    north = float(record.leader.wind_north_m_s[sample])
    east = float(record.leader.wind_east_m_s[sample])
    speed = math.hypot(north, east)
    if not math.isfinite(speed):
        return
    still = speed < STILL_AIR_M_S
    text = "no wind" if still else f"wind {speed:.1f} m/s"
    axes.text(0.02, 0.79, text, transform=axes.transAxes, fontsize=TEXT_SIZE, path_effects=halo())
    if not still:
        right, up = 20.0 * east / speed, 20.0 * north / speed
        axes.annotate(
            "",
            xy=(50.0 + right, SCENE_HEIGHT - 40.0 + up),
            xytext=(50.0 - right, SCENE_HEIGHT - 40.0 - up),
            xycoords="axes pixels",
            textcoords="axes pixels",
            arrowprops={"color": WIND_COLOUR, "width": 2.0, "headwidth": 9.0, "headlength": 9.0},
        )


def frame_scene(
    axes: Axes, places: tuple[FloatArray, FloatArray], sample: int, reach_m: float
) -> None:
    """Set centre and scale of a scene, and draw a grid with its spacing as text."""
    (west, east), (south, north) = (extent([rows[:, sample]]) for rows in places)
    up = max(reach_m, LEAST_REACH_M) * SCENE_HEIGHT / (SCENE_HEIGHT - 68.0)
    across = up * WIDTH / SCENE_HEIGHT
    axes.set_xlim((west + east) / 2.0 - across, (west + east) / 2.0 + across)
    axes.set_ylim((south + north) / 2.0 - up, (south + north) / 2.0 + up)
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    first, second, *_ = axes.get_xticks()
    axes.yaxis.set_major_locator(MultipleLocator(second - first))
    axes.grid(visible=True, color="#e3e6ea")
    axes.set_axisbelow(True)
    axes.tick_params(length=0, labelleft=False, labelbottom=False)
    text = f"grid {second - first:g} m"
    axes.text(0.02, 0.04, text, transform=axes.transAxes, fontsize=TEXT_SIZE, path_effects=halo())


def draw_errors(axes: Axes, record: FlightRecord, span: Span) -> Line2D:
    """Draw each follower's distance from its slot; return the line that marks the moment."""
    colours, errors = vehicle_colours(record), slot_distances(record, record.reference)
    for follower, error in zip(record.followers, errors, strict=True):
        drawn = np.maximum(error, LEAST_DRAWN_M)
        axes.plot(record.time_s, drawn, color=colours[follower.name], linewidth=1.2)
    shown = (record.time_s >= span.begin_s) & (record.time_s <= span.end_s)
    low, high = extent([errors[:, shown]])
    least = max(low, LEAST_DRAWN_M) / 1.5
    set_log_scale(axes, least, max(1.5 * high, 10.0 * least))
    axes.set_xlim(span.begin_s, span.end_s)
    dress(axes)
    axes.set_title("distance from the slot, m", fontsize=TEXT_SIZE, loc="left")
    axes.tick_params(labelbottom=False)
    return axes.axvline(span.begin_s, color=QUIET_COLOUR, linewidth=1.0)
