"""QGroundControl's plan files (`.plan`, JSON): the mission's waypoints, the fence and the rally points.

Format: docs.qgroundcontrol.com, developer guide, Plan File Format; commands and frames: MAVLink, common.xml.
What a formation does not do (cameras, changes of speed, loitering on the way) is left out and noted.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeGuard

from vfguide.errors import InputError
from vfguide.regular_file import PipeOrDeviceError, open_regular

MAX_BYTES = 4 * 1024 * 1024
MOST_ITEMS = 20_000
DEEPEST = 4
"""Depth of complex items within each other, at most."""

WAYPOINTS = {16, 82}
"""NAV_WAYPOINT and NAV_SPLINE_WAYPOINT."""

LOITERS = {17: 2, 18: 2, 19: 2, 31: 1}
"""NAV_LOITER_UNLIM, _TURNS, _TIME and _TO_ALT: which parameter is the radius."""

TAKEOFFS = {22, 84}
"""NAV_TAKEOFF and NAV_VTOL_TAKEOFF: a formation is in the air when it gathers."""

ENDS = {20, 21, 85, 189}
"""NAV_RETURN_TO_LAUNCH, NAV_LAND, NAV_VTOL_LAND, DO_LAND_START."""

LANDINGS = {"fwLandingPattern", "vtolLandingPattern"}
JUMP = 177
"""DO_JUMP."""

ABSOLUTE, RELATIVE, TERRAIN = {0, 5}, {3, 6}, {10, 11}
"""Frames: MAV_FRAME_GLOBAL, _GLOBAL_RELATIVE_ALT and _GLOBAL_TERRAIN_ALT, with their integer variants."""

GEOGRAPHIC = 7
"""Parameters of an item: the last three are latitude, longitude and altitude."""


MOST_LATITUDE_DEG = 85.0
"""Nobody flies nearer to a pole."""


def read_plan(path: Path) -> dict[str, Any]:
    """What a plan file says, as fields of a mission's `path.contents`.

    Raises:
        InputError: it cannot be read or is no such file; the message is one line with the remedy.
    """
    try:
        with open_regular(path) as stream:
            content = stream.read(MAX_BYTES + 1)
    except (PipeOrDeviceError, IsADirectoryError) as error:
        raise InputError(f"{path}: is no file; give the path of a .plan") from error
    except FileNotFoundError as error:
        raise InputError(
            f"{path}: there is no such file; give its path relative to the mission file"
        ) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: cannot be read: {reason}; check its permissions") from error
    if len(content) > MAX_BYTES:
        raise InputError(f"{path}: larger than 4 MiB; this is no plan of QGroundControl")
    try:
        return parse_plan(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def parse_plan(content: bytes) -> dict[str, Any]:
    """The content of a plan from the bytes of a file.

    Raises:
        InputError: it is no plan, or none that can be flown.
    """
    again = "save it again with QGroundControl"
    try:
        data = json.loads(content.decode("utf-8-sig"), parse_constant=float)
    except (ValueError, RecursionError) as error:
        line = f" at line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"is no JSON{line}; {again}") from error
    if not isinstance(data, dict) or data.get("fileType") != "Plan":
        raise InputError(f"is no plan (fileType is not Plan); {again}")
    mission = group(data.get("mission"))
    home = numbers(mission.get("plannedHomePosition"), 3)
    if home and not -500.0 <= home[2] <= 9000.0:
        raise InputError(f"begins at {home[2]:g} m above mean sea level; move its planned home")
    reader = Reader(home[2] if home else None)
    reader.read(list(flat(mission.get("items"))))
    if len(reader.waypoints) < 2:
        raise InputError(
            f"has {len(reader.waypoints)} waypoints that can be flown; draw two or more"
        )
    found: dict[str, Any] = {
        "waypoints": reader.waypoints,
        "end": reader.end,
        "home": place_of(home),
    }
    if reader.loiter_radius_m:
        found["loiter_radius_m"] = reader.loiter_radius_m
    if not isinstance(data.get("geoFence", {}), dict):
        raise InputError(f"its geoFence is none; {again}")
    fence = fence_of(group(data.get("geoFence")))
    if fence:
        found["fence"] = fence
    rally = [
        {"latitude_deg": point[0], "longitude_deg": point[1]}
        for point in (numbers(one, 2) for one in listed(data, "rallyPoints", "points"))
        if point
    ]
    if rally:
        found["rally_points"] = rally
    if reader.left_out:
        found["left_out"] = sorted(reader.left_out)
    return found


def place_of(place: Sequence[float] | None) -> dict[str, float] | None:
    """Latitude and longitude of a place, if there is one where somebody flies."""
    if not place or abs(place[0]) > MOST_LATITUDE_DEG or abs(place[1]) > 180.0:
        return None
    return {"latitude_deg": place[0], "longitude_deg": place[1]}


class Reader:
    """Turns items into a route, one after the other."""

    def __init__(self, home_amsl_m: float | None) -> None:
        """Begin with nothing; relative altitudes count from this, m above mean sea level."""
        self._home_amsl_m = home_amsl_m
        self._first_id: object = None
        self.waypoints: list[dict[str, float]] = []
        self.end = "loiter"
        self.loiter_radius_m = 0.0
        self.left_out: set[str] = set()

    def read(self, items: list[Mapping[str, Any]]) -> None:
        """Take the items in their order, up to a landing or the way home."""
        for number, item in enumerate(items, start=1):
            command = whole(item.get("command"))
            if command is None and "complexItemType" not in item:
                raise InputError(f"item {number} has no command; save it again with QGroundControl")
            if command in ENDS or str(item.get("complexItemType")) in LANDINGS:
                self.end = "hand-back"
                self.left_out.add("the return and the landing")
                return
            if command in WAYPOINTS or command in LOITERS:
                self._waypoint(item, number)
            elif command == JUMP and self._repeats(item):
                self.end = "repeat"
                if number < len(items):
                    self.left_out.add("what comes after the jump back to the beginning")
                return
            elif command == JUMP:
                self._leave_out_jump(item)
            elif command in TAKEOFFS:
                self.left_out.add("take-off")
            else:
                self.left_out.add("an item" if command is None else f"command {command}")

    def _waypoint(self, item: Mapping[str, Any], number: int) -> None:
        latitude, longitude, altitude = position(item, number)
        place = {"latitude_deg": latitude, "longitude_deg": longitude}
        frame = whole(item.get("frame"))
        if frame in RELATIVE:
            if self._home_amsl_m is None:
                raise InputError(
                    f"item {number} counts its altitude from the launch, and the plan has none;"
                    " set the planned home position"
                )
            place["altitude_amsl_m"] = self._home_amsl_m + altitude
        elif frame in ABSOLUTE:
            place["altitude_amsl_m"] = altitude
        else:
            what = "counts its altitude from the terrain" if frame in TERRAIN else "has no altitude"
            raise InputError(
                f"item {number} {what}, which is not known here;"
                " choose altitudes relative to launch, or above mean sea level"
            )
        same = {"latitude_deg", "longitude_deg"}
        if self.waypoints and all(self.waypoints[-1][name] == place[name] for name in same):
            # As a survey that begins where the waypoint before it is.
            self.waypoints.pop()
        if not self.waypoints:
            self._first_id = item.get("doJumpId")
        self.waypoints.append(place)
        self.loiter_radius_m = 0.0
        place_of_radius = LOITERS.get(whole(item.get("command")) or 0)
        if place_of_radius is not None:
            parameters = listed(item, "params")[place_of_radius:]
            self.loiter_radius_m = float(parameters[0]) if numbers(parameters, 1) else 0.0

    def _repeats(self, item: Mapping[str, Any]) -> bool:
        """Whether a jump leads back to the first waypoint, and always does."""
        fields = numbers(item.get("params"), 2)
        if not fields or self._first_id is None:
            return False
        target, count = fields
        return target == self._first_id and count < 0.0

    def _leave_out_jump(self, item: Mapping[str, Any]) -> None:
        """A jump that is not flown: to elsewhere, or some times only."""
        fields = numbers(item.get("params"), 2)
        count = fields[1] if fields else 0.0
        often = f"{count:.0f} times" if count > 0.0 else "always" if count < 0.0 else "never"
        self.left_out.add(f"a jump that is taken {often}")


def flat(items: object, depth: int = 0) -> Iterator[Mapping[str, Any]]:
    """Simple items in their order, those of surveys and corridor scans among them."""
    if not isinstance(items, list):
        raise InputError("has no mission items; save it again with QGroundControl")
    if depth > DEEPEST or len(items) > MOST_ITEMS:
        raise InputError("has too many items; this is no plan of QGroundControl")
    for item in items:
        if not isinstance(item, dict):
            raise InputError("has an item that is no group of fields; save it again")
        inner = group(item.get("TransectStyleComplexItem")).get("Items", item.get("Items"))
        if item.get("type") == "ComplexItem" and str(item.get("complexItemType")) not in LANDINGS:
            if inner is None:
                raise InputError(
                    f"has a complex item ({str(item.get('complexItemType'))[:40]}) without its waypoints;"
                    " save the plan again with QGroundControl"
                )
            yield from flat(inner, depth + 1)
        else:
            yield item


def position(item: Mapping[str, Any], number: int) -> tuple[float, float, float]:
    """(latitude, longitude in degrees, altitude in m) of an item.

    Raises:
        InputError: it has none.
    """
    parameters = item.get("params")
    found: object = item.get("coordinate")
    if isinstance(parameters, list) and len(parameters) == GEOGRAPHIC:
        found = parameters[4:]
    place = numbers(found, 3)
    if not place or (place[0] == 0.0 and place[1] == 0.0):
        raise InputError(f"item {number} has no position; place it on the map")
    if not (abs(place[0]) <= 85.0 and abs(place[1]) <= 180.0 and -500.0 <= place[2] <= 12000.0):
        raise InputError(
            f"item {number} is at {place[0]:g}, {place[1]:g}, {place[2]:g} m: nowhere to fly; move it"
        )
    return place[0], place[1], place[2]


def fence_of(data: Mapping[str, Any]) -> dict[str, Any]:
    """The fence as a mission has it; empty where there is none."""
    polygons: list[dict[str, Any]] = [
        {
            "inclusion": inclusion(one),
            "points": [place(point, "a polygon of the fence") for point in listed(one, "polygon")],
        }
        for one in map(group, listed(data, "polygons"))
    ]
    circles = []
    for one in map(group, listed(data, "circles")):
        circle = group(one.get("circle"))
        radius = circle.get("radius")
        if not is_number(radius) or not 0.0 < radius <= 1000e3:
            raise InputError("a circle of the fence has no radius; draw it again")
        centre = place(circle.get("center"), "a circle of the fence")
        circles.append({"inclusion": inclusion(one), "centre": centre, "radius_m": float(radius)})
    if any(len(one["points"]) < 3 for one in polygons):
        raise InputError("a polygon of the fence has fewer than three corners; draw it again")
    return {name: areas for name, areas in (("polygons", polygons), ("circles", circles)) if areas}


def inclusion(area: Mapping[str, Any]) -> bool:
    """Whether vehicles have to stay inside of an area of the fence."""
    return area.get("inclusion") is not False


def place(value: object, owner: str) -> dict[str, float]:
    """A latitude and a longitude as a mission has them.

    Raises:
        InputError: there are none.
    """
    point = numbers(value, 2)
    if not point or not (abs(point[0]) <= 85.0 and abs(point[1]) <= 180.0):
        raise InputError(f"{owner} has a corner or a centre without a place; draw it again")
    return {"latitude_deg": point[0], "longitude_deg": point[1]}


def group(value: object) -> Mapping[str, Any]:
    """A group of fields; empty where it is none."""
    return value if isinstance(value, dict) else {}


def listed(data: Mapping[str, Any], *steps: str) -> list[Any]:
    """The list at a place of the tree; empty where there is none."""
    value: object = data
    for step in steps:
        value = group(value).get(step)
    return value if isinstance(value, list) else []


def whole(value: object) -> int | None:
    """A whole number that is not too long to be written; None for anything else."""
    return value if isinstance(value, int) and abs(value) < 1e9 else None


def numbers(value: object, count: int) -> list[float]:
    """The first so many numbers of a list; empty where they are not there."""
    if not isinstance(value, list) or len(value) < count:
        return []
    return [float(one) for one in value[:count]] if all(map(is_number, value[:count])) else []


def is_number(value: object) -> TypeGuard[float]:
    """Whether it is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < 1e12 and math.isfinite(value)
