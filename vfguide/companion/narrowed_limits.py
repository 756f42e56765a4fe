"""Limits of the autopilot that are tighter than the mission's, and what the flight takes of them."""

import math
from collections.abc import Callable

import msgspec
import numpy as np

from vfguide.companion.plan import FlightPlan, FollowerTask
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.formation import Slot, slot_velocity
from vfguide.guidance.intended_motion import KnownLeader
from vfguide.guidance.path import Path

PLACES = 500
"""At which a path is looked at for its turns and climbs."""

LEAST = 0.05
"""m/s, or degrees: a limit that is tighter by less is the same one in another unit."""


class FlightDemand(msgspec.Struct, frozen=True, kw_only=True):
    """What a vehicle has to fly on its place in the formation, in still air, the leader at its cruise."""

    bank: float
    """Greatest, rad."""
    slowest: float
    """Airspeed, m/s."""
    fastest: float
    """Airspeed, m/s."""
    climb: float
    """Fastest, m/s; 0 where it never climbs."""
    sink: float
    """Fastest, m/s, above zero."""


class NarrowedLimits(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a mission's limits."""

    sentence: str
    """For the pilot; empty where no limit is tighter."""
    too_tight: bool
    """Whether the place in the formation takes more than a limit that is tighter."""


def flight_demand(path: Path, airspeed: float, slot: Slot) -> FlightDemand:
    """What a slot takes while its leader flies along a path.

    Args:
        path: the leader's.
        airspeed: the leader's cruise, m/s.
        slot: the vehicle's place; at the leader's own for the leader.
    """
    places = path.at(path.outline(PLACES))
    turn_rate = airspeed * np.asarray(places.curvature, dtype=float)
    along, right = slot_velocity(
        np.full_like(turn_rate, airspeed), turn_rate, Slot(forward=slot.forward, right=slot.right)
    )
    speed = np.hypot(along, right)
    climb = airspeed * np.asarray(places.slope, dtype=float)
    return FlightDemand(
        bank=float(np.max(np.arctan(speed * np.abs(turn_rate) / GRAVITY))),
        slowest=float(np.min(speed)),
        fastest=float(np.max(speed)),
        climb=max(float(np.max(climb)), 0.0),
        sink=max(float(-np.min(climb)), 0.0),
    )


def demand_of(plan: FlightPlan) -> FlightDemand | None:
    """What a plan's place takes; None behind a leader whose path is not known."""
    task = plan.task
    if not isinstance(task, FollowerTask):
        return flight_demand(task.path, task.airspeed, Slot(forward=0.0, right=0.0))
    if not isinstance(task.leader, KnownLeader):
        return None
    return flight_demand(task.leader.path, task.leader.airspeed, task.slot)


class Limit(msgspec.Struct, frozen=True):
    """One limit of the mission, and what became of it."""

    words: str
    """With a place for the value that is flown by, and one for the mission's."""
    declared: float
    """The mission's, in the unit of the words."""
    flown: float
    """The one that is flown by."""
    taken: float | None
    """What the flight takes of it; None where that is not known."""
    is_least: bool = False
    """Whether it is a least value: then the higher one is the tighter."""

    @property
    def is_tighter(self) -> bool:
        """Whether less is allowed than the mission allows."""
        return self._beyond(self.declared) > LEAST

    @property
    def is_too_tight(self) -> bool:
        """Whether the flight takes more than is allowed."""
        return self.is_tighter and self.taken is not None and self._beyond(self.taken) > 0.0

    def sentence(self, place: str) -> str:
        """Both values, and what the vehicle's place takes."""
        words = self.words.format(self.flown, self.declared)
        return f"{words} (its {place} takes {self.taken:.3g})" if self.taken else words

    def _beyond(self, value: float) -> float:
        return self.flown - value if self.is_least else value - self.flown


def limits_of(declared: FlightPlan, flown: FlightPlan) -> tuple[Limit, ...]:
    """Every limit of a mission, and what became of it."""
    before, now, demand = declared.airframe, flown.airframe, demand_of(declared)

    def taken(value: Callable[[FlightDemand], float]) -> float | None:
        return None if demand is None else value(demand)

    bank_words = "{:.0f} degrees of bank, not {:.0f}"
    if demand is None:
        radius = now.cruise**2 / (GRAVITY * math.tan(now.max_bank))
        bank_words += f", no turn tighter than {radius:.0f} m at {now.cruise:g} m/s"
    return (
        Limit(
            bank_words,
            math.degrees(before.max_bank),
            math.degrees(now.max_bank),
            taken(lambda one: math.degrees(one.bank)),
        ),
        Limit(
            "up to {:g} m/s, not {:g}",
            before.airspeed_max,
            now.airspeed_max,
            taken(lambda one: one.fastest),
        ),
        Limit(
            "down to {:g} m/s, not {:g}",
            before.airspeed_min,
            now.airspeed_min,
            taken(lambda one: one.slowest),
            is_least=True,
        ),
        Limit(
            "climbs of {:g} m/s, not {:g}",
            before.climb_max,
            now.climb_max,
            taken(lambda one: one.climb),
        ),
        Limit(
            "descents of {:g} m/s, not {:g}",
            before.sink_max,
            now.sink_max,
            taken(lambda one: one.sink),
        ),
    )


def narrowed_limits(declared: FlightPlan, flown: FlightPlan) -> NarrowedLimits:
    """What of a plan's limits became tighter.

    Args:
        declared: with the mission's limits.
        flown: with the tighter ones of mission and autopilot.
    """
    found = [limit for limit in limits_of(declared, flown) if limit.is_tighter]
    if not found:
        return NarrowedLimits(sentence="", too_tight=False)
    place = "path" if flown.leads else "slot"
    too_tight = any(limit.is_too_tight for limit in found)
    cost = (
        f"the {place} cannot be held: raise them, or fly slower and in wider turns"
        if too_tight
        else f"less is left to come back to the {place} with"
    )
    limits = ", ".join(limit.sentence(place) for limit in found)
    return NarrowedLimits(
        sentence=f"tighter than the mission's limits: {limits}; {cost}", too_tight=too_tight
    )
