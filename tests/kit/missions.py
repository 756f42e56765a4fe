"""Missions as shipped, and changed where a test wants them otherwise."""

import re
from functools import cache
from pathlib import Path
from typing import Any, Literal

from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.plan import FlightPlan
from vfguide.mission import Mission, MissionError, load_mission, parse_mission
from vfguide.mission.load import LoadedMission

ROOT = Path(__file__).parents[2]
MISSIONS = ROOT / "missions"
MISSION_FILES = sorted(MISSIONS.glob("*.yaml"))

LEAST = """
name: alone
origin: {latitude_deg: 0, longitude_deg: 0, altitude_amsl_m: 0}
path: {type: line, course_deg: 90}
leader: {vehicle: one, airspeed_m_s: 20}
vehicles: {one: {system_id: 1}}
"""
"""A mission's file with everything left out that may be."""

IN_PLACE: dict[str, Any] = {"leader": {"north_m": 0, "east_m": 0}, "f1": {}, "f2": {}, "f3": {}}
"""A start on the path, with everyone in the slot."""

Change = dict[str, Any]


@cache
def shipped(name: str) -> Mission:
    """Load a mission that comes along, by the name of its file."""
    return load_mission(MISSIONS / f"{name}.yaml")


def content_of(name: str | Mission, mode: Literal["python", "json"] = "python") -> Change:
    """Return what is in a mission's file, to be changed."""
    mission = shipped(name) if isinstance(name, str) else name
    return mission.model_dump(mode=mode, exclude_unset=True)


def mission_with(name: str | Mission, /, **sections: Change) -> Mission:
    """Make a mission as valid as if its file said so, with fields of some sections otherwise."""
    content = content_of(name)
    for section, fields in sections.items():
        content[section] = content.get(section, {}) | fields
    return Mission.model_validate(content)


def replaced(name: str | Mission, /, **sections: Any) -> Mission:
    """Make a mission as valid as if its file said so, with other sections in the place of some."""
    return Mission.model_validate(content_of(name) | sections)


def with_vehicle(name: str | Mission, vehicle: str, /, **fields: Any) -> Mission:
    """Make a mission as valid as if its file said so, with fields of one vehicle otherwise."""
    content = content_of(name)
    content["vehicles"][vehicle] |= fields
    return Mission.model_validate(content)


def in_place(name: str, **rehearsal: Any) -> Mission:
    """Make a mission that comes along with everyone in the slot at the beginning."""
    return mission_with(name, rehearsal={"start": IN_PLACE, **rehearsal})


def on_the_circle(**rehearsal: Any) -> Mission:
    """Make the article's circle in wind, with everyone in place and on course at the beginning."""
    leader = {"north_m": 0.0, "east_m": 0.0, "course_deg": 270.0}
    start = IN_PLACE | {"leader": leader}
    return mission_with("circle-wind", rehearsal={"start": start, **rehearsal})


def plan_of(name: str = "line-calm", vehicle: str = "f1") -> FlightPlan:
    """Make the part of a vehicle in a mission that comes along."""
    return flight_plan(shipped(name), vehicle)


def text_of(name: str, *changes: tuple[str, str], controller: str | None = None) -> str:
    """Read the file of a mission that comes along, with some of its words otherwise.

    Args:
        name: of the mission.
        changes: words, and what stands in the first place of each instead, one after the other.
        controller: fields of its section of that name, in one line.
    """
    text = (MISSIONS / f"{name}.yaml").read_text(encoding="utf-8")
    if controller is not None:
        text = re.sub(r"controller: \{[^}]*\}", f"controller: {{{controller}}}", text)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def loaded(content: str | bytes) -> LoadedMission:
    """Load what stands in a mission's file, here called m.yaml."""
    return parse_mission(content.encode() if isinstance(content, str) else content, file="m.yaml")


def faults_of(content: str | bytes) -> list[str]:
    """Return what is wrong in a mission's file, a line each."""
    # Without pytest: benchmarks run where it is not installed.
    try:
        loaded(content)
    except MissionError as error:
        found = error
    else:
        raise AssertionError("nothing is wrong")
    lines = str(found).split("\n")
    assert len(lines) == len(found.faults)
    return lines


def line_of(words: str, text: str) -> int:
    """Return the number of the line in which words stand first."""
    return text[: text.index(words)].count("\n") + 1
