"""Figures as text, the same for the page and the terminal."""

import math
from dataclasses import dataclass

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from vfguide.lab.report.figures import Spread
from vfguide.lab.report.metrics import (
    FollowerSummary,
    Handling,
    LeaderSummary,
    Summary,
    reject_error,
    reject_separation,
    reject_settling,
)
from vfguide.record.response import VehicleResponse

UNKNOWN = "not measured"
NOT_REQUIRED = "no limit"

LEAST_BANK_DEG = 0.5
"""Least reported difference between learned and declared bank limits, degrees."""


HoldNumbers = tuple[float | None, float | None, float | None]
"""Gain (1/s), dead time (s) and lag (s) of a hold."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedFigure:
    """Figure with the mission's requirement, both as text with units."""

    name: str
    measured: str
    required: str
    met: bool | None
    """Whether the requirement is met; None where there is none."""


def in_digits(value: float | None, unit: str = "") -> str:
    """Format a figure with about three significant digits, never in powers of ten, and its unit."""
    if value is None:
        return UNKNOWN
    size = abs(value)
    decimals = 3 if size < 1.0 else 2 if size < 10.0 else 1 if size < 100.0 else 0
    return f"{value:.{decimals}f} {unit}".rstrip()


def mean_in_digits(spread: Spread | None) -> str:
    """Format the mean of a figure."""
    return in_digits(None if spread is None else spread.mean)


def in_percent(fraction: float | None) -> str:
    """Format a fraction as a percentage."""
    return UNKNOWN if fraction is None else f"{100.0 * fraction:.1f} %"


def in_degrees(angle_rad: float | None) -> str:
    """Format an angle in rad, or an angular rate in rad/s, in degrees."""
    return in_digits(None if angle_rad is None else math.degrees(angle_rad))


def settled_after(settled_s: float | None) -> str:
    """Describe a settling time; None means that a follower was still out."""
    return "still out at the end" if settled_s is None else f"after {settled_s:.1f} s"


def verdict(summary: Summary) -> str:
    """Return the verdict in a word or two."""
    return {True: "Accepted", False: "Not accepted", None: "Not judged"}[summary.accepted]


def why_unjudged(summary: Summary) -> str:
    """Return why there is no verdict, and what to do."""
    if len(summary.vehicles) < 2:
        return "no follower was flown or recorded: there is no formation to judge"
    return "the mission asks for no error: set acceptance in it, such as mean_error_m: 2"


def compare(summary: Summary) -> tuple[ComparedFigure, ...]:
    """Return all figures of the formation with the mission's requirements."""
    formation, wanted = summary.formation, summary.acceptance

    def error(name: str, error_m: float | None, limit_m: float | None = None) -> ComparedFigure:
        asked = None if limit_m is None else f"at most {limit_m:g} m"
        return compared(name, in_digits(error_m, "m"), asked, reject_error(name, error_m, limit_m))

    def settling(distance_m: int, settled_s: float | None, limit_s: float | None) -> ComparedFigure:
        name = f"All within {distance_m} m of their slots"
        asked = None if limit_s is None else f"after at most {limit_s:g} s"
        reason = reject_settling(distance_m, settled_s, limit_s)
        return compared(name, settled_after(settled_s), asked, reason)

    least_m, limit_m = formation.min_separation_m, wanted.min_separation_m
    return (
        error("Mean formation error", formation.mean_error_m, wanted.mean_error_m),
        error(
            "Mean formation error in space, heights included",
            formation.mean_error_3d_m,
            wanted.mean_error_3d_m,
        ),
        error("95 % of formation errors are below", formation.p95_error_m),
        error("Greatest formation error", formation.max_error_m, wanted.max_error_m),
        error(
            "Mean distance from the slot as the path means it, not as gusts turn the leader",
            formation.intended_error_m,
        ),
        settling(10, formation.settle_10m_s, wanted.settle_10m_s),
        settling(1, formation.settle_1m_s, wanted.settle_1m_s),
        compared(
            "Least separation, whole flight",
            in_digits(least_m, "m"),
            f"at least {limit_m:g} m",
            reject_separation(least_m, limit_m),
        ),
    )


def compared(name: str, measured: str, asked: str | None, reason: str | None) -> ComparedFigure:
    """Return a figure with its requirement; it is met where there is no reason against it."""
    met = None if asked is None else reason is None
    return ComparedFigure(
        name=name, measured=measured, required=NOT_REQUIRED if asked is None else asked, met=met
    )


def setting(summary: Summary) -> str:
    """Describe controller, plant, wind and run settings of the flight."""
    return (
        f"controller {summary.controller}, plant {summary.plant}, wind {summary.wind}, "
        f"{summary.mode}, {summary.rate_hz:g} Hz, seed {summary.seed}"
    )


def pace(summary: Summary) -> str:
    """Describe the length of the flight and the real time that it took."""
    flown = f"{summary.duration_s:g} s"
    if summary.wall_s is not None:
        flown += f" in {summary.wall_s:.1f} s"
    if summary.real_time_factor is not None:
        flown += f" ({summary.real_time_factor:.3g} times real time)"
    return flown


