"""The flight that latency is measured in: leader and three followers on a circle in the article's wind."""

from pathlib import Path
from typing import Literal

import yaml

from vfguide.mission import Mission

FOLLOWERS = {"f1": (-20.0, -20.0), "f2": (-20.0, 20.0), "f3": (-40.0, 0.0)}
"""Slots, m ahead of and right of the leader."""


def formation(rate_hz: float, autopilot: Literal["ardupilot", "px4"] = "ardupilot") -> Mission:
    """The mission, as `missions/circle-wind.yaml` has it but for the rate."""
    names = ["leader", *FOLLOWERS]
    aircraft = {"alpha_1_s": 1.2, "beta_1_s": 0.8, "airspeed_range_m_s": [12, 32]}
    content = {
        "name": "bench-latency",
        "origin": {"latitude_deg": 47.397742, "longitude_deg": 8.545594, "altitude_amsl_m": 488},
        "height_above_origin_m": 100,
        "path": {
            "type": "circle",
            "centre": {"north_m": 150, "east_m": 0},
            "radius_m": 150,
            "direction": "clockwise",
            "gain": 0.015,
        },
        "leader": {"vehicle": "leader", "airspeed_m_s": 20},
        "followers": [
            {"vehicle": name, "slot": {"forward_m": ahead, "right_m": right, "up_m": 0}}
            for name, (ahead, right) in FOLLOWERS.items()
        ],
        "vehicles": {
            name: {"system_id": number, "autopilot": autopilot, "max_bank_deg": 45, **aircraft}
            for number, name in enumerate(names, start=1)
        },
        "controller": {"type": "slot", "k_x": 0.25, "k_y": 0.25, "kappa": 3, "epsilon": 0.01},
        "wind": {"type": "article"},
        "rehearsal": {
            "rate_hz": rate_hz,
            "start": {"leader": {"north_m": 30, "east_m": 0, "course_deg": 270}},
        },
    }
    return Mission.model_validate(content)


def write_mission(mission: Mission, directory: Path) -> Path:
    """The mission as a file that companions read."""
    path = directory / "mission.yaml"
    content = mission.model_dump(mode="json", exclude_unset=True)
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path
