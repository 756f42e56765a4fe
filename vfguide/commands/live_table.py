"""How a live flight goes while it is flown: a table redrawn in place on a terminal, plain lines elsewhere."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from rich import box
from rich.live import Live
from rich.table import Table
from rich.text import Text

from vfguide.commands.terminal import PLAIN_STEPS, Terminal
from vfguide.link.presence import Presence
from vfguide.record.flight import FlightRecord
from vfguide.report.geometry import slot_error

UNKNOWN = "-"

Show = Callable[[float, "Sequence[Row]"], None]
"""Called with the simulation time and the vehicles, again and again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One vehicle, now."""

    vehicle: str
    """Its name."""
    mode: str
    """Of its companion, as that says; empty before it has said anything."""
    error_m: float | None
    """Distance from slot or path, by true states."""
    ground_speed_m_s: float | None
    """True."""
    leader_age_s: float | None
    """Age of the leader's state when its companion used one last; None for the leader."""


def rows_of(
    names: Sequence[str], record: FlightRecord | None, presences: Mapping[str, Presence]
) -> list[Row]:
    """The vehicles now.

    Args:
        names: of the vehicles, leader first.
        record: the newest true states; None before the first.
        presences: what companions say, by vehicle.
    """
    return [row_of(name, record, presences.get(name)) for name in names]


def row_of(name: str, record: FlightRecord | None, presence: Presence | None) -> Row:
    """One vehicle now."""
    error_m = speed_m_s = age_ms = None
    vehicle = next((one for one in record.vehicles if one.name == name), None) if record else None
    if record is not None and vehicle is not None:
        leads = vehicle is record.leader
        off = (
            abs(vehicle.path_cross_track_error_m)
            if leads
            else slot_error(record.leader, vehicle).distance_m
        )
        error_m, speed_m_s = float(off[-1]), float(vehicle.ground_speed_m_s[-1])
        if presence is not None and not leads:
            age_ms = presence.figures.get("leader_age_ms_last")
    mode = ""
    if presence is not None:
        mode = presence.mode if presence.status == "online" else presence.status
    return Row(
        vehicle=name,
        mode=mode,
        error_m=error_m,
        ground_speed_m_s=speed_m_s,
        leader_age_s=None if age_ms is None else age_ms * 1e-3,
    )


def table_of(title: str, rows: Sequence[Row]) -> Table:
    """The vehicles as a table."""
    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("vehicle")
    table.add_column("mode")
    for heading in ("error, m", "ground speed, m/s", "leader's state, s old"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            Text(row.vehicle),
            Text(row.mode or UNKNOWN),
            digits(row.error_m, 2),
            digits(row.ground_speed_m_s, 1),
            digits(row.leader_age_s, 3),
        )
    return table


def line_of(rows: Sequence[Row]) -> str:
    """The vehicles in one line."""
    return ", ".join(
        f"{row.vehicle} {row.mode or UNKNOWN} {digits(row.error_m, 2)} m off" for row in rows
    )


def digits(value: float | None, decimals: int) -> str:
    """A figure; a dash for one that is not known."""
    return UNKNOWN if value is None else f"{value:.{decimals}f}"


@contextmanager
def live_table(console: Terminal, title: str, duration_s: float) -> Iterator[Show]:
    """Something to call with the time and the vehicles as they change."""
    if not console.is_terminal or console.is_dumb_terminal:
        yield plain_lines(console, title, duration_s)
        return
    with Live(console=console, auto_refresh=False, transient=True) as live:

        def show(now_s: float, rows: Sequence[Row]) -> None:
            heading = f"{title}: {now_s:.0f} of {duration_s:g} s"
            live.update(table_of(heading, rows), refresh=True)

        yield show


def plain_lines(console: Terminal, title: str, duration_s: float) -> Show:
    """A line for each fifth of the flight."""
    shown = 0

    def show(now_s: float, rows: Sequence[Row]) -> None:
        nonlocal shown
        step = int(PLAIN_STEPS * now_s / duration_s)
        if step > shown:
            shown = step
            console.tell(f"{title}: {now_s:g} of {duration_s:g} s: {line_of(rows)}")

    return show
