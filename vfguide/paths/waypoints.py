"""Route of straight legs between waypoints, with fillets at its corners and a choice of endings.

The waypoints come from the mission, or from a ground station's plan, whose fence `vfguide check` uses.
"""

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import msgspec
from pydantic import AfterValidator, Field, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError

from vfguide.elementwise import wrap_angle
from vfguide.errors import InputError
from vfguide.mission import quantity
from vfguide.mission.finding import Misfit
from vfguide.mission.flight_path import PathShape, shape_of
from vfguide.mission.place import MOST_WAYPOINTS, Fence, MissionFrame, Place, needed
from vfguide.mission.plan_file import read_plan
from vfguide.mission.quantity import NotNegative, Section
from vfguide.paths.chain import Chain, ChainedPath
from vfguide.paths.circle import Radius
from vfguide.paths.climb import HeightProfile
from vfguide.paths.pieces import (
    Bend,
    Element,
    Pieces,
    circle_entry,
    eased_turn,
    tangent_length,
    turn_back,
)
from vfguide.registry import paths

SHARPEST_RAD = math.radians(160.0)
"""Largest turn of a corner, rad: beyond it the route comes back along its own leg."""

LEAST_CIRCLE_M = 10.0
"""Smallest radius of the final circle, m; `check` tests what an aircraft can fly."""

NEAREST_M = 1.0
"""Smallest distance between two waypoints, m."""

LEAST_M = 1e-6
"""Length below which elements are dropped, m."""

USUAL_EASEMENT = 1.0
"""Default easement in units of the radius."""

End = Literal["repeat", "reverse", "loiter", "hand-back"]

FARTHEST_M = 100e3
"""Largest distance from the mission's origin, m: no formation of small aircraft flies farther away."""

FALLBACK_RADIUS_M = 100.0
"""Radius where the mission gives no speed, m."""


class Waypoint(Place):
    """A corner of a route."""

    up_m: Annotated[quantity.Number, Field(ge=-9000.0, le=9000.0)] = 0.0
    """Above the mission's flying height, m; negative is below."""

    altitude_amsl_m: Annotated[quantity.Number, Field(ge=-500.0, le=12000.0)] | None = None
    """Instead of `up_m`: above mean sea level, m."""

    radius_m: Radius | None = None
    """Radius of the fillet at this waypoint, m; that of the path if absent."""

    @model_validator(mode="after")
    def _one_height(self) -> Self:
        if self.altitude_amsl_m is not None and "up_m" in self.model_fields_set:
            raise PydanticCustomError("waypoint_height", "has both up_m and altitude_amsl_m")
        return self

    def up(self, frame: MissionFrame | None) -> float:
        """Return the height above the mission's flying height, m."""
        if self.altitude_amsl_m is None:
            return self.up_m
        base = needed(frame)
        return self.altitude_amsl_m - base.altitude_amsl_m - base.height_above_origin_m


def _round_something(radius_m: float) -> float:
    if abs(radius_m) < LEAST_CIRCLE_M:
        kind = "loiter_radius"
        message = "a circle of less than 10 m; write 10 or more, or -10 or less"
        raise PydanticCustomError(kind, message)
    return radius_m


