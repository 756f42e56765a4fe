"""The guidance law of a mission and its gains.

`Controller` holds the fields that all laws share. Each law defines its gains as a section of its own. For
each law, a model combines both: it validates `controller:` and is passed to the law as its gains.
"""

import math
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    ValidationError,
    create_model,
    model_serializer,
)
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails

from vfguide.guidance.response import amplification_of, factor_of
from vfguide.guidance.sliding_laws import SlotFrame
from vfguide.mission.quantity import Duration, Gain, NotNegative, Section, Switch
from vfguide.registry import laws

USUAL_LAW = "slot"
"""Default law."""


class Observer(Section):
    """Adaptive estimate of the ground speed inside the course law."""

    gamma: Gain = 1.0
    """Gamma of the article: adaptation gain."""

    rho: Gain = 200.0
    """rho of the article: weight of the course error in the adaptation."""

    sigma: Annotated[NotNegative, Field(le=100.0)] = 0.5
    """sigma of the article: pull of the estimate toward the measured ground speed."""


class Controller(Section):
    """Formation keeping: law, gains and feedforward."""

    type: str = USUAL_LAW
    """Guidance law. `slot`: field around the slot's motion; `article`: around the leader's; `pid`, `mpc`:
    baselines."""

    sharpness: Annotated[NotNegative, Field(le=1.0)] = 0.5
    """Speed of the loops, 0 to 1, relative to what each aircraft's known response tolerates. All gains are
    upper bounds beside it."""

    kappa: Annotated[Gain, Field(le=100.0)] = 3.0
    """kappa of the article: rate at which course and speed errors are reduced, per hold bandwidth."""

    epsilon: Annotated[Gain, Field(le=10.0)] = 0.01
    """epsilon of the article: minimum width of the boundary layer in which the switching term is linear."""

    boundary_layer_factor: Annotated[NotNegative, Field(le=100.0)] = 3.5
    """Factor of the boundary layer: max(epsilon, factor * kappa * (loop period + loop delay)). Below 0.5 the
    loop chatters."""

    rho: Gain = 50.0
    """rho of the article: weight of speed against position in the speed law; smaller values pull harder at
    x_E."""

    loop_delay_s: Duration = 0.0
    """Known delay between a measurement and its effect, in addition to one loop period, s."""

    leader_speed_source: Literal["measured", "observer"] = "measured"
    """Source of the ground speed in the leader's course law."""

    observer: Observer = Observer()
    """Gains of the ground-speed observer."""

    velocity_filter_s: Duration = 0.0
    """Time constant over which reported positions reveal errors of the reported velocities, s; 0: velocities
    are right. 0.3 suits PX4, whose estimator's velocities are off by 0.3 m/s for a second or two in turns."""

    position_filter_s: Duration = 2.0
    """Time constant of the follower's position filter, s; 0 disables it."""

    wind_filter_s: Duration = 0.35
    """Time constant of the wind estimate, s; 0 disables the filter."""

    rate_filter_s: Duration = 0.6
    """Time constant of the leader's turn rate and acceleration estimates, s; 0 disables the filter."""

    predict_leader: Switch = True
    """Extrapolate the received leader state to the follower's own time."""

    wind_feedforward: Switch = True
    """Feed the estimated change of wind forward."""

    give_way: Switch = True
    """Let the leader change its airspeed if a slot would leave its follower's airspeed range."""

    slot_frame: SlotFrame = "path"
    """Reference of the slots' rotation. `path`: the leader's course, or its path's while the course is
    disturbed. `plan`: the path's course while the leader is on the path, for autopilots with noisy courses.
    `leader`: the measured course."""

    @property
    def layer_factor(self) -> float:
        """Boundary layer over kappa times the delay: as configured, or derived from `sharpness`."""
        chosen = "boundary_layer_factor" in self.model_fields_set
        return self.boundary_layer_factor if chosen else factor_of(self.sharpness)

    @property
    def amplification(self) -> float:
        """Maximum ratio of loop to hold bandwidth, from `sharpness`; infinite if the mission sets gains."""
        gains = set(type(self).model_fields) - set(Controller.model_fields)
        chosen = self.model_fields_set & {*gains, "kappa", "boundary_layer_factor"}
        return math.inf if chosen else amplification_of(self.sharpness)

    _gains_of_others: dict[str, Any] = PrivateAttr(default_factory=dict)
    """Gains of other laws as the mission file has them, for flights by one of those laws."""

    def keep_for_other_laws(self, fields: Mapping[str, Any]) -> None:
        """Keep fields that this law does not have, for `with_law`."""
        self._gains_of_others.update(fields)

    @model_serializer(mode="wrap")
    def _with_gains_of_others(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {**handler(self), **self._gains_of_others}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as plain fields: each process creates the model of the law itself."""
        return controller_of, (self.model_dump(exclude_unset=True) | {"type": self.type},)


@cache
def controller_model(name: str, gains: type[BaseModel]) -> type[Controller]:
    """Return the model of `controller:` for a law: the shared fields and the law's gains."""
    kind: Any = (Literal[name], name)
    bases: tuple[Any, ...] = (Controller, gains)
    return create_model(
        f"{name.capitalize()}Controller", __base__=bases, __module__=__name__, type=kind
    )


def controller_of(content: Mapping[str, Any]) -> Controller:
    """Return the controller for the fields of a mission file.

    Gains of the law may also stand in a group named after the law. Gains of other laws are kept, so that one
    file can be flown by several laws.

    Raises:
        pydantic.ValidationError: the law or a field is unknown, or a value is out of range.
    """
    name = content.get("type", USUAL_LAW)
    if name not in laws:
        raise unknown_law(name)
    model = controller_model(name, laws.find(name).Gains)
    fields = merged(content)
    unknown = [key for key in fields if key not in model.model_fields]
    others: dict[str, Any] = {}
    if unknown:
        known = gains_by_field() | dict.fromkeys(laws.names())
        others = {key: fields.pop(key) for key in unknown if key in known and key != name}
    controller = model.model_validate(fields)
    controller.keep_for_other_laws(others)
    return controller


def merged(content: Mapping[str, Any]) -> dict[str, Any]:
    """Merge the group named after the law into the other fields of a `controller:`."""
    name = content.get("type", USUAL_LAW)
    own = content.get(name) if isinstance(name, str) else None
    if not isinstance(own, Mapping):
        return dict(content)
    return {field: value for field, value in content.items() if field != name} | dict(own)


def with_law(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the fields of a `controller:` for another law, including gains the mission holds for it.

    Gains that mean something else in the other law are dropped.

    Raises:
        InputError: there is no law of this name.
    """
    law, after = content.get("type", USUAL_LAW), laws.find(name).Gains
    if law not in laws:
        return {**content, "type": name}
    before = laws.find(law).Gains
    common = {
        field
        for section in before.__mro__
        if section in after.__mro__
        for field in getattr(section, "model_fields", ())
    }
    dropped = set(before.model_fields) - common
    kept = {field: value for field, value in content.items() if field not in dropped}
    group = kept.get(name)
    if isinstance(group, Mapping):
        del kept[name]
        kept |= group
    return {**kept, "type": name}


def chosen_controller(value: object) -> object:
    """Convert a mapping to a controller; return anything else unchanged."""
    return controller_of(value) if isinstance(value, Mapping) else value


def gains_by_field() -> dict[str, FieldInfo]:
    """Return the gains of all known laws by name."""
    return {
        name: field
        for law in laws.names()
        for name, field in laws.find(law).Gains.model_fields.items()
    }


def unknown_law(name: object) -> ValidationError:
    """Return the validation error for an unknown law."""
    details = InitErrorDetails(
        type="literal_error",
        loc=("type",),
        input=name,
        ctx={"expected": " or ".join(f"'{one}'" for one in laws.names())},
    )
    return ValidationError.from_exception_data("controller", [details])
