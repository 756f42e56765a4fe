"""`vfguide bench radio`."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from vfguide.commands.bench_studies import write
from vfguide.commands.terminal import Terminal
from vfguide.lab.studies.flown import executor_on, flown_by
from vfguide.lab.studies.radio import RATES_HZ, SIZES, RadioCase, RadioFigures, fly


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
        found = dict(zip(cases, flown_by(executor, fly, cases), strict=True))
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
