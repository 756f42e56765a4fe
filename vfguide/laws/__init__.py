"""Parts for laws of followers and leaders, and the laws of vfguide. See docs/own-law.md."""

from vfguide.laws.base import DesiredMotion, Law, View, approach, law
from vfguide.laws.leader import LeaderLaw, LeaderMotion, LeaderView, leader_law
from vfguide.laws.vectors import OBSERVATION, motion_of, observed
from vfguide.mission.finding import Finding
from vfguide.mission.flight_limits import Conditions
from vfguide.mission.model import Mission
from vfguide.mission.quantity import Duration, Gain, NotNegative, Number, Positive, Section, Switch

__all__ = [
    "OBSERVATION",
    "Conditions",
    "DesiredMotion",
    "Duration",
    "Finding",
    "Gain",
    "Law",
    "LeaderLaw",
    "LeaderMotion",
    "LeaderView",
    "Mission",
    "NotNegative",
    "Number",
    "Positive",
    "Section",
    "Switch",
    "View",
    "approach",
    "law",
    "leader_law",
    "motion_of",
    "observed",
]
