"""A leader without a companion: what a mission file may leave out of it, and what has to be right.

Reads plain data, as `consistency` does.
"""

from collections.abc import Mapping

OWN_COMPANION = "companion"
"""`leader.follows` of a leader with a companion, and where a mission does not say."""

DEFAULT_NAME = "leader"
"""What a leader without a companion is called where the mission does not say."""

DEFAULT_AIRSPEED_M_S = 20.0
"""What it is expected to fly where the mission does not say, m/s."""

ADSB_DISTANCE_M = 100.0
"""Slots behind an aircraft that is heard by ADS-B are at least this far from it, level."""


def group(data: object) -> dict[str, object]:
    """A group of fields as a new dictionary; empty where it is none."""
    return dict(data) if isinstance(data, Mapping) else {}


def is_foreign(data: Mapping[str, object]) -> bool:
    """Whether the leader of a mission, given as plain data, has no companion."""
    return group(data.get("leader")).get("follows", OWN_COMPANION) != OWN_COMPANION


def completed(data: object) -> object:
    """A mission with what it may leave out where its leader has no companion; anything else as it is.

    Such a leader needs no entry under `vehicles`, and no path: what it flies is its own affair. A rehearsal
    lets it fly north then.
    """
    if not isinstance(data, Mapping) or not is_foreign(data):
        return data
    leader, vehicles = group(data["leader"]), group(data.get("vehicles"))
    name = leader.setdefault("vehicle", DEFAULT_NAME)
    leader.setdefault("airspeed_m_s", DEFAULT_AIRSPEED_M_S)
    system_id = leader.get("system_id")
    if leader["follows"] == "adsb" and system_id is None:
        system_id = free_id(vehicles)
    if isinstance(name, str) and name not in vehicles and system_id is not None:
        vehicles[name] = {"system_id": system_id}
    path = data.get("path", {"type": "line", "course_deg": 0.0})
    return {**data, "leader": leader, "vehicles": vehicles, "path": path}


def free_id(vehicles: Mapping[str, object]) -> int:
    """A system id that no vehicle has: an aircraft that is heard by ADS-B has none of its own."""
    taken = {group(vehicle).get("system_id") for vehicle in vehicles.values()}
    return next(number for number in range(1, 255) if number not in taken)
