"""A moving picture of a flight, for a README or a message: the formation from above, its errors below it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.figures import errors_that_count, settling_time
from vfguide.lab.report.geometry import slot_error, slot_track
from vfguide.lab.report.metrics import slot_distances
from vfguide.lab.report.style import STILL_AIR_M_S, WIND_COLOUR, extent
from vfguide.lab.report.tracks_plot import HALF_AIRCRAFT, Point
from vfguide.record.flight import FlightRecord, VehicleRecord

WIDTH, SCENE_HEIGHT, PLOT_HEIGHT = 640, 360, 120
"""Pixels."""

FINER = 2
"""Times as large as shown is drawn, so that edges come out smooth."""

FRAMES_PER_S = 10.0
MOST_FRAMES = 250
"""A picture of more is no longer small."""

USUAL_LENGTH_S = 12.0
"""How long the picture usually plays, s."""

AFTER_SETTLING_S = 8.0
SHORTEST_S, LONGEST_S = 15.0, 60.0
"""Length of the part of the flight that is shown where none is chosen."""

TRAIL_S = 15.0
SMOOTHING_S = 4.0
LEAST_DRAWN_M = 1e-3

GRID, TEXT, QUIET, PATH = "#e3e6ea", "#1c1e21", "#5c6370", "#c2c7ce"
FORMATS = {".gif": "GIF", ".webp": "WEBP", ".png": "PNG"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """The part of a flight that is shown."""

    begin_s: float
    """From."""
    end_s: float
    """To."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnimationFrame:
    """What one picture shows: places in pixels, from metres."""

    sample: int
    """Number of the record's sample."""
    east_m: float
    """The middle."""
    north_m: float
    """The middle."""
    scale: float
    """Pixels of a metre."""

    def place(self, east_m: FloatArray, north_m: FloatArray) -> list[Point]:
        """Where places are drawn; those that are not known are left out."""
        x = FINER * (WIDTH / 2 + self.scale * (east_m - self.east_m))
        y = FINER * (SCENE_HEIGHT / 2 - self.scale * (north_m - self.north_m))
        known = np.isfinite(x) & np.isfinite(y)
        return list(zip(x[known].tolist(), y[known].tolist(), strict=True))


def choose_span(record: FlightRecord, begin_s: float | None, end_s: float | None) -> Span:
    """The part to show: what is asked for, else the way into the formation and some seconds more.

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
    """Write a moving picture of a flight.

    Args:
        record: of the flight.
        path: a `.gif`, `.webp` or `.png` (animated PNG).
        begin_s: from when; from the beginning if absent.
        end_s: until when; until all have settled in their slots if absent.

    Returns:
        what it shows.

    Raises:
        InputError: another ending, or nothing to show.
        OSError: it cannot be written.
    """
    kind = format_of(path)
    if record.time_s.size < 2:
        raise InputError("the flight broke at once: there is nothing to animate")
    span = choose_span(record, begin_s, end_s)
    pictures = list(draw_frames(record, span))
    save_pictures(pictures, path, kind)
    return span


def format_of(path: Path) -> str:
    """The format that a file's ending names.

    Raises:
        InputError: it names none.
    """
    kind = FORMATS.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"{path}: an animation is a .gif, .webp or .png; give such a name")
    return kind


def save_pictures(pictures: list[Image.Image], path: Path, kind: str) -> None:
    """Write pictures as one that moves, the last one standing a while."""
    durations = [round(1000 / FRAMES_PER_S)] * len(pictures)
    durations[-1] = 2500
    if kind != "WEBP":
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
    """48 colours for all pictures: of the first, the middle and the last."""
    chosen = [pictures[0], pictures[len(pictures) // 2], pictures[-1]]
    together = Image.new("RGB", (WIDTH, len(chosen) * chosen[0].height))
    for number, picture in enumerate(chosen):
        together.paste(picture, (0, number * picture.height))
    return together.quantize(48, method=Image.Quantize.MAXCOVERAGE)


def draw_frames(record: FlightRecord, span: Span) -> Iterator[Image.Image]:
    """The pictures, one after another."""
    count = frame_count(span)
    times = np.linspace(span.begin_s, span.end_s, count)
    latest = record.time_s.size - 1
    samples = np.unique(np.clip(np.searchsorted(record.time_s, times - 1e-9), 0, latest))
    places = formation_places(record)
    reaches = smooth_reach(record, places)
    artist = Artist(record, span)
    for sample in samples.tolist():
        (west, east), (south, north) = (extent([one[:, sample]]) for one in places)
        room = 0.5 * SCENE_HEIGHT - 34.0
        yield artist.draw(
            AnimationFrame(
                sample=sample,
                east_m=(west + east) / 2.0,
                north_m=(south + north) / 2.0,
                scale=room / max(float(reaches[sample]), 10.0),
            )
        )


def frame_count(span: Span) -> int:
    """How many pictures show a span: twelve seconds' worth, or five for each second of it if that is more."""
    wanted = max(USUAL_LENGTH_S * FRAMES_PER_S, 5.0 * (span.end_s - span.begin_s))
    return round(min(wanted, MOST_FRAMES))


