"""Command-line values that replace fields of a mission file, applied to plain data before validation."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from vfguide.errors import InputError
from vfguide.mission.consistency import DEFAULT_NAME, group, is_foreign
from vfguide.mission.controller import merged, with_law
from vfguide.mission.explain import described
from vfguide.mission.finding import Finding, Location, MissionError, dotted
from vfguide.mission.yaml_tree import read_tree

SpeedResponseName = Literal["first-order", "tecs", "px4", "px4-untrimmed"]
WindName = Literal["calm", "article"]

EXACT = "exact"
"""Suffix of a law's name: use its gains as written, whatever the aircraft tolerates."""

DEFAULTS = "defaults"
"""Key under `vehicles` for the defaults of all vehicles."""

FIELD = re.compile(r"[^.\[\]]+(\.[^.\[\]]+|\[[^.\[\]]+\])*")
"""Field path, such as `followers[0].slot.forward_m`."""

INDEX = re.compile(r"-?[0-9]{1,9}", re.ASCII)
"""Index of a list entry."""

EMULATOR = ("rehearsal", "emulator")
LAW: Location = ("controller", "type")


@dataclass(frozen=True, slots=True, kw_only=True)
class Overrides:
    """Values from the command line; None keeps the file's value.

    `wind` replaces the mission's. `speed_response` replaces the field of this name in `rehearsal.emulator`;
    `duration_s`, `rate_hz` and `seed` replace those in `rehearsal`.
    """

    controller: str | None = None
    """Replaces `controller.type`."""
    settings: tuple[tuple[Location, object], ...] = ()
    """Values of any fields, in any order."""
    plant: str | None = None
    """Replaces every vehicle's `plant`; all but the holds become `rehearsal.emulator.plant`."""
    speed_response: SpeedResponseName | None = None
    wind: WindName | None = None
    duration_s: float | None = None
    rate_hz: float | None = None
    seed: int | None = None


@dataclass(slots=True)
class Overridden:
    """Mission as plain data with command-line values, valid or not."""

    data: dict[str, Any]
    """Mission data; changed groups and lists are copies."""
    options: dict[Location, str] = field(default_factory=dict)
    """Option that set each changed field."""
    faults: list[Finding] = field(default_factory=list)
    """Options without a place in the mission, or given twice."""
    _given: dict[Location, str] = field(default_factory=dict)
    """Locations that options have named so far."""

    def set(self, option: str, place: Location, value: object) -> None:
        """Set the value of an option; one under `vehicles.defaults` is set in every vehicle."""
        if (before := self._given.get(place)) is not None:
            message = "is given twice" if before == option else f"{before} says it already"
            self._refuse(option, place, message, "give it once")
            return
        self._given[place] = option
        if place[:2] == ("vehicles", DEFAULTS) and len(place) > 2:
            for name in flown(self.data):
                self._put(option, ("vehicles", name, *place[2:]), value)
        elif place == LAW and isinstance(value, str) and self.has_controller:
            self._put_law(option, value)
        else:
            self._put(option, place, value)

    @property
    def has_controller(self) -> bool:
        """Whether `controller` is a group, or absent."""
        return isinstance(self.data.get("controller", {}), dict)

    def emulate(self, option: str, name: str, value: object) -> None:
        """Give all emulated aircraft the same value, replacing those of single aircraft."""
        self.set(option, (*EMULATOR, name), value)
        for vehicle, own in group(self.data, *EMULATOR, "vehicles").items():
            if name in group(own):
                left = {one: value for one, value in group(own).items() if one != name}
                self._put(option, (*EMULATOR, "vehicles", vehicle), left)

    def _put_law(self, option: str, name: str) -> None:
        law, _, manner = name.partition(" ")
        exact = {"exact": True} if manner.strip() == EXACT else {}
        try:
            fields = with_law(group(self.data, "controller"), law if exact else name)
        except InputError as error:
            raise InputError(f"{option} {error}") from error
        self.data["controller"] = fields | exact
        self.options[LAW] = option

    def _put(self, option: str, place: Location, value: object) -> None:
        here: Any = self.data
        for depth, step in enumerate(place):
            key: str | int = str(step) if isinstance(here, dict) else step
            fault = misstep(here, place[:depth], key, is_index=isinstance(step, int))
            if fault is not None:
                self._refuse(option, place, *fault)
                return
            if depth == len(place) - 1:
                here[key] = value
                break
            inner = here.get(key) if isinstance(here, dict) else here[key]
            if inner is None:
                inner = [] if isinstance(place[depth + 1], int) else {}
            elif isinstance(inner, list | tuple):
                inner = [*inner]
            elif isinstance(inner, dict):
                inner = {**inner}
            here[key] = inner
            here = inner
        self.options[place] = option

    def _refuse(self, option: str, place: Location, message: str, remedy: str) -> None:
        self.faults.append(Finding("error", place, message, remedy, option=option))


