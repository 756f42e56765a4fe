"""The figures of a flight for a terminal."""

from rich import box
from rich.table import Table
from rich.text import Text

from vfguide.report.summary import LeaderSummary, Summary
from vfguide.report.wording import (
    circumstances,
    in_digits,
    in_percent,
    main_error,
    settled_after,
    verdict,
)


def summary_table(summary: Summary) -> Table:
    """Errors of each vehicle and of the formation, and the verdict with its reasons below."""
    begin, end = summary.formation.window_s
    table = Table(
        title=Text(summary.mission, style="bold"),
        caption=verdict_text(summary),
        caption_justify="left",
        title_justify="left",
        box=box.SIMPLE_HEAD,
    )
    table.add_column(Text(f"error in m, {begin:g} to {end:g} s"))
    for heading in ("mean", "95 %", "greatest", "cut by limits"):
        table.add_column(heading, justify="right")
    for name, vehicle in summary.vehicles.items():
        of = "path" if isinstance(vehicle, LeaderSummary) else "slot"
        table.add_row(
            Text(f"{name}, from its {of}"),
            *main_error(vehicle),
            in_percent(vehicle.limited_fraction),
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
        )
    return table


def verdict_text(summary: Summary) -> Text:
    """Settling, separation, circumstances, and the verdict; a line for each reason against it."""
    lines = [Text(circumstances(summary), style="dim")]
    if len(summary.vehicles) > 1:
        formation = summary.formation
        lines.append(
            Text(
                f"all within 10 m {settled_after(formation.settle_10m_s)}, "
                f"within 1 m {settled_after(formation.settle_1m_s)}; "
                f"nearest two vehicles {in_digits(formation.min_separation_m, 'm')}"
            )
        )
    lines.append(Text(verdict(summary), style="bold green" if summary.accepted else "bold red"))
    lines += [Text(f"  {reason}", style="red") for reason in summary.rejections]
    return Text("\n").join(lines)
