"""Fly drawn scenarios with several laws and score them: `vfguide bench suite` and `monte-carlo`.

A failed flight has no points, others have up to 100. The distance from the slots gives 25 as flown and 25 as
meant, the time to join 20; effort, roll rate and freedom from limits give 10 each. A part of weight w and
value x has w / (1 + x / u) points; x = u gives half of them.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.figures import slot_error
from vfguide.lab.studies.comparison import mean_of
from vfguide.lab.studies.flown import Figures, Row, figures_of, or_nan
from vfguide.record.flight import FlightRecord
from vfguide.suite import with_law

LOST_M, NEAR_M = 50.0, 5.0
"""Final distance from the slot that fails a flight, and least separation below which it fails, m."""

BEATEN_BY = 1.0
"""Points by which another law has to be better in a scenario to be listed."""

HALF_WORTH = {
    "mean_error_m": (25.0, 1.0),
    "intended_error_m": (25.0, 1.0),
    "settle_10m_s": (20.0, 30.0),
    "effort_m_s2": (10.0, 2.0),
    "roll_deg_s": (10.0, 10.0),
}
"""Points of each part and value worth half of them; 10 more points are for setpoints not cut by limits."""

SUITE_COLUMNS = {
    "law": "{case}",
    "score": "{score:.1f} ± {score_half:.1f}",
    "as flown, m": "{flown_m} ± {flown_m_half}",
    "as meant, m": "{meant_m} ± {meant_m_half}",
    "joined after, s": "{joined_s} ± {joined_s_half}",
    "effort, m/s²": "{effort_m_s2} ± {effort_m_s2_half}",
    "roll, °/s": "{roll_deg_s} ± {roll_deg_s_half}",
    "at limits, %": "{limited_percent:.1f} ± {limited_percent_half:.1f}",
    "nearest, m": "{nearest_m}",
    "failed": "{failed:g} of {flights:g}",
}
"""Columns of the table: means ± half of their 95 % intervals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SuiteFlight:
    """Result of one scenario with one law of the followers."""

    scenario: str
    law: str
    failed: str
    """Reason of a failure; empty without one."""
    figures: Figures | None
    """Figures of the flight; None if it raised an error."""

    @property
    def score(self) -> float:
        """Points, 0 to 100; unknown figures have none."""
        if self.failed or self.figures is None:
            return 0.0
        points = 10.0 * (1.0 - self.figures.limited)
        for name, (weight, half) in HALF_WORTH.items():
            value = or_nan(getattr(self.figures, name))
            points += weight / (1.0 + value / half) if math.isfinite(value) else 0.0
        return points


def fly_scenario(task: tuple[int, str]) -> SuiteFlight:
    """Fly a scenario; the task is (number of the scenario, law)."""
    number, law = task
    mission = with_law(number, law)
    try:
        record = fly_rehearsal(mission).record
    except VfguideError as error:
        return SuiteFlight(scenario=mission.name, law=law, failed=str(error), figures=None)
    figures = figures_of(record)
    failed = failure(record, figures.min_separation_m)
    return SuiteFlight(scenario=record.mission, law=law, failed=failed, figures=figures)


def in_figures(flight: SuiteFlight) -> dict[str, Any]:
    """Return a flight with its score, ready for JSON."""
    kept = {"scenario": flight.scenario, "law": flight.law, "failed": flight.failed}
    figures = {} if flight.figures is None else asdict(flight.figures)
    return {**kept, "score": flight.score, **figures}


def failure(record: FlightRecord, nearest_m: float) -> str:
    """Return why a flight failed; empty if it did not."""
    if nearest_m < NEAR_M:
        return f"two aircraft came within {nearest_m:.1f} m"
    for one in record.followers:
        off_m = slot_error(record.reference, one).distance_m
        known = off_m[np.isfinite(off_m)]
        if known.size and known[-1] > LOST_M:
            return f"{one.name} was {known[-1]:.0f} m from its slot at the end"
    return ""


def by_law(flights: Sequence[SuiteFlight]) -> dict[str, list[SuiteFlight]]:
    """Return the flights of each law, laws in order of appearance."""
    found: dict[str, list[SuiteFlight]] = {}
    for one in flights:
        found.setdefault(one.law, []).append(one)
    return found


def means(flights: Sequence[SuiteFlight]) -> list[Row]:
    """Return a row for each law, best score first; score parts leave failed flights out."""
    found: list[tuple[str, dict[str, float]]] = []
    for law, own in by_law(flights).items():
        whole = [one.figures for one in own if one.figures is not None and not one.failed]
        parts = {
            "score": [one.score for one in own],
            "flown_m": [one.mean_error_m for one in whole],
            "meant_m": [one.intended_error_m for one in whole],
            "joined_s": [or_nan(one.settle_10m_s) for one in whole],
            "effort_m_s2": [one.effort_m_s2 for one in whole],
            "roll_deg_s": [one.roll_deg_s for one in whole],
            "limited_percent": [100.0 * one.limited for one in whole],
        }
        figures = dict[str, float]()
        for name, values in parts.items():
            mean, half = mean_of([one for one in values if math.isfinite(one)])
            figures |= {name: mean, f"{name}_half": half}
        nearest = [one.figures.min_separation_m for one in own if one.figures is not None]
        figures["nearest_m"] = min(filter(math.isfinite, nearest), default=math.nan)
        figures |= {"flights": len(own), "failed": len(own) - len(whole)}
        found.append((law, figures))
    return [*sorted(found, key=lambda row: -row[1]["score"])]


def shortcomings(flights: Sequence[SuiteFlight], law: str) -> list[str]:
    """Return a line for each scenario in which a law failed or another was better."""
    laws = by_law(flights)
    lines = []
    for one in laws.get(law, []):
        others = [
            (other.score, name)
            for name, flown in laws.items()
            if name != law
            for other in flown
            if other.scenario == one.scenario
        ]
        best, name = max(others, default=(0.0, ""))
        if one.failed:
            lines.append(f"{one.scenario}: {law} failed: {one.failed}")
        elif best > one.score + BEATEN_BY:
            lines.append(f"{one.scenario}: {law} {one.score:.0f} points, {name} {best:.0f}")
    return lines


def draw_scores(flights: Sequence[SuiteFlight], file: Path) -> None:
    """Draw each law's scores in order, worst scenario first."""
    # Imported here, since it loads the plotting library.
    from matplotlib.figure import Figure

    from vfguide.lab.report.colours import FOLLOWER_COLOURS
    from vfguide.lab.report.style import DOTS_PER_INCH, save_figure

    figure = Figure(figsize=(7.0, 4.0), dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.subplots()
    for (law, own), colour in zip(by_law(flights).items(), FOLLOWER_COLOURS, strict=False):
        scores = sorted(one.score for one in own)
        axes.plot(np.arange(1, len(scores) + 1), scores, color=colour, label=law)
    axes.set(xlabel="scenarios, worst first", ylabel="score", ylim=(0.0, 100.0))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    save_figure(figure, file)
