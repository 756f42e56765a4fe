"""The article's four missions, as `missions/` ships them, and what a benchmark changes about them."""

from collections.abc import Mapping
from typing import Any, Literal

from vfguide.mission.controller import with_law
from vfguide.mission.model import Mission

MissionName = Literal["line-calm", "line-wind", "circle-calm", "circle-wind"]

MISSIONS: tuple[MissionName, ...] = ("line-calm", "line-wind", "circle-calm", "circle-wind")

ARTICLE_ERROR_M: Mapping[MissionName, float] = {
    "line-calm": 0.85,
    "line-wind": 2.31,
    "circle-calm": 1.12,
    "circle-wind": 2.97,
}
"""Mean errors that the article claims for its field, m."""

AIRCRAFT = {"alpha_1_s": 1.2, "beta_1_s": 0.8, "airspeed_range_m_s": [12, 32], "max_bank_deg": 45}
SLOTS = {"f1": (-20, -20), "f2": (-20, 20), "f3": (-40, 0)}

PATHS: Mapping[str, Mapping[str, Any]] = {
    "line": {
        "type": "line",
        "point": {"north_m": 0, "east_m": 0},
        "course_deg": 45,
        "gain": 0.03,
    },
    "circle": {
        "type": "circle",
        "centre": {"north_m": 150, "east_m": 0},
        "radius_m": 150,
        "direction": "clockwise",
        "gain": 0.015,
    },
}

LEADER_STARTS = {
    "line": {"north_m": -21.2, "east_m": 21.2, "course_deg": 45},
    "circle": {"north_m": 30, "east_m": 0, "course_deg": 270},
}
FOLLOWER_STARTS = {"f1": (-60, -50), "f2": (-50, 60), "f3": (-80, 10)}
"""Displacements from the slots, m ahead and right."""

Changes = Mapping[str, Mapping[str, Any]]
"""Fields to be replaced, by section of the mission."""


def article_mission(
    name: str, changes: Changes | None = None, *, plant: str = "heading-hold"
) -> Mission:
    """One of the four, changed.

    Args:
        name: which.
        changes: fields to be replaced.
        plant: of every vehicle.
    """
    path, _, wind = name.partition("-")
    vehicles = ["leader", *SLOTS]
    content: dict[str, Any] = {
        "name": name,
        "origin": {"latitude_deg": 47.397742, "longitude_deg": 8.545594, "altitude_amsl_m": 488},
        "height_above_origin_m": 100,
        "path": dict(PATHS[path]),
        "leader": {"vehicle": "leader", "airspeed_m_s": 20},
        "followers": [
            {"vehicle": follower, "slot": {"forward_m": ahead, "right_m": right, "up_m": 0}}
            for follower, (ahead, right) in SLOTS.items()
        ],
        "vehicles": {
            vehicle: {"system_id": number, "plant": plant, **AIRCRAFT}
            for number, vehicle in enumerate(vehicles, start=1)
        },
        "controller": {
            "type": "slot",
            "k_x": 0.42,
            "k_y": 0.28,
            "integral_s": 0.65,
            "chi_inf_deg": 45,
            "v_inf_m_s": 8,
            "kappa": 3,
            "epsilon": 0.01,
            "boundary_layer_factor": 4.8,
        },
        "wind": {"type": "article" if wind == "wind" else "calm"},
        "rehearsal": {
            "duration_s": 300,
            "rate_hz": 20,
            "link_delay_s": 0.1,
            "start": {
                "leader": LEADER_STARTS[path],
                **{
                    follower: {"forward_m": ahead, "right_m": right}
                    for follower, (ahead, right) in FOLLOWER_STARTS.items()
                },
            },
        },
    }
    for section, fields in (changes or {}).items():
        before = content.get(section, {})
        if section == "controller" and "type" in fields:
            before = with_law(before, fields["type"])
        content[section] = {**before, **fields}
    return Mission.model_validate(content)
