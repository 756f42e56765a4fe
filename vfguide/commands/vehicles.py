"""Vehicles that a command line names."""

from vfguide.errors import InputError
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
