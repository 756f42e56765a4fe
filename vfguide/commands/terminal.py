"""Terminal output of commands, progress, and the signals that end a command.

Progress is a bar on a terminal and plain lines elsewhere.
"""

import asyncio
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper, UnsupportedOperation
from pathlib import Path
from types import FrameType
from typing import IO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from vfguide.system import on_signals

PLAIN_STEPS = 5
"""Progress lines of a whole flight where there is no terminal."""

BAR_PERIOD_S = 5.0
"""Virtual time between two movements of the bar."""


NARROWEST = 60
"""Least width of output, columns; a narrower terminal wraps it."""


class Terminal(Console):
    """Standard output or standard error that tolerates a closed pipe."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr)
        # A narrower table is nothing but ellipses, and a width of 0 would show nothing.
        self.width = max(self.width, NARROWEST)

    def tell(self, text: str) -> None:
        """Print one line as it is, neither wrapped nor coloured."""
        self.out(text, highlight=False)

    def on_broken_pipe(self) -> None:
        """Fall silent, as after `| head -1`, where rich would end the program in the middle of a flight."""
        self.quiet = True
        discard(self.file)


def discard(stream: IO[str]) -> None:
    """Discard a stream's buffer and all later output."""
    with suppress(UnsupportedOperation), Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())


def escape_what_cannot_be_encoded() -> None:
    """Print escapes for letters that a terminal cannot encode."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def flight_progress(title: str, duration_s: float) -> Iterator[Callable[[float], None]]:
    """Yield a function that shows the virtual time as it passes."""
    console = Terminal(stderr=True)
    if not console.is_terminal:
        begins_fifth = fifths_of(duration_s)

        def tell(now: float) -> None:
            if begins_fifth(now):
                console.tell(f"{title}: {now:g} of {duration_s:g} s")

        yield tell
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


def fifths_of(duration_s: float) -> Callable[[float], bool]:
    """Return a function that tells whether a time is the first one seen in another fifth of the flight."""
    shown = 0

    def begins_fifth(now: float) -> bool:
        nonlocal shown
        before, shown = shown, max(shown, int(PLAIN_STEPS * now / duration_s))
        return shown > before

    return begins_fifth


def stop_event() -> asyncio.Event:
    """Return an event of the running loop that Ctrl-C or SIGTERM sets, instead of ending the program."""
    stop = asyncio.Event()
    on_signals(stop.set)
    return stop


@contextmanager
def stopped_by_signals() -> Iterator[Callable[[], bool]]:
    """Yield a check for Ctrl-C or SIGTERM, with which a flight ends between two steps and is kept."""
    stopped = False

    def stop(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