def misstep(
    here: object, outer: Location, step: str | int, *, is_index: bool
) -> tuple[str, str] | None:
    """Return the fault of a step down from a value, and its remedy; None if the step is valid.

    `outer` is the location of the value. `step` is text where the value is a group; `is_index` tells whether
    it was written as a number.
    """
    name = dotted(outer)
    if isinstance(here, dict):
        if not is_index or step in here:
            return None
        known = f"name one of: {', '.join(map(str, here))}" if here else "give the list as a whole"
        return f"there is no entry {step} in {name}", known
    if not isinstance(here, list):
        return f"{name} is {described(here)}, which has no fields", f"give --set {name}=VALUE"
    if isinstance(step, int) and 0 <= step < len(here):
        return None
    indices = (index for index, one in enumerate(here) if group(one).get("vehicle") == step)
    if (index := next(indices, None)) is not None:
        return f"{name} is a list", f"write {name}[{index}] for '{step}'"
    entries = " or ".join(dict.fromkeys((f"{name}[0]", f"{name}[{len(here) - 1}]")))
    if len(here) > 2:
        entries = entries.replace(" or ", " to ")
    remedy = f"write {entries}" if here else f"give the list as a whole: {name}=[…]"
    return f"there is no entry {step} in {name}, a list of {len(here)}", remedy


def overridden(data: Mapping[str, Any], overrides: Overrides) -> Overridden:
    """Return a mission, given as plain data, with the overrides applied.

    Raises:
        InputError: an option names no law.
    """
    found = Overridden(dict(data))
    if "controller" in data and found.has_controller:
        # Overrides also precede a group named after the law.
        found.data["controller"] = merged(data["controller"])
    if overrides.controller is not None:
        found.set("--controller", LAW, overrides.controller)
    if overrides.plant is not None:
        # For the companion, a banking plant resembles a hold of heading and airspeed.
        banks = overrides.plant not in {"heading-hold", "course-hold"}
        hold = "heading-hold" if banks else overrides.plant
        found.set("--plant", ("vehicles", DEFAULTS, "plant"), hold)
        found.emulate("--plant", "plant", overrides.plant if banks else None)
    if overrides.speed_response is not None:
        found.emulate("--speed-response", "speed_response", overrides.speed_response)
    if overrides.wind is not None:
        found.set("--wind", ("wind",), {"type": overrides.wind})
    for option, name in (("--duration", "duration_s"), ("--rate", "rate_hz"), ("--seed", "seed")):
        if (value := getattr(overrides, name)) is not None:
            found.set(option, ("rehearsal", name), value)
    for place, value in sorted(overrides.settings, key=lambda one: precedence(one[0])):
        found.set(f"--set {dotted(place)}", place, value)
    return found


def precedence(place: Location) -> tuple[int, bool, bool]:
    """Return a sort key: groups before their fields, the law before its gains, defaults before vehicles."""
    return len(place), place != LAW, place[:2] != ("vehicles", DEFAULTS)


def flown(data: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names of all vehicles, including a leader without a companion and without an entry."""
    vehicles = group(data, "vehicles")
    yield from vehicles
    leader = group(data, "leader").get("vehicle", DEFAULT_NAME)
    if is_foreign(data) and isinstance(leader, str) and leader not in vehicles:
        yield leader


def parse_settings(texts: Sequence[str]) -> tuple[tuple[Location, object], ...]:
    """Parse `FIELD=VALUE` texts; values are as in a mission file, fields such as `followers[0].slot`.

    Raises:
        InputError: a text has another form.
    """
    found = []
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not FIELD.fullmatch(name):
            raise InputError(f"--set {text}: write FIELD=VALUE, such as controller.k_x=0.3")
        try:
            tree = read_tree(value)
        except MissionError as error:
            fault = error.faults[0]
        else:
            if not tree.faults:
                found.append((place_of(name), tree.data))
                continue
            fault = tree.faults[0]
        raise InputError(f"--set {text}: {fault.message}; write the value as in a mission file")
    return tuple(found)


def place_of(name: str) -> Location:
    """Return the location of a field such as `followers[0].slot.forward_m`."""
    steps = name.replace("[", ".").replace("]", "").split(".")
    return tuple(int(step) if INDEX.fullmatch(step) else step for step in steps)
