"""Style of plots: one colour for each vehicle in all of them, units on all axes, room for all text.

Figures are drawn without pyplot, so that a report leaves no state behind and needs no display. PNG files have
a palette of 256 colours: they take a third of the room and look the same.
"""

from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray
from PIL import Image

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.lab.report.figures import window_s
from vfguide.record.flight import FlightRecord

DOTS_PER_INCH = 120

NARROW_INCH = 3.8
"""Width of a figure for a phone, by which its text is as large as the page's."""

NARROW_DOTS_PER_INCH = 230

NARROW_LETTERS = 34
"""Number of letters of a title that fit into a line of a narrow figure."""

LIMIT_COLOUR = "#c1121f"

QUIET_COLOUR = "#767676"
"""Colour of lines for comparison."""

STILL_AIR_M_S = 0.05
"""Wind speed below which no direction is drawn, m/s."""

WIND_COLOUR = "#5b7fa6"

WINDOW_COLOUR = "#eef3e6"
"""Background of the window in which errors count."""

TEXT_SIZE = 9.0
TITLE_SIZE = 10.5
SMALL_SIZE = 8.0


def plain_text(text: str) -> str:
    """Escape dollar signs, which would begin a formula in matplotlib."""
    return text.replace("$", r"\$")


def new_figure(width_inch: float, height_inch: float) -> Figure:
    """Return an empty figure with a layout in which no text is cut or overlapped."""
    return Figure(
        figsize=(width_inch, height_inch),
        dpi=DOTS_PER_INCH,
        layout="constrained",
        facecolor="white",
    )


