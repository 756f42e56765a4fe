"""Progress that is a bar on a terminal and plain lines elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

PLAIN_STEPS = 5
"""Lines that a whole flight takes where there is no terminal."""

BAR_PERIOD_S = 5.0
"""Virtual seconds between two movements of the bar."""


@contextmanager
def flight_progress(
    console: Console, title: str, duration_s: float
) -> Iterator[Callable[[float], None]]:
    """Something to call with the virtual time as it passes."""
    if not console.is_terminal:
        yield plain_progress(console, title, duration_s)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f} s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(title, total=duration_s)
        shown = 0.0

        def show(now: float) -> None:
            nonlocal shown
            if now - shown >= BAR_PERIOD_S:
                shown = now
                bar.update(task, completed=now)

        yield show


def plain_progress(console: Console, title: str, duration_s: float) -> Callable[[float], None]:
    """A line for each fifth of the flight."""
    shown = 0

    def show(now: float) -> None:
        nonlocal shown
        step = int(PLAIN_STEPS * now / duration_s)
        if step > shown:
            shown = step
            console.print(f"{title}: {now:.0f} of {duration_s:.0f} s", highlight=False)

    return show
