"""The article's comparison: every law on every mission, ablations of a law, and sweeps.

Every case of the comparison is flown twice: as shipped, and over a bad link with noise. In a sweep one
condition gets worse step by step.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from random import Random
from typing import Any

from vfguide.lab.studies.flown import (
    ARTICLE_ERROR_M,
    MISSIONS,
    Case,
    Changes,
    Figures,
    Row,
    Shown,
    flown_by,
    fly,
    markdown,
    shipped,
)
from vfguide.mission.controller import controller_of
from vfguide.registry import laws

PLANTS = ("heading-hold", "course-hold")

BAD_LINK = {"link_delay_s": 0.2, "link_jitter_s": 0.05, "link_loss": 0.2, "position_noise_m": 0.3}
"""Conditions of the flights over a bad link, which differ by their seed."""

START_SPREAD_M = 25.0
"""Largest random offset of a start over a bad link, on each axis."""

FIGURES = {
    "mean_error_m": "mean_m",
    "p95_error_m": "p95_m",
    "max_error_m": "max_m",
    "settle_10m_s": "settle_10m_s",
    "settle_1m_s": "settle_1m_s",
    "effort_m_s2": "effort_m_s2",
    "course_variation_rad_s": "chatter_rad_s",
    "speed_variation_m_s2": "speed_variation_m_s2",
    "limited": "limited",
    "min_separation_m": "nearest_m",
}
"""Figures of a flight in rows, and their names there."""

LAW_COLUMNS = {
    "mission, law": "{case}",
    "mean, m": "{mean_m}",
    "95 %, m": "{p95_m}",
    "max, m": "{max_m}",
    "10 m, s": "{settle_10m_s:.1f}",
    "1 m, s": "{settle_1m_s:.1f}",
    "effort, m/s²": "{effort_m_s2:.2f}",
    "course back and forth, rad/s": "{chatter_rad_s:.3f}",
    "speed variation, m/s²": "{speed_variation_m_s2:.2f}",
    "cut by limits": "{limited:.1%}",
    "nearest, m": "{nearest_m:.1f}",
    "course-hold, m": "{course_hold_mean_m}",
    "bad link, m": "{bad_link_mean_m} ± {bad_link_mean_m_half}",
}
"""Columns of the long table: errors, settling, control, separation; a dash means never settled."""

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
"""Mission fields that switch one part of the law off."""

QUICK_S, FULL_S = 120.0, 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Extent of the comparison."""

    duration_s: float
    seeds: int
    """Flights over the bad link per mission, law and plant."""
    bad_link_plants: tuple[str, ...]
    """Plants flown over the bad link."""


FULL = Extent(duration_s=300.0, seeds=5, bad_link_plants=PLANTS)
QUICK = Extent(duration_s=60.0, seeds=2, bad_link_plants=PLANTS[:1])


def cases(extent: Extent, laws: Sequence[str]) -> list[Case]:
    """Return all flights of the comparison by these laws."""
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
    """Return the changes for a flight over the bad link, the same for every law with this seed."""
    random = Random(seed)
    starts = shipped(mission).rehearsal.start.model_dump(exclude_unset=True)
    for follower in shipped(mission).followers_by_name:
        for field in ("forward_m", "right_m"):
            starts[follower][field] += random.uniform(-START_SPREAD_M, START_SPREAD_M)
    return {"rehearsal": {**BAD_LINK, "seed": seed, "duration_s": duration_s, "start": starts}}


def compare(executor: Executor, extent: Extent, laws: Sequence[str]) -> Iterator[Row]:
    """Fly the comparison by some laws, and yield a row per mission and law.

    Figures without a prefix are for the mission as shipped on the heading-hold plant; a prefix names another
    plant or link.
    """
    flown = cases(extent, laws)
    return rows(zip(flown, flown_by(executor, fly, flown), strict=True))


def rows(results: Iterable[tuple[Case, Figures]]) -> Iterator[Row]:
    """Combine flights that differ only by plant, link and seed."""
    groups: dict[str, dict[str, list[Figures]]] = {}
    for case, figures in results:
        conditions = [case.plant, case.label.replace(" ", "_")]
        prefix = "".join(
            f"{one.replace('-', '_')}_"
            for one in conditions
            if one not in ("heading-hold", "shipped")
        )
        several = groups.setdefault(f"{case.mission}, {case.controller}", {})
        several.setdefault(prefix, []).append(figures)
    for name, conditions_flown in groups.items():
        found: dict[str, float | None] = {}
        for prefix, figures_flown in conditions_flown.items():
            found |= {f"{prefix}{key}": one for key, one in summed_up(figures_flown).items()}
        yield name, found


def mean_of(values: Sequence[float]) -> tuple[float, float]:
    """Return the mean and half of its 95 % interval by Student's distribution; NaN where unknown."""
    # Imported here, since it takes a third of a second to load.
    from scipy.stats import t as student

    if not values:
        return math.nan, math.nan
    mean, count = sum(values) / len(values), len(values)
    if count == 1:
        return mean, math.nan
    variance = sum((value - mean) ** 2 for value in values) / (count - 1)
    return mean, float(student.ppf(0.975, count - 1)) * math.sqrt(variance / count)