def response_words(handling: Handling) -> str | None:
    """Describe the vehicle response used last, compared with the declared one; None where not recorded."""
    flown, declared = handling.response, handling.declared or VehicleResponse()
    if flown is None:
        return None
    parts = [
        hold_words("alpha", course_of(flown), flown.course_spread, course_of(declared)),
        hold_words("beta", speed_of(flown), flown.speed_spread, speed_of(declared)),
    ]
    if flown.turn_efficiency is not None:
        turns = "slips" if flown.slips else "does not slip"
        parts.append(f"turns {flown.turn_efficiency:.2f} of what its bank says: {turns}")
    elif flown.slips:
        parts.append("taken for one that slips")
    bank, said = flown.max_bank_deg, declared.max_bank_deg
    if bank is not None and said is not None and abs(bank - said) >= LEAST_BANK_DEG:
        parts.append(f"banks to {bank:.0f}\u00b0, declared {said:.0f}\u00b0")
    return "; ".join(parts)


def course_of(response: VehicleResponse) -> HoldNumbers:
    """Return the numbers of the course hold."""
    return response.alpha_1_s, response.course_dead_time_s, response.course_lag_s


def speed_of(response: VehicleResponse) -> HoldNumbers:
    """Return the numbers of the speed hold."""
    return response.beta_1_s, response.speed_dead_time_s, response.speed_lag_s


def hold_words(name: str, flown: HoldNumbers, spread: float | None, declared: HoldNumbers) -> str:
    """Describe a hold as flown, with the bounds of its gain, compared with the declared one."""
    gain, dead_time, lag = flown
    if gain is None:
        return f"{name} not told"
    if flown == declared:
        return f"{name} {gain:.2f} as declared"
    bounds = "" if spread is None else f" ({gain / spread:.2f} to {gain * spread:.2f})"
    words = f"{name} {gain:.2f}{bounds}{lateness(dead_time, lag)}"
    if declared[0] is None:
        return f"{words}, not declared"
    return f"{words}, declared {declared[0]:.2f}{lateness(*declared[1:])}"


def lateness(dead_time: float | None, lag: float | None) -> str:
    """Describe the delay of a hold: dead time plus lag, s; empty where there is none."""
    late = (dead_time or 0.0) + (lag or 0.0)
    return f" {late:.2g} s late" if late > 0.0 else ""


def main_error(vehicle: LeaderSummary | FollowerSummary) -> tuple[str, str, str]:
    """Format mean, 95th percentile and maximum of a leader's cross-track or a follower's formation error."""
    error = (
        vehicle.cross_track_error_m
        if isinstance(vehicle, LeaderSummary)
        else vehicle.formation_error_m
    )
    if error is None:
        return UNKNOWN, UNKNOWN, UNKNOWN
    return in_digits(error.mean), in_digits(error.p95), in_digits(error.max)


# Output for a terminal.


def summary_table(summary: Summary) -> Group:
    """Return a table of the errors of each vehicle and the formation, with the verdict below."""
    begin, end = summary.formation.window_s
    table = Table(
        title=Text(summary.mission, style="bold"), title_justify="left", box=box.SIMPLE_HEAD
    )
    table.add_column(Text(f"error in m, {begin:g} to {end:g} s"))
    for heading in ("mean", "95 %", "greatest", "cut by limits", "roll, °/s"):
        table.add_column(heading, justify="right")
    for name, vehicle in summary.vehicles.items():
        of = "path" if isinstance(vehicle, LeaderSummary) else "slot"
        table.add_row(
            Text(f"{name}, from its {of}"),
            *main_error(vehicle),
            in_percent(vehicle.limited_fraction),
            in_degrees(vehicle.roll_rate_rad_s),
        )
    if len(summary.vehicles) > 1:
        formation = summary.formation
        table.add_section()
        table.add_row(
            Text("formation", style="bold"),
            in_digits(formation.mean_error_m),
            in_digits(formation.p95_error_m),
            in_digits(formation.max_error_m),
            "",
            "",
        )
        table.add_row(Text("formation, in space"), in_digits(formation.mean_error_3d_m), *[""] * 4)
        table.add_row(
            Text("formation, as its path means it"),
            in_digits(formation.intended_error_m),
            *[""] * 4,
        )
    # A caption would wrap at the table's width; text below it has the whole terminal.
    return Group(table, verdict_text(summary))


def verdict_text(summary: Summary) -> Text:
    """Return circumstances, settling, separation and verdict, with a line for each rejection."""
    lines = [Text(text, style="dim") for text in (setting(summary), pace(summary))]
    if len(summary.vehicles) > 1:
        formation = summary.formation
        lines.append(
            Text(
                f"within 10 m: {settled_after(formation.settle_10m_s)}; "
                f"within 1 m: {settled_after(formation.settle_1m_s)}; "
                f"least separation: {in_digits(formation.min_separation_m, 'm')}"
            )
        )
    lines += [
        Text(f"{name}: {words}", style="dim")
        for name, vehicle in summary.vehicles.items()
        if (words := response_words(vehicle)) is not None
    ]
    style = {True: "bold green", False: "bold red", None: "bold"}[summary.accepted]
    lines.append(Text(verdict(summary), style=style))
    if summary.accepted is None:
        lines.append(Text(f"  {why_unjudged(summary)}"))
    lines += [Text(f"  {reason}", style="red") for reason in summary.rejections]
    return Text("\n").join(lines)
