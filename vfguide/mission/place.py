"""Places and fences of a mission file, and their local frame.

A fence limits where and how high a formation may fly. A vehicle has to be inside every inclusion area and
outside every exclusion area, as with ArduPlane; for PX4 one inclusion area suffices.

A route needs the origin and the turn radius of its mission. Both are read from plain data, as in
`consistency`, since other parts of the mission may still be invalid.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.frames import LocalFrame
from vfguide.guidance.airframe import GRAVITY
from vfguide.mission.consistency import (
    DEFAULT_AIRSPEED_RANGE_M_S,
    airspeed_range,
    group,
    listed,
    number,
)
from vfguide.mission.quantity import Coordinate, Number, Positive, Section, Switch
from vfguide.mission.vehicle import DEFAULT_MAX_BANK_DEG
from vfguide.registry import paths

MOST_AREAS, MOST_CORNERS = 100, 500

MOST_WAYPOINTS = 2000
"""Maximum number of waypoints of one route."""

ENGAGED_M = 5000.0
"""Maximum distance from path or slot at which a vehicle is engaged."""

EDGE_POINTS = 121
"""Number of points of a drawn circle."""


class MissionFrame(Section):
    """Data that a path takes from the rest of its mission."""

    latitude_deg: float
    """Latitude of the mission's origin, degrees."""

    longitude_deg: float
    """Longitude of the mission's origin, degrees."""

    altitude_amsl_m: float
    """Altitude of the origin above mean sea level, m."""

    height_above_origin_m: float
    """The mission's flying height, m."""

    radius_m: float
    """Least radius of a turn that suits every vehicle of the formation, m."""

    @property
    def local(self) -> LocalFrame:
        """Local frame about the origin."""
        return LocalFrame(self.latitude_deg, self.longitude_deg, self.altitude_amsl_m)


def needed(frame: MissionFrame | None) -> MissionFrame:
    """Return the frame of a mission.

    Raises:
        PydanticCustomError: the mission's origin is missing or invalid.
    """
    if frame is None:
        raise PydanticCustomError(
            "frame", "needs the mission's origin, which is missing or invalid"
        )
    return frame


class Place(Section):
    """A point on the ground: `north_m` and `east_m`, or `latitude_deg` and `longitude_deg`."""

    PAIRS: ClassVar = ("north_m", "east_m", "latitude_deg", "longitude_deg")

    north_m: Coordinate | None = None
    """Metres north of the mission's origin."""

    east_m: Coordinate | None = None
    """Metres east of the mission's origin."""

    latitude_deg: Annotated[Number, Field(ge=-85.0, le=85.0)] | None = None
    """Latitude, degrees, north positive; with `longitude_deg` instead of `north_m` and `east_m`."""

    longitude_deg: Annotated[Number, Field(ge=-180.0, le=180.0)] | None = None
    """Longitude, degrees, east positive."""

    @model_validator(mode="after")
    def _in_one_way(self) -> Self:
        given = [getattr(self, name) is not None for name in self.PAIRS]
        if given not in ([True, True, False, False], [False, False, True, True]):
            message = "needs north_m and east_m, or latitude_deg and longitude_deg"
            raise PydanticCustomError("place", message)
        return self

    def local(self, frame: MissionFrame | None) -> tuple[float, float]:
        """Return (north, east) in the mission's frame, m.

        Raises:
            PydanticCustomError: it is given by latitude and longitude, and there is no frame.
        """
        if self.latitude_deg is None or self.longitude_deg is None:
            return self.north_m or 0.0, self.east_m or 0.0
        return needed(frame).local.to_local(self.latitude_deg, self.longitude_deg)


