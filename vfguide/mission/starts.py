"""Where each vehicle begins a rehearsal: what the mission says, or a default derived from its path.

Local frame: x north, y east (m). Courses are degrees clockwise from north.
"""

import math
from dataclasses import dataclass, replace

from vfguide.mission.flight_path import PathShape, path_of
from vfguide.mission.model import Follower, Mission
from vfguide.mission.rehearsal import FollowerStart

LEADER_OFFSET_M = 30.0
"""How far right of its path a leader begins."""

NEAREST_BEHIND_M, FARTHEST_BEHIND_M = 50.0, 80.0
NEAREST_OUTWARD_M, FARTHEST_OUTWARD_M = 30.0, 60.0


@dataclass(frozen=True, slots=True)
class StartState:
    """A place and a direction to begin from."""

    north_m: float
    """Metres north of the origin."""
    east_m: float
    """Metres east of the origin."""
    up_m: float
    """Metres above the leader's flying height."""
    course_deg: float
    """Course, degrees clockwise from north."""
    climb_m_s: float = 0.0
    """Climb rate, m/s, positive up."""

    def shifted(self, *, forward_m: float, right_m: float, up_m: float = 0.0) -> "StartState":
        """A start in this direction, at a place ahead of, right of and above this one."""
        course = math.radians(self.course_deg)
        return StartState(
            self.north_m + forward_m * math.cos(course) - right_m * math.sin(course),
            self.east_m + forward_m * math.sin(course) + right_m * math.cos(course),
            self.up_m + up_m,
            self.course_deg,
            self.climb_m_s,
        )


def path_beginning(shape: PathShape) -> StartState:
    """The first point of the path and the course of the path there, at the mission's flying height."""
    place = path_of(shape).at(0.0)
    return StartState(place.north, place.east, 0.0, math.degrees(place.course) % 360.0)


def leader_start(mission: Mission) -> StartState:
    """Where the leader begins: as given, or 30 m right of the beginning of its path and along it."""
    beginning = path_beginning(mission.path)
    given = mission.rehearsal.start.leader
    if given is None:
        return beginning.shifted(forward_m=0.0, right_m=LEADER_OFFSET_M)
    course = beginning.course_deg if given.course_deg is None else given.course_deg
    return StartState(given.north_m, given.east_m, given.up_m, course, given.climb_m_s)


def follower_start(mission: Mission, vehicle: str) -> StartState:
    """Where a follower begins: displaced from its slot beside the leader's start.

    Args:
        mission: the mission.
        vehicle: name of the follower's vehicle.
    """
    slot = mission.followers_by_name[vehicle].slot
    given = mission.rehearsal.start.followers.get(vehicle)
    displacement = default_displacement(mission.followers, vehicle) if given is None else given
    start = leader_start(mission).shifted(
        forward_m=slot.forward_m + displacement.forward_m,
        right_m=slot.right_m + displacement.right_m,
        up_m=slot.up_m + displacement.up_m,
    )
    if displacement.course_deg is None:
        return start
    return replace(start, course_deg=displacement.course_deg)


def default_displacement(followers: tuple[Follower, ...], vehicle: str) -> FollowerStart:
    """Out of the slot by 50 to 100 m, away from the leader along and across its course.

    Slots further out are displaced further, so that distances only grow: nobody begins closer to anybody
    than in the formation, and nobody has to pass another on the way in.
    """
    slot = {one.vehicle: one.slot for one in followers}[vehicle]
    forward = _outward(
        slot.forward_m,
        sorted({abs(one.slot.forward_m) for one in followers}),
        NEAREST_BEHIND_M,
        FARTHEST_BEHIND_M,
    )
    right = _outward(
        slot.right_m,
        sorted({abs(one.slot.right_m) for one in followers}),
        NEAREST_OUTWARD_M,
        FARTHEST_OUTWARD_M,
    )
    # a slot beside the leader is left backwards, any other along the side of the leader it lies on
    return FollowerStart(
        forward_m=forward if slot.forward_m > 0.0 else -abs(forward),
        right_m=0.0 if slot.right_m == 0.0 else right,
    )


def _outward(offset: float, distances: list[float], nearest: float, farthest: float) -> float:
    """Displacement with the sign of the offset, growing with the offset's rank among all distances."""
    share = distances.index(abs(offset)) / max(1, len(distances) - 1)
    return math.copysign(nearest + (farthest - nearest) * share, offset)
