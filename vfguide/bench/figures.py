"""Series of measured times in a few numbers."""

from collections.abc import Sequence
from typing import Any


def quantile(ordered: Sequence[float], share: float) -> float:
    """The value that this share of a sorted series does not exceed; nearest rank, never interpolated."""
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def figures_of(seconds: Sequence[float]) -> dict[str, Any]:
    """Count, and median, 99th percentile and greatest in milliseconds; no times without any."""
    ordered = sorted(seconds)
    if not ordered:
        return {"count": 0}
    return {
        "count": len(ordered),
        "p50_ms": round(quantile(ordered, 0.5) * 1e3, 3),
        "p99_ms": round(quantile(ordered, 0.99) * 1e3, 3),
        "max_ms": round(ordered[-1] * 1e3, 3),
    }
