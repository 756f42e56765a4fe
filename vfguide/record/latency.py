"""Latencies and resource usage of the programs in a live flight."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field

import numpy as np

from vfguide.elementwise import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Percentiles:
    """Median, 99th percentile and maximum of a series of times, ms."""

    p50: float
    p99: float
    max: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Promptness:
    """Latencies of a companion, or the highest of several; None if not measured."""

    response_ms: Percentiles | None
    """Time from reading a telemetry datagram to sending the setpoints that answer it."""
    leader_age_ms: Percentiles | None
    """Age of the leader state when it was used, on the companion's clock; None for the leader. The
    milliseconds are simulated ones where that clock runs faster than real time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """Resource usage of a process."""

    cpu_share: float
    """Processor time during the flight, as a fraction of one core."""
    rss_mb: float
    """Resident memory, 10^6 bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """Latencies of the companions and usage of the processes in a live flight."""

    vehicles: dict[str, Promptness]
    """Latencies of each companion by vehicle name."""
    processes: dict[str, Usage] = field(default_factory=dict)
    """Usage of each process on the judge's computer."""

    def together(self) -> Promptness:
        """Return the maximum of each figure over all vehicles."""
        every = self.vehicles.values()
        return Promptness(
            response_ms=worst(one.response_ms for one in every),
            leader_age_ms=worst(one.leader_age_ms for one in every),
        )


def worst(series: Iterable[Percentiles | None]) -> Percentiles | None:
    """Return the maximum of each figure; None for an empty series."""
    known = [one for one in series if one is not None]
    if not known:
        return None
    return Percentiles(
        p50=max(one.p50 for one in known),
        p99=max(one.p99 for one in known),
        max=max(one.max for one in known),
    )


def latency_of(
    figures: Mapping[str, Mapping[str, float]],
    *,
    leader: str,
    processes: Mapping[str, Usage] | None = None,
) -> Latency:
    """Return the latencies that companions report in their presence messages, and the processes' usage.

    The leader's own state has no age.
    """
    return Latency(
        vehicles={
            name: Promptness(
                response_ms=_percentiles(said, "response_ms"),
                leader_age_ms=None if name == leader else _percentiles(said, "leader_age_ms"),
            )
            for name, said in figures.items()
        },
        processes=dict(processes or {}),
    )


def recorded_latency(ages_s: Mapping[str, FloatArray]) -> Latency | None:
    """Return the recorded ages of leader states, NaN where none was used; None without any."""
    known = {name: 1e3 * ages[np.isfinite(ages)] for name, ages in ages_s.items()}
    vehicles = {
        name: Promptness(
            response_ms=None,
            leader_age_ms=Percentiles(
                p50=float(np.percentile(ages, 50)),
                p99=float(np.percentile(ages, 99)),
                max=float(ages.max()),
            ),
        )
        for name, ages in known.items()
        if ages.size
    }
    return Latency(vehicles=vehicles) if vehicles else None


def _percentiles(figures: Mapping[str, float], name: str) -> Percentiles | None:
    try:
        values = {key: figures[f"{name}_{key}"] for key in ("p50", "p99", "max")}
    except KeyError:
        return None
    return Percentiles(**values)


def describe_latency(latency: Latency) -> dict[str, object]:
    """Return the latencies as JSON data, the maxima first."""
    return {**asdict(latency.together()), **asdict(latency)}