def formation_places(record: FlightRecord) -> tuple[FloatArray, FloatArray]:
    """(east, north) of all vehicles and slots, one row for each."""
    norths = [vehicle.north_m for vehicle in record.vehicles]
    easts = [vehicle.east_m for vehicle in record.vehicles]
    for follower in record.followers:
        north, east = slot_track(record.reference, *follower.slot_m)
        norths.append(north)
        easts.append(east)
    return np.stack(easts), np.stack(norths)


def smooth_reach(record: FlightRecord, places: tuple[FloatArray, FloatArray]) -> FloatArray:
    """How far vehicles and slots reach from their middle, m; smooth, so that the picture does not pump."""
    reach = np.zeros_like(record.time_s)
    for rows in places:
        low = np.min(np.where(np.isfinite(rows), rows, np.inf), axis=0)
        high = np.max(np.where(np.isfinite(rows), rows, -np.inf), axis=0)
        reach = np.hypot(reach, np.where(high >= low, high - low, 0.0) / 2.0)
    step_s = record.duration_s / max(record.time_s.size - 1, 1)
    around = max(1, round(SMOOTHING_S / max(step_s, 1e-3)))
    return running_mean(running_most(reach, around), around)


def running_most(values: FloatArray, around: int) -> FloatArray:
    """The greatest of each value's neighbours, as many as `around` on either side."""
    padded = np.pad(values, around, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * around + 1)
    most: FloatArray = windows.max(axis=1)
    return most


def running_mean(values: FloatArray, around: int) -> FloatArray:
    """The mean of each value's neighbours."""
    padded = np.pad(values, around, mode="edge")
    sums = np.concatenate([[0.0], np.cumsum(padded)])
    mean: FloatArray = (sums[2 * around + 1 :] - sums[: -2 * around - 1]) / (2 * around + 1)
    return mean


