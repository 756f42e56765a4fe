"""The article's comparison: every law on every mission, the own law without its parts, and sweeps.

Every case of the comparison is flown twice: as shipped, and over a bad link with noise. A sweep has one
condition after the other get worse.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields
from random import Random
from typing import Any

from vfguide.lab.studies.flown import (
    ARTICLE_ERROR_M,
    MISSIONS,
    Case,
    Changes,
    Figures,
    flown_by,
    fly,
    shipped,
)
from vfguide.mission.controller import controller_of
from vfguide.registry import laws

PLANTS = ("heading-hold", "course-hold")

BAD_LINK = {
    "link_delay_s": 0.2,
    "link_jitter_s": 0.05,
    "link_loss": 0.2,
    "position_noise_m": 0.3,
}
"""The conditions of the flights that differ by their seed."""

START_SPREAD_M = 25.0
"""And so do the starts, by up to this on each axis."""

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
"""Columns of the long table: errors, settling, control, separation."""

ABLATIONS: dict[str, dict[str, dict[str, Any]]] = {
    "as shipped": {},
    "no slot motion": {"controller": {"type": "article"}},
    "no integral": {"controller": {"integral_s": 0.0}},
    "no rates of the slot's motion": {"controller": {"rate_feedforward": False}},
    "no wind rate": {"controller": {"wind_feedforward": False}},
    "no wind filter": {"controller": {"wind_filter_s": 0.0}},
    "no filter of the leader's rates": {"controller": {"rate_filter_s": 0.0}},
    "no delay compensation": {"controller": {"predict_leader": False}},
    "no measured leader speed (observer)": {"controller": {"leader_speed_source": "observer"}},
    "boundary layer of the article": {"controller": {"boundary_layer_factor": 0.0}},
    "no position filter": {"controller": {"position_filter_s": 0.0}},
    "no giving way": {"controller": {"give_way": False}},
}
"""Fields of the mission that switch one part off."""

QUICK_S, FULL_S = 120.0, 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """How much is flown."""

    duration_s: float
    """Length of each flight, s."""
    seeds: int
    """Flights over the bad link for each mission, law and plant."""
    bad_link_plants: tuple[str, ...]
    """Plants that are flown over the bad link."""


FULL = Extent(duration_s=300.0, seeds=5, bad_link_plants=PLANTS)
QUICK = Extent(duration_s=60.0, seeds=2, bad_link_plants=PLANTS[:1])


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonRow:
    """One mission, law, plant and condition."""

    mission: str
    """Name of one of the article's four missions."""
    law: str
    """Law of the followers."""
    plant: str
    """Plant of all vehicles: `heading-hold` or `course-hold`."""
    condition: str
    """`shipped` or `bad link`."""
    flights: int
    """Over which the mean is taken."""
    mean: Figures
    """Mean of each figure over the flights; of a settling time None if any flight did not settle."""
    half_width: dict[str, float | None]
    """Half width of each mean's 95 % confidence interval; None for a single flight."""


def cases(extent: Extent, laws: Sequence[str]) -> list[Case]:
    """Everything that is flown, by each of these laws."""
    shipped = [
        Case(
            mission=mission,
            controller=law,
            plant=plant,
            changes={"rehearsal": {"duration_s": extent.duration_s}},
            label="shipped",
        )
        for mission in MISSIONS
        for law in laws
        for plant in PLANTS
    ]
    bad = [
        Case(
            mission=mission,
            controller=law,
            plant=plant,
            changes=seeded(mission, seed, extent.duration_s),
            label="bad link",
        )
        for mission in MISSIONS
        for law in laws
        for plant in extent.bad_link_plants
        for seed in range(1, extent.seeds + 1)
    ]
    return shipped + bad


def seeded(mission: str, seed: int, duration_s: float) -> Changes:
    """A flight over the bad link: noise, losses and starts of this seed, the same for every law."""
    random = Random(seed)
    starts = shipped(mission).rehearsal.start.model_dump(exclude_unset=True)
    for follower in shipped(mission).followers_by_name:
        for field in ("forward_m", "right_m"):
            starts[follower][field] += random.uniform(-START_SPREAD_M, START_SPREAD_M)
    return {"rehearsal": {**BAD_LINK, "seed": seed, "duration_s": duration_s, "start": starts}}


def compare(executor: Executor, extent: Extent, laws: Sequence[str]) -> list[ComparisonRow]:
    """Fly everything by some laws: the rows of the table."""
    flown = cases(extent, laws)
    return list(rows(zip(flown, flown_by(executor, fly, flown), strict=True)))


def rows(results: Iterable[tuple[Case, Figures]]) -> Iterable[ComparisonRow]:
    """One row for all flights that differ by nothing but their seed."""
    groups: dict[tuple[str, str, str, str], list[Figures]] = {}
    for case, figures in results:
        key = (case.mission, case.controller, case.plant, case.label)
        groups.setdefault(key, []).append(figures)
    for (mission, law, plant, condition), several in groups.items():
        mean, half_width = summed_up(several)
        yield ComparisonRow(
            mission=mission,
            law=law,
            plant=plant,
            condition=condition,
            flights=len(several),
            mean=mean,
            half_width=half_width,
        )


def mean_of(values: Sequence[float]) -> tuple[float, float]:
    """Return a mean and half of its 95 % interval by Student's distribution; NaN for what is not known."""
    # Here, because it takes a third of a second to load.
    from scipy.stats import t as student

    if not values:
        return math.nan, math.nan
    mean, count = sum(values) / len(values), len(values)
    if count == 1:
        return mean, math.nan
    variance = sum((value - mean) ** 2 for value in values) / (count - 1)
    return mean, float(student.ppf(0.975, count - 1)) * math.sqrt(variance / count)


