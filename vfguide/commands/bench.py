"""`vfguide bench`: the studies flown and measured, and their tables and figures."""

import json
import math
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from vfguide.commands.terminal import Terminal
from vfguide.lab.studies.comparison import (
    FULL,
    PLANTS,
    QUICK,
    ComparisonRow,
    ablation_cases,
    compare,
    long_table,
    metres,
    parts_of,
    row_json,
    seconds,
    short_table,
)
from vfguide.lab.studies.flown import MISSIONS, Tracks, executor_on, flown_by, fly
from vfguide.lab.studies.latency import render, run_latency
from vfguide.lab.studies.monte_carlo import (
    DURATION_S,
    SWEEPS,
    Found,
    fly_point,
    formations_of,
    points,
    sampled,
    summary_of,
)
from vfguide.lab.studies.radio import RATES_HZ, SIZES, RadioCase, RadioFigures
from vfguide.lab.studies.radio import fly as fly_radio
from vfguide.lab.studies.scale import measure_all, step_costs
from vfguide.registry import laws

CONDITIONS = ("shipped", "bad link")

SCALE_COLUMNS = (
    "vehicles",
    "times real time",
    "µs per vehicle and step",
    "memory, MB",
    "guidance step, µs",
    "companion",
    "of it decode",
    "encode",
    "guidance",
)
"""Columns of the table of sizes; the last are shares of the whole time."""


def compare_laws(
    chosen: Sequence[str] | None,
    *,
    quick: bool,
    json_file: Path | None,
    out: Path | None,
    scheduler: str | None,
) -> None:
    """Fly, print the tables, and keep them.

    Args:
        chosen: laws; all that are known if none.
        quick: shorter flights, and fewer.
        json_file: where all figures go.
        out: where tables, figures and the same JSON go.
        scheduler: of a Dask cluster; this computer if absent.
    """
    began = time.perf_counter()
    for directory in (out, json_file.parent if json_file else None):
        if directory is not None:
            directory.mkdir(parents=True, exist_ok=True)
    extent, flown = QUICK if quick else FULL, flown_laws(chosen)
    with executor_on(scheduler) as executor:
        rows, tracks = compare(executor, extent, flown)
    costs = step_costs(flown)
    content = {
        "machine": machine(),
        "duration_s": extent.duration_s,
        "seeds": extent.seeds,
        "rows": [row_json(row) for row in rows],
        "step_cost": costs,
        "wall_s": time.perf_counter() - began,
    }
    text = tables(rows, costs, content)
    Terminal().tell(text)
    written = json.dumps(content, indent=2, allow_nan=False) + "\n"
    if json_file is not None:
        json_file.write_text(written, encoding="utf-8")
    if out is not None:
        keep(out, text, written, tracks)


def flown_laws(chosen: Sequence[str] | None, *, but: str | None = None) -> list[str]:
    """The laws that a study flies: those chosen, or else all known but one.

    Raises:
        InputError: there is no law of a chosen name.
    """
    if chosen:
        return [laws.find(name).name for name in chosen]
    return [name for name in laws.names() if name != but]


def keep(out: Path, text: str, written: str, tracks: dict[tuple[str, str], Tracks]) -> None:
    """Tables, figures and JSON in a directory."""
    # Here, because it brings the plotting library.
    from vfguide.lab.studies.figures import draw_case, draw_laws

    (out / "bench.md").write_text(text, encoding="utf-8")
    (out / "bench.json").write_text(written, encoding="utf-8")
    draw_laws(tracks, out)
    for (mission, law), drawn in tracks.items():
        draw_case(mission, law, drawn, out)


def tables(
    rows: list[ComparisonRow], costs: dict[str, dict[str, Any]], content: dict[str, Any]
) -> str:
    """Everything in Markdown."""
    parts = [heading(content), short_table(rows, costs)]
    for condition in CONDITIONS:
        for plant in PLANTS:
            table = long_table(rows, plant, condition)
            if table:
                parts += [f"{plant}, {condition}\n", table]
    return "\n".join(parts)