class RouteShape(PathShape):
    """Fields common to all routes."""

    radius_m: Radius | None = None
    """Radius of the fillets, m; if absent the least that every vehicle of the formation flies with something
    to spare, at the mission's airspeed and in its wind."""

    easement_m: Annotated[NotNegative, Field(le=100e3)] | None = None
    """Length over which the curvature comes at the beginning of a fillet, and goes at its end, m; as long as
    the radius if absent."""

    loiter_radius_m: (
        Annotated[quantity.Number, AfterValidator(_round_something), Field(ge=-100e3, le=100e3)]
        | None
    ) = None
    """`loiter` and `hand-back`: radius of the circle, m, negative counter-clockwise; if absent that of the
    fillets, clockwise."""

    frame: SkipJsonSchema[MissionFrame | None] = Field(default=None, exclude=True)
    """Origin of coordinates and default radius; set by the mission."""

    @property
    @abstractmethod
    def corners(self) -> tuple[Waypoint, ...]:
        """Waypoints of the route."""

    @property
    @abstractmethod
    def after(self) -> End:
        """Ending after the last waypoint."""

    @property
    def curve(self) -> Mapping[str, Any]:
        """Fields of the shape, and its bend as (radius, easement), m."""
        return {**self.model_dump(), "bend": (self.bend.radius, self.bend.easement)}

    @property
    def circle_radius_m(self) -> float:
        """Radius of the circle at the end, m, negative counter-clockwise; 0 for that of the fillets."""
        return self.loiter_radius_m or 0.0

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle with the frame, which is no field of a mission."""
        return shape_of, (self.model_dump(exclude_unset=True) | {"frame": self.frame},)

    @property
    def bend(self) -> Bend:
        """Bend at waypoints without a radius of their own."""
        usual = self.frame.radius_m if self.frame is not None else FALLBACK_RADIUS_M
        return self.bend_of(self.radius_m if self.radius_m is not None else usual)

    def bend_of(self, radius_m: float) -> Bend:
        """Return the bend for a radius (m)."""
        easement_m = USUAL_EASEMENT * radius_m if self.easement_m is None else self.easement_m
        return Bend(radius_m, easement_m)

    def misfits(self) -> Iterator[Misfit]:
        """Yield the reasons why the route cannot be flown."""
        yield from WaypointRoute(self).misfits()


class WaypointsShape(RouteShape):
    """A route of straight legs between waypoints, with eased fillets at its corners."""

    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=2, max_length=MOST_WAYPOINTS)]
    """The corners in their order."""

    end: End = "loiter"
    """After the last waypoint. `repeat`: on to the first. `reverse`: turn, and back along the route, again
    and again. `loiter`: circle around the last one. `hand-back`: the same, and after a quarter of the circle
    all vehicles go back to their autopilots' loiter, each at a height of its own."""

    @property
    def corners(self) -> tuple[Waypoint, ...]:
        """Waypoints of the route."""
        return self.waypoints

    @property
    def after(self) -> End:
        """Ending after the last waypoint."""
        return self.end


class Corner(msgspec.Struct, frozen=True):
    """Waypoint with its turn."""

    north: float
    """North coordinate, m."""
    east: float
    """East coordinate, m."""
    up: float
    """Height above the mission's flying height, m."""
    bend: Bend
    """Fillet of the corner."""
    turn: float = 0.0
    """Turn, rad, positive clockwise; 0 where an open route begins or ends."""
    reach: float = 0.0
    """Distance from the corner to both ends of its fillet, m."""