def dress(axes: Axes, *, title: str = "", across: str = "", up: str = "") -> None:
    """Give axes a title, labels with units and a light grid, and no box."""
    axes.set_title(fitted(axes, title), fontsize=TITLE_SIZE, loc="left")
    axes.set_xlabel(across, fontsize=TEXT_SIZE)
    axes.set_ylabel(up, fontsize=TEXT_SIZE)
    axes.tick_params(labelsize=TEXT_SIZE, color="#b0b0b0")
    axes.grid(visible=True, color="#e2e2e2", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("bottom", "left"):
        axes.spines[side].set_color("#b0b0b0")


def fitted(axes: Axes, text: str) -> str:
    """Wrap a title to the width of a narrow figure."""
    figure = axes.get_figure(root=True)
    if figure is None or figure.get_figwidth() > NARROW_INCH:
        return text
    columns = axes.get_subplotspec().get_gridspec().ncols  # type: ignore[union-attr]
    return fill(text, NARROW_LETTERS // columns)


def set_log_scale(axes: Axes, low: float, high: float) -> None:
    """Set a logarithmic scale with plain figures: 0.1, 1, 10."""
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", color="#d0d0d0")


def halo() -> list[AbstractPathEffect]:
    """Return a white outline that keeps text readable on lines."""
    return [withStroke(linewidth=2.5, foreground="white")]


def shade_window(axes: Axes, record: FlightRecord) -> None:
    """Colour the background of the window in which errors count."""
    begin, end = window_s(record)
    axes.axvspan(begin, end, color=WINDOW_COLOUR, zorder=0, linewidth=0)


def show_whole_flight(axes: Axes, record: FlightRecord) -> None:
    """Let the time axis run from the first to the last sample."""
    axes.set_xlim(float(record.time_s[0]), float(record.time_s[-1]))


def legend_above(figure: Figure, panels: Iterable[Axes], columns: int) -> None:
    """Put one legend above the whole figure, with the labelled lines of some panels."""
    lines = [axes.get_legend_handles_labels() for axes in panels]
    handles = [handle for found, _ in lines for handle in found]
    labels = [label for _, found in lines for label in found]
    if figure.get_figwidth() <= NARROW_INCH and labels:
        # Each label's line sample takes the room of some letters.
        letters = max(len(label) for label in labels) + 7
        columns = max(1, min(columns, 52 // letters))
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=columns,
        frameon=False,
        fontsize=TEXT_SIZE,
    )


def mark_samples(axes: Axes, time_s: FloatArray, flags: BoolArray, colour: str) -> None:
    """Mark flagged samples, even single ones, in a strip along the bottom of the axes."""
    marked = time_s[flags]
    axes.plot(
        marked,
        np.full_like(marked, 0.02),
        marker="|",
        markersize=6,
        markeredgewidth=0.8,
        color=colour,
        linestyle="none",
        transform=axes.get_xaxis_transform(),
    )


def extent(arrays: Sequence[FloatArray]) -> tuple[float, float]:
    """Return least and greatest finite value of some arrays; (0, 0) without any."""
    values = np.concatenate([array[np.isfinite(array)] for array in arrays])
    return (float(np.min(values)), float(np.max(values))) if values.size else (0.0, 0.0)


Colours = NDArray[np.int32]
"""Rows of red, green, blue, 0 to 255."""

WEBP_EFFORT, WEBP_METHOD = 60, 2
"""Effort for the smallest file: a page takes 0.8 s, and more time gains nothing."""

FREQUENT = 128
"""Number of most frequent colours that are kept unchanged."""


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG."""
    path.write_bytes(picture_of(figure, DOTS_PER_INCH))
    return path


def picture_of(figure: Figure, dots_per_inch: int) -> bytes:
    """Return a figure as PNG."""
    reduced = BytesIO()
    figure.set_dpi(dots_per_inch)
    picture = with_palette(pixels_of(figure))
    picture.save(reduced, format="PNG", optimize=True, dpi=(dots_per_inch, dots_per_inch))
    return reduced.getvalue()


def pixels_of(figure: Figure) -> Image.Image:
    """Return the pixels of a figure; matplotlib's `savefig` would lay it out and draw it twice."""
    # Matplotlib's canvas is untyped.
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def as_webp(png: bytes) -> bytes:
    """Convert PNG to lossless WebP for pages: a fifth smaller, and shown by every browser since 2020."""
    smaller = BytesIO()
    with Image.open(BytesIO(png)) as picture:
        picture.convert("RGB").save(
            smaller, format="WEBP", lossless=True, quality=WEBP_EFFORT, method=WEBP_METHOD
        )
    return smaller.getvalue()


def with_palette(picture: Image.Image) -> Image.Image:
    """Return a picture in 256 colours, each pixel in the nearest of them.

    Half of the palette are the most frequent colours, which keep backgrounds true. The other half are spread
    over all colours, which keeps thin lines true.
    """
    pixels = np.asarray(picture).astype(np.int32)
    packed = (pixels[..., 0] << 16) | (pixels[..., 1] << 8) | pixels[..., 2]
    found, where, counts = np.unique(packed.ravel(), return_inverse=True, return_counts=True)
    colours = np.stack([found >> 16, (found >> 8) & 255, found & 255], axis=1)
    spread = picture.quantize(256 - FREQUENT, method=Image.Quantize.MAXCOVERAGE).getpalette() or []
    palette = np.concatenate(
        [
            colours[np.argsort(counts)[::-1][:FREQUENT]],
            np.array(spread, dtype=np.int32).reshape(-1, 3),
        ]
    )
    numbers = nearest(colours, palette)[where].reshape(packed.shape)
    reduced = Image.fromarray(numbers.astype(np.uint8))
    reduced.putpalette(palette.astype(np.uint8).tobytes())
    return reduced


def nearest(colours: Colours, palette: Colours) -> NDArray[np.intp]:
    """Return for each colour the index of the nearest in the palette."""
    # |c - p|^2 without |c|^2, which is the same for every p. All numbers are integers below 2^24: exact in
    # float32, whose matrix products are many times faster.
    tints, palette = colours.astype(np.float32), palette.astype(np.float32)
    lengths = np.sum(palette * palette, axis=1)
    numbers: NDArray[np.intp] = np.argmin(lengths - 2.0 * (tints @ palette.T), axis=1)
    return numbers
