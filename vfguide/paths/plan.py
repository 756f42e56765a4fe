"""A plan of a ground station as a path: its waypoints are the route, `vfguide check` knows its fence."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError

from vfguide.errors import InputError
from vfguide.mission import quantity
from vfguide.mission.flight_path import Misfit
from vfguide.mission.place import MOST_WAYPOINTS, Fence, Place
from vfguide.mission.plan_file import read_plan
from vfguide.mission.quantity import Section
from vfguide.paths.waypoints import End, RouteShape, Waypoint, Waypoints
from vfguide.registry import paths


class PlanContents(Section):
    """What a plan file said when the mission was read."""

    file: str
    """Which."""

    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=2, max_length=MOST_WAYPOINTS)]
    """Waypoints of the plan's mission, with those of surveys."""

    end: End
    """What its last item asks for."""

    loiter_radius_m: quantity.Number = 0.0
    """Radius of the loiter that ends the mission, m; negative counter-clockwise, 0 where it gives none."""

    home: Place | None = None
    """Where it is meant to take off."""

    fence: Fence = Fence()
    """The plan's fence."""

    rally_points: tuple[Place, ...] = ()
    """Where autopilots may go when they return."""

    left_out: tuple[str, ...] = ()
    """What it also asks for, and a formation does not do."""


class PlanShape(RouteShape):
    """The route of a plan that was drawn with a ground station, with its altitudes."""

    file: Annotated[str, Field(min_length=1, max_length=1000)]
    """A `.plan`, `.waypoints` or `.mission`, relative to the mission file."""

    end: End | None = None
    """After the last waypoint, as of `waypoints`; as the plan's last item has it if absent: `repeat` for
    a jump to the first waypoint, `hand-back` for a return or a landing, else `loiter`."""

    contents: SkipJsonSchema[PlanContents | None] = None
    """What the file said, so that the mission can be taken elsewhere without it."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:  # noqa: ANN401 - whatever the mission file says
        """Read the file, if it has not been read yet."""
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
        """What the file said."""
        if self.contents is None:
            raise InputError(f"path.file: {self.file} has not been read; load the mission again")
        return self.contents

    @property
    def curve(self) -> Mapping[str, Any]:
        """All but what the file is called, and what it says beside the route."""
        route = {"waypoints", "end", "loiter_radius_m"}
        return {
            **super().curve,
            "file": None,
            "contents": self.read.model_dump(include=route),
        }

    @property
    def corners(self) -> tuple[Waypoint, ...]:
        """The waypoints."""
        return self.read.waypoints

    @property
    def after(self) -> End:
        """What comes after the last of them."""
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
        """Where the plan is meant to take off."""
        return self.read.home

    @property
    def rally_points(self) -> tuple[Place, ...]:
        """Rally points of the plan."""
        return self.read.rally_points

    @property
    def left_out(self) -> tuple[str, ...]:
        """What the plan also asks for, and a formation does not do."""
        return self.read.left_out

    def misfits(self) -> Iterator[Misfit]:
        """What keeps the route from being flown; waypoints have no line in the mission."""
        for one in super().misfits():
            yield Misfit(
                ("file",), f"waypoint {int(one.location[-1]) + 1}: {one.message}", one.remedy
            )


@paths.register("plan")
class Plan(Waypoints):
    """The route of a plan."""

    Shape: ClassVar[type[RouteShape]] = PlanShape