class WaypointRoute:
    """Geometry of a shape: corners, and the legs between them."""

    def __init__(self, shape: RouteShape) -> None:
        """Place the waypoints in the plane, and compute each turn."""
        self.shape = shape
        self.closed = shape.after == "repeat"
        self.circles = shape.after in {"loiter", "hand-back"}
        self.places = [(*one.local(shape.frame), one.up(shape.frame)) for one in shape.corners]
        self.loiter = self._loiter_bend()
        self.entry = circle_entry(self.loiter, self._sense())
        self.legs = self._legs()
        self.corners = [self._corner(index) for index in range(len(self.places))]

    def _sense(self) -> float:
        return math.copysign(1.0, self.shape.circle_radius_m or 1.0)

    def _loiter_bend(self) -> Bend:
        given = self.shape.circle_radius_m
        return self.shape.bend if not given else self.shape.bend_of(abs(given))

    def _legs(self) -> list[tuple[float, float]]:
        """Return the (length in m, course in rad) of the line from each waypoint to the next."""
        ends = [*self.places[1:], *self.places[:1]] if self.closed else self.places[1:]
        legs = [
            (
                math.hypot(there[0] - here[0], there[1] - here[1]),
                math.atan2(there[1] - here[1], there[0] - here[0]),
            )
            for here, there in zip(self.places, ends, strict=False)
        ]
        if self.circles and legs[-1][0] > self.entry.aside:
            # The last leg ends where it touches the circle, not at its centre.
            length, course = legs[-1]
            off = math.asin(self.entry.aside / length)
            legs[-1] = (length * math.cos(off), course - self._sense() * off)
        return legs

    def _corner(self, index: int) -> Corner:
        north, east, up = self.places[index]
        waypoint = self.shape.corners[index]
        bend = (
            self.shape.bend if waypoint.radius_m is None else self.shape.bend_of(waypoint.radius_m)
        )
        if not self.closed and index in {0, len(self.places) - 1}:
            return Corner(north, east, up, bend)
        turn = wrap_angle(self.legs[index][1] - self.legs[index - 1][1])
        reach = tangent_length(turn, bend) if abs(turn) <= SHARPEST_RAD else 0.0
        return Corner(north, east, up, bend, turn, reach)

    def misfits(self) -> Iterator[Misfit]:
        """Yield waypoints too far or coincident, corners too sharp, and legs too short for their fillets."""
        for index, (north, east, *_) in enumerate(self.places):
            if (distance := math.hypot(north, east)) > FARTHEST_M:
                yield Misfit(
                    ("waypoints", index),
                    f"is {distance / 1e3:.0f} km away from the origin",
                    f"correct its coordinates: {FARTHEST_M / 1e3:.0f} km at most",
                )
                return
        for index, (length, _) in enumerate(self.legs):
            if length < NEAREST_M:
                yield Misfit(
                    ("waypoints", self._next(index)),
                    f"is the same place as {self._named(index)}",
                    f"remove it, or move it {NEAREST_M:g} m away or more",
                )
                return
        sharp = [at for at, one in enumerate(self.corners) if abs(one.turn) > SHARPEST_RAD]
        for index in sharp:
            yield Misfit(
                ("waypoints", index),
                f"the route turns back by {math.degrees(abs(self.corners[index].turn)):.0f}° here",
                f"a corner turns by {math.degrees(SHARPEST_RAD):.0f}° at most: put a waypoint beside it, or"
                " end: reverse where the route ends",
            )
        if not sharp:
            for index in range(len(self.legs)):
                yield from self._short_leg(index)

    def _short_leg(self, index: int) -> Iterator[Misfit]:
        length, last = self.legs[index][0], index == len(self.legs) - 1
        if (
            last
            and self.circles
            and math.dist(self.places[-2][:2], self.places[-1][:2]) <= self.entry.aside
        ):
            yield Misfit(
                ("waypoints", index + 1),
                f"the circle of {self.loiter.radius:.0f} m around it reaches beyond the waypoint before it",
                "move it further away, or make loiter_radius_m smaller",
            )
            return
        needed = self.corners[index].reach + self.corners[self._next(index)].reach
        needed += self.entry.before if last and self.circles else 0.0
        if needed <= length:
            return
        fits = self._radius_that_fits(index)
        remedy = f"radius_m: {fits} fits, " if fits >= 1 else ""
        radius_m = self.corners[self._next(index)].bend.radius
        yield Misfit(
            ("waypoints", self._next(index)),
            f"the leg from {self._named(index)} to {self._named(self._next(index))} is {length:.0f} m long,"
            f" its fillets need {needed:.0f} m at a radius of {radius_m:.0f} m",
            f"{remedy}or move the waypoints further apart, or fly slower",
        )

    def _radius_that_fits(self, index: int) -> int:
        """Return the largest radius (whole m) with which a leg has room for its fillets; 0 for none."""
        turns = [self.corners[at].turn for at in (index, self._next(index))]
        length, last = self.legs[index][0], index == len(self.legs) - 1

        def needed(radius: float) -> float:
            bend = self.shape.bend_of(radius)
            entry = circle_entry(bend, 1.0).before if last and self.circles else 0.0
            return entry + sum(tangent_length(turn, bend) for turn in turns)

        least, most = 0, max(1, math.floor(self.shape.bend.radius))
        while least < most:
            middle = (least + most + 1) // 2
            least, most = (middle, most) if needed(middle) <= length else (least, middle - 1)
        return least

    def _next(self, index: int) -> int:
        return (index + 1) % len(self.places)

    def _named(self, index: int) -> str:
        north, east, _ = self.places[index]
        return f"waypoint {index + 1} (north {north:.0f} m, east {east:.0f} m)"

    def line(self) -> "ElementChain":
        """Return the whole route as one line."""
        first = self.corners[0]
        course = self.legs[0][1]
        begin = (
            first.north + first.reach * math.cos(course),
            first.east + first.reach * math.sin(course),
        )
        line = ElementChain(*begin, course)
        if not self.closed:
            line.note(first.up)
        for index in range(len(self.legs)):
            self._leg(line, index)
        if self.closed:
            progress, up = line.knots[-1]
            line.knots.insert(0, (progress - line.run, up))
        elif self.circles:
            line.note(self.corners[-1].up)
            line.add(self.entry.elements)
            line.again = line.run
            curvature = self._sense() / self.loiter.radius
            line.add([Element(2.0 * math.pi * self.loiter.radius, curvature)])
        else:
            self._turn_back(line, self.corners[-1])
            for index in reversed(range(len(self.legs))):
                self._leg(line, index, -1.0)
            self._turn_back(line, first)
        return line

    def _leg(self, line: "ElementChain", index: int, way: float = 1.0) -> None:
        """Append a leg, forward or back (-1.0), and the turn at its end."""
        near, far = self.corners[index], self.corners[self._next(index)]
        length = self.legs[index][0] - near.reach - far.reach
        if self.circles and index == len(self.legs) - 1:
            length -= self.entry.before
        line.add([Element(max(length, 0.0))])
        end, ends = (far, self._next(index)) if way > 0.0 else (near, index)
        if self.closed or 0 < ends < len(self.places) - 1:
            turn = eased_turn(way * end.turn, end.bend)
            before = line.run
            line.add(turn)
            line.note(end.up, 0.5 * (before + line.run))
        elif not self.circles:
            line.note(end.up)

    def _turn_back(self, line: "ElementChain", corner: Corner) -> None:
        """Append a turn beyond an end of the route, and the way back to it."""
        elements = turn_back(corner.bend)
        line.add(elements)
        line.add([Element(Pieces.of(0.0, 0.0, 0.0, elements).end()[0])])
        line.note(corner.up)


