"""Figures that a benchmark tells as soon as it has them, line by line or as rows of a table."""

import resource
import sys
from pathlib import Path


def tell(text: object = "") -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def heading(*columns: str) -> None:
    """Begin a table."""
    tell(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")


def row(*cells: object) -> None:
    """Tell a row of a table."""
    tell(f"| {' | '.join(map(str, cells))} |")


def cell(value: float | None, width: int = 8) -> str:
    """A figure in a column, or a dash where there is none."""
    if value is None:
        return f"{'-':>{width}}"
    return f"{value:{width}.3f}" if value < 10.0 else f"{value:{width}.1f}"


def resident_mb() -> float:
    """Memory of this process, 10^6 bytes."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6