class Artist:
    """Draws the pictures of one flight."""

    def __init__(self, record: FlightRecord, span: Span) -> None:
        """Take up what all pictures share."""
        self._record = record
        self._span = span
        self._colours = vehicle_colours(record)
        file = Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
        self._small = ImageFont.truetype(file, 12 * FINER)
        self._bold = ImageFont.truetype(file.with_name("DejaVuSans-Bold.ttf"), 13 * FINER)
        self._errors = {
            one.name: slot_error(record.reference, one).distance_m for one in record.followers
        }
        shown = (record.time_s >= span.begin_s) & (record.time_s <= span.end_s)
        low, high = extent([error[shown] for error in self._errors.values()] or [np.ones(1)])
        self._least = max(low, LEAST_DRAWN_M) / 1.5
        self._most = max(high * 1.5, 10.0 * self._least)

    def draw(self, frame: AnimationFrame) -> Image.Image:
        """One picture."""
        height = SCENE_HEIGHT + (PLOT_HEIGHT if self._record.followers else 0)
        picture = Image.new("RGB", (FINER * WIDTH, FINER * height), "white")
        pen = ImageDraw.Draw(picture)
        self._draw_grid(pen, frame)
        self._draw_path(pen, frame)
        for vehicle in self._record.vehicles:
            self._draw_trail(pen, frame, vehicle)
        for vehicle in self._record.followers:
            self._draw_slot(picture, frame, vehicle)
        for vehicle in reversed(self._record.vehicles):
            self._draw_vehicle(pen, frame, vehicle)
        self._draw_wind(pen, frame)
        self._draw_words(pen, frame)
        if self._record.followers:
            self._draw_errors(pen, frame)
        return picture.resize((WIDTH, height), Image.Resampling.BOX)

    def _draw_grid(self, pen: ImageDraw.ImageDraw, frame: AnimationFrame) -> None:
        spacing = round_length(110.0 / frame.scale)
        half_width, half_height = WIDTH / 2 / frame.scale, SCENE_HEIGHT / 2 / frame.scale
        bottom = FINER * SCENE_HEIGHT
        for number in range(
            math.ceil((frame.east_m - half_width) / spacing),
            math.floor((frame.east_m + half_width) / spacing) + 1,
        ):
            x = FINER * (WIDTH / 2 + frame.scale * (number * spacing - frame.east_m))
            pen.line([(x, 0), (x, bottom)], fill=GRID, width=FINER)
        for number in range(
            math.ceil((frame.north_m - half_height) / spacing),
            math.floor((frame.north_m + half_height) / spacing) + 1,
        ):
            y = FINER * (SCENE_HEIGHT / 2 - frame.scale * (number * spacing - frame.north_m))
            pen.line([(0, y), (FINER * WIDTH, y)], fill=GRID, width=FINER)

    def _draw_path(self, pen: ImageDraw.ImageDraw, frame: AnimationFrame) -> None:
        places = frame.place(self._record.path_east_m, self._record.path_north_m)
        if len(places) > 1:
            pen.line(places, fill=PATH, width=3 * FINER, joint="curve")

    def _draw_trail(
        self, pen: ImageDraw.ImageDraw, frame: AnimationFrame, vehicle: VehicleRecord
    ) -> None:
        begin = int(
            np.searchsorted(self._record.time_s, self._record.time_s[frame.sample] - TRAIL_S)
        )
        part = slice(begin, frame.sample + 1)
        places = frame.place(vehicle.east_m[part], vehicle.north_m[part])
        if len(places) > 1:
            colour = mixed(self._colours[vehicle.name], 0.55)
            pen.line(places, fill=colour, width=2 * FINER, joint="curve")

    def _draw_slot(
        self, picture: Image.Image, frame: AnimationFrame, vehicle: VehicleRecord
    ) -> None:
        leader, sample = self._record.reference, frame.sample
        north, east = slot_track(leader, *vehicle.slot_m)
        here = slice(sample, sample + 1)
        slot = frame.place(east[here], north[here])
        place = frame.place(vehicle.east_m[here], vehicle.north_m[here])
        if not slot:
            return
        pen = ImageDraw.Draw(picture)
        colour = self._colours[vehicle.name]
        if place:
            pen.line([place[0], slot[0]], fill=mixed(colour, 0.5), width=FINER)
        outline = aircraft(slot[0], float(leader.course_rad[sample]), 14.0)
        pen.polygon(outline, fill=mixed(colour, 0.18))
        pen.line([*outline, outline[0]], fill=mixed(colour, 0.8), width=FINER)

    def _draw_vehicle(
        self, pen: ImageDraw.ImageDraw, frame: AnimationFrame, vehicle: VehicleRecord
    ) -> None:
        sample = frame.sample
        here = slice(sample, sample + 1)
        place = frame.place(vehicle.east_m[here], vehicle.north_m[here])
        if not place:
            return
        heading = float(vehicle.heading_rad[sample])
        if not math.isfinite(heading):
            heading = float(vehicle.course_rad[sample])
        colour = self._colours[vehicle.name]
        outline = aircraft(place[0], heading, 14.0)
        pen.line([*outline, outline[0]], fill="white", width=4 * FINER, joint="curve")
        pen.polygon(outline, fill=colour)
        pen.text(
            (place[0][0] + 20 * FINER, place[0][1]),
            vehicle.name[:14],
            font=self._bold,
            fill=colour,
            anchor="lm",
            stroke_width=2 * FINER,
            stroke_fill="white",
        )

    def _draw_wind(self, pen: ImageDraw.ImageDraw, frame: AnimationFrame) -> None:
        leader = self._record.leader
        north = float(leader.wind_north_m_s[frame.sample])
        east = float(leader.wind_east_m_s[frame.sample])
        speed = math.hypot(north, east)
        if not math.isfinite(speed):
            return
        middle = (48.0, 42.0)
        text = "no wind" if speed < STILL_AIR_M_S else f"wind {speed:.1f} m/s"
        self._tell(pen, (middle[0] + 4.0, middle[1] + 36.0), text, "mm")
        if speed < STILL_AIR_M_S:
            return
        x, y = east / speed, -north / speed
        tip = (middle[0] + 24.0 * x, middle[1] + 24.0 * y)
        neck = (middle[0] + 13.0 * x, middle[1] + 13.0 * y)
        sides = [
            (tip[0] - 12.0 * x - s * 6.0 * y, tip[1] - 12.0 * y + s * 6.0 * x) for s in (1, -1)
        ]
        tail = (middle[0] - 24.0 * x, middle[1] - 24.0 * y)
        pen.line(finer([tail, neck]), fill=WIND_COLOUR, width=3 * FINER)
        pen.polygon(finer([tip, *sides]), fill=WIND_COLOUR)

    def _draw_words(self, pen: ImageDraw.ImageDraw, frame: AnimationFrame) -> None:
        time_s = float(self._record.time_s[frame.sample])
        self._tell(pen, (WIDTH - 14.0, 16.0), f"{self._record.mission}, {time_s:.1f} s", "rm")
        length = round_length(120.0 / frame.scale)
        x, y = 14.0, SCENE_HEIGHT - 16.0
        right = x + length * frame.scale
        pen.line(finer([(x, y - 5), (x, y), (right, y), (right, y - 5)]), fill=TEXT, width=FINER)
        self._tell(pen, (x + 5.0, y - 11.0), f"{length:g} m", "lm")

    def _draw_errors(self, pen: ImageDraw.ImageDraw, frame: AnimationFrame) -> None:
        left, right = 52.0, WIDTH - 14.0
        top, bottom = SCENE_HEIGHT + 26.0, SCENE_HEIGHT + PLOT_HEIGHT - 12.0
        corners = finer([(0, SCENE_HEIGHT), (WIDTH, SCENE_HEIGHT + PLOT_HEIGHT)])
        pen.rectangle(corners, fill="white")
        pen.line(finer([(0, SCENE_HEIGHT), (WIDTH, SCENE_HEIGHT)]), fill=PATH, width=FINER)
        self._tell(pen, (left, top - 14.0), "distance from the slot, m", "lm")
        span = self._span
        tall = (bottom - top) / math.log(self._most / self._least)

        def up(values: FloatArray) -> FloatArray:
            drawn: FloatArray = bottom - tall * np.log(
                np.maximum(values, self._least) / self._least
            )
            return drawn

        for power in range(
            math.ceil(math.log10(self._least)), math.floor(math.log10(self._most)) + 1
        ):
            y = float(up(np.array([10.0**power]))[0])
            pen.line(finer([(left, y), (right, y)]), fill=GRID, width=FINER)
            self._tell(pen, (left - 6.0, y), f"{10.0**power:g}", "rm")
        begin = int(np.searchsorted(self._record.time_s, span.begin_s))
        part = slice(begin, frame.sample + 1)
        share = (self._record.time_s[part] - span.begin_s) / (span.end_s - span.begin_s)
        x = left + (right - left) * share
        for name, error in self._errors.items():
            y_values = up(error[part])
            known = np.isfinite(y_values)
            line = list(zip(x[known].tolist(), y_values[known].tolist(), strict=True))
            if len(line) > 1:
                pen.line(finer(line), fill=self._colours[name], width=2 * FINER, joint="curve")
        if x.size:
            now = float(x[-1])
            pen.line(finer([(now, top), (now, bottom)]), fill=QUIET, width=FINER)

    def _tell(self, pen: ImageDraw.ImageDraw, place: Point, text: str, anchor: str) -> None:
        pen.text(
            finer([place])[0],
            text,
            font=self._small,
            fill=TEXT,
            anchor=anchor,
            stroke_width=2 * FINER,
            stroke_fill="white",
        )


