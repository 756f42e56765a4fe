"""How quick the programs of a live flight were, and what they took of the computer."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field

import numpy as np

from vfguide.elementwise import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Percentiles:
    """A series of times in three numbers, ms."""

    p50: float
    """Median."""
    p99: float
    """99th percentile."""
    max: float
    """Greatest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Promptness:
    """How quick a companion was, or the slowest of several; None where nothing was measured."""

    response_ms: Percentiles | None
    """From a telemetry datagram that has been read to the setpoints that answer it."""
    leader_age_ms: Percentiles | None
    """Age of the leader's state when it was used, by the companion's clock: simulated milliseconds where
    that runs faster than real time. None for the leader."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """What a process took of the computer."""

    cpu_share: float
    """Processor time during the flight, in parts of one core."""
    rss_mb: float
    """Resident memory, 10^6 bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """How quickly companions of a live flight answered, and what processes took."""

    vehicles: dict[str, Promptness]
    """Each companion by the name of its vehicle."""
    processes: dict[str, Usage] = field(default_factory=dict)
    """Each program, as far as it ran on the judge's computer."""

    def together(self) -> Promptness:
        """The greatest of each figure of any vehicle: no companion was worse."""
        every = self.vehicles.values()
        return Promptness(
            response_ms=worst(one.response_ms for one in every),
            leader_age_ms=worst(one.leader_age_ms for one in every),
        )


def worst(series: Iterable[Percentiles | None]) -> Percentiles | None:
    """The greatest of each figure; None without any."""
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
    """What companions say in their presences, and what their processes took.

    Args:
        figures: of each presence, by vehicle.
        leader: who knows himself: his own state has no age.
        processes: by name, as far as they are known.
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
    """How old the leader's states were that companions have recorded; None where none has.

    Args:
        ages_s: by vehicle, s; NaN where it flew by none.
    """
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
    """Ready for JSON, the greatest figures first."""
    return {**asdict(latency.together()), **asdict(latency)}
