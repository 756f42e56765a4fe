"""Figures of a companion's presence: latencies, leader, battery, and refused messages.

Each series is kept as a few numbers, so that memory stays the same however long it flies.
"""

from collections import Counter

from vfguide.link.presence import BATTERY, BATTERY_VOLTAGE, LEADER_FIGURES
from vfguide.mavlink.reports import SensorsReport
from vfguide.state import HeardState


class Quantiles:
    """Quantiles of the newest values of a series, and its all-time maximum."""

    def __init__(self, size: int = 2000) -> None:
        """Keep `size` newest values."""
        self._size = size
        self._newest: list[float] = []
        self._next = 0
        self.greatest = 0.0
        """Maximum of all values ever, at least 0."""
        self.last: float | None = None
        """Newest value; None before the first."""

    def add(self, value: float) -> None:
        """Note a value."""
        self.last = value
        self.greatest = max(self.greatest, value)
        if len(self._newest) < self._size:
            self._newest.append(value)
        else:
            self._newest[self._next] = value
            self._next = (self._next + 1) % self._size

    def quantiles(self, *shares: float) -> list[float]:
        """Return the quantile of the newest values at each share; empty without values."""
        ordered = sorted(self._newest)
        if not ordered:
            return []
        return [ordered[min(len(ordered) - 1, int(share * len(ordered)))] for share in shares]


def latency_figures(name: str, series: Quantiles) -> dict[str, float]:
    """Return a series of times, s, as figures in ms, whose names begin with `name`."""
    figures = {f"{name}_max": round(series.greatest * 1e3, 3)}
    if series.last is not None:
        figures[f"{name}_last"] = round(series.last * 1e3, 3)
    found = series.quantiles(0.5, 0.99)
    for label, value in zip(("p50", "p99"), found, strict=False):
        figures[f"{name}_{label}"] = round(value * 1e3, 3)
    return figures


def figures_of_leader(leader: HeardState, now: float) -> dict[str, float]:
    """Return age and motion of a leader without a companion, for those who do not hear it."""
    values = (
        now - leader.time_s,
        leader.north,
        leader.east,
        leader.altitude_amsl,
        leader.course,
        leader.ground_speed,
        leader.turn_rate,
    )
    return {name: round(one, 3) for name, one in zip(LEADER_FIGURES, values, strict=True)}


def figures_of_battery(sensors: SensorsReport | None) -> dict[str, float]:
    """Return the battery's charge, %, and voltage, V, as far as the autopilot reports them."""
    if sensors is None:
        return {}
    figures = {}
    if sensors.battery is not None:
        figures[BATTERY] = round(100.0 * sensors.battery, 1)
    if sensors.battery_voltage is not None:
        figures[BATTERY_VOLTAGE] = round(sensors.battery_voltage, 2)
    return figures


def refused_messages(counters: Counter[str]) -> dict[str, float]:
    """Return the counts of refused messages, in all and by reason."""
    found = {
        reason.replace(": ", "_").replace(" ", "_").replace("'", ""): float(count)
        for reason, count in counters.items()
        if reason.startswith("refused: ")
    }
    return {"refused": sum(found.values()), **found}
