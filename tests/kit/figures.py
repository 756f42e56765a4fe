"""Figures that a benchmark tells as soon as it has them."""

import resource
import sys
from pathlib import Path


def tell(text: object = "") -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def resident_mb() -> float:
    """Memory of this process, 10^6 bytes."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6
