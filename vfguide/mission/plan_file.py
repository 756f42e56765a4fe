"""Plan files of ground stations: waypoints, fence and rally points.

Supported are QGroundControl's `.plan` and its older `.mission` (JSON; docs.qgroundcontrol.com, developer
guide, Plan File Format), and the text of `.waypoints` and `.mission` files that ArduPilot's ground stations
write (mavlink.io, file formats). The content decides the format, not the file name.
"""

import json
import math
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from vfguide.errors import InputError
from vfguide.mission.plan_route import (
    LAND,
    MOST_LATITUDE_DEG,
    PlanItem,
    PlanRoute,
    is_number,
    numbers,
    place,
    radius_of,
    whole,
)
from vfguide.regular_file import PipeOrDeviceError, open_regular

MAX_BYTES = 4 * 1024 * 1024
MOST_ITEMS = 20_000
DEEPEST = 4
"""Maximum nesting depth of complex items."""

LANDINGS = {"fwLandingPattern", "vtolLandingPattern"}

GEOGRAPHIC = 7
"""Number of parameters of an item; the last three are latitude, longitude and altitude."""

PLAN, FENCE, RALLY, AREA = "a plan", "a geoFence", "rally points", "an area of the fence"
NEWEST_VERSIONS = {PLAN: 1, "a mission": 2, FENCE: 2, RALLY: 2, AREA: 1}

FENCE_PARTS = {"version", "polygon", "polygons", "circles", "breachReturn"}
RALLY_PARTS = {"version", "points"}
"""Known fields of fences and rally points; the breach return point limits no vehicle."""

TEXT = ("QGC", "WPL")
WITH_HOME, WITHOUT_HOME = "110", "120"
"""Text versions: item 0 is the home position, or the first waypoint."""

COLUMNS = 12
"""Number, current flag, frame, command, four parameters, position (3) and autocontinue flag."""

WAYPOINT, GLOBAL = 16, 0

AGAIN = "save it again with QGroundControl"


