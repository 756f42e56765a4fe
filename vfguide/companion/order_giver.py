"""Gives what a ground station has requested: worked out here, signed by an operator's key."""

import msgspec
from msgspec.structs import replace

from vfguide.formation.arrangement import Arrangement
from vfguide.formation.orders import Order
from vfguide.link.trust import Trust
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import LeaderPlace, formation_of_mission, resolve


class FlownFormation(msgspec.Struct, frozen=True, kw_only=True):
    """What a companion knows of the formation that it flies in."""

    number: int
    """Number of the newest order that anybody flies by."""
    flown: Arrangement | None
    """What is flown; None for the slots of the mission."""
    holder: str
    """Who leads; empty for the mission's leader."""
    leader: LeaderPlace | None
    """Where the leader will be when an order begins; None where it is not heard."""


class OrderGiver:
    """Works out orders of one mission, as the operator whose key it has."""

    def __init__(self, mission: Mission, operator: Trust) -> None:
        """Give nothing yet."""
        self._mission = mission
        self.operator = operator
        """What signs the orders."""

    def resolved(
        self, order: Order, known: FlownFormation, *, number: int, time_s: float
    ) -> Arrangement:
        """The arrangement that an order comes to.

        Args:
            order: what is wanted.
            known: the formation as it is.
            number: of the arrangement.
            time_s: when it begins, s on the formation's clock.

        Raises:
            RefusedOrderError: it cannot be carried out; one sentence says why.
        """
        formation = formation_of_mission(self._mission)
        if known.flown is not None:
            formation = formation.after(known.flown)
        formation = replace(formation, holder=known.holder)
        found, _ = resolve(
            self._mission, order, formation, number=number, time_s=time_s, leader=known.leader
        )
        return found