def aircraft(place: Point, heading_rad: float, size: float) -> list[Point]:
    """The outline of an aircraft whose half span is `size` pixels, its nose along the heading."""
    mirrored = [(-right, forward) for right, forward in reversed(HALF_AIRCRAFT[1:-1])]
    sine, cosine = math.sin(heading_rad), math.cos(heading_rad)
    return [
        (
            place[0] + FINER * size * (forward * sine + right * cosine),
            place[1] - FINER * size * (forward * cosine - right * sine),
        )
        for right, forward in (*HALF_AIRCRAFT, *mirrored)
    ]


def finer(places: list[Point]) -> list[Point]:
    """Places in the pixels that are drawn, from those that are shown."""
    return [(FINER * x, FINER * y) for x, y in places]


def mixed(colour: str, share: float) -> str:
    """A colour thinned with white; a share of 1 leaves it as it is."""
    channels = [int(colour[place : place + 2], 16) for place in (1, 3, 5)]
    return "#" + "".join(f"{round(255 - share * (255 - one)):02x}" for one in channels)


def round_length(length: float) -> float:
    """The greatest of 1, 2, 5 times a power of ten that is not above a length."""
    power = 10.0 ** math.floor(math.log10(length))
    return power * max(one for one in (1.0, 2.0, 5.0) if one <= length / power * (1 + 1e-9))
