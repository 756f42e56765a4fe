"""The comparison as text."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from vfguide.bench.article import ARTICLE_ERROR_M, MISSIONS
from vfguide.bench.comparison import Row

COLUMNS = (
    "mean, m",
    "95 %, m",
    "max, m",
    "10 m, s",
    "1 m, s",
    "effort, m/s²",
    "course back and forth, rad/s",
    "speed variation, m/s²",
    "cut by limits",
    "nearest, m",
)
"""Of the long table: errors, settling, control, separation."""


def metres(value: float | None) -> str:
    """A figure with the digits that it deserves."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.3f}" if value < 1.0 else f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def seconds(value: float | None) -> str:
    """A settling time."""
    return "never" if value is None else f"{value:.1f}"


def short_table(rows: Sequence[Row], costs: Mapping[str, Mapping[str, Any]]) -> str:
    """Mean errors by mission and law, the shipped missions on the air-relative plant: the one table."""
    laws = list(dict.fromkeys(row.law for row in rows))
    found = {
        (row.mission, row.law): row.mean.mean_error_m
        for row in rows
        if row.plant == "heading-hold" and row.condition == "shipped"
    }
    lines = [
        "| mean error, m | article's claim | " + " | ".join(laws) + " |",
        "|---|" + "---|" * (len(laws) + 1),
    ]
    for mission in MISSIONS:
        values = [found[mission, law] for law in laws]
        best = min(values)
        cells = [f"**{metres(value)}**" if value == best else metres(value) for value in values]
        lines.append(f"| {mission} | {ARTICLE_ERROR_M[mission]:.2f} | " + " | ".join(cells) + " |")
    steps = " | ".join(f"{costs[law]['median_us']:.0f} µs" for law in laws)
    lines.append(f"| one guidance step | | {steps} |")
    return "\n".join(lines) + "\n"


def long_table(rows: Sequence[Row], plant: str, condition: str) -> str:
    """All figures of one plant and condition."""
    chosen = [row for row in rows if row.plant == plant and row.condition == condition]
    if not chosen:
        return ""
    lines = [
        f"| mission | law | {' | '.join(COLUMNS)} |",
        "|---|---|" + "---|" * len(COLUMNS),
    ]
    for row in chosen:
        mean, half = row.mean, row.half_width["mean_error_m"]
        spread = f" ± {metres(half)}" if half is not None else ""
        cells = [
            row.mission,
            row.law,
            metres(mean.mean_error_m) + spread,
            metres(mean.p95_error_m),
            metres(mean.max_error_m),
            seconds(mean.settle_10m_s),
            seconds(mean.settle_1m_s),
            f"{mean.effort_m_s2:.2f}",
            f"{mean.course_variation_rad_s:.3f}",
            f"{mean.speed_variation_m_s2:.2f}",
            f"{mean.limited:.1%}",
            f"{mean.min_separation_m:.1f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
