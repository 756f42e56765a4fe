"""What latency is required to be, for a reader to hold the measured figures against.

With four companions, their emulators and the broker on two cores at 50 Hz; on a machine that is busy with
something else, or at another rate, the comparison says little.
"""

from typing import Any


def comparison(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Each required figure with the measured one; a figure that could not be measured is None."""
    responses, companions = result["response"]["clients"], result["response"]["companions"]
    ours = [responses[name] for name in companions["names"]]
    ages = {entry["subscribers"]: entry for entry in result["link_age"]}
    rows = [
        ("companion's response, p50", "ms", 0.7, companions.get("p50_ms")),
        ("companion's response, p99", "ms", 3.0, companions.get("p99_ms")),
        ("share of a core, busiest companion", "%", 5.0, greatest(ours, "cpu_percent")),
        ("memory, largest companion", "MB", 80.0, greatest(ours, "memory_mb")),
        ("age on arrival, 3 followers, p99", "ms", 15.0, ages[3].get("p99_ms")),
        ("age on arrival, 100 subscribers, p99", "ms", 40.0, ages[100].get("p99_ms")),
    ]
    return [
        {
            "figure": figure,
            "unit": unit,
            "at_most": at_most,
            "measured": measured,
            "met": measured is not None and measured <= at_most,
        }
        for figure, unit, at_most, measured in rows
    ]


def greatest(entries: list[dict[str, Any]], key: str) -> float | None:
    """The greatest of the figures that there are."""
    return max((float(entry[key]) for entry in entries if key in entry), default=None)