def summed_up(several: list[Figures]) -> tuple[Figures, dict[str, float | None]]:
    """Mean and half of the 95 % confidence interval of each figure."""
    means: dict[str, Any] = {}
    halves: dict[str, float | None] = {}
    for field in fields(Figures):
        values = [getattr(one, field.name) for one in several]
        known = [value for value in values if value is not None]
        complete = len(known) == len(values)
        mean, half = mean_of(known)
        means[field.name] = mean if complete else None
        halves[field.name] = half if complete and len(known) > 1 else None
    return Figures(**means), halves


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def metres(value: float | None) -> str:
    """A figure with the digits that it deserves."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.3f}" if value < 1.0 else f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def seconds(value: float | None) -> str:
    """A settling time."""
    return "never" if value is None else f"{value:.1f}"


def short_table(rows: Sequence[ComparisonRow], costs: Mapping[str, Mapping[str, Any]]) -> str:
    """Mean errors by mission and law, the shipped missions on the air-relative plant: the one table."""
    laws = list(dict.fromkeys(row.law for row in rows))
    found = {
        (row.mission, row.law): row.mean.mean_error_m
        for row in rows
        if row.plant == "heading-hold" and row.condition == "shipped"
    }
    table = []
    for mission in MISSIONS:
        values = [found[mission, law] for law in laws]
        best = min(values)
        cells = [f"**{metres(value)}**" if value == best else metres(value) for value in values]
        table.append([mission, f"{ARTICLE_ERROR_M[mission]:.2f}", *cells])
    steps = [f"{costs[law]['median_us']:.0f} µs" for law in laws]
    head = ["mean error, m", "article's claim", *laws]
    return markdown(head, [*table, ["one guidance step", "", *steps]]) + "\n"


def long_table(rows: Sequence[ComparisonRow], plant: str, condition: str) -> str:
    """All figures of one plant and condition."""
    table = []
    for row in rows:
        if (row.plant, row.condition) != (plant, condition):
            continue
        mean, half = row.mean, row.half_width["mean_error_m"]
        spread = f" ± {metres(half)}" if half is not None else ""
        table.append(
            [
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
        )
    return markdown(["mission", "law", *COLUMNS], table) + "\n" if table else ""


def parts_of(law: str) -> list[str]:
    """Names of the ablations that a law has: what is no field of its `controller:` cannot be switched off.

    Raises:
        InputError: there is no such law.
    """
    fields = controller_of({"type": laws.find(law).name})
    return [
        name
        for name, changes in ABLATIONS.items()
        if all(
            hasattr(fields, field) and (field != "type" or law == "slot")
            for field in changes.get("controller", {})
        )
    ]


def ablation_cases(law: str, *, quick: bool) -> list[Case]:
    """Every part of a law off, on every mission."""
    duration_s = QUICK_S if quick else FULL_S
    return [
        Case(
            mission=mission,
            controller=changes.get("controller", {}).get("type", law),
            changes={**changes, "rehearsal": {"duration_s": duration_s}},
            label=name,
        )
        for name in parts_of(law)
        if (changes := ABLATIONS[name]) is not None
        for mission in MISSIONS
    ]


SWEEP_QUICK_S, SWEEP_S = 60.0, 120.0

AIRSPEED_M_S = 20.0

SWEPT_MISSIONS = ("line-wind", "circle-wind")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One thing that gets worse."""

    title: str
    """With its unit."""
    values: tuple[float, ...]
    """From good to bad."""


SWEEPS = {
    "delay": Sweep(title="link delay, s", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "loss": Sweep(title="link loss", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "noise": Sweep(title="position noise, m", values=(0.0, 0.1, 0.3, 0.6, 1.0)),
    "alpha": Sweep(title="true alpha / declared", values=(0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "beta": Sweep(title="true beta / declared", values=(0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "wind": Sweep(title="steady wind / airspeed", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
    "rate": Sweep(title="loop rate, Hz", values=(5.0, 8.0, 10.0, 20.0, 50.0)),
}


def sweep_cases(laws: Sequence[str], *, quick: bool) -> list[Case]:
    """Every flight of every sweep, by each of these laws; a label is such as "delay 0.2"."""
    duration_s = SWEEP_QUICK_S if quick else SWEEP_S
    return [
        Case(
            mission=mission,
            controller=law,
            changes=swept_changes(name, value, mission, duration_s),
            label=f"{name} {value:g}",
        )
        for name, sweep in SWEEPS.items()
        for mission in (SWEPT_MISSIONS[1:] if quick else SWEPT_MISSIONS)
        for law in laws
        for value in sweep.values
    ]


def swept_changes(sweep: str, value: float, mission: str, duration_s: float) -> Changes:
    """Fields of a mission by which one thing is so bad."""
    rehearsal: dict[str, Any] = {"duration_s": duration_s}
    match sweep:
        case "delay":
            rehearsal["link_delay_s"] = value
        case "loss":
            rehearsal["link_loss"] = value
        case "noise":
            rehearsal["position_noise_m"] = value
        case "alpha" | "beta":
            # Vehicles respond faster or slower than their mission says; companions learn it.
            declared = f"{sweep}_1_s"
            rehearsal["emulator"] = {
                declared: getattr(shipped(mission).leader_vehicle, declared) * value
            }
        case "wind":
            # Along the line's course on one side, across it on the other half of the circle.
            speed = value * AIRSPEED_M_S
            wind = {"type": "steady", "speed_m_s": speed, "toward_deg": 90.0}
            return {"rehearsal": rehearsal, "wind": wind}
        case "rate":
            rehearsal["rate_hz"] = value
    return {"rehearsal": rehearsal}
