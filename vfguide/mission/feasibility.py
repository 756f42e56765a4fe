"""All that can be known about a mission before take-off."""

from collections.abc import Callable, Iterator

from vfguide.mission.conditions import Conditions, conditions_of
from vfguide.mission.finding import Finding, Report, worst_first
from vfguide.mission.location import MissionSource
from vfguide.mission.loop_limits import (
    leader_state_too_old,
    loop_too_slow,
    observer_out_of_tune,
)
from vfguide.mission.model import Mission
from vfguide.mission.separation_limits import distance_kept_from_strays
from vfguide.mission.slot_limits import leader_in_wind, slots_beyond_centre, slots_out_of_airspeed
from vfguide.mission.start_limits import (
    below_ground,
    crowded_starts,
    distant_starts,
    settling_after_the_end,
)
from vfguide.mission.turn_limits import field_beyond_bank, turns_beyond_bank
from vfguide.registry import laws


def findings_of_the_law(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """What the mission's own law says of its gains."""
    if mission.followers:
        yield from laws.find(mission.controller.type).findings(mission, conditions)


OF_THE_MISSION: tuple[Callable[[Mission], Iterator[Finding]], ...] = (
    below_ground,
    loop_too_slow,
    leader_state_too_old,
    observer_out_of_tune,
    crowded_starts,
    distant_starts,
    settling_after_the_end,
)
"""Checks that need no wind."""

OF_THE_GROUND_TRACK: tuple[Callable[[Mission, Conditions], Iterator[Finding]], ...] = (
    slots_beyond_centre,
    turns_beyond_bank,
    slots_out_of_airspeed,
    distance_kept_from_strays,
    field_beyond_bank,
    findings_of_the_law,
)
"""Checks that ask what happens along the path; each needs a leader that can fly it."""


def check_mission(mission: Mission, source: MissionSource | None = None) -> tuple[Finding, ...]:
    """Everything worth knowing before take-off, the worst first.

    Args:
        mission: a mission that agrees with itself.
        source: where its fields stand, so that findings can name lines.
    """
    conditions = conditions_of(mission.path, mission.wind)
    findings = [found for check in OF_THE_MISSION for found in check(mission)]
    hopeless = list(leader_in_wind(mission, conditions))
    findings += hopeless
    for check in () if hopeless else OF_THE_GROUND_TRACK:
        found_on_track = list(check(mission, conditions))
        findings += found_on_track
        if any(one.severity == "error" for one in found_on_track):
            # what follows would only describe the same impossible turn in other words
            break
    if source is not None:
        findings = [one.placed(source) for one in findings]
    return worst_first(findings)


def report_on(mission: Mission, source: MissionSource | None = None) -> Report:
    """The findings of `check_mission` as a report."""
    return Report(check_mission(mission, source))
