"""Where the parts of a mission contradict each other.

The checks read plain data (mappings, lists, numbers) and pass over whatever is missing or of the wrong
kind: so they also work on a file that has other faults, and all faults are reported at once.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from pydantic import BaseModel

from vfguide.formation.arrangement import MAIN_PATH
from vfguide.mission.flight_path import Location, Misfit

# A leader without a companion: what a mission file may leave out of it, and what has to be right.

OWN_COMPANION = "companion"
"""`leader.follows` of a leader with a companion, and where a mission does not say."""

DEFAULT_NAME = "leader"
"""What a leader without a companion is called where the mission does not say."""

DEFAULT_AIRSPEED_M_S = 20.0
"""What it is expected to fly where the mission does not say, m/s."""

ADSB_DISTANCE_M = 100.0
"""Slots behind an aircraft that is heard by ADS-B are at least this far from it, level."""


def group(data: object, *steps: str) -> Mapping[str, Any]:
    """The group of fields at a place of the tree; empty if there is none."""
    for step in steps:
        data = data.get(step) if isinstance(data, Mapping) else None
    if isinstance(data, BaseModel):
        return data.model_dump()
    return data if isinstance(data, Mapping) else {}


def number(value: object) -> float | None:
    """A finite number of a sensible size; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if -1e9 < value < 1e9 else None


def is_foreign(data: Mapping[str, object]) -> bool:
    """Whether the leader of a mission, given as plain data, has no companion."""
    return bool(group(data, "leader").get("follows", OWN_COMPANION) != OWN_COMPANION)


def completed(data: object) -> object:
    """A mission with what it may leave out where its leader has no companion; anything else as it is.

    Such a leader needs no entry under `vehicles`, and no path: what it flies is its own affair. A rehearsal
    lets it fly north then.
    """
    if not isinstance(data, Mapping) or not is_foreign(data):
        return data
    leader, vehicles = dict(group(data, "leader")), dict(group(data, "vehicles"))
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


DEFAULT_MIN_SEPARATION_M = 5.0
"""Least distance between two vehicles (m) where a mission does not say."""

DEFAULT_AIRSPEED_RANGE_M_S = (12.0, 32.0)
"""Lowest and highest airspeed of a vehicle (m/s) where a mission does not say."""

MAX_FOLLOWERS = 253
"""MAVLink has 255 system ids; the leader has one of them, ground stations another."""

MAX_DEPUTIES = 7
"""The last of them leads 2.7 s after a leader has fallen silent, at the earliest."""

GROUND_STATION = 255
"""System id that ground stations have, and no vehicle."""

LEADER = "leader"
"""Key of the leader under `rehearsal.start`, whatever its vehicle is called."""


@dataclass(frozen=True, slots=True)
class _Role:
    """A vehicle's name at the place that gives it something to do."""

    location: Location
    title: str
    vehicle: str


def inconsistencies(data: Mapping[str, object]) -> tuple[Misfit, ...]:
    """All contradictions in a mission given as plain data."""
    checks: tuple[Callable[[Mapping[str, object]], Iterator[Misfit]], ...] = (
        _unknown_vehicles,
        _vehicles_with_two_roles,
        _ambiguous_leader_name,
        _deputies_who_cannot_lead,
        _paths_without_use,
        _contradicting_orders,
        _lost_strangers,
        _emulated_strangers,
        _unused_vehicles,
        _shared_system_ids,
        _crowded_slots,
        _strangers_at_the_start,
        _airspeed_out_of_range,
        _unheard_leader,
        _slots_near_adsb,
        _more_jitter_than_delay,
        _deputies_on_a_radio,
    )
    whole = completed(data)
    return tuple(found for check in checks for found in check(group(whole)))


def _followers(data: Mapping[str, object]) -> list[Mapping[str, object]]:
    """The followers in order, with an empty group for whatever is none."""
    followers = data.get("followers")
    if not isinstance(followers, list | tuple):
        return []
    return [group(one) for one in followers[:MAX_FOLLOWERS]]


def _roles(data: Mapping[str, object]) -> list[_Role]:
    """Everyone who has something to do, the leader first."""
    leader = group(data, "leader").get("vehicle")
    named: list[tuple[Location, str, object]] = [(("leader", "vehicle"), "the leader", leader)]
    for index, follower in enumerate(_followers(data)):
        place = ("followers", index, "vehicle")
        named.append((place, f"followers[{index}]", follower.get("vehicle")))
    return [
        _Role(location, title, vehicle)
        for location, title, vehicle in named
        if isinstance(vehicle, str)
    ]


