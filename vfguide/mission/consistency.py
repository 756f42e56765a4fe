"""Contradictions between the parts of a mission.

The checks read plain data (mappings, lists, numbers) and skip what is missing or of the wrong type. They
therefore also work on a file with other faults, and all faults are reported at once.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from pydantic import BaseModel

from vfguide.formation.arrangement import MAIN_PATH
from vfguide.mission.finding import Location, Misfit

# Defaults and limits of a leader without a companion.

OWN_COMPANION = "companion"
"""`leader.follows` of a leader with a companion; the default."""

DEFAULT_NAME = "leader"
"""Default name of a leader without a companion."""

DEFAULT_AIRSPEED_M_S = 20.0
"""Default expected airspeed of a leader without a companion, m/s."""

ADSB_DISTANCE_M = 100.0
"""Minimum horizontal distance of slots from an aircraft that is heard by ADS-B, m."""


def group(data: object, *steps: str) -> Mapping[str, Any]:
    """Return the group of fields at a path of keys; empty if there is none."""
    for step in steps:
        data = group(data).get(step)
    if isinstance(data, BaseModel):
        return data.model_dump()
    return data if isinstance(data, Mapping) else {}


def number(value: object) -> float | None:
    """Return a finite number between -1e9 and 1e9 as a float, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if -1e9 < value < 1e9 else None


def is_foreign(data: Mapping[str, object]) -> bool:
    """Check whether the leader of a mission, given as plain data, has no companion."""
    return bool(group(data, "leader").get("follows", OWN_COMPANION) != OWN_COMPANION)


def completed(data: object) -> object:
    """Return a mission with its defaults for a leader without a companion; other data unchanged.

    Such a leader needs no entry under `vehicles` and no path, since it navigates on its own. In a rehearsal
    without a path it flies north.
    """
    if not isinstance(data, Mapping) or not is_foreign(data):
        return data
    leader, vehicles = dict(group(data, "leader")), dict(group(data, "vehicles"))
    name = leader.setdefault("vehicle", DEFAULT_NAME)
    leader.setdefault("airspeed_m_s", DEFAULT_AIRSPEED_M_S)
    system_id = leader.get("system_id")
    if leader["follows"] == "adsb" and system_id is None:
        system_id = free_id(vehicles)
    entry = vehicles.get(name) or {} if isinstance(name, str) else None
    if isinstance(entry, Mapping) and system_id is not None:
        vehicles[name] = {"system_id": system_id, **entry}
    path = data.get("path", {"type": "line", "course_deg": 0.0})
    return {**data, "leader": leader, "vehicles": vehicles, "path": path}


