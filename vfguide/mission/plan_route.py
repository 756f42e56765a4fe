"""Route of a plan's items: waypoints, jumps and the end.

Commands and frames: MAVLink, common.xml. What a formation does not do (cameras, changes of speed, loitering
on the way) is left out and noted in a pilot's words.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, TypeGuard

import msgspec

from vfguide.errors import InputError
from vfguide.mission.place import MOST_WAYPOINTS

WAYPOINTS = {16, 82, 4501, *range(31000, 31005)}
"""NAV_WAYPOINT, NAV_SPLINE_WAYPOINT, CONDITION_GATE, WAYPOINT_USER_1 to 5: points to fly through."""

GATE = 4501
ENDLESS_LOITER = 17
LOITERS = {ENDLESS_LOITER: 2, 18: 2, 19: 2, 31: 1}
"""NAV_LOITER_UNLIM, _TURNS, _TIME and _TO_ALT: index of the radius parameter."""

LAND = 21
ENDS = {20, LAND, 85, 189}
"""NAV_RETURN_TO_LAUNCH, NAV_LAND, NAV_VTOL_LAND, DO_LAND_START."""

JUMP, TAG, JUMP_TO_TAG = 177, 600, 601
RETURN_POINT, RALLY_POINT = 5000, 5100
CORNERS, CIRCLES = {5001: True, 5002: False}, {5003: True, 5004: False}
"""Fence polygon corners and circles: True for inclusion, False for exclusion."""

LAST_NAVIGATION = 95
"""Highest number of a navigation command."""

WORDS = {
    number: words
    for words, numbers in {
        "take-off": (22, 24, 84),
        "changes of height on the way": (30, 113, 186),
        "following another vehicle": (25, 32, 33),
        "points to look at": (80, 195, 196, 197, 201),
        "waiting": (83, 93, 112, 114),
        "control by another computer": (92, 222),
        "turns of the nose": (115,),
        "changes of speed": (178,),
        "a new home": (179,),
        "relays and servos": (181, 182, 183, 184),
        "return paths and aborted landings": (188, 191),
        "cameras": (200, 202, 203, 206, 214, 530, 531, 532, 2000, 2001, 2003, 2500, 2501),
        "gimbals": (204, 205, 1000, 1001),
        "switching the fence": (207,),
        "parachutes, grippers and winches": (208, 211, 42600),
        "inverted flight": (210,),
        "engine and tuning commands": (212, 223),
        "scripts": (217, 42702),
        "changes between hover and forward flight": (3000,),
        "places on the map only": tuple(range(31005, 31010)),
    }.items()
    for number in numbers
}
"""Pilots' names of commands that are left out."""

ABSOLUTE, RELATIVE, TERRAIN = {0, 5}, {3, 6}, {10, 11}
"""Frames: MAV_FRAME_GLOBAL, _GLOBAL_RELATIVE_ALT and _GLOBAL_TERRAIN_ALT, with their integer variants."""

MOST_LATITUDE_DEG = 85.0
"""Latitude limit; nobody flies nearer to a pole."""

MOST_STEPS = 100_000
"""Maximum number of items executed, including repetitions by jumps."""


class PlanItem(msgspec.Struct, frozen=True):
    """One item of a plan of any file format; missing numbers are NaN."""

    number: int
    """Number in messages."""
    label: int | None
    """Target number for jumps."""
    command: int
    """MAV_CMD."""
    frame: int | None
    """MAV_FRAME."""
    params: tuple[float, ...]
    """First four parameters."""
    place: tuple[float, ...]
    """Latitude and longitude in degrees, altitude in m."""


