"""The figures of a flight for a terminal."""

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from vfguide.lab.report.summary import LeaderSummary, Summary
from vfguide.lab.report.wording import (
    in_degrees,
    in_digits,
    in_percent,
    main_error,
    pace,
    response_words,
    setting,
    settled_after,
    verdict,
)


def summary_table(summary: Summary) -> Group:
    """Errors of each vehicle and of the formation, and the verdict with its reasons below."""
    begin, end = summary.formation.window_s
    table = Table(
        title=Text(summary.mission, style="bold"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
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
    # A caption would be wrapped to the table's width; a text below it has the whole terminal.
    return Group(table, verdict_text(summary))


def verdict_text(summary: Summary) -> Text:
    """Circumstances, settling, separation, and the verdict; a line for each reason against it."""
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
    lines.append(Text(verdict(summary), style="bold green" if summary.accepted else "bold red"))
    lines += [Text(f"  {reason}", style="red") for reason in summary.rejections]
    return Text("\n").join(lines)
