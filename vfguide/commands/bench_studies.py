"""`vfguide bench ablations`, `robustness`, `scale` and `monte-carlo`."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vfguide.commands.bench_compare import flown_laws, machine
from vfguide.commands.terminal import Terminal
from vfguide.lab.studies.comparison import ablation_cases, metres, parts_of, seconds
from vfguide.lab.studies.flown import MISSIONS, executor_on, flown_by, fly
from vfguide.lab.studies.monte_carlo import (
    SWEEPS,
    Found,
    batches,
    fly_point,
    points,
    sampled,
    summary_of,
)
from vfguide.lab.studies.scale import measure_all
from vfguide.registry import laws

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
"""Of the table of sizes; the last are shares of the whole time."""


def write(json_file: Path | None, content: dict[str, Any]) -> None:
    """All figures as JSON, which knows neither NaN nor infinity."""
    if json_file is None:
        return
    json_file.parent.mkdir(parents=True, exist_ok=True)
    known = without_nan({"machine": machine(), **content})
    json_file.write_text(json.dumps(known, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def without_nan(value: object) -> object:
    """The same with None for what is no finite number."""
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
        result = summary_of(list(sampled(executor, batches(law, formations, seed))))
    error, settle = result["mean_error_m"], result["settle_10m_s"]
    Terminal().tell(
        f"{law}, slot_frame leader: {result['formations']} formations, "
        f"{result['vehicle_seconds']:.3g} vehicle-seconds, "
        f"{result['vehicle_seconds_per_processor_second']:.3g} for each second of one core\n"
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
