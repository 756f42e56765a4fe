"""`vfguide bench`: the studies flown and measured, and their tables and figures."""

import json
import math
import os
import platform
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from vfguide.commands.options import directory_of, with_plugins
from vfguide.commands.terminal import Terminal
from vfguide.errors import PLOTTING, InputError, require
from vfguide.lab.studies.comparison import (
    FULL,
    PLANTS,
    QUICK,
    SWEEPS,
    ComparisonRow,
    ablation_cases,
    long_table,
    markdown,
    metres,
    parts_of,
    seconds,
    short_table,
    sweep_cases,
)
from vfguide.lab.studies.comparison import compare as compare_all
from vfguide.lab.studies.flown import MISSIONS, Case, Figures, executor_on, flown_by, fly
from vfguide.lab.studies.scale import (
    RATES_HZ,
    SIZES,
    RadioCase,
    RadioFigures,
    fly_radio,
    measure_all,
    step_costs,
)
from vfguide.registry import laws
from vfguide.system import require_linux

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


bench = typer.Typer(help="Measure on this computer.", rich_markup_mode=None)


def study_directory(text: str) -> Path:
    """A directory for results; a file is refused before a long study begins.

    Raises:
        InputError: the name is empty, or that of a file.
    """
    directory = directory_of(text)
    if directory.is_file():
        raise InputError(f"{text}: is a file; give another directory with --out")
    return directory


def study_file(text: str) -> Path:
    """A file for results; a directory is refused before a long study begins.

    Raises:
        InputError: the name is that of a directory.
    """
    if Path(text).is_dir():
        raise InputError(f"{text}: is a directory; name a file with --json")
    return Path(text)


JsonFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Where all figures go.", parser=study_file),
]
Directory = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Where tables, plots and JSON go.", parser=study_directory),
]
Quick = Annotated[bool, typer.Option("--quick", help="Shorter flights, and fewer.")]
Law = Annotated[str, typer.Option(metavar="LAW", help="By which followers keep their slots.")]
Laws = Annotated[
    list[str] | None,
    typer.Option("--law", metavar="LAW", help="Fly this one, or several; all known if absent."),
]
Processes = Annotated[
    int | None, typer.Option(metavar="N", min=1, help="As many as processors if absent.")
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="A Dask scheduler, such as tcp://host:8786; this computer if absent.",
    ),
]


@bench.callback(invoke_without_command=True)
@with_plugins
def compare(
    context: typer.Context,
    *,
    law: Laws = None,
    json_file: JsonFile = None,
    quick: Quick = False,
    out: Directory = None,
    scheduler: Scheduler = None,
) -> None:
    """Fly the article's comparison: its four missions by every law, on both plants.

    As shipped, and over a bad link with noise, several seeds. Exit status: 0 measured, 3 broken.
    """
    require("osqp", "scipy")
    if context.invoked_subcommand is not None:
        return
    began = time.perf_counter()
    extent, flown = QUICK if quick else FULL, flown_laws(law)
    with executor_on(scheduler) as executor:
        rows = compare_all(executor, extent, flown)
    costs = step_costs(flown)
    content = {
        "machine": machine(),
        "duration_s": extent.duration_s,
        "seeds": extent.seeds,
        "rows": [asdict(row) for row in rows],
        "step_cost": costs,
        "wall_s": time.perf_counter() - began,
    }
    text = tables(rows, costs, content)
    Terminal().tell(text)
    write(json_file, content)
    if out is not None:
        write(out / "bench.json", content)
        (out / "bench.md").write_text(text, encoding="utf-8")


@bench.command()
def latency(
    *,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=5.0, max=600.0, help="Length of each measurement.")
    ] = 15.0,
    rate: Annotated[
        float, typer.Option(metavar="HZ", min=20.0, max=100.0, help="Position reports per second.")
    ] = 50.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")] = False,
) -> None:
    """Measure from telemetry in to setpoint out, beside plain pymavlink and MAVSDK loops.

    Four companions, four emulated autopilots and a broker at once. Exit status: 0 measured, 3 broken.
    """
    # Here, because an aircraft's computer has no library that counts what processes take.
    from vfguide.lab.studies.latency import render, run_latency

    require_linux("vfguide bench latency")
    result = run_latency(seconds=seconds, rate_hz=rate)
    Terminal().tell(json.dumps(result, indent=2) if as_json else render(result))


