"""Series of measured times in a few numbers.

The robustness maps as one picture: error and chatter against what gets worse, unstable flights marked.

A figure for each case, like the article's: tracks, and the followers' distances from their slots.
"""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vfguide.lab.report.colours import FOLLOWER_COLOURS, LEADER_COLOUR
from vfguide.lab.report.picture import save_figure
from vfguide.lab.report.style import (
    DOTS_PER_INCH,
    LIMIT_COLOUR,
    SMALL_SIZE,
    TITLE_SIZE,
)
from vfguide.lab.studies.flown import Tracks
from vfguide.lab.studies.robustness import SWEEPS, Found

COLUMNS = 4

LEAST_ERROR_M = 1e-3
"""Below this no error is drawn: the scale is logarithmic."""


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


def draw_case(mission: str, law: str, tracks: Tracks, directory: Path) -> Path:
    """Tracks on the left, errors over time on the right."""
    figure = Figure(figsize=(9.0, 3.8), dpi=DOTS_PER_INCH, layout="constrained")
    map_axes, error_axes = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
    figure.suptitle(f"{mission}, {law}", fontsize=TITLE_SIZE)
    colours = dict(zip(tracks.error_m, FOLLOWER_COLOURS, strict=False))
    for name, north in tracks.north_m.items():
        colour = colours.get(name, LEADER_COLOUR)
        map_axes.plot(tracks.east_m[name], north, color=colour, linewidth=0.8, label=name)
        map_axes.plot(tracks.east_m[name][0], north[0], "o", color=colour, markersize=3)
    map_axes.set_aspect("equal", adjustable="datalim")
    map_axes.set_xlabel("east, m")
    map_axes.set_ylabel("north, m")
    map_axes.legend(fontsize=SMALL_SIZE, loc="upper left")
    for name, error in tracks.error_m.items():
        error_axes.plot(
            tracks.time_s, error.clip(LEAST_ERROR_M), color=colours[name], linewidth=0.8, label=name
        )
    dress_errors(error_axes)
    error_axes.legend(fontsize=SMALL_SIZE, loc="upper right")
    return save_figure(figure, directory / f"{mission}-{law}.png")


def draw_laws(tracks: dict[tuple[str, str], Tracks], directory: Path) -> Path:
    """The greatest follower error over time of every law, a panel for each mission."""
    missions = list(dict.fromkeys(mission for mission, _ in tracks))
    colours = dict(
        zip(dict.fromkeys(law for _, law in tracks), cycle(FOLLOWER_COLOURS), strict=False)
    )
    figure = Figure(figsize=(9.0, 5.6), dpi=DOTS_PER_INCH, layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for mission, axes in zip(missions, panels.flat, strict=False):
        for law, colour in colours.items():
            drawn = tracks[mission, law]
            worst = next(iter(drawn.error_m.values()))
            for error in drawn.error_m.values():
                worst = worst.clip(min=error)
            axes.plot(
                drawn.time_s,
                worst.clip(LEAST_ERROR_M),
                color=colour,
                linewidth=0.9,
                label=law,
            )
        axes.set_title(mission, fontsize=TITLE_SIZE)
        dress_errors(axes)
    # Above the panels: within, it would hide the article's field, which stays metres away.
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, fontsize=SMALL_SIZE, loc="outside upper center", ncols=len(colours)
    )
    return save_figure(figure, directory / "laws.png")


def dress_errors(axes: Axes) -> None:
    """Scales and labels of errors over time."""
    axes.set_yscale("log")
    axes.set_ylim(bottom=LEAST_ERROR_M)
    axes.grid(visible=True, which="major", linewidth=0.4)
    axes.set_xlabel("time, s")
    axes.set_ylabel("distance from the slot, m")


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
