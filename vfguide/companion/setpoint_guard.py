"""Nothing behind this guard depends on the laws: setpoints are finite and inside the vehicle's limits.

Nor on what is heard of a leader's height, or learned of the speed: no height is below the mission's floor.
"""

import math
from collections import Counter

from vfguide.companion.plan import FlightPlan
from vfguide.guidance.height import floor_of
from vfguide.state import Setpoint

PATIENCE_S = 1.0
"""An autopilot holds its last setpoint: after this without any other it is better off by itself."""

STRONGEST_WIND = 0.75
"""Wind over the greatest airspeed that a ground speed is believed with: in more no formation can be flown."""

SLOWEST_GROUND = 0.25
"""Least ground speed over the least airspeed: an aircraft that all but stands in a headwind has no course."""

NO_HEIGHT = (
    "guidance asks for a height that is no number: the last one is held; take over, report the log"
)
"""What the pilot hears then."""


def is_flyable(setpoint: Setpoint[float], plan: FlightPlan) -> bool:
    """Whether a setpoint is finite and its speed one that the vehicle may be asked for."""
    if not (math.isfinite(setpoint.course) and math.isfinite(setpoint.speed)):
        return False
    airframe = plan.airframe
    slowest, fastest = airframe.airspeed_min, airframe.airspeed_max
    if airframe.hold == "course-hold":
        slowest, fastest = SLOWEST_GROUND * slowest, fastest + STRONGEST_WIND * fastest
    return slowest <= setpoint.speed <= fastest


class SetpointGuard:
    """Lets pass what can be flown."""

    def __init__(self, plan: FlightPlan) -> None:
        self._plan = plan
        self._closed_s = math.inf
        self._floor = floor_of(plan.lowest)
        self._height = max(plan.height, self._floor)
        self._has_height = True
        self.counters: Counter[str] = Counter()
        """What did not pass."""

    def closed(self, now: float) -> bool:
        """Whether nothing has passed for so long that the autopilot is better off by itself."""
        return now - self._closed_s > PATIENCE_S

    def pass_on(
        self, setpoint: Setpoint[float] | None, now: float
    ) -> tuple[Setpoint[float] | None, str | None]:
        """(the setpoint if it can be flown, a complaint when one that cannot follows one that could)."""
        if setpoint is None or is_flyable(setpoint, self._plan):
            self._closed_s = math.inf
            return setpoint, None
        self.counters["setpoint not flyable"] += 1
        if math.isfinite(self._closed_s):
            return None, None
        self._closed_s = now
        return None, (
            f"guidance asks for a course of {math.degrees(setpoint.course):.0f} degrees at"
            f" {setpoint.speed:.1f} m/s, which cannot be flown: not passed on, handed back after"
            f" {PATIENCE_S:g} s; take over, and report the log"
        )

    def height(self, asked: float) -> tuple[float, str | None]:
        """(a height that may be asked for, m above the origin; a complaint once guidance has none).

        In its place the last one is held.
        """
        if not math.isfinite(asked):
            self.counters["height not finite"] += 1
            complaint, self._has_height = self._has_height, False
            return self._height, NO_HEIGHT if complaint else None
        if asked < self._floor:
            self.counters["height below the floor"] += 1
        self._has_height, self._height = True, max(asked, self._floor)
        return self._height, None
