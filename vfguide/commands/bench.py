"""`vfguide bench`: the studies flown and measured, and their tables."""

import json
import os
import platform
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import typer

from vfguide.commands.options import directory_of, with_plugins
from vfguide.commands.terminal import Terminal
from vfguide.errors import PLOTTING, InputError, require
from vfguide.lab.report.metrics import plain_json
from vfguide.lab.studies.comparison import (
    ABLATION_COLUMNS,
    FULL,
    LAW_COLUMNS,
    QUICK,
    compare,
    short_table,
)
from vfguide.lab.studies.comparison import ablations as fly_ablations
from vfguide.lab.studies.comparison import robustness as fly_robustness
from vfguide.lab.studies.flown import Row, executor_on, flown_by, markdown
from vfguide.lab.studies.scale import (
    RATES_HZ,
    SCALE_COLUMNS,
    SIZES,
    growth_exponent,
    radio_columns,
    sizes,
    step_costs,
)
from vfguide.lab.studies.scale import radio as fly_radio
from vfguide.registry import laws
from vfguide.system import require_linux

bench = typer.Typer(help="Measure on this computer.", rich_markup_mode=None)


def study_directory(text: str) -> Path:
    """Parse a directory for results, refusing a file before a long study begins.

    Raises:
        InputError: the name is empty, or that of a file.
    """
    directory = directory_of(text)
    if directory.is_file():
        raise InputError(f"{text}: is a file; give another directory with --out")
    return directory


def study_file(text: str) -> Path:
    """Parse a file for results, refusing a directory before a long study begins.

    Raises:
        InputError: the name is that of a directory.
    """
    if Path(text).is_dir():
        raise InputError(f"{text}: is a directory; name a file with --json")
    return Path(text)


JsonFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="File for all figures.", parser=study_file),
]
Directory = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR", help="Directory for tables, plots and JSON.", parser=study_directory
    ),
]
Quick = Annotated[bool, typer.Option("--quick", help="Fly fewer and shorter flights.")]
Law = Annotated[str, typer.Option(metavar="LAW", help="Law by which followers keep their slots.")]
Laws = Annotated[
    list[str] | None,
    typer.Option(
        "--law", metavar="LAW", help="Law to fly; may be given several times. Default: all."
    ),
]
Processes = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, help="Number of processes; default: one for each processor."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="URL", help="Dask scheduler, such as tcp://host:8786; default: this computer."
    ),
]


@bench.callback(invoke_without_command=True)
@with_plugins
def side_by_side(
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
        rows = list(compare(executor, extent, flown))
    costs, wall_s = list(step_costs(flown)), time.perf_counter() - began
    about = machine()
    heading = (
        f"{about['date']}, {about['processor']}, {about['processors']} processors, Python "
        f"{about['python']}, vfguide {about['vfguide']}: {extent.duration_s:.0f} s flights, "
        f"{wall_s:.0f} s in all"
    )
    tables = [heading, short_table(rows, costs), markdown(LAW_COLUMNS, rows)]
    content = {**asdict(extent), "step_cost": in_json(costs), "wall_s": wall_s}
    publish("bench", tables, {**content, "rows": in_json(rows)}, json_file=json_file, out=out)


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
    # Imported here, since an aircraft's computer lacks the library that measures processes.
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
        typer.Option(
            metavar="N", min=2, max=12, help="Size of a formation; default: 2, 4, 8 and 12."
        ),
    ] = None,
    rate: Annotated[
        list[float] | None,
        typer.Option(
            metavar="HZ", min=0.5, max=20.0, help="Rate of the leader; default: 20, 10, 5 and 2."
        ),
    ] = None,
    followers: Annotated[
        float, typer.Option(metavar="HZ", min=0.5, max=20.0, help="Rate of each follower.")
    ] = 2.5,
    loss: Annotated[
        float, typer.Option(min=0.0, max=0.9, help="Share of packets that a receiver loses.")
    ] = 0.0,
    bursts: Annotated[
        float,
        typer.Option(min=0.0, max=0.9, help="Share of the time in which it loses all packets."),
    ] = 0.0,
    json_file: JsonFile = None,
) -> None:
    """Fly circle-wind over an emulated radio of 57600 baud and 4000 B/s that all share.

    The mean slot error for each size of the formation and each rate of the leader, through MAVLink bytes.
    """
    with executor_on() as executor:
        rows = list(
            fly_radio(
                executor,
                sizes=aircraft or SIZES,
                rates_hz=rate or RATES_HZ,
                followers_hz=followers,
                loss=loss,
                bursts=bursts,
                seconds=seconds,
            )
        )
    title = "mean error, m / greatest error, m / age of the leader's state, ms / bytes a second"
    tables = [title, markdown(radio_columns(aircraft or SIZES), rows)]
    publish("radio", tables, {"rows": in_json(rows)}, json_file=json_file)


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
    with executor_on(scheduler) as executor:
        rows = list(fly_ablations(executor, law, quick=quick))
    content = {"rows": in_json(rows)}
    publish("ablations", [markdown(ABLATION_COLUMNS, rows)], content, json_file=json_file)


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
    flown = flown_laws(law, but="article")
    with executor_on(scheduler) as executor:
        rows = list(fly_robustness(executor, flown, quick=quick))
    columns = {one: f"{{{one}}} m, {{{one}_s:.1f}} s" for one in flown}
    tables = [markdown({"": "{case}"} | columns, rows)]
    publish("robustness", tables, {"rows": in_json(rows)}, json_file=json_file, out=out)