@bench.command()
def radio(
    *,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=20.0, max=600.0, help="Length of each flight.")
    ] = 120.0,
    aircraft: Annotated[
        list[int] | None,
        typer.Option(metavar="N", min=2, max=12, help="Size of a formation; 2, 4, 8 and 12."),
    ] = None,
    rate: Annotated[
        list[float] | None,
        typer.Option(metavar="HZ", min=0.5, max=20.0, help="The leader's; 20, 10, 5 and 2."),
    ] = None,
    followers: Annotated[
        float, typer.Option(metavar="HZ", min=0.5, max=20.0, help="Rate of each follower.")
    ] = 2.5,
    loss: Annotated[
        float, typer.Option(min=0.0, max=0.9, help="Share of packets that a receiver misses.")
    ] = 0.0,
    bursts: Annotated[
        float, typer.Option(min=0.0, max=0.9, help="Share of the time that it misses all.")
    ] = 0.0,
    json_file: JsonFile = None,
) -> None:
    """Fly circle-wind over an emulated radio of 57600 baud and 4000 B/s that all share.

    The mean slot error for each size of the formation and each rate of the leader, through MAVLink bytes.
    """
    sizes, rates = aircraft or SIZES, [None, *(rate or RATES_HZ)]
    cases = [
        RadioCase(
            size=size,
            leader_hz=rate_hz,
            followers_hz=followers,
            loss=loss,
            bursts=bursts,
            seconds=seconds,
        )
        for rate_hz in rates
        for size in sizes
    ]
    with executor_on() as executor:
        found = dict(zip(cases, flown_by(executor, fly_radio, cases), strict=True))
    table = [
        [
            "no radio, 0.1 s late" if rate_hz is None else f"{rate_hz:g} Hz",
            *(shown(found[case]) for case in cases if case.leader_hz == rate_hz),
        ]
        for rate_hz in rates
    ]
    Terminal().tell(
        "mean error, m / greatest error, m / age of the leader's state, ms / bytes a second\n\n"
        + markdown(["leader", *(f"{size} aircraft" for size in sizes)], table)
    )
    rows = [{**asdict(case), **asdict(figures)} for case, figures in found.items()]
    write(json_file, {"rows": rows})


@bench.command()
@with_plugins
def ablations(
    *,
    law: Law = "slot",
    json_file: JsonFile = None,
    quick: Quick = False,
    scheduler: Scheduler = None,
) -> None:
    """Switch off each part of a law alone, and fly the four missions."""
    flown = ablation_cases(law, quick=quick)
    with executor_on(scheduler) as executor:
        found = {
            (case.label, case.mission): figures
            for case, figures in zip(flown, flown_by(executor, fly, flown), strict=True)
        }
    table = []
    for name in parts_of(law):
        here = [found[name, mission] for mission in MISSIONS]
        cells = [f"{metres(one.mean_error_m)} / {metres(one.max_error_m)}" for one in here]
        table.append([name, *cells, f"{max(one.course_variation_rad_s for one in here):.3f}"])
    head = ["mean / greatest error, m", *MISSIONS, "back and forth, rad/s"]
    Terminal().tell(markdown(head, table))
    rows = [
        {"ablation": label, "mission": mission, **asdict(figures)}
        for (label, mission), figures in found.items()
    ]
    write(json_file, {"rows": rows})


@bench.command()
@with_plugins
def robustness(
    *,
    law: Laws = None,
    json_file: JsonFile = None,
    quick: Quick = False,
    out: Directory = None,
    scheduler: Scheduler = None,
) -> None:
    """Map errors and settling against link, noise, wrong responses, wind and loop rate."""
    with executor_on(scheduler) as executor:
        swept = sweep_cases(flown_laws(law, but="article"), quick=quick)
        found = list(zip(swept, flown_by(executor, fly, swept), strict=True))
    text = maps(found)
    Terminal().tell(text)
    content = {"points": [{**asdict(case), **asdict(one)} for case, one in found]}
    write(json_file, content)
    if out is not None:
        write(out / "robustness.json", content)
        (out / "robustness.md").write_text(text, encoding="utf-8")


@bench.command()
def scale(*, json_file: JsonFile = None, quick: Quick = False) -> None:
    """Fly 4, 10, 30 and 100 vehicles: how the cost grows, and where it goes."""
    result = measure_all(quick=quick)
    table = [
        [
            f"{one['vehicles']}",
            f"{one['real_time_factor']:.1f}",
            f"{one['processor_us_per_vehicle_step']:.0f}",
            f"{one['memory_mb']:.0f}",
            f"{one['guidance_step_us']:.0f}",
            *(
                f"{one['shares'][part]:.0%}"
                for part in ("companion", "decode", "encode", "guidance")
            ),
        ]
        for one in result["sizes"]
    ]
    grows = f"processor time grows with the vehicles to the power {result['exponent']:.2f}"
    Terminal().tell(f"{markdown(SCALE_COLUMNS, table)}\n\n{grows}")
    write(json_file, result)


