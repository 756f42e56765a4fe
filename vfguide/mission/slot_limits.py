"""Before take-off: can every slot be flown within its vehicle's airspeed range?"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.guidance.formation import Slot
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
from vfguide.mission.flight_path import Location
from vfguide.mission.model import Follower, Mission

AIRSPEED_STEPS = 41
"""How finely the leader's airspeed range is searched for one that suits all followers."""

TOLERANCE_M_S = 0.05
"""An airspeed this little out of range is not worth a word."""


@dataclass(frozen=True, slots=True)
class SlotNeed:
    """A follower, and the airspeeds its slot takes while the leader keeps the mission's airspeed."""

    index: int
    follower: Follower
    slot: Slot[float]
    lowest: float
    """m/s."""
    highest: float
    """m/s."""
    range_m_s: tuple[float, float]
    """What its vehicle can fly, m/s."""

    @property
    def location(self) -> Location:
        """Where the mission gives the slot."""
        return ("followers", self.index, "slot")

    @property
    def fits(self) -> bool:
        """Whether the vehicle can fly all of it."""
        least, most = self.range_m_s
        return self.lowest >= least - TOLERANCE_M_S and self.highest <= most + TOLERANCE_M_S

    @property
    def text(self) -> str:
        """The need in words."""
        least, most = self.range_m_s
        return (
            f"this slot needs {self.lowest:.1f} to {self.highest:.1f} m/s of airspeed, "
            f"'{self.follower.vehicle}' flies {least:g} to {most:g}"
        )


def leader_in_wind(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Wind that the leader cannot make way against."""
    strongest = float(np.hypot(conditions.wind_north, conditions.wind_east).max())
    airspeed = mission.leader.airspeed_m_s
    if strongest >= airspeed:
        message = f"the declared wind reaches {strongest:.1f} m/s, the leader's airspeed is {airspeed:g} m/s"
        remedy = "raise leader.airspeed_m_s well above the wind, or wait for less of it"
        yield Finding("error", ("wind",), message, remedy)


def slots_beyond_centre(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Slots that would move backwards on a turn: V_l - omega g_y = V_l (1 - g_y / R) <= 0."""
    for index, follower in enumerate(mission.followers):
        least = float((1.0 - conditions.curvature * follower.slot.right_m).min())
        if least <= 0.0:
            yield Finding(
                "error",
                ("followers", index, "slot", "right_m"),
                "on the turn this slot lies at or beyond the centre, where no aircraft can keep it",
                "move the slot nearer to the leader, or to its other side, or widen the path's turns",
            )


def slots_out_of_airspeed(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Slots that need an airspeed their vehicles do not have, and whether the leader can help."""
    needs = [_need(mission, conditions, index, one) for index, one in enumerate(mission.followers)]
    misfits = [need for need in needs if not need.fits]
    if not misfits:
        return
    lowest, highest = mission.leader_vehicle.airspeed_range_m_s
    cruise = mission.leader.airspeed_m_s
    searched = np.linspace(lowest, highest, AIRSPEED_STEPS)
    airspeeds = np.union1d(searched, [cruise])[:, np.newaxis]
    flyable = [_flyable(conditions, airspeeds, need) for need in needs]
    hopeless = [need for need in misfits if not flyable[need.index].any(axis=0).all()]
    for need in hopeless:
        remedy = "move the slot nearer to the leader, widen the turn or the airspeed range"
        message = f"{need.text}, and no airspeed of the leader changes that"
        yield Finding("error", need.location, message, remedy)
    if hopeless:
        return
    together = np.logical_and.reduce(flyable)
    if not together.any(axis=0).all():
        names = ", ".join(f"'{need.follower.vehicle}'" for need in misfits)
        message = f"no airspeed of the leader suits all slots at once; out of range now: {names}"
        remedy = "bring the slots closer together, widen the turn or the airspeed ranges"
        yield Finding("error", ("followers",), message, remedy)
        return
    given = giving_way(together, airspeeds, cruise)
    yield from (_misfit(mission, need, given) for need in misfits)


def giving_way(flyable: BoolArray, airspeeds: FloatArray, cruise: float) -> tuple[float, float]:
    """(most the leader must fly slower, most it must fly faster) than cruise, m/s, neither negative.

    Args:
        flyable: which airspeed (row) suits every slot in which condition (column).
        airspeeds: the airspeed of each row, m/s, as a column.
        cruise: the leader's airspeed in the mission, m/s.
    """
    change = np.where(flyable, airspeeds - cruise, np.inf)
    nearest = np.take_along_axis(
        change, np.abs(change).argmin(axis=0, keepdims=True), axis=0
    ).ravel()
    return float(-min(nearest.min(), 0.0)), float(max(nearest.max(), 0.0))


def _need(mission: Mission, conditions: Conditions, index: int, follower: Follower) -> SlotNeed:
    slot = Slot(forward=follower.slot.forward_m, right=follower.slot.right_m)
    airspeed = conditions.slot_airspeed(mission.leader.airspeed_m_s, slot)
    span = mission.vehicles[follower.vehicle].airspeed_range_m_s
    return SlotNeed(index, follower, slot, float(airspeed.min()), float(airspeed.max()), span)


def _flyable(conditions: Conditions, airspeeds: FloatArray, need: SlotNeed) -> BoolArray:
    """Which leader airspeed (row) lets the follower keep its slot in which condition (column)."""
    least, most = need.range_m_s
    airspeed = conditions.slot_airspeed(airspeeds, need.slot)
    return (airspeed >= least - TOLERANCE_M_S) & (airspeed <= most + TOLERANCE_M_S)


def _misfit(mission: Mission, need: SlotNeed, given: tuple[float, float]) -> Finding:
    slower, faster = given
    changes = [
        f"{amount:.1f} m/s {way}"
        for amount, way in ((faster, "faster"), (slower, "slower"))
        if amount > 0.0
    ]
    change = " and ".join(changes) or "a little"
    if mission.controller.give_way:
        message = f"{need.text}; the leader gives way by up to {change}"
        remedy = "to keep the leader's airspeed, move the slot nearer to it or widen the turn"
    else:
        message = f"{need.text}, and will fall out of its slot"
        remedy = (
            f"set controller.give_way: true (the leader would fly up to {change}), or move the slot"
        )
    return Finding("warning", need.location, message, remedy)