def read_plan(path: Path) -> dict[str, Any]:
    """Read a plan file as fields of a mission's `path.contents`.

    Raises:
        InputError: the file cannot be read or is no plan; the message is one line with the remedy.
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
        raise InputError(f"{path}: larger than 4 MiB; this is no plan of a ground station")
    try:
        return parse_plan(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def parse_plan(content: bytes) -> dict[str, Any]:
    """Parse a plan from the bytes of a file.

    Raises:
        InputError: the bytes are no plan, or one that cannot be flown.
    """
    try:
        text = content.decode("utf-8-sig")
        if tuple(text[:20].split()[:2]) == TEXT:
            home, items = text_items(text)
            return contents_of(home, items, {}, [])
        data = json.loads(text, parse_constant=float)
    except (ValueError, RecursionError) as error:
        line = f" at line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"is no JSON{line}, nor a list of waypoints; {AGAIN}") from error
    kind = data.get("fileType") if isinstance(data, dict) else None
    if kind == "Plan":
        understood(data, PLAN)
        mission = group(data.get("mission"))
    elif kind == "Mission" or (isinstance(data, dict) and "MAV_AUTOPILOT" in data):
        mission = data
    else:
        raise InputError(f"is no plan (fileType is not Plan); {AGAIN}")
    understood(mission, "a mission")
    if mission.get("complexItems"):
        raise InputError(f"has surveys in an old form, without their waypoints; {AGAIN}")
    fence, rally = fence_of(data.get("geoFence", {})), rally_of(data.get("rallyPoints", {}))
    planned = mission.get("plannedHomePosition")
    home = numbers(group(planned).get("coordinate", planned), 3)
    items = [item_of(one, number) for number, one in enumerate(flat(mission.get("items")), 1)]
    return contents_of(home, items, fence, rally)


def contents_of(
    home: list[float],
    items: list[PlanItem],
    fence: dict[str, list[dict[str, Any]]],
    rally: list[dict[str, float]],
) -> dict[str, Any]:
    """Return the parts of a plan that a mission keeps.

    `home` is latitude, longitude and altitude, or empty if unknown. Fences and rally points among the items
    are added to `fence` and `rally`.
    """
    if home and not -500.0 <= home[2] <= 9000.0:
        raise InputError(f"begins at {home[2]:g} m above mean sea level; move its planned home")
    route = PlanRoute(items, home[2] if home else None)
    found: dict[str, Any] = {"waypoints": route.waypoints, "end": route.end}
    somewhere = home and abs(home[0]) <= MOST_LATITUDE_DEG and abs(home[1]) <= 180.0
    found["home"] = {"latitude_deg": home[0], "longitude_deg": home[1]} if somewhere else None
    areas = {
        "polygons": [*fence.get("polygons", []), *route.polygons],
        "circles": [*fence.get("circles", []), *route.circles],
    }
    others = {
        "loiter_radius_m": route.loiter_radius_m,
        "fence": {name: one for name, one in areas.items() if one},
        "rally_points": [*rally, *route.rally_points],
        "left_out": sorted(route.left_out),
    }
    return found | {name: value for name, value in others.items() if value}


def flat(items: object, depth: int = 0) -> Iterator[Mapping[str, Any]]:
    """Yield simple items in order, including those of surveys and corridor scans."""
    if not isinstance(items, list):
        raise InputError(f"has no mission items; {AGAIN}")
    if depth > DEEPEST or len(items) > MOST_ITEMS:
        raise InputError("has too many items; this is no plan of QGroundControl")
    for item in items:
        if not isinstance(item, dict):
            raise InputError("has an item that is no group of fields; save it again")
        kind = str(item.get("complexItemType"))[:40]
        if item.get("type") != "ComplexItem" or kind in LANDINGS:
            yield item
            continue
        inner = group(item.get("TransectStyleComplexItem")).get("Items", item.get("Items"))
        if inner is None and kind == "StructureScan":
            raise InputError(
                "has a structure scan, whose file holds the structure and no waypoints;"
                " draw waypoints round the structure instead"
            )
        if inner is None:
            raise InputError(
                f"has a complex item ({kind}) without its waypoints; save the plan again with QGroundControl"
            )
        yield from flat(inner, depth + 1)


def item_of(item: Mapping[str, Any], number: int) -> PlanItem:
    """Convert one JSON item of any version.

    Raises:
        InputError: the item has no command.
    """
    landing = str(item.get("complexItemType")) in LANDINGS
    command = LAND if landing else whole(item.get("command"))
    if command is None:
        raise InputError(f"item {number} has no command; {AGAIN}")
    values = item.get("params")
    if not isinstance(values, list):
        values = [item.get(f"param{one}") for one in range(1, 5)]
    found = values[4:] if len(values) == GEOGRAPHIC else item.get("coordinate")
    where = found if isinstance(found, list) else []
    label = whole(item.get("doJumpId", item.get("id")))
    return PlanItem(
        number=number,
        label=label,
        command=command,
        frame=whole(item.get("frame")),
        params=padded(values[:4], 4),
        place=padded(where, 3),
    )


def text_items(text: str) -> tuple[list[float], list[PlanItem]]:
    """Return (home or an empty list, items) of a text list of waypoints.

    Raises:
        InputError: the version is unknown, or a line is no item.
    """
    first, *lines = text.splitlines()
    version = first.split()[-1]
    if version not in {WITH_HOME, WITHOUT_HOME}:
        raise InputError(
            f"is a list of waypoints of version {version[:20]}, which is not known here; {AGAIN}"
        )
    home: list[float] = []
    items: list[PlanItem] = []
    for line, words in enumerate(map(str.split, lines), start=2):
        if not words or words[0].startswith("#"):
            continue
        try:
            values = [float(one) for one in words]
            number, frame, command = (int(values[at]) for at in (0, 2, 3))
        except (ValueError, OverflowError, IndexError):
            values = []
        if len(values) != COLUMNS or len(items) > MOST_ITEMS:
            raise InputError(
                f"is no list of waypoints at line {line}; save it again with its ground station"
            )
        item = PlanItem(
            number=number,
            label=number,
            command=command,
            frame=frame,
            params=padded(values[4:8], 4),
            place=padded(values[8:11], 3),
        )
        is_home = (number, frame, command) == (0, GLOBAL, WAYPOINT) and version == WITH_HOME
        if not is_home:
            items.append(item)
        elif any(item.place[:2]):
            home = numbers(values[8:11], 3)
    return home, items


def fence_of(fence: object) -> dict[str, list[dict[str, Any]]]:
    """Return polygons and circles of a fence of any version.

    Raises:
        InputError: the fence has unknown parts, which are never ignored.
    """
    if not isinstance(fence, dict):
        raise InputError(f"its geoFence is none; {AGAIN}")
    understood(fence, FENCE, FENCE_PARTS)
    polygons = [area_of(one) for one in areas_in(fence, "polygons")]
    if areas_in(fence, "polygon"):
        # Version 1 has one inclusion polygon.
        polygons.append({"polygon": fence["polygon"]})
    circles = [area_of(one) for one in areas_in(fence, "circles")]
    return {"polygons": [*map(polygon_of, polygons)], "circles": [*map(circle_of, circles)]}


def areas_in(fence: Mapping[str, Any], name: str) -> list[Any]:
    """Return a list of a fence; empty if absent."""
    found = fence.get(name)
    if not isinstance(found, list | None):
        raise InputError(f"its geoFence has {name} that are no list; {AGAIN}")
    return found or []


def area_of(area: object) -> Mapping[str, Any]:
    """Return an area of a fence after checking its version and type."""
    found = group(area)
    understood(found, AREA)
    if not isinstance(found.get("inclusion", True), bool):
        raise InputError(f"an area of the fence does not say whether to stay in or out; {AGAIN}")
    return found


def polygon_of(area: Mapping[str, Any]) -> dict[str, Any]:
    """Convert a polygon to a mission's fields."""
    corners = area.get("polygon")
    points = (
        [place(one, "a polygon of the fence") for one in corners]
        if isinstance(corners, list)
        else []
    )
    if len(points) < 3:
        raise InputError("a polygon of the fence has fewer than three corners; draw it again")
    return {"inclusion": area.get("inclusion", True), "points": points}


