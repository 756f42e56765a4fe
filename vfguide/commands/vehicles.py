"""Vehicles that a command line names."""

from collections.abc import Sequence

from vfguide.errors import InputError
from vfguide.link.address import LinkAddress
from vfguide.mission import Mission


def flying(mission: Mission) -> list[str]:
    """Vehicles that fly in a mission, leader first."""
    return [mission.leader.vehicle, *mission.followers_by_name]


def check_flies(mission: Mission, vehicle: str) -> None:
    """See that a vehicle flies in the mission.

    Raises:
        InputError: it does not.
    """
    if vehicle not in flying(mission):
        raise InputError(
            f"{vehicle!r} does not fly in {mission.name}; one of {', '.join(flying(mission))} does"
        )


def check_deputies(mission: Mission, links: Sequence[LinkAddress]) -> None:
    """See that the links carry what deputies say: a slow radio has no room for it.

    Raises:
        InputError: there are deputies, and a radio.
    """
    if mission.deputies and any(one.scheme == "serial" for one in links):
        raise InputError(
            f"{mission.name}: deputies cannot lead over serial://; use another link, or remove `deputies`"
        )
