"""`vfguide bench`: the article's comparison, flown."""

import json
import os
import platform
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from vfguide.commands.terminal import Terminal
from vfguide.lab.studies.comparison import (
    FULL,
    PLANTS,
    QUICK,
    Row,
    compare,
    long_table,
    row_json,
    short_table,
)
from vfguide.lab.studies.flown import Tracks, executor_on
from vfguide.lab.studies.scale import step_costs
from vfguide.registry import laws

CONDITIONS = ("shipped", "bad link")


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


def tables(rows: list[Row], costs: dict[str, dict[str, Any]], content: dict[str, Any]) -> str:
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
    """Its name, as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