def summed_up(several: Sequence[Figures]) -> dict[str, float | None]:
    """Return means and halves of their 95 % intervals; None where a flight lacks the figure."""
    found: dict[str, float | None] = {}
    for field, name in FIGURES.items():
        values = [getattr(one, field) for one in several]
        known = [value for value in values if value is not None]
        mean, half = mean_of(known) if len(known) == len(values) else (None, None)
        found |= {name: mean, f"{name}_half": half}
    return found


def short_table(compared: Sequence[Row], costs: Sequence[Row]) -> str:
    """Return the article's table: mean errors by mission and law, the best in bold, and a step's cost."""
    found = {case: figures["mean_m"] for case, figures in compared}
    laws = [law for law, _ in costs]
    table: list[Row] = []
    for mission in MISSIONS:
        values = {law: Shown.of(found[f"{mission}, {law}"]) for law in laws}
        best = min(values.values())
        cells = {law: f"**{one:}**" if one == best else f"{one:}" for law, one in values.items()}
        table.append((mission, {"claim": f"{ARTICLE_ERROR_M[mission]:.2f}", **cells}))
    steps = {law: f"{Shown.of(cost['median_us']):.0f} µs" for law, cost in costs}
    table.append(("one guidance step", {"claim": "", **steps}))
    columns = {"mean error, m": "{case}", "article's claim": "{claim}"}
    return markdown(columns | {law: f"{{{law}}}" for law in laws}, table)


def parts_of(law: str) -> list[str]:
    """Return the ablations that apply to a law: those whose fields its `controller:` has.

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
    """Return the flights of a law with each part off, on every mission."""
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


def ablations(executor: Executor, law: str, *, quick: bool) -> Iterator[Row]:
    """Switch off each part of a law in turn, and fly the four missions."""
    flown = ablation_cases(law, quick=quick)
    found: dict[str, dict[str, Figures]] = {}
    for case, one in zip(flown, flown_by(executor, fly, flown), strict=True):
        found.setdefault(case.label, {})[case.mission.replace("-", "_")] = one
    for part, missions in found.items():
        figures: dict[str, float | None] = {
            "chatter_rad_s": max(one.course_variation_rad_s for one in missions.values())
        }
        for mission, one in missions.items():
            figures[mission], figures[f"{mission}_max"] = one.mean_error_m, one.max_error_m
        yield part, figures


ABLATION_COLUMNS: dict[str, str] = {
    "mean / greatest error, m": "{case}",
    **{one: f"{{{one.replace('-', '_')}}} / {{{one.replace('-', '_')}_max}}" for one in MISSIONS},
    "back and forth, rad/s": "{chatter_rad_s:.3f}",
}

SWEEP_QUICK_S, SWEEP_S = 60.0, 120.0

AIRSPEED_M_S = 20.0

SWEPT_MISSIONS = ("line-wind", "circle-wind")


SWEEPS = {
    "delay": ("link delay, s", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "loss": ("link loss", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "noise": ("position noise, m", (0.0, 0.1, 0.3, 0.6, 1.0)),
    "alpha": ("true alpha / declared", (0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "beta": ("true beta / declared", (0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "wind": ("steady wind / airspeed", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
    "rate": ("loop rate, Hz", (5.0, 8.0, 10.0, 20.0, 50.0)),
}
"""Condition that gets worse, with its unit and its values."""


def sweep_cases(laws: Sequence[str], *, quick: bool) -> list[Case]:
    """Return the flights of all sweeps by these laws, with labels such as "link delay, s: 0.2"."""
    duration_s = SWEEP_QUICK_S if quick else SWEEP_S
    return [
        Case(
            mission=mission,
            controller=law,
            changes=swept_changes(name, value, mission, duration_s),
            label=f"{title}: {value:g}",
        )
        for name, (title, values) in SWEEPS.items()
        for mission in (SWEPT_MISSIONS[1:] if quick else SWEPT_MISSIONS)
        for law in laws
        for value in values
    ]


def robustness(executor: Executor, laws: Sequence[str], *, quick: bool) -> Iterator[Row]:
    """Fly all sweeps, and yield mean errors and settling times by law."""
    swept = sweep_cases(laws, quick=quick)
    found: dict[str, dict[str, float | None]] = {}
    for case, one in zip(swept, flown_by(executor, fly, swept), strict=True):
        figures = {case.controller: one.mean_error_m, f"{case.controller}_s": one.settle_10m_s}
        found.setdefault(f"{case.mission}, {case.label}", {}).update(figures)
    yield from found.items()


def swept_changes(sweep: str, value: float, mission: str, duration_s: float) -> Changes:
    """Return the mission fields for one value of a sweep."""
    rehearsal: dict[str, Any] = {"duration_s": duration_s}
    match sweep:
        case "delay":
            rehearsal["link_delay_s"] = value
        case "loss":
            rehearsal["link_loss"] = value
        case "noise":
            rehearsal["position_noise_m"] = value
        case "alpha" | "beta":
            # Vehicles respond faster or slower than their mission declares; companions learn it.
            declared = f"{sweep}_1_s"
            rehearsal["emulator"] = {
                declared: getattr(shipped(mission).leader_vehicle, declared) * value
            }
        case "wind":
            # Toward east: 45 degrees off the line's course, and every angle in turn on the circle.
            speed = value * AIRSPEED_M_S
            wind = {"type": "steady", "speed_m_s": speed, "toward_deg": 90.0}
            return {"rehearsal": rehearsal, "wind": wind}
        case "rate":
            rehearsal["rate_hz"] = value
    return {"rehearsal": rehearsal}
