"""A mission with what the command line says in the place of what the file says."""

from dataclasses import dataclass, replace
from typing import Any, Literal

from pydantic import ValidationError

from vfguide.errors import InputError
from vfguide.mission.explain import explain
from vfguide.mission.finding import Finding
from vfguide.mission.location import Location, dotted
from vfguide.mission.model import Mission

ControllerName = Literal["slot", "article", "pid", "mpc"]
PlantName = Literal["course-hold", "heading-hold", "bank", "npfg"]
SpeedResponseName = Literal["first-order", "tecs"]
WindName = Literal["calm", "article"]

OPTIONS: dict[Location, str] = {
    ("rehearsal", "duration_s"): "--duration",
    ("rehearsal", "rate_hz"): "--rate",
    ("rehearsal", "seed"): "--seed",
}
"""Fields that an option overrides, and that may be out of range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Overrides:
    """What the command line says; None leaves the file's word."""

    controller: ControllerName | None = None
    """Instead of `controller.type`."""
    plant: PlantName | None = None
    """Instead of every vehicle's `plant`; `bank` is flown as `rehearsal.emulator.plant`."""
    speed_response: SpeedResponseName | None = None
    """Instead of `rehearsal.emulator.speed_response`."""
    wind: WindName | None = None
    """Instead of `wind`."""
    duration_s: float | None = None
    """Instead of `rehearsal.duration_s`."""
    rate_hz: float | None = None
    """Instead of `rehearsal.rate_hz`."""
    seed: int | None = None
    """Instead of `rehearsal.seed`."""


def apply_overrides(mission: Mission, overrides: Overrides) -> Mission:
    """The mission with the command line's word in it.

    Raises:
        InputError: an option is out of its range.
    """
    try:
        return overridden(mission, overrides)
    except ValidationError as error:
        lines = (
            f"{OPTIONS.get(one.location, 'command line')}: {one.message}; {one.remedy}"
            for one in explain(error)
        )
        raise InputError("\n".join(lines)) from error


def blamed(finding: Finding, overrides: Overrides) -> Finding:
    """The same finding, with options in place of the fields that the command line overrides."""
    for location, option in OPTIONS.items():
        if getattr(overrides, str(location[-1])) is None:
            continue
        field = dotted(location)
        finding = replace(
            finding,
            message=finding.message.replace(field, option),
            remedy=finding.remedy.replace(field, option),
        )
        if finding.location == location:
            finding = replace(finding, location=(option,), file=None, line=None)
    return finding


def overridden(mission: Mission, overrides: Overrides) -> Mission:
    """The mission with the overrides, as valid as if its file had said so.

    Raises:
        pydantic.ValidationError: an override is out of its range.
    """
    content: dict[str, Any] = mission.model_dump(exclude_unset=True)
    if overrides.controller is not None:
        content.setdefault("controller", {})["type"] = overrides.controller
    if overrides.plant is not None:
        # A companion takes the others for what they resemble: a hold of heading and airspeed.
        banks = overrides.plant in {"bank", "npfg"}
        hold = "heading-hold" if banks else overrides.plant
        for vehicle in content["vehicles"].values():
            vehicle["plant"] = hold
        emulator(content)["plant"] = overrides.plant if banks else None
    if overrides.speed_response is not None:
        emulator(content)["speed_response"] = overrides.speed_response
    if overrides.wind is not None:
        content["wind"] = {"type": overrides.wind}
    rehearsal = {
        name: value
        for name in ("duration_s", "rate_hz", "seed")
        if (value := getattr(overrides, name)) is not None
    }
    content.setdefault("rehearsal", {}).update(rehearsal)
    return Mission.model_validate(content)


def emulator(content: dict[str, Any]) -> dict[str, Any]:
    """The part of a mission file about the emulated autopilots; there is one afterwards."""
    section: dict[str, Any] = content.setdefault("rehearsal", {}).setdefault("emulator", {})
    return section
