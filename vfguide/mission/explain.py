"""Plain-language explanations of Pydantic's findings, each with a remedy.

Reported locations are translated to fields of the mission model.
"""

import difflib
import math
import re
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from vfguide.mission.consistency import inconsistencies
from vfguide.mission.controller import Controller, gains_by_field
from vfguide.mission.finding import Location, Misfit, shortened
from vfguide.mission.flight_path import PathShape, shape_models
from vfguide.mission.model import Mission
from vfguide.mission.quantity import NAME_RULES, field_meanings
from vfguide.registry import laws

COVERED_ELSEWHERE = {"inconsistent_mission", "default_factory_not_called"}
"""Findings that repeat others: contradictions are reported separately, each at its own field."""

EXPECTED = {
    "float_type": ("a number", "write a number without quotes"),
    "int_type": ("a whole number", "write a whole number without quotes"),
    "bool_type": ("true or false", "write true or false without quotes"),
    "string_type": ("text", "put it in quotes if it is meant as text"),
    "model_type": ("a group of fields", "write its fields below it, or {field: value, …}"),
    "dict_type": ("a group of fields", "write its fields below it, or {name: …, …}"),
    "model_attributes_type": ("a group of fields", "write its fields below it, or {type: …, …}"),
    "tuple_type": ("a list", "write [first, second, …], or one line with a dash for each"),
}

REMEDIES = {
    "airspeed_range": "write [lowest, highest]",
    "climb_end": "write both positive, or both negative",
    "airspeed_range_m_s": "write [lowest, highest]",
    "easement_m": "shorten it, or leave it out",
    "line_given_twice": "remove one of the two",
    "line_without_course": "add course_deg, degrees clockwise from north, or slope",
    "line_without_slope": "add slope, or use point and course_deg",
    "place": "give one of the two pairs",
    "waypoint_height": "remove one of the two",
}

WITH_UNIT = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)\s*[^\d\s.,:eE+-]")
"""A number followed by something else, such as a unit."""

WRITTEN_OUT = 10**15
"""Whole numbers below this are quoted with all digits."""


@dataclass(frozen=True, slots=True)
class FilePlace:
    """Meaning of a reported location in the file."""

    location: Location
    """Location as the file's author sees it."""
    group: type[BaseModel] | None
    """Group of fields that contains the last field of the location."""
    kinds: tuple[type[BaseModel], ...]
    """Models that the field itself may hold; empty if it is no group."""

    @property
    def known(self) -> Mapping[str, FieldInfo]:
        """Fields that the group may hold."""
        if self.group is Controller:
            return {**Controller.model_fields, **gains_by_field()}
        return self.group.model_fields if self.group else {}


def place_of(reported: Location) -> FilePlace:
    """Translate a reported location, which names the chosen type of a path or wind as an extra step."""
    annotation: object = Mission
    location: list[str | int] = []
    group: type[BaseModel] | None = None
    for step in reported:
        if step == "[key]":
            break
        kinds = _kinds(annotation)
        if len(kinds) > 1:
            annotation = next((kind for kind in kinds if step in kind_names(kind)), None)
            continue
        location.append(step)
        group = kinds[0] if kinds else None
        annotation = _inner(annotation, group, step)
    return FilePlace(tuple(location), group, tuple(_kinds(annotation)))


def kind_names(model: type[BaseModel]) -> tuple[object, ...]:
    """Return the values of `type` that select a model."""
    field = model.model_fields.get("type")
    if field is None or get_origin(field.annotation) is not Literal:
        return ()
    return get_args(field.annotation)


def _kinds(annotation: object) -> list[type[BaseModel]]:
    """Return the models of an annotation: several for a union that is told apart by `type`."""
    if get_origin(annotation) is Annotated:
        return _kinds(get_args(annotation)[0])
    if get_origin(annotation) in {Union, UnionType}:
        members = [member for member in get_args(annotation) if member is not NoneType]
        return [kind for member in members for kind in _kinds(member)]
    if annotation is PathShape:
        return [*shape_models()]
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return []


