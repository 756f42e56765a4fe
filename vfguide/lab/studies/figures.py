"""Series of measured times in a few numbers.

The robustness maps as one picture: error and chatter against what gets worse, unstable flights marked.
"""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from vfguide.lab.report.colours import FOLLOWER_COLOURS
from vfguide.lab.report.picture import save_figure
from vfguide.lab.report.style import DOTS_PER_INCH, LIMIT_COLOUR, SMALL_SIZE
from vfguide.lab.studies.robustness import SWEEPS, Found

COLUMNS = 4


def draw_maps(found: Sequence[Found], directory: Path) -> list[Path]:
    """One picture for each mission."""
    missions = list(dict.fromkeys(one.point.mission for one in found))
    return [
        draw_mission([one for one in found if one.point.mission == mission], mission, directory)
        for mission in missions
    ]


def draw_mission(found: Sequence[Found], mission: str, directory: Path) -> Path:
    """All sweeps of a mission, a panel each: mean errors as lines, flights that never settled as crosses."""
    rows = -(-len(SWEEPS) // COLUMNS)
    figure = Figure(figsize=(12.0, 2.9 * rows), dpi=DOTS_PER_INCH, layout="constrained")
    panels = figure.subplots(rows, COLUMNS, squeeze=False)
    figure.suptitle(
        f"{mission}: mean distance from the slots, m; crosses: not within 10 m at the end"
    )
    laws = dict.fromkeys(one.point.law for one in found)
    colours = dict(zip(laws, cycle(FOLLOWER_COLOURS), strict=False))
    for (name, sweep), axes in zip(SWEEPS.items(), panels.flat, strict=False):
        for law, colour in colours.items():
            here = [one for one in found if one.point.sweep == name and one.point.law == law]
            if not here:
                continue
            axes.plot(
                [one.point.value for one in here],
                [one.mean_error_m for one in here],
                "o-",
                color=colour,
                markersize=3,
                linewidth=0.9,
                label=law,
            )
            lost = [one for one in here if one.settle_10m_s is None]
            axes.plot(
                [one.point.value for one in lost],
                [one.mean_error_m for one in lost],
                "x",
                color=LIMIT_COLOUR,
                markersize=9,
            )
        axes.set_yscale("log")
        axes.set_xlabel(sweep.title)
        axes.grid(visible=True, which="major", linewidth=0.4)
        axes.legend(fontsize=SMALL_SIZE)
    for axes in panels.flat[len(SWEEPS) :]:
        axes.set_visible(False)
    return save_figure(figure, directory / f"robustness-{mission}.png")


def quantile(ordered: Sequence[float], share: float) -> float:
    """The value that this share of a sorted series does not exceed; nearest rank, never interpolated."""
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def figures_of(seconds: Sequence[float]) -> dict[str, Any]:
    """Count, and median, 99th percentile and greatest in milliseconds; no times without any."""
    ordered = sorted(seconds)
    if not ordered:
        return {"count": 0}
    return {
        "count": len(ordered),
        "p50_ms": round(quantile(ordered, 0.5) * 1e3, 3),
        "p99_ms": round(quantile(ordered, 0.99) * 1e3, 3),
        "max_ms": round(ordered[-1] * 1e3, 3),
    }
