"""Figures: told by a benchmark as soon as it has them, and made up for those that sum them up."""

import resource
import sys
from pathlib import Path
from typing import Any

from vfguide.lab.studies.flown import Figures


def tell(text: object = "") -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def resident_mb() -> float:
    """Memory of this process, 10^6 bytes."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def figures_with(**changes: Any) -> Figures:
    """Make the figures of a flight that is half worth in all parts of a score, but for what is given."""
    usual = {
        "mean_error_m": 1.0,
        "intended_error_m": 1.0,
        "p95_error_m": 2.0,
        "max_error_m": 3.0,
        "settle_10m_s": 30.0,
        "settle_1m_s": 40.0,
        "min_separation_m": 12.0,
        "effort_m_s2": 2.0,
        "roll_deg_s": 10.0,
        "course_variation_rad_s": 0.1,
        "speed_variation_m_s2": 0.1,
        "limited": 0.0,
    }
    return Figures(**(usual | changes))