def _unknown_vehicles(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Roles given to vehicles that are not described."""
    vehicles = group(data, "vehicles")
    if not vehicles:
        return
    for role in _roles(data):
        if role.vehicle not in vehicles:
            known = ", ".join(str(name) for name in vehicles)
            yield Misfit(
                role.location,
                f"there is no vehicle '{role.vehicle}'",
                f"describe it under vehicles, or name one of: {known}",
            )


def _vehicles_with_two_roles(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Vehicles that would have to be in two places."""
    taken: dict[str, str] = {}
    for role in _roles(data):
        if role.vehicle in taken:
            yield Misfit(
                role.location,
                f"'{role.vehicle}' already flies as {taken[role.vehicle]}",
                "give each role a vehicle of its own",
            )
        taken.setdefault(role.vehicle, role.title)


def _ambiguous_leader_name(data: Mapping[str, object]) -> Iterator[Misfit]:
    """A follower with the leader's key, so that its start could not be told from the leader's."""
    for role in _roles(data)[1:]:
        if role.vehicle == LEADER:
            yield Misfit(
                role.location,
                "a follower cannot be called 'leader'",
                "rename this vehicle, here and under vehicles",
            )


def _deputies_who_cannot_lead(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Deputies that do not follow, are named twice, or have no leader with a companion to stand in for."""
    deputies = data.get("deputies")
    if not isinstance(deputies, list | tuple) or not deputies:
        return
    follows = group(data, "leader").get("follows", OWN_COMPANION)
    if follows != OWN_COMPANION:
        yield Misfit(
            ("deputies",),
            f"a leader with `follows: {follows}` has no companion that deputies could hear",
            "remove them, or let the leader have a companion",
        )
    if group(data, "controller").get("leader_speed_source") == "observer":
        yield Misfit(
            ("deputies",),
            "a leader that does not measure its ground speed cannot come back as a follower",
            "write controller.leader_speed_source: measured, or remove the deputies",
        )
    followers = [role.vehicle for role in _roles(data) if role.location[0] == "followers"]
    for index, deputy in enumerate(deputies[:MAX_DEPUTIES]):
        if deputy not in followers:
            yield Misfit(
                ("deputies", index),
                f"'{deputy}' is no follower",
                f"name one of: {', '.join(followers)}" if followers else "remove it",
            )
        elif deputy in deputies[:index]:
            yield Misfit(("deputies", index), f"'{deputy}' is named twice", "remove one")


def _deputies_on_a_radio(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Deputies in a formation that is joined by a radio, which has no room for what they say."""
    if data.get("deputies") and group(data, "rehearsal").get("radio") is not None:
        yield Misfit(
            ("deputies",),
            "deputies cannot lead over a radio (rehearsal.radio)",
            "remove one of the two",
        )


def _paths_without_use(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Other paths that cannot be ordered: of the first's name, or of a leader without a companion."""
    others = group(data, "paths")
    follows = group(data, "leader").get("follows", OWN_COMPANION)
    if others and follows != OWN_COMPANION:
        yield Misfit(
            ("paths",),
            f"a leader with `follows: {follows}` flies no path that is ordered",
            "remove them, or let the leader have a companion",
        )
    if MAIN_PATH in others:
        yield Misfit(("paths", MAIN_PATH), "`main` is the name of `path`", "give it another name")


def _contradicting_orders(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Orders of the time table for one time, and of followers that are not where the order needs them."""
    orders = data.get("orders")
    if not isinstance(orders, list | tuple):
        return
    present = {role.vehicle for role in _roles(data) if role.location[0] == "followers"}
    followers = set(present)
    before: float | None = None
    for index, one in enumerate(orders):
        order = group(one)
        time_s = number(order.get("at_s"))
        if time_s is not None and before is not None and time_s <= before:
            yield Misfit(
                ("orders", index, "at_s"),
                f"{time_s:g} s is no later than the {before:g} s of the order before",
                "put orders in the order of their times, one for each time",
            )
        before = before if time_s is None else time_s
        for field, named in _named_in(order):
            wrong = [name for name in named if (name in present) is (field == "join")]
            for name in wrong:
                place = ("orders", index, field)
                yield _misplaced(place, name, followers, joins=field == "join")
        present -= set(_names(order.get("leave")))
        present |= set(_names(order.get("join"))) & followers


def _named_in(order: Mapping[str, object]) -> Iterator[tuple[str, list[str]]]:
    """(field, followers that it names) of an order."""
    for field in ("swap", "leave", "join"):
        yield field, _names(order.get(field))


def _names(value: object) -> list[str]:
    """The names in a list of some; none where it is none."""
    return (
        [name for name in value if isinstance(name, str)] if isinstance(value, list | tuple) else []
    )


def _misplaced(place: Location, name: str, followers: set[str], *, joins: bool) -> Misfit:
    """What to say of a follower that is not where an order needs it."""
    if name not in followers:
        known = ", ".join(sorted(followers)) or "none"
        return Misfit(place, f"'{name}' is no follower", f"name one of: {known}")
    if joins:
        return Misfit(
            place, f"'{name}' is in the formation already", "remove it, or let it leave before"
        )
    return Misfit(place, f"'{name}' has left the formation", "remove it, or let it join before")


def _lost_strangers(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Companions that are lost in the rehearsal and that no vehicle has."""
    losses = group(data, "rehearsal").get("losses")
    if not isinstance(losses, list | tuple):
        return
    names = [role.vehicle for role in _roles(data)]
    if is_foreign(data):
        names = names[1:]
    for index, loss in enumerate(losses):
        name = group(loss).get("vehicle")
        if isinstance(name, str) and names and name not in names:
            yield Misfit(
                ("rehearsal", "losses", index, "vehicle"),
                f"'{name}' has no companion to lose",
                f"name one of: {', '.join(names)}",
            )


def _emulated_strangers(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Emulated aircraft that differ from the others and that nobody flies."""
    names = [role.vehicle for role in _roles(data)]
    for name in group(data, "rehearsal", "emulator", "vehicles"):
        if names and name not in names:
            yield Misfit(
                ("rehearsal", "emulator", "vehicles", name),
                f"there is no vehicle '{name}' in the formation",
                f"remove it, or name one of: {', '.join(names)}",
            )


def _unused_vehicles(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Vehicles that nobody flies."""
    flown = {role.vehicle for role in _roles(data)}
    if not flown:
        return
    for name in group(data, "vehicles"):
        if name not in flown:
            yield Misfit(
                ("vehicles", name),
                "this vehicle has no role",
                "name it as leader.vehicle or in followers, or remove it",
            )


def _shared_system_ids(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Vehicles that MAVLink could not tell apart."""
    owners: dict[float, str] = {GROUND_STATION: "the ground station"}
    for name, vehicle in group(data, "vehicles").items():
        system_id = number(group(vehicle).get("system_id"))
        if system_id is None:
            continue
        if system_id in owners:
            yield Misfit(
                ("vehicles", name, "system_id"),
                f"{system_id:.0f} is also {owners[system_id]}'s",
                "give each vehicle its own number from 1 to 254",
            )
        owners.setdefault(system_id, name)


def _crowded_slots(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Slots too close to the leader or to each other, whatever the formation flies."""
    allowed = number(group(data, "acceptance").get("min_separation_m"))
    allowed = DEFAULT_MIN_SEPARATION_M if allowed is None else allowed
    places: list[tuple[Location, str, tuple[float, float, float]]] = [
        (("leader",), "the leader", (0.0, 0.0, 0.0))
    ]
    for index, follower in enumerate(_followers(data)):
        slot = group(follower, "slot")
        forward, right = number(slot.get("forward_m")), number(slot.get("right_m"))
        up = number(slot.get("up_m", 0.0))
        if forward is not None and right is not None and up is not None:
            title = f"followers[{index}]'s slot"
            places.append((("followers", index, "slot"), title, (forward, right, up)))
    for (_, other, at_other), (location, _, here) in combinations(places, 2):
        distance = math.dist(at_other, here)
        if distance < allowed or distance == 0.0:
            yield Misfit(
                location,
                f"only {distance:.1f} m from {other}",
                f"keep slots acceptance.min_separation_m = {allowed:g} m apart",
            )


def _strangers_at_the_start(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Starting places of vehicles that do not follow."""
    roles = _roles(data)
    if len(roles) <= len(_followers(data)):
        return
    names = [LEADER, *(role.vehicle for role in roles[1:])]
    for name in group(data, "rehearsal", "start"):
        if name not in names:
            yield Misfit(
                ("rehearsal", "start", name),
                f"'{name}' is neither 'leader' nor a follower",
                f"use one of: {', '.join(dict.fromkeys(names))}",
            )


def _airspeed_out_of_range(data: Mapping[str, object]) -> Iterator[Misfit]:
    """A leader that is to fly faster or slower than it can."""
    leader = group(data, "leader")
    airspeed = number(leader.get("airspeed_m_s"))
    vehicle = group(data, "vehicles", str(leader.get("vehicle")))
    span = vehicle.get("airspeed_range_m_s", DEFAULT_AIRSPEED_RANGE_M_S)
    if not vehicle or airspeed is None or not isinstance(span, list | tuple) or len(span) != 2:
        return
    lowest, highest = number(span[0]), number(span[1])
    if lowest is None or highest is None or lowest > highest or lowest <= airspeed <= highest:
        return
    yield Misfit(
        ("leader", "airspeed_m_s"),
        f"{airspeed:g} m/s is outside the airspeed_range_m_s of '{leader.get('vehicle')}'",
        f"choose {lowest:g} to {highest:g} m/s",
    )


def _unheard_leader(data: Mapping[str, object]) -> Iterator[Misfit]:
    """A leader without a companion that nobody can hear, or fields that another kind of leader has."""
    leader = group(data, "leader")
    follows = leader.get("follows", OWN_COMPANION)
    kinds = {
        "connection": ("mavlink", "adsb"),
        "system_id": ("mavlink",),
        "icao_address": ("adsb",),
        "least_delay_s": ("mavlink", "adsb"),
    }
    for field, of in kinds.items():
        if follows not in of and leader.get(field) is not None:
            yield Misfit(
                ("leader", field),
                f"a leader that followers hear by `follows: {follows}` has none",
                f"write follows: {' or '.join(of)}, or remove it",
            )
    needs = {"mavlink": ("connection",), "adsb": ("connection", "icao_address")}
    examples = {"connection": "udpin://0.0.0.0:14560", "icao_address": "0x4B1900"}
    for field in needs.get(str(follows), ()):
        if leader.get(field) is None:
            yield Misfit(
                ("leader", field),
                f"needed with `follows: {follows}`",
                f"write {field}: {examples[field]}, or what it is",
            )
    known = number(group(data, "vehicles", str(leader.get("vehicle"))).get("system_id"))
    system_id = number(leader.get("system_id"))
    if follows == "mavlink" and known is None and system_id is None:
        yield Misfit(
            ("leader", "system_id"),
            "needed of a leader that has no entry under vehicles",
            "write the MAVLink system id of the aircraft, 1 to 254",
        )
    elif system_id is not None and known is not None and system_id != known:
        yield Misfit(
            ("leader", "system_id"),
            f"its vehicle has {known:.0f}",
            "write it once, here or under vehicles",
        )


def _slots_near_adsb(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Slots near an aircraft with people in it, whose position is some seconds old."""
    if group(data, "leader").get("follows") != "adsb":
        return
    for index, follower in enumerate(_followers(data)):
        slot = group(follower, "slot")
        forward, right = number(slot.get("forward_m")), number(slot.get("right_m"))
        if forward is None or right is None:
            continue
        distance = math.hypot(forward, right)
        if distance < ADSB_DISTANCE_M:
            yield Misfit(
                ("followers", index, "slot"),
                f"only {distance:.0f} m from an aircraft that is heard by ADS-B",
                f"keep {ADSB_DISTANCE_M:g} m or more",
            )


def _more_jitter_than_delay(data: Mapping[str, object]) -> Iterator[Misfit]:
    """Messages of a leader that would arrive before they are sent."""
    heard = group(data, "rehearsal", "leader_telemetry")
    delay, jitter = number(heard.get("delay_s", 0.2)), number(heard.get("jitter_s", 0.0))
    if delay is not None and jitter is not None and jitter > delay:
        yield Misfit(
            ("rehearsal", "leader_telemetry", "jitter_s"),
            f"more than delay_s, {delay:g} s",
            "lower it, or raise delay_s",
        )