class PlanRoute:
    """Route that a plan's items describe."""

    def __init__(self, items: Sequence[PlanItem], home_amsl_m: float | None) -> None:
        """Execute the items like an autopilot, up to a landing, a return or an endless loiter.

        Relative altitudes count from `home_amsl_m`, m above mean sea level; None if unknown.

        Raises:
            InputError: the items cannot be flown; the message is one line with the remedy.
        """
        self._items = items
        self._home_amsl_m = home_amsl_m
        self._first: int | None = None
        backwards = [*enumerate(items)][::-1]
        self._labels: dict[float, int] = {
            one.label: index for index, one in backwards if one.label is not None
        }
        self._tags = {one.params[0]: index for index, one in backwards if one.command == TAG}
        self._left: dict[int, int] = {}
        self.waypoints: list[dict[str, float]] = []
        self.end = "loiter"
        self.loiter_radius_m = 0.0
        self.left_out: set[str] = set()
        self.polygons: list[dict[str, Any]] = []
        self.circles: list[dict[str, Any]] = []
        self.rally_points: list[dict[str, float]] = []
        self._read_fence()
        self._follow()
        if len(self.waypoints) < 2:
            raise InputError(
                f"has {len(self.waypoints)} waypoints that can be flown; draw two or more"
            )

    def _follow(self) -> None:
        index = 0
        for _ in range(MOST_STEPS):
            if index >= len(self._items):
                return
            item = self._items[index]
            if item.command in ENDS:
                self.end = "hand-back"
                self.left_out.add("the return and the landing")
                return
            if item.command in {JUMP, JUMP_TO_TAG}:
                target = self._jump(index, item)
                if target is None:
                    self._drop_after(index, "the jump back to the beginning")
                    return
                index = target
                continue
            if item.command in WAYPOINTS or item.command in LOITERS:
                self._waypoint(index, item)
                if item.command == ENDLESS_LOITER:
                    self._drop_after(index, "a loiter without end")
                    return
                if item.command in LOITERS and index < len(self._items) - 1:
                    self.left_out.add("loitering on the way")
            elif item.command not in {TAG, *FENCE_ITEMS}:
                self._leave_out(item)
            index += 1
        raise InputError("jumps too often; draw the waypoints instead")

    def _drop_after(self, index: int, what: str) -> None:
        if index < len(self._items) - 1:
            self.left_out.add(f"what comes after {what}")

    def _leave_out(self, item: PlanItem) -> None:
        known = WORDS.get(item.command)
        if known is None and item.command <= LAST_NAVIGATION and any(map(is_place, item.place[:2])):
            raise InputError(
                f"item {item.number} (command {item.command}) is flown in a way that is not known here;"
                " draw waypoints instead"
            )
        self.left_out.add(known or f"command {item.command}")

    def _jump(self, index: int, item: PlanItem) -> int | None:
        """Return the index of the item after a jump; None where the route repeats."""
        count = item.params[1]
        if not abs(count) >= 1.0:
            self.left_out.add("a jump that is taken never")
            return index + 1
        target = self._target(item)
        if count < 0.0:
            if target > index:
                self.left_out.add("what a jump leads past")
                return target
            if self._first is not None and target <= self._first:
                self.end = "repeat"
                return None
            raise InputError(
                f"item {item.number} jumps back for ever, and not to the first waypoint;"
                " let it jump there, or so many times"
            )
        left = self._left.get(index, int(min(count, MOST_STEPS)))
        if left < 0:
            raise InputError(
                f"item {item.number} is a counted jump within another, which autopilots count differently;"
                " draw the waypoints instead"
            )
        self._left[index] = left - 1
        return target if left > 0 else index + 1

    def _target(self, item: PlanItem) -> int:
        wanted = item.params[0]
        known = self._labels if item.command == JUMP else self._tags
        if (found := known.get(wanted)) is not None:
            return found
        what = "item" if item.command == JUMP else "tag"
        raise InputError(
            f"item {item.number} jumps to {what} {wanted:g}, which there is not; correct the jump"
        )

    def _waypoint(self, index: int, item: PlanItem) -> None:
        before = self.waypoints[-1] if self.waypoints else None
        latitude, longitude, altitude = item.place
        if item.command in LOITERS and not any(map(is_place, item.place[:2])):
            # Without coordinates, an aircraft loiters at its current position.
            if before is None:
                return
            latitude, longitude = before["latitude_deg"], before["longitude_deg"]
            altitude = altitude or math.nan
        kept = math.isnan(altitude) and (item.command == GATE or item.command in LOITERS)
        if kept and before is not None:
            place = position(item.number, latitude, longitude, 0.0)
            place["altitude_amsl_m"] = before["altitude_amsl_m"]
        else:
            place = position(item.number, latitude, longitude, altitude)
            place["altitude_amsl_m"] = altitude + self._zero(item)
        if before is not None and all(
            before[name] == place[name] for name in ("latitude_deg", "longitude_deg")
        ):
            # For example, a survey that begins at the waypoint before it.
            self.waypoints.pop()
        if not self.waypoints:
            self._first = index
        self.waypoints.append(place)
        if len(self.waypoints) > MOST_WAYPOINTS:
            raise InputError(
                f"has more than {MOST_WAYPOINTS} waypoints, those of jumps each time; fly it in parts"
            )
        radius = item.params[LOITERS[item.command]] if item.command in LOITERS else 0.0
        self.loiter_radius_m = radius if math.isfinite(radius) else 0.0

    def _zero(self, item: PlanItem) -> float:
        """Return the reference of an item's altitude, m above mean sea level."""
        if item.frame in ABSOLUTE:
            return 0.0
        if item.frame not in RELATIVE:
            what = "from the terrain" if item.frame in TERRAIN else "in a frame of its own"
            raise InputError(
                f"item {item.number} counts its altitude {what}, which is not known here;"
                " choose altitudes relative to launch, or above mean sea level"
            )
        if self._home_amsl_m is None:
            raise InputError(
                f"item {item.number} counts its altitude from the launch, and the plan has none;"
                " set the planned home position"
            )
        return self._home_amsl_m

    def _read_fence(self) -> None:
        """Read the fence and rally points among the items, coded as for upload to an autopilot."""
        items = iter([one for one in self._items if one.command in FENCE_ITEMS])
        for item in items:
            if item.command in CORNERS:
                self.polygons.append(self._polygon(item, items))
            elif item.command in CIRCLES:
                circle = {"centre": fence_place(item), "radius_m": radius_of(item.params[0])}
                self.circles.append({"inclusion": CIRCLES[item.command], **circle})
            elif item.command == RALLY_POINT:
                self.rally_points.append(fence_place(item))

    @staticmethod
    def _polygon(first: PlanItem, items: Iterator[PlanItem]) -> dict[str, Any]:
        count = first.params[0]
        corners = [first]
        while len(corners) < count and (item := next(items, None)) is not None:
            if (item.command, item.params[0]) != (first.command, count):
                break
            corners.append(item)
        if len(corners) != count:
            raise InputError("a polygon of the fence has corners missing; draw it again")
        return {"inclusion": CORNERS[first.command], "points": [*map(fence_place, corners)]}


