"""The whole mission file, as immutable values."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    SerializeAsAny,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from vfguide.formation.arrangement import MAIN_PATH, Point, Shape
from vfguide.formation.orders import Order
from vfguide.guidance.formation import Slot as GuidanceSlot
from vfguide.mission.consistency import MAX_DEPUTIES, MAX_FOLLOWERS, completed, inconsistencies
from vfguide.mission.controller import Controller, chosen_controller, controller_of
from vfguide.mission.finding import Misfit, dotted, refuse
from vfguide.mission.flight_path import PathShape, chosen_path, curve_check
from vfguide.mission.place import Fence, with_frame
from vfguide.mission.quantity import (
    Duration,
    MissionName,
    NotNegative,
    Number,
    PathName,
    Positive,
    Section,
    Speed,
    VehicleName,
    known_in,
)
from vfguide.mission.rehearsal import Acceptance, CalmWind, Rehearsal, Wind
from vfguide.mission.vehicle import Vehicle
from vfguide.registry import leader_laws

SlotOffset = Annotated[Number, Field(ge=-10e3, le=10e3)]


class Slot(Section):
    """Position in the formation, relative to the leader's course."""

    forward_m: SlotOffset
    """Ahead of the leader, m; negative is behind."""

    right_m: SlotOffset
    """Right of the leader, m; negative is left."""

    up_m: SlotOffset = 0.0
    """Above the leader, m; negative is below."""

    @property
    def of_guidance(self) -> GuidanceSlot:
        """Slot in the horizontal plane, as guidance uses it."""
        return GuidanceSlot(forward=self.forward_m, right=self.right_m)

    @property
    def point(self) -> Point:
        """Slot as a point of the formation."""
        return Point(self.forward_m, self.right_m, self.up_m)


class WrittenOrder(Section):
    """An order to the formation as a file states it; docs/orders.md explains it."""

    shape: Shape | None = None
    """Shape: `vee`, `echelon-left`, `echelon-right`, `line-abreast`, `trail`, `diamond` or `finger-four`."""

    spacing_m: Annotated[Number, Field(ge=1.0, le=1000.0)] | None = None
    """Spacing of neighbours, m; unchanged if absent."""

    swap: tuple[VehicleName, VehicleName] | None = None
    """Two followers that exchange slots."""

    slots: dict[VehicleName, Slot] = Field(default_factory=dict)
    """Slots by follower."""

    leave: tuple[VehicleName, ...] = ()
    """Followers that leave the formation, each to its autopilot's loiter."""

    join: tuple[VehicleName, ...] = ()
    """Followers that return to the formation."""

    path: Annotated[str, Field(max_length=32)] | None = None
    """Path to change to: a name under `paths`, or `main`."""

    lead: VehicleName | None = None
    """Vehicle that takes the lead: the leader or a deputy."""

    action: Literal["hold", "resume", "abort"] | None = None
    """`hold`: all vehicles circle, each at its own height; `resume`: the mission continues; `abort`: all
    vehicles return to their autopilots at once."""

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
        """The order as the formation uses it."""
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
    """An order to the formation at a time of the flight."""

    at_s: Annotated[NotNegative, Field(ge=5.0, le=86400.0)]
    """Beginning of the manoeuvre, s from the start; the formation agrees on it in the seconds before."""


MAX_PATHS = 16
"""Maximum number of other paths; every companion checks all of them before the flight."""

Silence = Annotated[Positive, Field(le=3600.0)]


class Timeouts(Section):
    """Timeouts of telemetry and leader states, and their consequences."""

    telemetry_s: Silence = 1.0
    """Age of position reports after which the companion stops sending setpoints until reports resume, s."""

    telemetry_lost_s: Silence = 10.0
    """Age of position reports after which a steered vehicle is handed back to its autopilot, s."""

    leader_s: Silence = 0.6
    """Age of leader states after which the leader is predicted along its path, s."""

    prediction_s: Silence = 30.0
    """Maximum age of a leader state for prediction, s; then the formation breaks up."""

    breakaway_s: Annotated[NotNegative, Field(le=3600.0)] = 25.0
    """Time for which each follower then flies away from the others, before its autopilot takes over, s."""


class Origin(Section):
    """A point on the earth's surface."""

    latitude_deg: Annotated[Number, Field(ge=-85.0, le=85.0)]
    """Latitude, degrees, north positive."""

    longitude_deg: Annotated[Number, Field(ge=-180.0, le=180.0)]
    """Longitude, degrees, east positive."""

    altitude_amsl_m: Annotated[Number, Field(ge=-500.0, le=9000.0)]
    """Altitude above mean sea level, m."""