class FencePolygon(Section):
    """An area with straight edges."""

    inclusion: Switch = True
    """Whether vehicles have to stay inside (true) or outside (false)."""

    points: Annotated[tuple[Place, ...], Field(min_length=3, max_length=MOST_CORNERS)]
    """Corners in order."""

    def inward(self, north: FloatArray, east: FloatArray, frame: MissionFrame | None) -> FloatArray:
        """Return the distance (m) of places (m) inside the edges; negative outside."""
        corners = np.array([one.local(frame) for one in self.points])
        shape = north.shape
        inside: BoolArray = np.zeros(shape, dtype=bool)
        nearest = np.full(shape, math.inf)
        for here, there in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            edge = there - here
            span = max(float(edge @ edge), 1e-12)
            away_north, away_east = north - here[0], east - here[1]
            run = np.clip((away_north * edge[0] + away_east * edge[1]) / span, 0.0, 1.0)
            distance = np.hypot(away_north - run * edge[0], away_east - run * edge[1])
            nearest = np.minimum(nearest, distance)
            # A ray due north crosses the edge if the ends of the edge are on both sides of the ray.
            crosses = (here[1] > east) != (there[1] > east)
            rise = np.divide(edge[0], edge[1], where=edge[1] != 0.0, out=np.zeros(()))
            inside ^= crosses & (here[0] + rise * away_east > north)
        return np.where(inside, nearest, -nearest)

    def edge(self, frame: MissionFrame | None) -> tuple[FloatArray, FloatArray]:
        """Return (north, east) of the corners in order and the first one again, m."""
        corners = np.array([one.local(frame) for one in (*self.points, self.points[0])])
        return corners[:, 0], corners[:, 1]


class FenceCircle(Section):
    """A round area."""

    inclusion: Switch = True
    """Whether vehicles have to stay inside (true) or outside (false)."""

    centre: Place
    """Centre of the circle."""

    radius_m: Annotated[Positive, Field(le=1000e3)]
    """m."""

    def inward(self, north: FloatArray, east: FloatArray, frame: MissionFrame | None) -> FloatArray:
        """Return the distance (m) of places (m) inside the circle; negative outside."""
        middle = self.centre.local(frame)
        return np.asarray(self.radius_m - np.hypot(north - middle[0], east - middle[1]))

    def edge(self, frame: MissionFrame | None) -> tuple[FloatArray, FloatArray]:
        """Return (north, east) of points once round the circle, the last equal to the first, m."""
        north, east = self.centre.local(frame)
        angle = np.linspace(0.0, math.tau, EDGE_POINTS)
        return north + self.radius_m * np.cos(angle), east + self.radius_m * np.sin(angle)


class Fence(Section):
    """Area limits of every vehicle of the formation; `vfguide check` checks all slots."""

    polygons: Annotated[tuple[FencePolygon, ...], Field(max_length=MOST_AREAS)] = ()
    """Areas with straight edges."""

    circles: Annotated[tuple[FenceCircle, ...], Field(max_length=MOST_AREAS)] = ()
    """Round areas."""

    max_height_m: Annotated[Positive, Field(le=12000.0)] | None = None
    """Maximum height above the mission's origin, m; unlimited if absent."""

    @property
    def exists(self) -> bool:
        """Whether the fence limits anything."""
        return bool(self.polygons or self.circles or self.max_height_m)

    @property
    def areas(self) -> tuple[FencePolygon | FenceCircle, ...]:
        """All areas."""
        return (*self.polygons, *self.circles)

    def room(self, north: FloatArray, east: FloatArray, frame: MissionFrame | None) -> FloatArray:
        """Return the distance (m) of places (m) to the nearest limit; negative beyond it."""
        least = np.full(north.shape, math.inf)
        for area in self.areas:
            inward = area.inward(north, east, frame)
            least = np.minimum(least, inward if area.inclusion else -inward)
        return least


BANK_SHARE = 2.0 / 3.0
"""Share of a vehicle's bank limit used on turns without a given radius; the rest is for gusts and for
returning to the slot."""

SPARE_M_S = 1.0
"""Airspeed margin of a slot at both ends of its vehicle's range, on turns without a given radius."""

