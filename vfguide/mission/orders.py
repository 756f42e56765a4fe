"""Orders in a mission: a time table of what the formation is to fly, and how fast its slots may move."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from vfguide.formation.arrangement import Point
from vfguide.formation.orders import Order
from vfguide.formation.shapes import Shape
from vfguide.mission.quantity import NotNegative, Number, Section, VehicleName

SlotOffset = Annotated[Number, Field(ge=-10e3, le=10e3)]


class Slot(Section):
    """A place in the formation, fixed to the leader's course."""

    forward_m: SlotOffset
    """Ahead of the leader, m; negative is behind."""

    right_m: SlotOffset
    """Right of the leader, m; negative is left."""

    up_m: SlotOffset = 0.0
    """Above the leader, m; negative is below."""

    @property
    def point(self) -> Point:
        """This place as a point of the formation."""
        return Point(self.forward_m, self.right_m, self.up_m)


class WrittenOrder(Section):
    """What a formation is to do, as somebody writes it down; docs/orders.md explains it."""

    shape: Shape | None = None
    """`vee`, `echelon-left`, `echelon-right`, `line-abreast`, `trail`, `diamond` or `finger-four`."""

    spacing_m: Annotated[Number, Field(ge=1.0, le=1000.0)] | None = None
    """Between neighbours, m; if absent as it is."""

    swap: tuple[VehicleName, VehicleName] | None = None
    """Two followers that change places."""

    slots: dict[VehicleName, Slot] = Field(default_factory=dict)
    """Slots by follower."""

    leave: tuple[VehicleName, ...] = ()
    """Followers that leave the formation, each to its autopilot's loiter."""

    join: tuple[VehicleName, ...] = ()
    """Followers that come back."""

    path: Annotated[str, Field(max_length=32)] | None = None
    """Another path to be followed: a name under `paths`, or `main`."""

    lead: VehicleName | None = None
    """Who is to lead: the leader or a deputy."""

    action: Literal["hold", "resume", "abort"] | None = None
    """`hold`: all circle, each at a height of its own; `resume`: the mission goes on; `abort`: everybody back
    to the autopilot, at once."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if self.order == Order():
            kind, text = (
                "order",
                "say what: shape, spacing_m, swap, slots, leave, join, path, lead or action",
            )
            raise PydanticCustomError(kind, text)
        if self.action == "abort" and self.order != Order(action="abort"):
            raise PydanticCustomError(
                "order", "an abort stands alone: nothing else is flown with it"
            )
        return self

    @property
    def order(self) -> Order:
        """What is wanted."""
        return Order(
            shape=self.shape,
            spacing=self.spacing_m,
            swap=self.swap,
            slots={name: slot.point for name, slot in self.slots.items()},
            leave=self.leave,
            join=self.join,
            action=self.action,
            path=self.path,
            lead=self.lead,
        )


class TimedOrder(WrittenOrder):
    """What the formation is to do from a moment of the flight on."""

    at_s: Annotated[NotNegative, Field(ge=5.0, le=86400.0)]
    """When it begins, s from the start; the formation agrees on it in the seconds before."""