def _with_scheme(address: str) -> str:
    scheme, separator, rest = address.partition("://")
    if not (separator and scheme and rest):
        kind, message = "connection", "write an address such as udpin://0.0.0.0:14560"
        raise PydanticCustomError(kind, message)
    return address


class Leader(Section):
    """The vehicle that followers follow: one with a path, or any aircraft with MAVLink or ADS-B messages."""

    vehicle: VehicleName
    """Name under `vehicles`. Without a companion the default is `leader`, and the entry is optional."""

    airspeed_m_s: Speed
    """Airspeed, m/s; without a companion the expected airspeed, 20 by default."""

    follows: Literal["companion", "mavlink", "adsb"] = "companion"
    """Source of the leader's position. `companion`: a leader with a companion, over the formation's link.
    `mavlink`: an aircraft without one, from its MAVLink positions. `adsb`: an aircraft received by ADS-B,
    from at least 100 m away."""

    connection: Annotated[str, AfterValidator(_with_scheme)] | None = None
    """MAVLink address at which each follower's companion hears a leader without one, as for `--mavlink`."""

    system_id: Annotated[int, Field(strict=True, ge=1, le=255)] | None = None
    """`mavlink`: system id of the leader, if it has no entry under `vehicles`."""

    icao_address: Annotated[int, Field(strict=True, ge=1, le=0xFFFFFF)] | None = None
    """`adsb`: 24-bit address of the leader, such as 0x4B1900."""

    least_delay_s: Annotated[Duration, Field(le=5.0)] | None = None
    """Minimum latency of messages from a leader without a companion, s. If absent, followers ask the leader
    for its time. Without an answer they fly behind their slots by the latency times the speed."""

    @property
    def is_foreign(self) -> bool:
        """Whether the leader has no companion."""
        return self.follows != "companion"

    def misfits(self) -> Iterator[Misfit]:
        """Yield fields that this kind of leader must not have, and required ones that are missing."""
        kinds = {
            "connection": ("mavlink", "adsb"),
            "system_id": ("mavlink",),
            "icao_address": ("adsb",),
            "least_delay_s": ("mavlink", "adsb"),
        }
        for field, of in kinds.items():
            if self.follows not in of and getattr(self, field) is not None:
                yield Misfit(
                    (field,),
                    f"a leader that followers hear by `follows: {self.follows}` has none",
                    f"write follows: {' or '.join(of)}, or remove it",
                )
        needs = {"mavlink": ("connection",), "adsb": ("connection", "icao_address")}
        examples = {"connection": "udpin://0.0.0.0:14560", "icao_address": "0x4B1900"}
        for field in needs.get(self.follows, ()):
            if getattr(self, field) is None:
                yield Misfit(
                    (field,),
                    f"needed with `follows: {self.follows}`",
                    f"write {field}: {examples[field]}, or what it is",
                )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        refuse(self.misfits(), self)
        return self

    law: Annotated[str, AfterValidator(known_in(leader_laws))] = "field"
    """Law for following the path: `field`, the vector field around it, or a user-defined one (`--plugin`)."""

    gains: dict[str, Any] = Field(default_factory=dict)
    """Gains of a user-defined law, by name."""

    @cached_property
    def law_gains(self) -> Any:  # noqa: ANN401 - each law has a section of its own
        """Gains of the law, as an instance of its `Gains`."""
        return leader_laws.find(self.law).Gains.model_validate(self.gains)

    @model_validator(mode="after")
    def know_the_gains(self) -> Self:
        """Check whether the law accepts these gains.

        Raises:
            PydanticCustomError: a gain is unknown or out of range.
        """
        try:
            _ = self.law_gains
        except ValidationError as error:
            faults = "; ".join(
                f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()
            )
            known = ", ".join(leader_laws.find(self.law).Gains.model_fields) or "none"
            text = f"the law {self.law} does not take these gains ({faults}); it has {known}"
            raise PydanticCustomError("leader_gains", "{text}", {"text": text}) from error
        return self


class Follower(Section):
    """A vehicle that keeps a slot."""

    vehicle: VehicleName
    """Name under `vehicles`."""

    slot: Slot
    """Slot in the formation."""


class Avoidance(Section):
    """Avoidance of aircraft outside the formation."""

    traffic_m: Annotated[NotNegative, Field(le=1000.0)] = 100.0
    """Minimum horizontal distance from aircraft that the autopilot reports as ADSB_VEHICLE, m; 0 disables
    it."""


