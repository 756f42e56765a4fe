"""Points on the ground as a mission says them: in its local frame, or by latitude and longitude."""

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from vfguide.frames import LocalFrame
from vfguide.mission.quantity import Coordinate, Number, Section


class MissionFrame(Section):
    """What a path takes from the rest of its mission."""

    latitude_deg: float
    """Of the mission's origin."""

    longitude_deg: float
    """Of the origin."""

    altitude_amsl_m: float
    """Of the origin, m."""

    height_above_origin_m: float
    """The mission's flying height, m."""

    radius_m: float
    """Least radius of a turn that suits every vehicle of the formation, m."""

    @property
    def local(self) -> LocalFrame:
        """Of the origin."""
        return LocalFrame(self.latitude_deg, self.longitude_deg, self.altitude_amsl_m)


class Place(Section):
    """A point on the ground: `north_m` and `east_m`, or `latitude_deg` and `longitude_deg`."""

    PAIRS: ClassVar = ("north_m", "east_m", "latitude_deg", "longitude_deg")

    north_m: Coordinate | None = None
    """Metres north of the mission's origin."""

    east_m: Coordinate | None = None
    """Metres east of it."""

    latitude_deg: Annotated[Number, Field(ge=-85.0, le=85.0)] | None = None
    """Instead of `north_m` and `east_m`, with `longitude_deg`."""

    longitude_deg: Annotated[Number, Field(ge=-180.0, le=180.0)] | None = None
    """East positive."""

    @model_validator(mode="after")
    def _in_one_way(self) -> Self:
        given = [getattr(self, name) is not None for name in self.PAIRS]
        if given not in ([True, True, False, False], [False, False, True, True]):
            message = "needs north_m and east_m, or latitude_deg and longitude_deg"
            raise PydanticCustomError("place", message)
        return self

    def local(self, frame: MissionFrame | None) -> tuple[float, float]:
        """(north, east) in the mission's frame, m."""
        if self.latitude_deg is None or self.longitude_deg is None or frame is None:
            return self.north_m or 0.0, self.east_m or 0.0
        return frame.local.to_local(self.latitude_deg, self.longitude_deg)