def heading(content: dict[str, Any]) -> str:
    """Where and when, in one line."""
    about = content["machine"]
    return (
        f"{about['date']}, {about['processor']}, {about['processors']} processors, Python "
        f"{about['python']}, vfguide {about['vfguide']}: {content['duration_s']:.0f} s flights, "
        f"{content['wall_s']:.0f} s in all\n"
    )


def machine() -> dict[str, Any]:
    """What it ran on."""
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": processor(),
        "processors": os.cpu_count(),
        "python": platform.python_version(),
        "system": platform.platform(),
        "vfguide": version("vfguide"),
    }


def processor() -> str:
    """Name of the processor, as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def write(json_file: Path | None, content: dict[str, Any]) -> None:
    """All figures as JSON, which knows neither NaN nor infinity."""
    if json_file is None:
        return
    json_file.parent.mkdir(parents=True, exist_ok=True)
    known = without_nan({"machine": machine(), **content})
    json_file.write_text(json.dumps(known, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def without_nan(value: object) -> object:
    """A value with None for each number that is not finite."""
    if isinstance(value, dict):
        return {key: without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def show_ablations(law: str, *, quick: bool, json_file: Path | None, scheduler: str | None) -> None:
    """Fly and print."""
    flown = ablation_cases(law, quick=quick)
    with executor_on(scheduler) as executor:
        results = [figures for figures, _ in flown_by(executor, fly, flown)]
    found = {
        (case.label, case.mission): figures for case, figures in zip(flown, results, strict=True)
    }
    lines = [
        "| mean / greatest error, m | " + " | ".join(MISSIONS) + " | back and forth, rad/s |",
        "|---|" + "---|" * (len(MISSIONS) + 1),
    ]
    for name in parts_of(law):
        cells = [
            f"{metres(found[name, mission].mean_error_m)} / "
            f"{metres(found[name, mission].max_error_m)}"
            for mission in MISSIONS
        ]
        chatter = max(found[name, mission].course_variation_rad_s for mission in MISSIONS)
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {chatter:.3f} |")
    Terminal().tell("\n".join(lines))
    rows = [
        {"ablation": label, "mission": mission, **asdict(figures)}
        for (label, mission), figures in found.items()
    ]
    write(json_file, {"rows": rows})


def show_robustness(
    chosen: Sequence[str] | None,
    *,
    quick: bool,
    json_file: Path | None,
    out: Path | None,
    scheduler: str | None,
) -> None:
    """Fly, print, and draw."""
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    with executor_on(scheduler) as executor:
        found = list(
            flown_by(executor, fly_point, points(flown_laws(chosen, but="article"), quick=quick))
        )
    Terminal().tell(maps(found))
    content = {"points": [asdict(one) for one in found]}
    write(json_file, content)
    if out is not None:
        # Here, because it brings the plotting library.
        from vfguide.lab.studies.figures import draw_maps

        draw_maps(found, out)
        write(out / "robustness.json", content)


def maps(found: Sequence[Found]) -> str:
    """A table for each sweep and mission: mean error and settling, law by law."""
    parts = []
    for name, sweep in SWEEPS.items():
        here = [one for one in found if one.point.sweep == name]
        for mission in dict.fromkeys(one.point.mission for one in here):
            these = [one for one in here if one.point.mission == mission]
            flown = list(dict.fromkeys(one.point.law for one in these))
            lines = [
                f"| {mission}: {sweep.title} | " + " | ".join(flown) + " |",
                "|---|" + "---|" * len(flown),
            ]
            for value in sweep.values:
                cells = [
                    f"{metres(one.mean_error_m)} m, {seconds(one.settle_10m_s)} s"
                    for law in flown
                    for one in these
                    if one.point.law == law and one.point.value == value
                ]
                lines.append(f"| {value:g} | " + " | ".join(cells) + " |")
            parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def show_scale(*, quick: bool, json_file: Path | None) -> None:
    """Measure and print."""
    result = measure_all(quick=quick)
    lines = [
        f"| {' | '.join(SCALE_COLUMNS)} |",
        "|" + "---|" * len(SCALE_COLUMNS),
    ]
    for one in result["sizes"]:
        shares = one["shares"]
        cells = [
            f"{one['vehicles']}",
            f"{one['real_time_factor']:.1f}",
            f"{one['processor_us_per_vehicle_step']:.0f}",
            f"{one['memory_mb']:.0f}",
            f"{one['guidance_step_us']:.0f}",
            *(f"{shares[part]:.0%}" for part in ("companion", "decode", "encode", "guidance")),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines.append(f"\nprocessor time grows with the vehicles to the power {result['exponent']:.2f}")
    Terminal().tell("\n".join(lines))
    write(json_file, result)


def sample_formations(
    *,
    formations: int,
    law: str,
    processes: int | None,
    seed: int,
    json_file: Path | None,
    scheduler: str | None,
) -> None:
    """Fly and print."""
    laws.find(law)
    with executor_on(scheduler, processes) as executor:
        result = summary_of(list(sampled(executor, formations_of(law, formations, seed))))
    error, settle = result["mean_error_m"], result["settle_10m_s"]
    Terminal().tell(
        f"{law}: {result['formations']} formations of 4, {DURATION_S:.0f} s each\n"
        f"within 10 m at the end {result['within_10m_at_end']:.2%}, within 1 m "
        f"{result['within_1m_at_end']:.2%}; never at a limit in the last half "
        f"{result['share_without_limits']:.2%}\n"
        f"mean error, m: {spelt(error)}; where nothing was at a limit: "
        f"{spelt(result['mean_error_without_limits_m'])}\n"
        f"within 10 m after, s: {spelt(settle)}"
    )
    write(json_file, {"law": law, "seed": seed, **result})


def spelt(quantiles: dict[str, float] | None) -> str:
    """Quantiles in words."""
    if quantiles is None:
        return "none"
    return (
        f"median {quantiles['median']:.3g}, 95 % {quantiles['p95']:.3g}, "
        f"greatest {quantiles['max']:.3g}"
    )


def show_radio(
    *,
    seconds: float,
    aircraft: Sequence[int] | None,
    rates_hz: Sequence[float] | None,
    followers_hz: float,
    loss: float,
    bursts: float,
    json_file: Path | None,
) -> None:
    """Fly and print."""
    sizes, rates = aircraft or SIZES, [None, *(rates_hz or RATES_HZ)]
    cases = [
        RadioCase(
            size=size,
            leader_hz=rate_hz,
            followers_hz=followers_hz,
            loss=loss,
            bursts=bursts,
            seconds=seconds,
        )
        for rate_hz in rates
        for size in sizes
    ]
    with executor_on() as executor:
        found = dict(zip(cases, flown_by(executor, fly_radio, cases), strict=True))
    lines = [
        "| leader | " + " | ".join(f"{size} aircraft" for size in sizes) + " |",
        "|---|" + "---|" * len(sizes),
    ]
    for rate_hz in rates:
        title = "no radio, 0.1 s late" if rate_hz is None else f"{rate_hz:g} Hz"
        cells = [shown(found[case]) for case in cases if case.leader_hz == rate_hz]
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    Terminal().tell(
        "mean error, m / greatest error, m / age of the leader's state, ms / bytes a second\n\n"
        + "\n".join(lines)
    )
    rows = [{**asdict(case), **asdict(figures)} for case, figures in found.items()]
    write(json_file, {"rows": rows})


def shown(figures: RadioFigures) -> str:
    """The figures of a flight in one cell."""
    errors = f"{figures.mean_error_m:.3f} / {figures.max_error_m:.2f}"
    if figures.air_bytes_s == 0.0:
        return errors
    return f"{errors} / {figures.leader_age_s * 1e3:.0f} / {figures.air_bytes_s:.0f}"


def measure_latency(*, seconds: float, rate_hz: float, as_json: bool) -> None:
    """Measure, and print the table or the figures."""
    result = run_latency(seconds=seconds, rate_hz=rate_hz)
    Terminal().tell(json.dumps(result, indent=2) if as_json else render(result))