WIDEST_M = 2000.0
"""Maximum radius of turns without a given radius; a slot that needs more needs another mission."""

ARTICLE_WIND_M_S = 8.0
"""Maximum speed of the article's wind."""


def with_frame(data: object) -> object:
    """Return a mission, given as plain data, with the frame added to paths that need it; else unchanged."""
    if not isinstance(data, Mapping):
        return data
    frame = frame_of(data)
    if frame is None:
        return data
    framed = {"path": _framed(data["path"], frame)} if "path" in data else {}
    others = data.get("paths")
    if isinstance(others, Mapping):
        framed["paths"] = {name: _framed(path, frame) for name, path in others.items()}
    return {**data, **framed}


def _framed(path: object, frame: MissionFrame) -> object:
    if isinstance(path, Mapping) and takes_frame(path.get("type")):
        return {**path, "frame": frame}
    return path


def takes_frame(kind: object) -> bool:
    """Check whether a type of path needs the mission's frame."""
    known = isinstance(kind, str) and kind in paths.own
    return known and "frame" in paths.find(str(kind)).Shape.model_fields


def frame_of(data: Mapping[str, object]) -> MissionFrame | None:
    """Return the frame of a mission; None where its data are missing or invalid."""
    origin = group(data, "origin")
    values = [
        number(origin.get(name)) for name in ("latitude_deg", "longitude_deg", "altitude_amsl_m")
    ]
    height = number(data.get("height_above_origin_m", 100.0))
    latitude, longitude, altitude = values
    if latitude is None or longitude is None or altitude is None or height is None:
        return None
    if abs(latitude) > 85.0 or abs(longitude) > 180.0:
        return None
    return MissionFrame(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=altitude,
        height_above_origin_m=height,
        radius_m=least_radius(data),
    )


def least_radius(data: Mapping[str, object]) -> float:
    """Return the radius (m, whole) of turns that every vehicle of the formation flies with some margin.

    At the leader's ground speed V in the strongest tailwind, a slot y metres outside flies V (1 + y / R) and
    needs a bank of atan(V² (1 + y / R) / (g R)). Its airspeed is about the leader's plus or minus V y / R.
    """
    airspeed = number(group(data, "leader").get("airspeed_m_s")) or 20.0
    speed = airspeed + wind_speed(group(data, "wind"))
    radius = 1.0
    for vehicle, aside in slots(data):
        bank = math.radians(number(vehicle.get("max_bank_deg")) or DEFAULT_MAX_BANK_DEG)
        acceleration = GRAVITY * math.tan(max(min(bank, 1.4), 0.01) * BANK_SHARE)
        tight = speed * speed / acceleration
        # R² - tight R - tight y = 0
        radius = max(radius, 0.5 * (tight + math.sqrt(tight * tight + 4.0 * tight * aside)))
        lowest, highest = airspeed_range(vehicle) or DEFAULT_AIRSPEED_RANGE_M_S
        for room in (airspeed - lowest, highest - airspeed):
            if aside > 0.0:
                radius = max(radius, aside * speed / max(room - SPARE_M_S, 0.1))
    return float(math.ceil(min(radius, WIDEST_M)))


def slots(data: Mapping[str, object]) -> Iterator[tuple[Mapping[str, object], float]]:
    """Yield (vehicle, sideways distance of its slot from the leader in m) of the leader and all followers."""
    vehicles = group(data, "vehicles")
    yield group(vehicles.get(str(group(data, "leader").get("vehicle")))), 0.0
    for one in listed(data.get("followers")):
        aside = number(group(one, "slot").get("right_m"))
        yield group(vehicles.get(str(group(one).get("vehicle")))), abs(aside or 0.0)


def wind_speed(wind: Mapping[str, object]) -> float:
    """Return the maximum speed of the mean wind, m/s."""
    if wind.get("type") == "article":
        return ARTICLE_WIND_M_S
    return max(number(wind.get("speed_m_s")) or 0.0, 0.0)