def circle_of(area: Mapping[str, Any]) -> dict[str, Any]:
    """Convert a circle to a mission's fields."""
    circle = group(area.get("circle"))
    radius_m = radius_of(circle.get("radius"))
    centre = place(circle.get("center"), "a circle of the fence")
    return {"inclusion": area.get("inclusion", True), "centre": centre, "radius_m": radius_m}


def rally_of(rally: object) -> list[dict[str, float]]:
    """Return rally points of any version.

    Raises:
        InputError: the rally points have unknown parts.
    """
    points = rally.get("points", []) if isinstance(rally, dict) else None
    if not isinstance(rally, dict) or not isinstance(points, list):
        raise InputError(f"its rallyPoints are none; {AGAIN}")
    understood(rally, RALLY, RALLY_PARTS)
    return [place(one, "a rally point") for one in points]


def understood(part: Mapping[str, Any], what: str, names: Collection[str] = ()) -> None:
    """Check that a part of a plan has a known version and, if `names` is given, no other fields.

    Old parts have no version, or `1.0`. Messages call the part `what`.

    Raises:
        InputError: the version or a field is unknown.
    """
    version, newest = part.get("version", 1), NEWEST_VERSIONS[what]
    if version not in (*range(1, newest + 1), "1.0"):
        raise InputError(
            f"has {what} of version {str(version)[:20]}, which is not known here ({newest} is the newest);"
            " save it with QGroundControl 4"
        )
    for name, value in part.items():
        if names and name not in names and value:
            raise InputError(f"has {what} with {name[:40]!r}, which is not known here; {AGAIN}")


def padded(values: list[Any], count: int) -> tuple[float, ...]:
    """Return `count` numbers, NaN where one is missing."""
    wanted = [*values, *[None] * count][:count]
    return tuple(float(one) if is_number(one) else math.nan for one in wanted)


def group(value: object) -> Mapping[str, Any]:
    """Return a group of fields; empty for anything else."""
    return value if isinstance(value, dict) else {}