class Mission(Section):
    """A flight: vehicles, path, formation and rehearsal."""

    name: MissionName
    """Short name: lower-case letters, digits and hyphens."""

    origin: Origin
    """Origin of the local coordinates on the earth."""

    height_above_origin_m: Annotated[Positive, Field(le=9000.0)] = 100.0
    """Flying height of the leader above the origin's altitude, m."""

    height: Literal["leader", "path"] | None = None
    """Reference of the slots' `up_m`. `leader`: the leader's own intended and sustained height. `path`: the
    height that the mission plans for it. By default `path` for a leader received by ADS-B, `leader` for
    every other."""

    orders: tuple[TimedOrder, ...] = ()
    """Orders to the formation, by time of the rehearsal."""

    path: Annotated[SerializeAsAny[PathShape], BeforeValidator(chosen_path)]
    """Path of the leader; without a companion only its path in a rehearsal, by default due north."""

    paths: Annotated[
        dict[PathName, Annotated[SerializeAsAny[PathShape], BeforeValidator(chosen_path)]],
        Field(max_length=MAX_PATHS),
    ] = Field(default_factory=dict)
    """Other paths by name, for orders in flight (`path: NAME`); `main` is `path`."""

    leader: Leader
    """Leading vehicle and its airspeed."""

    followers: Annotated[tuple[Follower, ...], Field(max_length=MAX_FOLLOWERS)] = ()
    """Following vehicles and their slots; empty for a leader alone."""

    deputies: Annotated[tuple[VehicleName, ...], Field(max_length=MAX_DEPUTIES)] = ()
    """Followers that take the lead, in this order, when the leader is lost, leaves or is taken over by its
    pilot. Without deputies the formation then breaks up."""

    vehicles: Annotated[dict[VehicleName, Vehicle], Field(min_length=1)]
    """All vehicles by name; `defaults` holds the fields of vehicles that do not set them."""

    controller: Annotated[
        SerializeAsAny[Controller],
        BeforeValidator(chosen_controller),
        Field(default_factory=lambda: controller_of({})),
    ]
    """The guidance law and its gains."""

    patience: Timeouts = Timeouts()
    """Timeouts for missing messages."""

    wind: Wind = CalmWind(type="calm")
    """Wind of the rehearsal; a companion on a real vehicle ignores it."""

    rehearsal: Rehearsal = Rehearsal()
    """Rehearsal of the flight on the computer."""

    avoidance: Avoidance = Avoidance()
    """Distance from aircraft outside the formation."""

    fence: Fence = Fence()
    """Area limits of every vehicle, in addition to the fence of a plan; `vfguide check` checks all slots."""

    acceptance: Acceptance = Acceptance()
    """Acceptance limits of the rehearsal."""

    @property
    def follows_height(self) -> bool:
        """Whether slot heights count from the leader's own height."""
        return (self.height or ("path" if self.leader.follows == "adsb" else "leader")) == "leader"

    @property
    def paths_by_name(self) -> Mapping[str, PathShape]:
        """All paths; the mission begins with `main`."""
        return {MAIN_PATH: self.path, **self.paths}

    @property
    def path_checks(self) -> Mapping[str, int]:
        """Check value that tells each path from others of its name; 0 without other paths and deputies.

        Raises:
            InputError: a user-defined path cannot be compared.
        """
        if not (self.paths or self.deputies):
            return dict.fromkeys(self.paths_by_name, 0)
        return {
            name: curve_check(one, self.origin, self.height_above_origin_m)
            for name, one in self.paths_by_name.items()
        }

    @property
    def leader_vehicle(self) -> Vehicle:
        """Vehicle that leads."""
        return self.vehicles[self.leader.vehicle]

    @property
    def timekeeper(self) -> str:
        """Vehicle whose clock the formation shares: the leader, or the first follower of a foreign leader.

        With a foreign leader it counts only for messages between followers. Each follower times the leader
        on its own clock.
        """
        if self.leader.is_foreign and self.followers:
            return self.followers[0].vehicle
        return self.leader.vehicle

    @property
    def companions(self) -> tuple[str, ...]:
        """Vehicles that have a companion, the leader first if it is one."""
        leader = () if self.leader.is_foreign else (self.leader.vehicle,)
        return (*leader, *self.followers_by_name)

    @property
    def followers_by_name(self) -> Mapping[str, Follower]:
        """Followers by vehicle name."""
        return {follower.vehicle: follower for follower in self.followers}

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, data: object) -> object:
        return with_frame(completed(data))

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        found = inconsistencies(self.model_dump())
        if found:
            kind = "inconsistent_mission"
            message = "; ".join(f"{dotted(one.location)}: {one.message}" for one in found)
            raise PydanticCustomError(kind, "{text}", {"text": message})
        return self
