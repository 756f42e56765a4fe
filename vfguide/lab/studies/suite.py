"""Drawn scenarios flown by several laws, and their score: `vfguide bench suite` and `monte-carlo`.

A flight has no points if it failed, else up to 100: 25 each for the distance from the slots as flown and as
meant, 20 for the time to join, 10 each for effort, roll rate and freedom from limits. A part of weight w has
w / (1 + x / u) points, where u is worth half of them.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.figures import slot_error
from vfguide.lab.report.metrics import FollowerSummary, summarise
from vfguide.lab.studies.comparison import markdown, mean_of, metres
from vfguide.lab.studies.flown import figures_of, or_nan
from vfguide.record.flight import FlightRecord
from vfguide.suite import with_law

LOST_M, NEAR_M = 50.0, 5.0
"""A follower so far from its slot at the end is lost; two so near have nearly met: either fails a flight."""

BEATEN_BY = 1.0
"""Points by which another law has to be better before a scenario counts as lost to it."""

HALF_WORTH = {
    "mean_error_m": (25.0, 1.0),
    "intended_error_m": (25.0, 1.0),
    "settle_10m_s": (20.0, 30.0),
    "effort_m_s2": (10.0, 2.0),
    "roll_deg_s": (10.0, 10.0),
}
"""Points of each part, and what is worth half of them; the last 10 are the share of setpoints not cut."""

COLUMNS = {
    "score": "score",
    "mean_error_m": "as flown, m",
    "intended_error_m": "as meant, m",
    "settle_10m_s": "joined after, s",
    "effort_m_s2": "effort, m/s²",
    "roll_deg_s": "roll, °/s",
    "limited": "at limits",
}
"""Columns of the table that are means."""


class SuiteFlight(msgspec.Struct, frozen=True, kw_only=True):
    """What one scenario came to by one law; NaN: not measured, or never reached."""

    scenario: str
    """Name of its mission."""
    law: str
    """Law of the followers."""
    failed: str
    """Why it counts as failed; empty if it does not."""
    score: float = 0.0
    """Points, 0 to 100."""
    mean_error_m: float = math.nan
    """Mean distance from the slots, last half of the flight."""
    intended_error_m: float = math.nan
    """The same from the slots as the path means them."""
    settle_10m_s: float = math.nan
    """Last time any follower was 10 m or more from its slot."""
    effort_m_s2: float = math.nan
    """Root mean square of the followers' acceleration through the air."""
    roll_deg_s: float = math.nan
    """Root mean square of their roll rates."""
    limited: float = math.nan
    """Share of their setpoints that a limit cut."""
    nearest_m: float = math.nan
    """Least distance of any two vehicles on the whole flight."""


def fly_scenario(task: tuple[int, str]) -> SuiteFlight:
    """Fly a scenario, by its number, with a law."""
    number, law = task
    mission = with_law(number, law)
    try:
        record = fly_rehearsal(mission).record
    except VfguideError as error:
        return SuiteFlight(scenario=mission.name, law=law, failed=str(error))
    return judged(record, law)


def judged(record: FlightRecord, law: str) -> SuiteFlight:
    """Judge a flight by its record."""
    summary, figures = summarise(record), figures_of(record)
    followers = [one for one in summary.vehicles.values() if isinstance(one, FollowerSummary)]
    rolls = [one.roll_rate_rad_s for one in followers if one.roll_rate_rad_s is not None]
    flight = SuiteFlight(
        scenario=record.mission,
        law=law,
        failed=failure(record, figures.min_separation_m),
        mean_error_m=figures.mean_error_m,
        intended_error_m=or_nan(summary.formation.intended_error_m),
        settle_10m_s=or_nan(figures.settle_10m_s),
        effort_m_s2=figures.effort_m_s2,
        roll_deg_s=math.degrees(float(np.mean(rolls))) if rolls else math.nan,
        limited=figures.limited,
        nearest_m=figures.min_separation_m,
    )
    return msgspec.structs.replace(flight, score=score(flight))


def failure(record: FlightRecord, nearest_m: float) -> str:
    """Say why a flight counts as failed; empty if it does not."""
    if nearest_m < NEAR_M:
        return f"two aircraft came within {nearest_m:.1f} m"
    for one in record.followers:
        off_m = slot_error(record.reference, one).distance_m
        known = off_m[np.isfinite(off_m)]
        if known.size and known[-1] > LOST_M:
            return f"{one.name} was {known[-1]:.0f} m from its slot at the end"
    return ""


def score(flight: SuiteFlight) -> float:
    """Points of a flight, 0 to 100; what is not known has none."""
    if flight.failed:
        return 0.0
    points = 10.0 * (1.0 - flight.limited)
    for name, (weight, half) in HALF_WORTH.items():
        value = getattr(flight, name)
        points += weight / (1.0 + value / half) if math.isfinite(value) else 0.0
    return points


def by_law(flights: Sequence[SuiteFlight]) -> dict[str, list[SuiteFlight]]:
    """The flights of each law, in the order in which laws appear."""
    found: dict[str, list[SuiteFlight]] = {}
    for one in flights:
        found.setdefault(one.law, []).append(one)
    return found


def means(flights: Sequence[SuiteFlight]) -> dict[str, dict[str, Any]]:
    """Means of each law with their intervals: the score over all flights, its parts over those not failed."""
    result: dict[str, dict[str, Any]] = {}
    for law, own in by_law(flights).items():
        whole = [one for one in own if not one.failed]
        found: dict[str, Any] = {}
        for name in COLUMNS:
            values = [getattr(one, name) for one in (own if name == "score" else whole)]
            mean, half = mean_of([one for one in values if math.isfinite(one)])
            found[name] = {"mean": mean, "half_width": half}
        nearest = [one.nearest_m for one in own if math.isfinite(one.nearest_m)]
        found["nearest_m"] = min(nearest, default=math.nan)
        found["flights"], found["failed"] = len(own), len(own) - len(whole)
        result[law] = found
    return result


def suite_table(flights: Sequence[SuiteFlight]) -> str:
    """A row for each law, best score first, in Markdown."""
    found = means(flights)
    rows = [
        [
            law,
            *(spelt(name, **one[name]) for name in COLUMNS),
            metres(one["nearest_m"]),
            f"{one['failed']} of {one['flights']}",
        ]
        for law, one in sorted(found.items(), key=lambda item: -item[1]["score"]["mean"])
    ]
    return markdown(["law", *COLUMNS.values(), "nearest, m", "failed"], rows)


def spelt(name: str, mean: float, half_width: float) -> str:
    """A mean with half of its interval, with the digits that it deserves."""
    if not math.isfinite(mean):
        return "-"
    if name == "limited":
        return f"{mean:.1%} ± {half_width:.1%}"
    if name == "score":
        return f"{mean:.1f} ± {half_width:.1f}"
    return f"{metres(mean)} ± {metres(half_width)}"


def shortcomings(flights: Sequence[SuiteFlight], law: str) -> list[str]:
    """Say where a law failed, and where others were better, a line for each scenario."""
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
    # Here, because it brings the plotting library.
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
