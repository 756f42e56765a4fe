"""How high a leader is planned to fly: along its path, in a hold, and from one path's height to another's.

The leader and each of its followers work this out by themselves, from the leader's place; so they climb
together. A change begins when the leader goes over to another path, or from a hold back to its path, with
the height and the climb rate that were planned until then; from the leader's own where that is elsewhere,
as for a companion that was started anew. It is over once the planned height has come to the path's and the
leader is beside the path: on its way there the point of the path that is nearest to it may jump from one
leg to another. While the leader is not steered a change waits at the leader's own height.
"""

import math
from dataclasses import replace

from vfguide.guidance.height import HeightTarget, held_height, path_height
from vfguide.guidance.height_change import (
    ClimbLimits,
    HeightMotion,
    changed_height,
    target_on_the_way,
)
from vfguide.guidance.path import Path, PathPoint
from vfguide.state import LeaderState

BESIDE_M = 30.0
"""A leader that is further away from its path is still on its way to it."""

ELSEWHERE_M = 5.0
"""A leader that is so much higher or lower than it is planned to be changes its height from there."""

LONGEST_S, LONGEST_BACK_S = 60.0, 2.0
"""After a longer silence, or by another clock, a change goes on from where it was."""


class PlannedHeight:
    """Of one leader, as one companion works it out."""

    def __init__(self, limits: ClimbLimits) -> None:
        """Make one for a leader whose path is not known yet.

        Args:
            limits: of the formation.
        """
        self._limits = limits
        self._path: Path | None = None
        self._last: HeightMotion | None = None
        self._changes = False
        self._as_planned = False
        """Whether it was steered, so that it flies what was planned last."""

    @property
    def height(self) -> float | None:
        """As it was planned last, m above the origin; None before the first time."""
        return None if self._last is None else self._last.height

    @property
    def changes(self) -> bool:
        """Whether it goes over to another height, or waits to."""
        return self._changes

    def hold(self, motion: LeaderState[float]) -> HeightTarget:
        """Stay at the height that was planned last, on the circle of a hold.

        Args:
            motion: of the leader, whose height counts for who does not know where the hold began.
        """
        height = motion.height
        if self._last is not None and (self._as_planned or not math.isfinite(height)):
            height = self._last.height
        self._path, self._changes, self._as_planned = None, False, True
        self._last = HeightMotion(time_s=motion.time_s, height=height, climb_rate=0.0)
        return held_height(height)

    def along(
        self,
        path: Path,
        point: PathPoint[float],
        motion: LeaderState[float],
        *,
        flying: float,
        ahead_s: float,
        steered: bool,
    ) -> HeightTarget:
        """The height planned for a leader beside a point of its path.

        Args:
            path: the leader's.
            point: of it, nearest to the leader.
            motion: of the leader at that place.
            flying: the mission's flying height, m above the origin, from which the path's heights count.
            ahead_s: from the motion's time to when a setpoint takes effect, s.
            steered: whether the leader's companion steers it.
        """
        target = path_height(path, point, motion, flying=flying, ahead_s=ahead_s)
        last = self._last
        own = HeightMotion(time_s=motion.time_s, height=motion.height, climb_rate=motion.climb_rate)
        if path is not self._path:
            self._path, self._changes = path, last is not None
            if last is not None and abs(own.height - last.height) > ELSEWHERE_M:
                last = own
        self._as_planned = steered
        if not steered and math.isfinite(own.height):
            # It flies as its pilot wants, and goes on from there.
            self._last = own
            return carried_on(own, ahead_s) if self._changes else target
        if last is None or not self._changes:
            self._last = HeightMotion(
                time_s=motion.time_s, height=target.height, climb_rate=target.climb_rate
            )
            return target
        if not -LONGEST_BACK_S <= motion.time_s - last.time_s <= LONGEST_S:
            last = replace(last, time_s=motion.time_s)
        self._last = changed_height(last, target, motion.time_s, self._limits)
        if self._last.is_at(target) and abs(point.cross_track_error) <= BESIDE_M:
            self._changes = False
        return target_on_the_way(self._last, target, ahead_s, self._limits)


def carried_on(motion: HeightMotion, ahead_s: float) -> HeightTarget:
    """A height that changes on as it does, now and so many seconds (s) ahead."""
    ahead = motion.height + motion.climb_rate * ahead_s
    return HeightTarget(height=motion.height, climb_rate=motion.climb_rate, ahead=ahead)
