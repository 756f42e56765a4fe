"""The options of `vfguide bench` and of what it measures besides."""

from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.shared_options import directory, with_plugins
from vfguide.extras import PLOTTING, require

# What measures is imported where it is called: every command reads these options, few measure.

bench = typer.Typer(help="Measure on this computer.", rich_markup_mode=None)

JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Where all figures go.")
]
Directory = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Where tables, plots and JSON go.", parser=directory),
]
Quick = Annotated[bool, typer.Option("--quick", help="Shorter flights, and fewer.")]
Law = Annotated[str, typer.Option(metavar="LAW", help="By which followers keep their slots.")]
Laws = Annotated[
    list[str] | None,
    typer.Option("--law", metavar="LAW", help="Fly this one, or several; all known if absent."),
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
    require(*PLOTTING, "osqp", "scipy")
    if context.invoked_subcommand is None:
        from vfguide.commands.bench import compare_laws

        compare_laws(law, quick=quick, json_file=json_file, out=out, scheduler=scheduler)


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
    from vfguide.commands.bench import measure_latency

    measure_latency(seconds=seconds, rate_hz=rate, as_json=as_json)


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
    from vfguide.commands.bench import show_radio

    show_radio(
        seconds=seconds,
        aircraft=aircraft,
        rates_hz=rate,
        followers_hz=followers,
        loss=loss,
        bursts=bursts,
        json_file=json_file,
    )


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
    from vfguide.commands.bench import show_ablations

    show_ablations(law, quick=quick, json_file=json_file, scheduler=scheduler)


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
    from vfguide.commands.bench import show_robustness

    show_robustness(law, quick=quick, json_file=json_file, out=out, scheduler=scheduler)


@bench.command()
def scale(*, json_file: JsonFile = None, quick: Quick = False) -> None:
    """Fly 4, 10, 30 and 100 vehicles: how the cost grows, and where it goes."""
    from vfguide.commands.bench import show_scale

    show_scale(quick=quick, json_file=json_file)


@bench.command(name="monte-carlo")
@with_plugins
def monte_carlo(
    *,
    formations: Annotated[
        int, typer.Option(metavar="N", min=1, help="How many, each in a flight of its own.")
    ] = 100,
    law: Law = "slot",
    processes: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="As many as processors if absent.")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Of everything random.")] = 1,
    json_file: JsonFile = None,
    scheduler: Scheduler = None,
) -> None:
    """Fly formations with random starts, winds, offsets and gains."""
    from vfguide.commands.bench import sample_formations

    sample_formations(
        formations=formations,
        law=law,
        processes=processes,
        seed=seed,
        json_file=json_file,
        scheduler=scheduler,
    )
