"""Robustness: sweeps of one condition after the other."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from vfguide.lab.studies.flown import Case, fly, shipped

QUICK_S, FULL_S = 60.0, 120.0

AIRSPEED_M_S = 20.0

MISSIONS = ("line-wind", "circle-wind")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One thing that gets worse."""

    title: str
    """With its unit."""
    values: tuple[float, ...]
    """From good to bad."""


SWEEPS = {
    "delay": Sweep(title="link delay, s", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "loss": Sweep(title="link loss", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "noise": Sweep(title="position noise, m", values=(0.0, 0.1, 0.3, 0.6, 1.0)),
    "alpha": Sweep(title="true alpha / declared", values=(0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "beta": Sweep(title="true beta / declared", values=(0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "wind": Sweep(title="steady wind / airspeed", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
    "rate": Sweep(title="loop rate, Hz", values=(5.0, 8.0, 10.0, 20.0, 50.0)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepPoint:
    """One flight of a map; can be handed to another process."""

    sweep: str
    """Which of the sweeps."""
    value: float
    """How bad."""
    mission: str
    """What is flown."""
    law: str
    """Name of the law."""
    duration_s: float
    """How long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a flight came to."""

    point: SweepPoint
    """Which."""
    mean_error_m: float
    """Over the last half."""
    max_error_m: float
    """In the last half."""
    settle_10m_s: float | None
    """Last time a follower was 10 m or more out, s; None: at the end still."""
    chatter_rad_s: float
    """Back and forth of the course setpoints."""


def points(laws: Sequence[str], *, quick: bool) -> list[SweepPoint]:
    """Every flight of every map, by each of these laws."""
    return [
        SweepPoint(
            sweep=name,
            value=value,
            mission=mission,
            law=law,
            duration_s=QUICK_S if quick else FULL_S,
        )
        for name, sweep in SWEEPS.items()
        for mission in (MISSIONS[1:] if quick else MISSIONS)
        for law in laws
        for value in sweep.values
    ]


def fly_point(point: SweepPoint) -> Found:
    """Fly one."""
    rehearsal: dict[str, Any] = {"duration_s": point.duration_s}
    changes: dict[str, dict[str, Any]] = {"rehearsal": rehearsal}
    match point.sweep:
        case "delay":
            rehearsal["link_delay_s"] = point.value
        case "loss":
            rehearsal["link_loss"] = point.value
        case "noise":
            rehearsal["position_noise_m"] = point.value
        case "alpha" | "beta":
            # Vehicles respond faster or slower than their mission says; companions learn it.
            declared = f"{point.sweep}_1_s"
            vehicle = shipped(point.mission).leader_vehicle
            rehearsal["emulator"] = {declared: getattr(vehicle, declared) * point.value}
        case "wind":
            # Along the line's course on one side, across it on the other half of the circle.
            speed = point.value * AIRSPEED_M_S
            changes["wind"] = {"type": "steady", "speed_m_s": speed, "toward_deg": 90.0}
        case "rate":
            rehearsal["rate_hz"] = point.value
    figures = fly(Case(mission=point.mission, controller=point.law, changes=changes))
    return Found(
        point=point,
        mean_error_m=figures.mean_error_m,
        max_error_m=figures.max_error_m,
        settle_10m_s=figures.settle_10m_s,
        chatter_rad_s=figures.course_variation_rad_s,
    )