def as_written(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return complete mission data that gives the system ID of a leader without a companion only once."""
    leader, vehicles = group(data, "leader"), dict(group(data, "vehicles"))
    name = str(leader.get("vehicle"))
    if is_foreign(data) and leader.get("system_id") is not None:
        entry = group(vehicles, name)
        vehicles[name] = {field: entry[field] for field in entry if field != "system_id"}
    return {**data, "vehicles": vehicles}


def free_id(vehicles: Mapping[str, object]) -> int:
    """Return an unused system ID, for an aircraft that is heard by ADS-B and has none of its own."""
    taken = {group(vehicle).get("system_id") for vehicle in vehicles.values()}
    return next(number for number in range(1, 255) if number not in taken)


DEFAULT_MIN_SEPARATION_M = 5.0
"""Default minimum distance between two vehicles, m."""

DEFAULT_AIRSPEED_RANGE_M_S: tuple[float, float] = (12.0, 32.0)
"""Default (minimum, maximum) airspeed of a vehicle, m/s."""

MAX_FOLLOWERS = 253
"""Maximum number of followers: of MAVLink's 255 system IDs the leader uses one, ground stations another."""

MAX_DEPUTIES = 7
"""Maximum number of deputies; the last leads 2.7 s after the leader has fallen silent, at the earliest."""

GROUND_STATION = 255
"""System ID of ground stations; the only vehicle that may share it is a ground station that leads."""

LEADER = "leader"
"""Key of the leader under `rehearsal.start`, whatever its vehicle is called."""


@dataclass(frozen=True, slots=True)
class _Role:
    """Vehicle name and the mission field that gives the vehicle a role."""

    location: Location
    title: str
    vehicle: str


class _Sketch:
    """Mission as plain data, with values that several checks share."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data
        self.leader = group(data, "leader")
        self.follows = self.leader.get("follows", OWN_COMPANION)
        self.vehicles = group(data, "vehicles")
        self.rehearsal = group(data, "rehearsal")
        # Entries that are no groups become empty groups.
        self.followers = [group(one) for one in listed(data.get("followers"))[:MAX_FOLLOWERS]]
        named: list[tuple[Location, str, object]] = [
            (("leader", "vehicle"), "the leader", self.leader.get("vehicle")),
            *(
                (("followers", index, "vehicle"), f"followers[{index}]", one.get("vehicle"))
                for index, one in enumerate(self.followers)
            ),
        ]
        self.roles = [_Role(*one[:2], one[2]) for one in named if isinstance(one[2], str)]
        """All roles, the leader first."""
        self.names = [role.vehicle for role in self.roles]
        self.follower_names = [
            role.vehicle for role in self.roles if role.location[0] == "followers"
        ]

    def slots(self) -> Iterator[tuple[int, tuple[float, float, float]]]:
        """Yield (index, (forward, right, up)) of each follower with a valid slot, m."""
        for index, follower in enumerate(self.followers):
            slot = group(follower, "slot")
            place = [number(slot.get(name)) for name in ("forward_m", "right_m")]
            forward, right, up = *place, number(slot.get("up_m", 0.0))
            if forward is not None and right is not None and up is not None:
                yield index, (forward, right, up)


def inconsistencies(data: Mapping[str, object]) -> tuple[Misfit, ...]:
    """Return all contradictions in a mission given as plain data."""
    checks: tuple[Callable[[_Sketch], Iterator[Misfit]], ...] = (
        _vehicles_and_roles,
        _deputies_who_cannot_lead,
        _paths_without_use,
        _contradicting_orders,
        _strangers_in_the_rehearsal,
        _shared_system_ids,
        _crowded_slots,
        _airspeed_out_of_range,
        _leader_without_id,
    )
    sketch = _Sketch(group(completed(data)))
    return tuple(found for check in checks for found in check(sketch))


def listed(value: object) -> Sequence[Any]:
    """Return the entries of a list or tuple; empty for anything else."""
    return value if isinstance(value, list | tuple) else ()


def _vehicles_and_roles(sketch: _Sketch) -> Iterator[Misfit]:
    """Find roles of undescribed vehicles, and vehicles with two roles or none."""
    known = ", ".join(str(name) for name in sketch.vehicles)
    taken: dict[str, str] = {}
    for role in sketch.roles:
        name = role.vehicle
        if sketch.vehicles and name not in sketch.vehicles:
            remedy = f"describe it under vehicles, or name one of: {known}"
            yield Misfit(role.location, f"there is no vehicle '{name}'", remedy)
        if name in taken:
            message = f"'{name}' already flies as {taken[name]}"
            yield Misfit(role.location, message, "give each role a vehicle of its own")
        # `rehearsal.start` could not tell its start from the leader's.
        if name == LEADER and role is not sketch.roles[0]:
            remedy = "rename this vehicle, here and under vehicles"
            yield Misfit(role.location, "a follower cannot be called 'leader'", remedy)
        taken.setdefault(name, role.title)
    for name in sketch.vehicles if taken else ():
        if name not in taken:
            remedy = "name it as leader.vehicle or in followers, or remove it"
            yield Misfit(("vehicles", name), "this vehicle has no role", remedy)


def _deputies_who_cannot_lead(sketch: _Sketch) -> Iterator[Misfit]:
    """Find deputies that do not follow, are named twice, or cannot stand in for the leader."""
    deputies = listed(sketch.data.get("deputies"))
    if not deputies:
        return
    if sketch.follows != OWN_COMPANION:
        yield Misfit(
            ("deputies",),
            f"a leader with `follows: {sketch.follows}` has no companion that deputies could hear",
            "remove them, or let the leader have a companion",
        )
    if group(sketch.data, "controller").get("leader_speed_source") == "observer":
        yield Misfit(
            ("deputies",),
            "a leader that does not measure its ground speed cannot come back as a follower",
            "write controller.leader_speed_source: measured, or remove the deputies",
        )
    # The radio has no capacity for the messages of deputies.
    if sketch.rehearsal.get("radio") is not None:
        message = "deputies cannot lead over a radio (rehearsal.radio)"
        yield Misfit(("deputies",), message, "remove one of the two")
    known = ", ".join(sketch.follower_names)
    for index, deputy in enumerate(deputies[:MAX_DEPUTIES]):
        place = ("deputies", index)
        if deputy not in sketch.follower_names:
            remedy = f"name one of: {known}" if known else "remove it"
            yield Misfit(place, f"'{deputy}' is no follower", remedy)
        elif deputy in deputies[:index]:
            yield Misfit(place, f"'{deputy}' is named twice", "remove one")


def _paths_without_use(sketch: _Sketch) -> Iterator[Misfit]:
    """Find other paths that cannot be ordered: one named `main`, or paths of a leader without a companion."""
    others = group(sketch.data, "paths")
    if others and sketch.follows != OWN_COMPANION:
        yield Misfit(
            ("paths",),
            f"a leader with `follows: {sketch.follows}` flies no path that is ordered",
            "remove them, or let the leader have a companion",
        )
    if MAIN_PATH in others:
        yield Misfit(("paths", MAIN_PATH), "`main` is the name of `path`", "give it another name")


def _contradicting_orders(sketch: _Sketch) -> Iterator[Misfit]:
    """Find orders out of time sequence, and followers ordered to leave or join a second time."""
    followers = set(sketch.follower_names)
    present = {*followers}
    before: float | None = None
    for index, one in enumerate(listed(sketch.data.get("orders"))):
        order = group(one)
        time_s = number(order.get("at_s"))
        if time_s is not None and before is not None and time_s <= before:
            yield Misfit(
                ("orders", index, "at_s"),
                f"{time_s:g} s is no later than the {before:g} s of the order before",
                "put orders in the order of their times, one for each time",
            )
        before = before if time_s is None else time_s
        named = {field: _names(order.get(field)) for field in ("swap", "leave", "join")}
        for field, names in named.items():
            for name in names:
                if (name in present) is (field == "join"):
                    yield _misplaced(("orders", index, field), name, followers)
        present -= set(named["leave"])
        present |= set(named["join"]) & followers


def _names(value: object) -> list[str]:
    """Return the strings in a list; empty if it is no list."""
    return [name for name in listed(value) if isinstance(name, str)]


def _misplaced(place: Location, name: str, followers: set[str]) -> Misfit:
    """Describe a follower that an order names although it is absent, or joins although it is present."""
    if name not in followers:
        known = ", ".join(sorted(followers)) or "none"
        return Misfit(place, f"'{name}' is no follower", f"name one of: {known}")
    if place[-1] == "join":
        remedy = "remove it, or let it leave before"
        return Misfit(place, f"'{name}' is in the formation already", remedy)
    return Misfit(place, f"'{name}' has left the formation", "remove it, or let it join before")


def _strangers_in_the_rehearsal(sketch: _Sketch) -> Iterator[Misfit]:
    """Find losses, emulated aircraft and starts of vehicles that do not fly in the formation."""
    names = sketch.names
    companions = names if sketch.follows == OWN_COMPANION else names[1:]
    for index, loss in enumerate(listed(sketch.rehearsal.get("losses"))):
        name = group(loss).get("vehicle")
        if isinstance(name, str) and companions and name not in companions:
            place: Location = ("rehearsal", "losses", index, "vehicle")
            remedy = f"name one of: {', '.join(companions)}"
            yield Misfit(place, f"'{name}' has no companion to lose", remedy)
    for name in group(sketch.rehearsal, "emulator", "vehicles"):
        if names and name not in names:
            place = ("rehearsal", "emulator", "vehicles", name)
            remedy = f"remove it, or name one of: {', '.join(names)}"
            yield Misfit(place, f"there is no vehicle '{name}' in the formation", remedy)
    if len(names) <= len(sketch.followers):
        return
    starting = [LEADER, *names[1:]]
    for name in group(sketch.rehearsal, "start"):
        if name not in starting:
            place = ("rehearsal", "start", name)
            remedy = f"use one of: {', '.join(dict.fromkeys(starting))}"
            yield Misfit(place, f"'{name}' is neither 'leader' nor a follower", remedy)


def _shared_system_ids(sketch: _Sketch) -> Iterator[Misfit]:
    """Find vehicles with the same MAVLink system ID."""
    owners: dict[float, str] = {GROUND_STATION: "the ground station"}
    for name, vehicle in sketch.vehicles.items():
        system_id = number(group(vehicle).get("system_id"))
        heard = sketch.follows == "mavlink" and name == sketch.leader.get("vehicle")
        # A ground station or its phone may lead by FOLLOW_TARGET.
        if system_id is None or (heard and system_id == GROUND_STATION):
            continue
        if system_id in owners:
            yield Misfit(
                ("vehicles", name, "system_id"),
                f"{system_id:.0f} is also {owners[system_id]}'s",
                "give each vehicle its own number from 1 to 254",
            )
        owners.setdefault(system_id, name)


def _crowded_slots(sketch: _Sketch) -> Iterator[Misfit]:
    """Find slots too close to the leader, to each other or to a crewed aircraft."""
    allowed = number(group(sketch.data, "acceptance").get("min_separation_m"))
    allowed = DEFAULT_MIN_SEPARATION_M if allowed is None else allowed
    places: list[tuple[Location, str, tuple[float, float, float]]] = [
        (("leader",), "the leader", (0.0, 0.0, 0.0)),
        *(
            (("followers", index, "slot"), f"followers[{index}]'s slot", place)
            for index, place in sketch.slots()
        ),
    ]
    for (_, other, at_other), (location, _, here) in combinations(places, 2):
        distance = math.dist(at_other, here)
        if distance < allowed or distance == 0.0:
            yield Misfit(
                location,
                f"only {distance:.1f} m from {other}",
                f"keep slots acceptance.min_separation_m = {allowed:g} m apart",
            )
    # The position of an ADS-B aircraft is some seconds old.
    for location, _, here in places[1:] if sketch.follows == "adsb" else ():
        distance = math.hypot(*here[:2])
        if distance < ADSB_DISTANCE_M:
            message = f"only {distance:.0f} m from an aircraft that is heard by ADS-B"
            yield Misfit(location, message, f"keep {ADSB_DISTANCE_M:g} m or more")


def _airspeed_out_of_range(sketch: _Sketch) -> Iterator[Misfit]:
    """Find a leader whose mission airspeed is outside its range."""
    name, airspeed = sketch.leader.get("vehicle"), number(sketch.leader.get("airspeed_m_s"))
    vehicle = group(sketch.vehicles, str(name))
    span = airspeed_range(vehicle)
    if not vehicle or airspeed is None or span is None:
        return
    lowest, highest = span
    if lowest <= highest and not lowest <= airspeed <= highest:
        yield Misfit(
            ("leader", "airspeed_m_s"),
            f"{airspeed:g} m/s is outside the airspeed_range_m_s of '{name}'",
            f"choose {lowest:g} to {highest:g} m/s",
        )


def airspeed_range(vehicle: Mapping[str, object]) -> tuple[float, float] | None:
    """Return a vehicle's (minimum, maximum) airspeed, m/s: the default if absent, None if malformed."""
    if "airspeed_range_m_s" not in vehicle:
        return DEFAULT_AIRSPEED_RANGE_M_S
    match [number(one) for one in listed(vehicle["airspeed_range_m_s"])]:
        case [float(lowest), float(highest)]:
            return lowest, highest
    return None


def _leader_without_id(sketch: _Sketch) -> Iterator[Misfit]:
    """Find a leader without a companion that has no system ID, or two different ones."""
    leader, follows = sketch.leader, sketch.follows
    known = number(group(sketch.vehicles, str(leader.get("vehicle"))).get("system_id"))
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
