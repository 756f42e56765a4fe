"""Finding one's way in the model of a mission file by the locations that validation reports."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from vfguide.mission.controller import Controller, gains_by_field
from vfguide.mission.flight_path import PathShape, shape_models
from vfguide.mission.location import Location
from vfguide.mission.model import Mission


@dataclass(frozen=True, slots=True)
class Place:
    """What a reported location means in the file."""

    location: Location
    """The location as the file's author sees it."""
    group: type[BaseModel] | None
    """The group of fields the last name belongs to."""
    kinds: tuple[type[BaseModel], ...]
    """What the field itself may hold, where that is one or another group."""

    @property
    def known(self) -> Mapping[str, FieldInfo]:
        """The fields that group may hold."""
        if self.group is Controller:
            return {**Controller.model_fields, **gains_by_field()}
        return self.group.model_fields if self.group else {}


def place_of(reported: Location) -> Place:
    """Translate a reported location: it names the chosen kind of a path or wind as a step of its own."""
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
    return Place(tuple(location), group, tuple(_kinds(annotation)))


def kind_names(model: type[BaseModel]) -> tuple[object, ...]:
    """The values of `type` that stand for a model."""
    field = model.model_fields.get("type")
    if field is None or get_origin(field.annotation) is not Literal:
        return ()
    return get_args(field.annotation)


def _kinds(annotation: object) -> list[type[BaseModel]]:
    """The models an annotation stands for: several for a union told apart by its `type`."""
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
    """The annotation of what lies one step further down."""
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