@bench.command()
@with_plugins
def suite(
    *,
    law: Laws = None,
    json_file: JsonFile = None,
    quick: Quick = False,
    out: Directory = None,
    processes: Processes = None,
    scheduler: Scheduler = None,
) -> None:
    """Fly a hundred fixed scenarios by each law, and give it a score.

    Paths, slots, winds, sensors, links, aircraft, losses, takeovers and orders were drawn once, by a rule
    that docs/suite.md tells. --quick flies ten of them. Exit status: 0 measured, 2 a scenario was changed.
    """
    from vfguide.suite import digest, numbers, with_law

    which, flown = numbers(quick=quick), flown_laws(law)
    for one in which:
        with_law(one, flown[0])
    with executor_on(scheduler, processes) as executor:
        content = scored(
            executor,
            which,
            flown,
            about={"suite": digest()},
            out=None if out is None else out / "suite",
        )
    write(json_file, content)


@bench.command(name="monte-carlo")
@with_plugins
def monte_carlo(
    *,
    formations: Annotated[
        int, typer.Option(metavar="N", min=1, max=100_000, help="How many scenarios.")
    ] = 100,
    law: Laws = None,
    processes: Processes = None,
    seed: Annotated[
        int, typer.Option(metavar="N", min=1, max=4000, help="Of what is drawn and flown.")
    ] = 1,
    json_file: JsonFile = None,
    out: Directory = None,
    scheduler: Scheduler = None,
) -> None:
    """Fly further scenarios, drawn by the rule of the suite, by slot or other laws, and score them."""
    from vfguide.suite import further

    with executor_on(scheduler, processes) as executor:
        content = scored(
            executor,
            further(formations, seed),
            flown_laws(law or ["slot"]),
            about={"seed": seed},
            out=None if out is None else out / "monte-carlo",
        )
    write(json_file, content)


def scored(
    executor: Executor,
    which: range,
    flown: list[str],
    *,
    about: dict[str, Any],
    out: Path | None,
) -> dict[str, Any]:
    """Fly scenarios by laws, tell their scores, and return what goes into JSON.

    Args:
        executor: that flies.
        which: numbers of the scenarios.
        flown: names of the laws.
        about: which scenarios they are, in a word and a value.
        out: where table, picture and JSON go, without their endings; None for nowhere.
    """
    require("scipy", *(PLOTTING if out else ()))
    # Here, because an aircraft's computer has no library that fits distributions.
    from vfguide.lab.studies.suite import (
        draw_scores,
        fly_scenario,
        means,
        shortcomings,
        suite_table,
    )

    tasks = [(one, name) for one in which for name in flown]
    Terminal(stderr=True).tell(f"{len(tasks)} flights, of which each takes some seconds")
    flights = list(flown_by(executor, fly_scenario, tasks))
    of = ", ".join(f"{word} {str(value)[:12]}" for word, value in about.items())
    text = "\n".join(
        [
            f"vfguide {version('vfguide')}, {len(which)} scenarios, {of}",
            "",
            suite_table(flights),
            "",
            *shortcomings(flights, flown[0]),
        ]
    )
    Terminal().tell(text)
    content = {
        **about,
        "laws": means(flights),
        "flights": [msgspec.structs.asdict(one) for one in flights],
    }
    if out is not None:
        write(out.with_suffix(".json"), content)
        out.with_suffix(".md").write_text(text + "\n", encoding="utf-8")
        draw_scores(flights, out.with_suffix(".png"))
    return content


def flown_laws(chosen: Sequence[str] | None, *, but: str | None = None) -> list[str]:
    """The laws that a study flies: those chosen, or else all known but one.

    Raises:
        InputError: there is no law of a chosen name.
    """
    if chosen:
        return [laws.find(name).name for name in chosen]
    return [name for name in laws.names() if name != but]


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


def maps(found: Sequence[tuple[Case, Figures]]) -> str:
    """A table for each sweep and mission: mean error and settling, law by law."""
    parts = []
    flown = {(case.label, case.mission, case.controller): one for case, one in found}
    missions, laws = (list(dict.fromkeys(key[at] for key in flown)) for at in (1, 2))
    for name, sweep in SWEEPS.items():
        for mission in missions:
            table = []
            for value in sweep.values:
                cells = [flown[f"{name} {value:g}", mission, law] for law in laws]
                words = [
                    f"{metres(one.mean_error_m)} m, {seconds(one.settle_10m_s)} s" for one in cells
                ]
                table.append([f"{value:g}", *words])
            parts.append(markdown([f"{mission}: {sweep.title}", *laws], table) + "\n")
    return "\n".join(parts)


def shown(figures: RadioFigures) -> str:
    """The figures of a flight in one cell."""
    errors = f"{figures.mean_error_m:.3f} / {figures.max_error_m:.2f}"
    if figures.air_bytes_s == 0.0:
        return errors
    return f"{errors} / {figures.leader_age_s * 1e3:.0f} / {figures.air_bytes_s:.0f}"
