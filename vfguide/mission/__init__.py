"""Mission files: their fields, their reader and the checks before take-off."""

from vfguide.mission.feasibility import check_mission
from vfguide.mission.finding import Finding, MissionError, MissionSource
from vfguide.mission.load import LoadedMission, load_mission, parse_mission, read_mission
from vfguide.mission.model import Mission

__all__ = [
    "Finding",
    "LoadedMission",
    "Mission",
    "MissionError",
    "MissionSource",
    "check_mission",
    "load_mission",
    "parse_mission",
    "read_mission",
]
