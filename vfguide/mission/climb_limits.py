"""Before take-off: can everybody climb as the path does, and fly faster in its slot meanwhile?

The fastest climb that a vehicle keeps up at cruise is its whole excess of power. What a climb leaves of it
is an acceleration a = g (climb_max - climb) / V, all that a follower has to get back into its slot with.
"""

from collections.abc import Iterator

import numpy as np

from vfguide.guidance.airframe import GRAVITY
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
from vfguide.mission.model import Mission

EXCESS_M_S2 = 0.25
"""Less than this, and a follower that has lost 1 m/s takes more than 4 s to get it back."""


def climbs_beyond_limits(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Climbs and descents that are too fast for a vehicle, or that leave it nothing to keep its slot with."""
    rates = conditions.ground_speed(mission.leader.airspeed_m_s) * conditions.slope
    climb, sink = float(np.max(rates, initial=0.0)), float(-np.min(rates, initial=0.0))
    names = {mission.leader.vehicle, *mission.followers_by_name} & set(mission.vehicles)
    for name in sorted(names):
        lowest, highest = mission.vehicles[name].climb_range_m_s
        for needed, limit, doing in ((climb, highest, "climbs"), (sink, -lowest, "descends")):
            yield from _finding(mission, name, needed, limit, doing)


def lowest_of_the_path(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Paths that lead a vehicle of the formation below the origin."""
    lowest = float(np.min(conditions.height, initial=0.0))
    slots = [0.0, *(follower.slot.up_m for follower in mission.followers)]
    height = mission.height_above_origin_m + lowest + min(slots)
    if lowest < 0.0 and height <= 0.0:
        yield Finding(
            "error",
            ("path",),
            f"it leads the lowest vehicle {-height:.0f} m below the origin",
            "raise the lowest height of the path, or height_above_origin_m",
        )


def _finding(
    mission: Mission, name: str, needed: float, limit: float, doing: str
) -> Iterator[Finding]:
    """What to say of one vehicle that climbs or descends at a rate (m/s), and of its limit."""
    if needed <= 0.0:
        return
    location = ("vehicles", name, "climb_range_m_s")
    remedy = "make the path climb less steeply, or fly slower"
    what = f"the path {doing} at up to {needed:.1f} m/s"
    if needed > limit:
        yield Finding("error", location, f"{what}, '{name}' at {limit:g} at most", remedy)
        return
    excess = GRAVITY * (limit - needed) / mission.leader.airspeed_m_s
    if excess < EXCESS_M_S2:
        change = "faster" if doing == "climbs" else "slower"
        yield Finding(
            "warning",
            location,
            f"{what}, which leaves '{name}' {excess:.2f} m/s² to fly {change} for its slot: its height will"
            " give way to that",
            remedy,
        )