def _inner(annotation: object, group: type[BaseModel] | None, step: str | int) -> object:
    """Return the annotation of an entry one step further down; None if unknown."""
    if group is not None:
        field = group.model_fields.get(str(step))
        if field is not None:
            return field.annotation
        extra = group.__annotations__.get("__pydantic_extra__")
        return get_args(extra)[1] if extra is not None else None
    if get_origin(annotation) is Annotated:
        return _inner(get_args(annotation)[0], None, step)
    arguments = get_args(annotation)
    if get_origin(annotation) is dict:
        return arguments[1]
    if get_origin(annotation) is tuple:
        return arguments[0]
    return None


def explain(error: ValidationError, data: Mapping[str, object]) -> list[Misfit]:
    """Return the faults of a mission, given as plain data with its validation error.

    Faults of single fields come first, then contradictions between valid fields.
    """
    details = error.errors(include_url=False)
    found = [
        _explain_one(one)
        for one in details
        if one["type"] not in COVERED_ELSEWHERE and not _is_short_by_faults(one, details)
    ]
    faulty = {one.location for one in found}
    return found + [one for one in inconsistencies(data) if one.location not in faulty]


def _is_short_by_faults(one: ErrorDetails, details: Sequence[ErrorDetails]) -> bool:
    """Check whether a list is reported as too short only because invalid entries do not count."""
    if one["type"] != "too_short":
        return False
    place = one["loc"]
    return any(other["loc"][: len(place)] == place and other is not one for other in details)


