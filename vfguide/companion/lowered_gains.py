"""Gains that a mission has chosen and an aircraft does not bear: they are upper bounds, and less is flown."""

import math

import msgspec

from vfguide.companion.plan import FlightPlan, bandwidth_for, follower_law
from vfguide.guidance.bandwidth import FIRM, TOLD
from vfguide.laws.leader import LeaderTask, PathField, steepest_gain

WORTH = 1.05
"""Factor between a gain and what is flown of it from which that is worth a word."""


class LoweredGain(msgspec.Struct, frozen=True, kw_only=True):
    """A gain that is not flown as it is written."""

    name: str
    """Its field."""
    written: float
    """In the mission."""
    flown: float
    """By this aircraft."""

    def sentence(self, who: str = "this aircraft bears") -> str:
        """Return what is flown in its place, and why.

        Args:
            who: does not bear it.
        """
        side = "more" if self.flown < self.written else "less"
        return (
            f"{self.name} {self.written:g} is {side} than {who} ({self.flown:.2g}):"
            f" {self.flown:.2g} is flown"
        )


def lowered_gains(plan: FlightPlan) -> list[LoweredGain]:
    """Return the gains that are not flown as they are written; none while the response is not known."""
    certainty = plan.certainty
    known = max(certainty.course.spread, certainty.speed.spread) < TOLD.spread
    if not known or plan.softness != FIRM or plan.asks_response or not plan.learns:
        return []
    if isinstance(plan.task, LeaderTask):
        gains = plan.task.path_gains
        if not (gains.chosen and issubclass(plan.task.law, PathField)):
            return []
        steepest = steepest_gain(bandwidth_for(plan).course, gains, plan.task.airspeed)
        pairs = [("path.gain", gains.gain, min(gains.gain, steepest))]
    else:
        law = follower_law(plan)
        flown = law.gains if plan.airframe.is_ideal else law.for_speed().gains
        pairs = [
            (name, getattr(plan.gains, name), getattr(flown, name))
            for name in sorted(plan.gains.model_fields_set)
            if isinstance(getattr(plan.gains, name), float)
        ]
    return [
        LoweredGain(name=name, written=written, flown=less)
        for name, written, less in pairs
        if written > 0.0 and less > 0.0 and abs(math.log(less / written)) > math.log(WORTH)
    ]