@bench.command()
def scale(*, json_file: JsonFile = None, quick: Quick = False) -> None:
    """Fly 4, 10, 30 and 100 vehicles: how the cost grows, and where it goes."""
    rows = list(sizes(quick=quick))
    exponent = growth_exponent([figures for _, figures in rows])
    grows = f"processor time grows with the vehicles to the power {exponent:.2f}"
    content = {"sizes": in_json(rows), "exponent": exponent}
    publish("scale", [markdown(SCALE_COLUMNS, rows), grows], content, json_file=json_file)


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
        about = {"suite": digest()}
        tell_scores("suite", executor, which, flown, about, json_file=json_file, out=out)


@bench.command(name="monte-carlo")
@with_plugins
def monte_carlo(
    *,
    formations: Annotated[
        int, typer.Option(metavar="N", min=1, max=100_000, help="Number of scenarios.")
    ] = 100,
    law: Laws = None,
    processes: Processes = None,
    seed: Annotated[
        int, typer.Option(metavar="N", min=1, max=4000, help="Seed of what is drawn and flown.")
    ] = 1,
    json_file: JsonFile = None,
    out: Directory = None,
    scheduler: Scheduler = None,
) -> None:
    """Fly further scenarios, drawn by the rule of the suite, by slot or other laws, and score them."""
    from vfguide.suite import further

    which, flown = further(formations, seed), flown_laws(law or ["slot"])
    with executor_on(scheduler, processes) as executor:
        about = {"seed": seed}
        tell_scores("monte-carlo", executor, which, flown, about, json_file=json_file, out=out)


def tell_scores(
    name: str,
    executor: Executor,
    which: range,
    flown: list[str],
    about: Mapping[str, object],
    *,
    json_file: Path | None,
    out: Path | None,
) -> None:
    """Fly scenarios by laws, and print and save their scores.

    Args:
        name: of the study and its files.
        executor: runs the flights.
        which: numbers of the scenarios.
        flown: names of the laws.
        about: identifies the scenarios, by a word and a value.
        json_file: file for all figures.
        out: directory for table, picture and JSON.
    """
    require("scipy", *(PLOTTING if out else ()))
    # Imported here, since an aircraft's computer lacks the library that fits distributions.
    from vfguide.lab.studies.suite import (
        SUITE_COLUMNS,
        draw_scores,
        fly_scenario,
        in_figures,
        means,
        shortcomings,
    )

    tasks = [(one, law) for one in which for law in flown]
    Terminal(stderr=True).tell(f"{len(tasks)} flights, of which each takes some seconds")
    flights = list(flown_by(executor, fly_scenario, tasks))
    of = ", ".join(f"{word} {str(value)[:12]}" for word, value in about.items())
    title = f"vfguide {version('vfguide')}, {len(which)} scenarios, {of}"
    rows = means(flights)
    short = "\n".join(shortcomings(flights, flown[0]))
    content = {**about, "laws": in_json(rows), "flights": [in_figures(one) for one in flights]}
    tables = [title, markdown(SUITE_COLUMNS, rows), short]
    publish(name, tables, content, json_file=json_file, out=out)
    if out is not None:
        draw_scores(flights, out / f"{name}.png")


def flown_laws(chosen: Sequence[str] | None, *, but: str | None = None) -> list[str]:
    """Return the chosen laws, or else all known ones except `but`.

    Raises:
        InputError: a chosen law is unknown.
    """
    if chosen:
        return [laws.find(name).name for name in chosen]
    return [name for name in laws.names() if name != but]


def machine() -> dict[str, Any]:
    """Return date, versions and processor of this computer."""
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": processor(),
        "processors": os.cpu_count(),
        "python": platform.python_version(),
        "system": platform.platform(),
        "vfguide": version("vfguide"),
    }


def processor() -> str:
    """Return the name of the processor, as the system reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def in_json(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return the rows of a study for JSON."""
    return [{"case": case, **figures} for case, figures in rows]


def publish(
    name: str,
    parts: Sequence[str],
    content: Mapping[str, Any],
    *,
    json_file: Path | None,
    out: Path | None = None,
) -> None:
    """Print the results of a study, and save them.

    Args:
        name: of the study, and of its files in `out`.
        parts: its tables, in Markdown.
        content: all figures.
        json_file: file for the figures.
        out: directory for tables and figures.
    """
    text = "\n\n".join(parts)
    Terminal().tell(text)
    known = plain_json({"machine": machine(), **content})
    for file in (json_file, out and out / f"{name}.json"):
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(known, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    if out is not None:
        (out / f"{name}.md").write_text(text + "\n", encoding="utf-8")