def described(value: object) -> str:
    """Return a value as a message can quote it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"'{shortened(value)}'"
    if isinstance(value, int) and abs(value) < WRITTEN_OUT:
        return str(value)
    if isinstance(value, int | float):
        # Python may refuse to write out huge integers.
        return "such a huge number" if 1e300 < abs(value) < math.inf else f"{value:g}"
    return "a list" if isinstance(value, list | tuple) else "a group of fields"


def _explain_one(detail: ErrorDetails) -> Misfit:
    kind, place = detail["type"], place_of(detail["loc"])
    if kind in EXPECTED:
        return _wrong_kind(detail, place)
    if kind in _EXPLAINERS:
        return _EXPLAINERS[kind](detail, place)
    remedy = _context(detail).get("remedy") or REMEDIES.get(kind, _meaning(place))
    return Misfit(place.location, detail["msg"], str(remedy))


def _meaning(place: FilePlace) -> str:
    """Return the description of the field, as a remedy of last resort."""
    if not place.location or place.group is None:
        return ""
    sections = [place.group]
    if place.group is Controller:
        sections += [laws.find(name).Gains for name in laws.names()]
    meanings = ChainMap(*(dict(field_meanings(one)) for one in sections))
    return " ".join(meanings.get(str(place.location[-1]), "").split()).rstrip(".")


def _context(detail: ErrorDetails) -> Mapping[str, object]:
    return detail.get("ctx", {})


def _wrong_kind(detail: ErrorDetails, place: FilePlace) -> Misfit:
    expected, remedy = EXPECTED[detail["type"]]
    value = detail["input"]
    if value is None:
        return Misfit(place.location, "is left empty", f"{remedy}, or remove the field")
    if (
        isinstance(value, str)
        and detail["type"] in {"float_type", "int_type"}
        and WITH_UNIT.match(value)
    ):
        remedy = "write the number alone, without a unit"
    if isinstance(value, float) and detail["type"] == "int_type":
        whole = "write a whole number, without a point"
        return Misfit(place.location, f"{value!r:.20} is not {expected}", whole)
    return Misfit(place.location, f"{described(value)} is not {expected}", remedy)


def _missing(_: ErrorDetails, place: FilePlace) -> Misfit:
    if place.location and isinstance(place.location[-1], int):
        around = Misfit(place.location[:-1], "has too few values", "")
        name = str(around.location[-1]) if around.location else ""
        return Misfit(around.location, around.message, REMEDIES.get(name, "add the others"))
    meaning = _meaning(place)
    return Misfit(place.location, "is missing", f"add it: {meaning}" if meaning else "add it")


def _unknown(_: ErrorDetails, place: FilePlace) -> Misfit:
    name = str(place.location[-1])
    near = nearest(name, place.known)
    remedy = f"did you mean '{near}'?" if near else f"known here: {', '.join(place.known)}"
    return Misfit(place.location, f"unknown field '{shortened(name)}'", remedy)


def nearest(name: str, known: Mapping[str, object]) -> str | None:
    """Return the most likely intended name, or None."""
    beginning = [one for one in known if one.startswith(f"{name}_")]
    near = beginning or difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return near[0] if near else None


def _not_finite(detail: ErrorDetails, place: FilePlace) -> Misfit:
    message = f"{described(detail['input'])} is not a finite number"
    return Misfit(place.location, message, "write a finite number")


def _out_of_bounds(detail: ErrorDetails, place: FilePlace) -> Misfit:
    words = {"gt": "above {}", "ge": "{} or more", "lt": "below {}", "le": "{} or less"}
    name, bound = next(iter(_context(detail).items()), ("", ""))
    limit = f"{bound:g}" if isinstance(bound, float) else str(bound)
    side = "small" if name in {"gt", "ge"} else "large"
    message = f"{described(detail['input'])} is too {side}"
    allowed = words.get(name, "{}").format(limit)
    return Misfit(place.location, message, f"choose {allowed}")


def _not_a_choice(detail: ErrorDetails, place: FilePlace) -> Misfit:
    choices = str(_context(detail).get("expected", "")).replace("'", "").replace(" or ", ", ")
    return _choice(place.location, detail["input"], choices)


def _choice(location: Location, value: object, choices: str) -> Misfit:
    names = [one.strip() for one in choices.split(",")]
    near = (
        difflib.get_close_matches(value, names, n=1, cutoff=0.6) if isinstance(value, str) else []
    )
    hint = f"did you mean '{near[0]}'? " if near else ""
    return Misfit(location, f"{described(value)} is not known", f"{hint}use one of: {choices}")


def _not_a_kind(detail: ErrorDetails, place: FilePlace) -> Misfit:
    context = _context(detail)
    choices = str(context.get("expected_tags", "")).replace("'", "")
    return _choice((*place.location, "type"), context.get("tag"), choices)


def _no_kind(_: ErrorDetails, place: FilePlace) -> Misfit:
    choices = ", ".join(str(name) for kind in place.kinds for name in kind_names(kind))
    return Misfit((*place.location, "type"), "is missing", f"add one of: {choices}")


def _bad_name(detail: ErrorDetails, place: FilePlace) -> Misfit:
    rule = NAME_RULES.get(str(_context(detail).get("pattern")), "")
    message = f"{described(detail['input'])} cannot be a name"
    return Misfit(place.location, message, f"use {rule}" if rule else "")


def _too_many(detail: ErrorDetails, place: FilePlace) -> Misfit:
    name = str(place.location[-1]) if place.location else ""
    limit = _context(detail).get("max_length")
    remedy = REMEDIES.get(name, f"write {limit} at most")
    return Misfit(place.location, "has too many values", remedy)


def _too_few(detail: ErrorDetails, place: FilePlace) -> Misfit:
    least = _context(detail).get("min_length")
    return Misfit(place.location, "has too few entries", f"write {least} or more")


_EXPLAINERS: dict[str, Callable[[ErrorDetails, FilePlace], Misfit]] = {
    "missing": _missing,
    "extra_forbidden": _unknown,
    "finite_number": _not_finite,
    "greater_than": _out_of_bounds,
    "greater_than_equal": _out_of_bounds,
    "less_than": _out_of_bounds,
    "less_than_equal": _out_of_bounds,
    "literal_error": _not_a_choice,
    "union_tag_invalid": _not_a_kind,
    "union_tag_not_found": _no_kind,
    "string_pattern_mismatch": _bad_name,
    "too_long": _too_many,
    "too_short": _too_few,
}