class ElementChain:
    """Line built up element by element."""

    def __init__(self, north: float, east: float, course: float) -> None:
        """Begin at a position (m) on a course (rad)."""
        self.begin = (north, east, course)
        self.elements: list[Element] = []
        self.knots: list[tuple[float, float]] = []
        """(progress, height) of the waypoints, m."""
        self.run = 0.0
        """Length so far, m."""
        self.again = 0.0
        """Progress that follows the end, m."""

    def add(self, elements: Iterable[Element]) -> None:
        """Append elements."""
        for one in elements:
            if one.length >= LEAST_M:
                self.elements.append(one)
                self.run += one.length

    def note(self, up: float, progress: float | None = None) -> None:
        """Set the height (m) here, or at a progress (m)."""
        self.knots.append((self.run if progress is None else progress, up))


@paths.register("waypoints")
class Waypoints(ChainedPath):
    """Route with one of the endings after its last waypoint."""

    Shape: ClassVar[type[RouteShape]] = WaypointsShape

    def __init__(self, shape: RouteShape) -> None:
        """Create the route of a shape without misfits."""
        line = WaypointRoute(shape).line()
        self.chain = Chain(Pieces.of(*line.begin, line.elements), again=line.again)
        self.heights = HeightProfile(line.knots, closed=line.again == 0.0)
        self._last_circle = line.again if shape.after == "hand-back" else None

    @property
    def last_circle(self) -> float | None:
        """Progress at which the final circle for the hand-back begins, m; None without one."""
        return self._last_circle

    @classmethod
    def of(cls, shape: RouteShape) -> Self:
        """Return the route of a mission."""
        return cls(shape)


