"""Missions as shipped, and changed where a test wants them otherwise."""

from functools import cache
from pathlib import Path
from typing import Any

from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.plan import FlightPlan
from vfguide.mission import Mission, load_mission

ROOT = Path(__file__).parents[2]
MISSIONS = ROOT / "missions"

IN_PLACE: dict[str, Any] = {"leader": {"north_m": 0, "east_m": 0}, "f1": {}, "f2": {}, "f3": {}}
"""A start on the path, with everyone in the slot."""

Change = dict[str, Any]


@cache
def shipped(name: str) -> Mission:
    """Load a mission that comes along, by the name of its file."""
    return load_mission(MISSIONS / f"{name}.yaml")


def content_of(name: str | Mission) -> Change:
    """Return what is in a mission's file, to be changed."""
    mission = shipped(name) if isinstance(name, str) else name
    return mission.model_dump(exclude_unset=True)


def mission_with(name: str | Mission, /, **sections: Change) -> Mission:
    """Make a mission as valid as if its file said so, with fields of some sections otherwise."""
    content = content_of(name)
    for section, fields in sections.items():
        content[section] = content.get(section, {}) | fields
    return Mission.model_validate(content)


def replaced(name: str | Mission, /, **sections: Any) -> Mission:
    """Make a mission as valid as if its file said so, with other sections in the place of some."""
    return Mission.model_validate(content_of(name) | sections)


def in_place(name: str, **rehearsal: Any) -> Mission:
    """Make a mission that comes along with everyone in the slot at the beginning."""
    return mission_with(name, rehearsal={"start": IN_PLACE, **rehearsal})


def plan_of(name: str = "line-calm", vehicle: str = "f1") -> FlightPlan:
    """Make the part of a vehicle in a mission that comes along."""
    return flight_plan(shipped(name), vehicle)
