"""A mission with what the command line says in the place of what the file says."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import yaml
from pydantic import ValidationError

from vfguide.errors import InputError
from vfguide.mission.controller import with_law
from vfguide.mission.explain import explain
from vfguide.mission.finding import Finding
from vfguide.mission.flight_path import Location, dotted
from vfguide.mission.load import DEFAULTS
from vfguide.mission.model import Mission

SpeedResponseName = Literal["first-order", "tecs", "px4", "px4-untrimmed"]
WindName = Literal["calm", "article"]

EXACT = "exact"
"""Behind the name of a law: its gains as they are written, whatever the aircraft bears."""

OPTIONS: dict[Location, str] = {
    ("rehearsal", "duration_s"): "--duration",
    ("rehearsal", "rate_hz"): "--rate",
    ("rehearsal", "seed"): "--seed",
    ("rehearsal", "emulator", "plant"): "--plant",
}
"""Fields that an option overrides, and that may be out of range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Overrides:
    """What the command line says; None leaves the file's word."""

    controller: str | None = None
    """Instead of `controller.type`."""
    settings: tuple[tuple[Location, object], ...] = ()
    """Values instead of those of any fields."""
    plant: str | None = None
    """Instead of every vehicle's `plant`; all but the holds are flown as `rehearsal.emulator.plant`."""
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
    if overrides == Overrides():
        return mission
    content = overridden(mission, overrides)
    try:
        return Mission.model_validate(content)
    except ValidationError as error:
        chosen = {place: f"--set {dotted(place)}" for place, _ in overrides.settings}
        options = {**OPTIONS, **chosen}
        lines = [
            f"{named(one.location, options)}: {one.message}; {one.remedy}"
            for one in explain(error, content)
        ]
        raise InputError("\n".join(dict.fromkeys(lines))) from error


def named(location: Location, options: Mapping[Location, str]) -> str:
    """The option that put a value at a place, above it or below it."""
    for length in range(len(location), 0, -1):
        if location[:length] in options:
            rest = dotted(location[length:])
            return f"{options[location[:length]]}" + (f", {rest}" if rest else "")
    below = (option for place, option in options.items() if place[: len(location)] == location)
    return next(below, "command line")


def with_options_named(finding: Finding, overrides: Overrides) -> Finding:
    """A finding with options in place of the fields that the command line overrides."""
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


def overridden(mission: Mission, overrides: Overrides) -> dict[str, Any]:
    """The fields of the mission with the overrides in them, valid or not.

    Raises:
        InputError: an option names no field, or no law.
    """
    content: dict[str, Any] = mission.model_dump(exclude_unset=True)
    if overrides.controller is not None:
        put_law(content, overrides.controller, option="--controller")
    if overrides.plant is not None:
        # A companion takes the others for what they resemble: a hold of heading and airspeed.
        banks = overrides.plant not in {"heading-hold", "course-hold"}
        hold = "heading-hold" if banks else overrides.plant
        for vehicle in content["vehicles"].values():
            vehicle["plant"] = hold
        emulate(content, "plant", overrides.plant if banks else None)
    if overrides.speed_response is not None:
        emulate(content, "speed_response", overrides.speed_response)
    if overrides.wind is not None:
        content["wind"] = {"type": overrides.wind}
    rehearsal = {
        name: value
        for name in ("duration_s", "rate_hz", "seed")
        if (value := getattr(overrides, name)) is not None
    }
    content.setdefault("rehearsal", {}).update(rehearsal)
    for place, value in overrides.settings:
        put(content, place, value)
    return content


def put_law(content: dict[str, Any], name: str, *, option: str) -> None:
    """Put a law into the fields of a mission.

    Args:
        content: fields of the mission.
        name: of the law; with `exact` behind it its gains are flown as they are written.
        option: that names it.

    Raises:
        InputError: there is no law of this name; the message begins with the option that names it.
    """
    law, _, manner = name.partition(" ")
    exact = {"exact": True} if manner.strip() == EXACT else {}
    try:
        content["controller"] = (
            with_law(content.get("controller", {}), law if exact else name) | exact
        )
    except InputError as error:
        raise InputError(f"{option} {error}") from error


def parse_settings(texts: Sequence[str]) -> tuple[tuple[Location, object], ...]:
    """Fields and values of `FIELD=VALUE`: values as in a mission file, fields such as `followers[0].slot`.

    Raises:
        InputError: a text is no such thing.
    """
    found = []
    for text in texts:
        field, equals, value = text.partition("=")
        if not equals or not field:
            raise InputError(f"--set {text}: write FIELD=VALUE, such as controller.k_x=0.3")
        try:
            parsed: object = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise InputError(
                f"--set {text}: the value cannot be read; write it as in YAML"
            ) from error
        found.append((place_of(field), parsed))
    return tuple(found)


def place_of(field: str) -> Location:
    """The place of a field such as `followers[0].slot.forward_m`."""
    steps = field.replace("[", ".").replace("]", "").split(".")
    return tuple(int(step) if step.isdecimal() else step for step in steps)


def put(content: dict[str, Any], place: Location, value: object) -> None:
    """Put a value into the fields of a mission.

    Raises:
        InputError: there is no such place.
    """
    if place[:2] == ("vehicles", DEFAULTS) and len(place) > 2:
        # Every vehicle has them by now.
        for name in content["vehicles"]:
            put(content, ("vehicles", name, *place[2:]), value)
        return
    if place == ("controller", "type") and isinstance(content.get("controller", {}), dict):
        put_law(content, str(value), option="--set controller.type")
        return
    here: Any = content
    for step, after in pairwise(place):
        try:
            inner = here.setdefault(step, {}) if isinstance(here, dict) else here[step]
            if isinstance(inner, tuple):
                inner = list(inner)
                here[step] = inner
        except (IndexError, TypeError, KeyError) as error:
            raise InputError(
                f"--set {dotted(place)}: there is no {after} in the mission"
            ) from error
        here = inner
    try:
        here[place[-1]] = value
    except (IndexError, TypeError) as error:
        raise InputError(
            f"--set {dotted(place)}: there is no {place[-1]} in the mission"
        ) from error


def emulate(content: dict[str, Any], field: str, value: object) -> None:
    """Give all emulated aircraft of a mission the same value, whatever single ones have."""
    section: dict[str, Any] = content.setdefault("rehearsal", {}).setdefault("emulator", {})
    section[field] = value
    for own in section.get("vehicles", {}).values():
        own.pop(field, None)
