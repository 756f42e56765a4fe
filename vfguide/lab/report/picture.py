"""Figures as small PNG files: a palette of 256 colours takes a third of the room, and looks the same."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from vfguide.lab.report.style import DOTS_PER_INCH

Colours = NDArray[np.int32]
"""Rows of red, green, blue, 0 to 255."""

WEBP_EFFORT, WEBP_METHOD = 60, 2
"""How hard is searched for the smallest file: a page takes 0.8 s, and more time gains nothing."""

FREQUENT = 128
"""Colours that are kept as they are."""


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG."""
    path.write_bytes(picture_of(figure, DOTS_PER_INCH))
    return path


def picture_of(figure: Figure, dots_per_inch: int) -> bytes:
    """A figure as PNG."""
    reduced = BytesIO()
    figure.set_dpi(dots_per_inch)
    picture = with_palette(pixels_of(figure))
    picture.save(reduced, format="PNG", optimize=True, dpi=(dots_per_inch, dots_per_inch))
    return reduced.getvalue()


def pixels_of(figure: Figure) -> Image.Image:
    """A figure as it is drawn. Matplotlib's own way to a file lays it out and draws it twice."""
    # Matplotlib says no types of its canvas.
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def as_webp(png: bytes) -> bytes:
    """A PNG as WebP without loss: a fifth smaller, for pages. Every browser since 2020 shows it."""
    smaller = BytesIO()
    with Image.open(BytesIO(png)) as picture:
        picture.convert("RGB").save(
            smaller, format="WEBP", lossless=True, quality=WEBP_EFFORT, method=WEBP_METHOD
        )
    return smaller.getvalue()


def with_palette(picture: Image.Image) -> Image.Image:
    """A picture in 256 colours, each pixel in the nearest of them.

    Half of the palette are the most frequent colours, half are spread so that none is far from all of them.
    The first keep backgrounds true and the second thin lines; each alone tints what the other keeps.
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
    """For each colour the number of the palette's nearest."""
    # |c - p|^2 without |c|^2, which is the same for every p. All numbers are whole and below 2^24: exact in
    # float32, whose products are many times as fast.
    tints, palette = colours.astype(np.float32), palette.astype(np.float32)
    lengths = np.sum(palette * palette, axis=1)
    numbers: NDArray[np.intp] = np.argmin(lengths - 2.0 * (tints @ palette.T), axis=1)
    return numbers