FENCE_ITEMS = {RETURN_POINT, RALLY_POINT, *CORNERS, *CIRCLES}


def is_place(value: float) -> bool:
    """Check whether a coordinate is given; 0 and NaN mean the current position."""
    return math.isfinite(value) and value != 0.0


def position(number: int, latitude: float, longitude: float, altitude: float) -> dict[str, float]:
    """Return latitude and longitude of an item as mission fields.

    Raises:
        InputError: the position is missing or out of range.
    """
    if not all(map(math.isfinite, (latitude, longitude, altitude))) or latitude == longitude == 0.0:
        raise InputError(f"item {number} has no position; place it on the map")
    if not (
        abs(latitude) <= MOST_LATITUDE_DEG
        and abs(longitude) <= 180.0
        and -500.0 <= altitude <= 12000.0
    ):
        raise InputError(
            f"item {number} is at {latitude:g}, {longitude:g}, {altitude:g} m: nowhere to fly; move it"
        )
    return {"latitude_deg": latitude, "longitude_deg": longitude}


def fence_place(item: PlanItem) -> dict[str, float]:
    """Return the position of a fence item or rally point."""
    return place(list(item.place), "the fence, or a rally point,")


def radius_of(value: object) -> float:
    """Return the radius of a fence circle, m.

    Raises:
        InputError: the radius is missing or out of range.
    """
    if not is_number(value) or not 0.0 < value <= 1000e3:
        raise InputError("a circle of the fence has no radius; draw it again")
    return float(value)


def place(value: object, owner: str) -> dict[str, float]:
    """Return latitude and longitude as mission fields.

    Raises:
        InputError: the position is missing or out of range.
    """
    point = numbers(value, 2)
    if not point or not (abs(point[0]) <= MOST_LATITUDE_DEG and abs(point[1]) <= 180.0):
        raise InputError(f"{owner} has a corner or a centre without a place; draw it again")
    return {"latitude_deg": point[0], "longitude_deg": point[1]}


def numbers(value: object, count: int) -> list[float]:
    """Return the first `count` numbers of a list; empty if there are fewer."""
    if not isinstance(value, list) or len(value) < count:
        return []
    return [float(one) for one in value[:count]] if all(map(is_number, value[:count])) else []


def is_number(value: object) -> TypeGuard[float]:
    """Check whether a value is a finite number below 1e12."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < 1e12 and math.isfinite(value)


def whole(value: object) -> int | None:
    """Return an integer below 1e9 in magnitude; None for anything else."""
    return int(value) if is_number(value) and value == int(value) and abs(value) < 1e9 else None