class PlanContents(Section):
    """Contents of a plan file when the mission was read."""

    file: str
    """Name of the plan file."""

    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=2, max_length=MOST_WAYPOINTS)]
    """Waypoints of the plan's mission, with those of surveys."""

    end: End
    """Ending by the plan's last item."""

    loiter_radius_m: quantity.Number = 0.0
    """Radius of the final loiter, m; negative counter-clockwise, 0 where the plan gives none."""

    home: Place | None = None
    """Intended take-off position."""

    fence: Fence = Fence()
    """The plan's fence."""

    rally_points: tuple[Place, ...] = ()
    """Rally points for autopilots that return."""

    left_out: tuple[str, ...] = ()
    """Items of the plan that a formation does not fly."""


class PlanShape(RouteShape):
    """The route of a plan that was drawn with a ground station, with its altitudes."""

    file: Annotated[str, Field(min_length=1, max_length=1000)]
    """A `.plan`, `.waypoints` or `.mission`, relative to the mission file."""

    end: End | None = None
    """After the last waypoint, as of `waypoints`; as the plan's last item has it if absent: `repeat` for
    a jump to the first waypoint, `hand-back` for a return or a landing, else `loiter`."""

    contents: SkipJsonSchema[PlanContents | None] = None
    """Contents of the file, so that the mission can be copied without it."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:  # noqa: ANN401 - whatever the mission file says
        """Read the file, unless it has been read."""
        if not isinstance(data, Mapping) or not isinstance(data.get("file"), str):
            return data
        contents = data.get("contents")
        file = (
            contents.get("file")
            if isinstance(contents, Mapping)
            else getattr(contents, "file", None)
        )
        if file == data["file"]:
            return data
        try:
            return {**data, "contents": {"file": data["file"], **read_plan(Path(data["file"]))}}
        except InputError as error:
            message, _, remedy = str(error).rpartition("; ")
            context = {"text": message, "remedy": remedy}
            raise PydanticCustomError("plan", "{text}", context) from error

    @property
    def read(self) -> PlanContents:
        """Contents of the file."""
        if self.contents is None:
            raise InputError(f"path.file: {self.file} has not been read; load the mission again")
        return self.contents

    @property
    def curve(self) -> Mapping[str, Any]:
        """Fields of the route, without the file's name and the plan's other contents."""
        route = {"waypoints", "end", "loiter_radius_m"}
        return {**super().curve, "file": None, "contents": self.read.model_dump(include=route)}

    @property
    def corners(self) -> tuple[Waypoint, ...]:
        """Waypoints of the route."""
        return self.read.waypoints

    @property
    def after(self) -> End:
        """Ending after the last waypoint."""
        return self.end or self.read.end

    @property
    def circle_radius_m(self) -> float:
        """Radius of the circle at the end, m, negative counter-clockwise; 0 for that of the fillets."""
        return self.loiter_radius_m or self.read.loiter_radius_m

    @property
    def fence(self) -> Fence:
        """Fence of the plan."""
        return self.read.fence

    @property
    def home(self) -> Place | None:
        """Intended take-off position of the plan."""
        return self.read.home

    @property
    def rally_points(self) -> tuple[Place, ...]:
        """Rally points of the plan."""
        return self.read.rally_points

    @property
    def left_out(self) -> tuple[str, ...]:
        """Items of the plan that a formation does not fly."""
        return self.read.left_out

    def misfits(self) -> Iterator[Misfit]:
        """Yield the route's misfits at the file, because its waypoints have no line in the mission."""
        for one in super().misfits():
            yield Misfit(
                ("file",), f"waypoint {int(one.location[-1]) + 1}: {one.message}", one.remedy
            )


@paths.register("plan")
class Plan(Waypoints):
    """Route of a plan."""

    Shape: ClassVar[type[RouteShape]] = PlanShape
