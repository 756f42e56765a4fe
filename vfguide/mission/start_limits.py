"""Before take-off: does the rehearsal begin, and is it judged, in a sensible way?"""

import math
from collections.abc import Iterator
from itertools import combinations

from vfguide.mission.consistency import LEADER
from vfguide.mission.finding import Finding
from vfguide.mission.flight_path import path_of
from vfguide.mission.model import Mission
from vfguide.mission.starts import follower_start, leader_start

FAR_M = 1000.0
"""A start further away than this (m) takes most of a rehearsal to fly in from."""


def crowded_starts(mission: Mission) -> Iterator[Finding]:
    """Vehicles that begin closer together than they may ever be."""
    places = {LEADER: leader_start(mission)}
    places |= {one.vehicle: follower_start(mission, one.vehicle) for one in mission.followers}
    allowed = mission.acceptance.min_separation_m
    for (other, at_other), (name, here) in combinations(places.items(), 2):
        distance = math.dist(
            (at_other.north_m, at_other.east_m, at_other.up_m),
            (here.north_m, here.east_m, here.up_m),
        )
        if distance < allowed:
            yield Finding(
                "warning",
                ("rehearsal", "start", name),
                f"begins {distance:.1f} m from {other}",
                f"keep starts acceptance.min_separation_m = {allowed:g} m apart",
            )


def distant_starts(mission: Mission) -> Iterator[Finding]:
    """Vehicles that begin so far away that the rehearsal is mostly their way in."""
    begins = leader_start(mission)
    nearest = path_of(mission.path).nearest(
        begins.north_m, begins.east_m, math.radians(begins.course_deg)
    )
    away = abs(nearest.cross_track_error)
    if away > FAR_M:
        yield _distant(LEADER, away, "the path")
    for name, start in mission.rehearsal.start.followers.items():
        displacement = math.hypot(start.forward_m, start.right_m)
        if displacement > FAR_M:
            yield _distant(name, displacement, "its slot")


def _distant(name: str, distance: float, target: str) -> Finding:
    location = ("rehearsal", "start", name)
    message = f"begins {distance:.0f} m from {target}"
    return Finding("warning", location, message, f"begin within {FAR_M:.0f} m of it")


def below_ground(mission: Mission) -> Iterator[Finding]:
    """Slots below the origin's altitude."""
    for index, follower in enumerate(mission.followers):
        height = mission.height_above_origin_m + follower.slot.up_m
        if height <= 0.0:
            yield Finding(
                "error",
                ("followers", index, "slot", "up_m"),
                f"this slot is {-height:g} m below the origin",
                "raise the slot or height_above_origin_m",
            )


def settling_after_the_end(mission: Mission) -> Iterator[Finding]:
    """Settling times that the rehearsal is too short to tell from never settling."""
    duration = mission.rehearsal.duration_s
    for name in ("settle_10m_s", "settle_1m_s"):
        allowed = getattr(mission.acceptance, name)
        if allowed is not None and allowed >= duration:
            message = f"{allowed:g} s is no shorter than the rehearsal of {duration:g} s"
            remedy = "lengthen rehearsal.duration_s or ask for earlier settling"
            yield Finding("warning", ("acceptance", name), message, remedy)
