"""How high a leader is planned to fly: along its path, in a hold, and from one path's height to another's.

The leader and each of its followers work this out by themselves, from the leader's place; so they climb
together. A change begins when the leader goes over to another path, or from a hold back to its path, with
the height and the climb rate that were planned until then; from the leader's own where that is elsewhere,
and for a companion that learns of the order late, as one that was started anew. It is over once the planned
height has come to the path's and the leader is beside the path: on its way there the point of the path that
is nearest to it may jump from one leg to another. While the leader is not steered a change waits at the
leader's own height. A hold ends a climb evenly, and is as high as that leads.
"""

import math

from msgspec.structs import replace

from vfguide.guidance.height import BesidePath, HeightTarget, held_height, path_height
from vfguide.guidance.height_change import (
    ClimbLimits,
    HeightMotion,
    changed_height,
    stopping_way,
    target_on_the_way,
)
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
        self._beside: BesidePath | None = None
        self._held: float | None = None
        """Height of the hold that is flown, m above the origin."""
        self._last: HeightMotion | None = None
        self._changes = False
        self._as_planned = False
        """Whether it was steered, so that it flies what was planned last."""
        self.began_anew = False
        """Whether what was asked for last began a change at the leader's own height: whatever it flew beside
        the plan before is in the plan now."""

    @property
    def height(self) -> float | None:
        """As it was planned last, m above the origin; None before the first time."""
        return None if self._last is None else self._last.height

    @property
    def changes(self) -> bool:
        """Whether it goes over to another height, or waits to."""
        return self._changes

    def hold(self, motion: LeaderState, *, ahead_s: float, late: bool) -> HeightTarget:
        """The height planned on the circle of a hold: where the climb before has come to rest.

        Args:
            motion: of the leader, whose height counts for who does not know where the hold began.
            ahead_s: from the motion's time to when a setpoint takes effect, s.
            late: whether the order to hold is learned of later than it began.
        """
        self.began_anew = False
        if self._held is None:
            known = self._as_planned and not late
            if self._last is None or (math.isfinite(motion.height) and not known):
                self._begin_anew(motion)
            last = self._last or own_height(motion)
            self._held = last.height + stopping_way(last.climb_rate)
        self._beside, self._as_planned = None, True
        target = held_height(self._held)
        self._follow(target, motion.time_s)
        return self._on_the_way(target, ahead_s)

    def along(self, leader: BesidePath, *, steered: bool, late: bool) -> HeightTarget:
        """The height planned for a leader beside a point of its path.

        Args:
            leader: where it is, and how far ahead is looked.
            steered: whether the leader's companion steers it.
            late: whether the order by which it flies along this path is learned of later than it began.
        """
        target, own = path_height(leader), own_height(leader.motion)
        self._held, self.began_anew = None, False
        before, self._beside = self._beside, leader
        if before is None or leader.path is not before.path:
            last = self._last
            self._changes = last is not None
            elsewhere = last is not None and abs(own.height - last.height) > ELSEWHERE_M
            if elsewhere or (late and math.isfinite(own.height)):
                self._begin_anew(leader.motion)
        self._as_planned = steered
        if not steered and math.isfinite(own.height):
            # It flies as its pilot wants, and goes on from there.
            self._last = own
            return carried_on(own, leader.ahead_s) if self._changes else target
        if self._last is None or not self._changes:
            self._last = HeightMotion(
                time_s=own.time_s, height=target.height, climb_rate=target.climb_rate
            )
            return target
        self._follow(target, own.time_s)
        if abs(leader.point.cross_track_error) > BESIDE_M:
            self._changes = True
        return self._on_the_way(target, leader.ahead_s)

    def _begin_anew(self, motion: LeaderState) -> None:
        """Change the height from the leader's own on."""
        self._last, self._changes, self.began_anew = own_height(motion), True, True

    def _follow(self, target: HeightTarget, time_s: float) -> None:
        """Plan on to a time (s) on the way to a target; a change ends where it has come there."""
        last = self._last
        if last is None:
            return
        if not -LONGEST_BACK_S <= time_s - last.time_s <= LONGEST_S:
            last = replace(last, time_s=time_s)
        self._last = changed_height(last, target, time_s, self._limits)
        self._changes = not self._last.is_at(target)

    def _on_the_way(self, target: HeightTarget, ahead_s: float) -> HeightTarget:
        """What is to be flown now and so many seconds (s) ahead."""
        if self._last is None:
            return target
        return target_on_the_way(self._last, target, ahead_s, self._limits)


def own_height(motion: LeaderState) -> HeightMotion:
    """As a leader flies."""
    return HeightMotion(time_s=motion.time_s, height=motion.height, climb_rate=motion.climb_rate)


def carried_on(motion: HeightMotion, ahead_s: float) -> HeightTarget:
    """A height that changes on as it does, now and so many seconds (s) ahead."""
    ahead = motion.height + motion.climb_rate * ahead_s
    return HeightTarget(height=motion.height, climb_rate=motion.climb_rate, ahead=ahead)
