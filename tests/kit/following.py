"""Steps of a law for one follower, or for a batch, without a mission around it."""

from typing import Any

from vfguide.guidance.formation import Slot
from vfguide.guidance.settings import GuidanceSettings
from vfguide.laws.keeper import FollowerGuidance, SlotKeeper
from vfguide.registry import laws
from vfguide.state import Airframe, LeaderState, VehicleState


def keeper(
    name: str, settings: GuidanceSettings, slot: Slot[Any], airframe: Airframe, **gains: object
) -> SlotKeeper[Any]:
    """A law of this name with its usual gains, but for what is given."""
    law = laws.find(name)
    return SlotKeeper(law(law.Gains(**gains), settings, airframe), slot)


def follower_step(
    state: VehicleState[Any],
    leader: LeaderState[Any],
    slot: Slot[Any],
    settings: GuidanceSettings,
    airframe: Airframe,
    *,
    period: float,
    law: str = "slot",
    **gains: object,
) -> FollowerGuidance[Any]:
    """The first step of a law, with its usual gains but for what is given."""
    return keeper(law, settings, slot, airframe, **gains).step(state, leader, period=period)
