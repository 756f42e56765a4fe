"""The leader's path as a mission file describes it.

Local frame: x north, y east (m). Courses are degrees clockwise from north. The types of paths and their
fields are in `vfguide.paths`.
"""

import json
import math
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import Field, ValidationError, create_model
from pydantic_core import InitErrorDetails, PydanticCustomError
from pydantic_core.core_schema import ErrorType

from vfguide.errors import InputError
from vfguide.guidance.path import Path
from vfguide.mission.finding import Misfit, refuse
from vfguide.mission.place import Fence, Place
from vfguide.mission.quantity import Gain, Section
from vfguide.registry import paths

PLACES = 500
"""Number of points at which a path is sampled for its lowest and highest."""

FieldGain = Annotated[Gain, Field(le=10.0)]


class PathShape(Section):
    """Fields that every path of a mission has."""

    type: str
    """Type of the path."""

    gain: FieldGain = 0.03
    """k of the article: how sharply the field turns onto the path, 1/m."""

    @property
    def approach_angle(self) -> float:
        """chi_inf, rad: angle to the path at which the field approaches it from far away."""
        return math.pi / 2.0

    @property
    def fence(self) -> Fence | None:
        """Fence that the path includes, or None."""
        return None

    @property
    def rally_points(self) -> tuple[Place, ...]:
        """Rally points that the path includes."""
        return ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """Parts of the path's file that a formation does not fly."""
        return ()

    @property
    def curve(self) -> Mapping[str, Any]:
        """Data that define curve and field: numbers, texts, lists, sets and tables of them."""
        return self.model_dump()

    def misfits(self) -> Iterable[Misfit]:
        """Return inconsistencies that keep the path from being flown although each field is valid."""
        return ()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as plain fields: each process creates the model of the path itself."""
        return shape_of, (self.model_dump(exclude_unset=True),)


def shape_model(name: str) -> type[PathShape]:
    """Return the model of `path:` for a type of path.

    Raises:
        InputError: there is no such type.
    """
    return named_shape(name, paths.find(name).Shape)


@cache
def named_shape(name: str, shape: type[PathShape]) -> type[PathShape]:
    """Return the model of a shape with a `type` of this name."""
    kind: Any = (Annotated[Literal[name], Field(description=f"`{name}`.")], ...)
    title = "".join(word.capitalize() for word in name.split("-"))
    return create_model(
        f"{title}Path", __base__=shape, __module__=__name__, __doc__=shape.__doc__, type=kind
    )


def shape_of(content: Mapping[str, Any]) -> PathShape:
    """Return the path for the fields of a mission file.

    Raises:
        pydantic.ValidationError: the type or a field is unknown, or a value is out of range. Locations begin
            with the type, as in a union that is told apart by its `type`.
    """
    name = content.get("type")
    if name is None:
        raise fault("union_tag_not_found", content, discriminator="'type'")
    if name not in paths:
        names = ", ".join(f"'{one}'" for one in paths.names())
        raise fault(
            "union_tag_invalid", content, discriminator="'type'", tag=str(name), expected_tags=names
        )
    try:
        shape = shape_model(name).model_validate(content)
    except ValidationError as error:
        raise below(name, error) from error
    refuse(shape.misfits(), content, name)
    return shape


def chosen_path(value: object) -> object:
    """Convert a mapping to a path; return anything else unchanged."""
    return shape_of(value) if isinstance(value, Mapping) else value


def path_of(shape: PathShape) -> Path:
    """Return the path of a mission for the guidance."""
    kind: Any = paths.find(shape.type)
    return made_path(kind, shape)


@lru_cache(maxsize=32)
def made_path(kind: type[Path], shape: PathShape) -> Path:
    """Create a path of a type; cached, since analysing a curve takes a while."""
    return kind.of(shape)


def height_span(path: Path) -> tuple[float, float]:
    """Return the (lowest, highest) height of a path's outline, m above the flying height."""
    heights = np.atleast_1d(path.at(path.outline(PLACES)).height)
    return float(heights.min()), float(heights.max())


def curve_check(shape: PathShape, origin: Section, height: float) -> int:
    """Return a CRC-32 that tells a path from others of its name; never 0.

    It covers the fields, their origin and the flying height above it, m. Numbers count to nine digits, since
    two computers may differ in the last digit of a radius.

    Raises:
        InputError: a user-defined path has a field that cannot be compared.
    """
    try:
        text = _canonical([origin.model_dump(), height, dict(shape.curve)])
    except TypeError as error:
        raise InputError(
            f"a path of type {shape.type!r} cannot be ordered in flight: {error}; let its `curve` give"
            " numbers, texts, lists and tables"
        ) from None
    return zlib.crc32(text.encode()) or 1


def _canonical(value: object) -> str:
    """Return plain data as a text that is the same on every computer.

    Raises:
        TypeError: the value is no plain data.
    """
    match value:
        case None | bool() | int() | str():
            return json.dumps(value)
        case float():
            return f"{value:.9g}"
        case list() | tuple():
            return f"[{','.join(_canonical(one) for one in value)}]"
        case set() | frozenset():
            return f"[{','.join(sorted(_canonical(one) for one in value))}]"
        case Mapping():
            entries = sorted((str(name), _canonical(one)) for name, one in value.items())
            return f"{{{','.join(f'{name}:{text}' for name, text in entries)}}}"
        case _:
            raise TypeError(f"{type(value).__name__} is not plain data")


def shape_models() -> list[type[PathShape]]:
    """Return the models of all known types of paths that can be loaded."""
    models = []
    for name in paths.names():
        with suppress(InputError):
            models.append(shape_model(name))
    return models


def fault(kind: str, value: object, **context: str) -> ValidationError:
    """Return a validation error for a path as a whole."""
    details = InitErrorDetails(type=kind, loc=(), input=value, ctx=dict(context))
    return ValidationError.from_exception_data("path", [details])


def below(name: str, error: ValidationError) -> ValidationError:
    """Return a section's validation error with its locations one step further down, below `name`."""
    known, found = set(get_args(ErrorType)), []
    for one in error.errors(include_url=False):
        kind: Any = one["type"]
        if kind not in known:
            text = one["msg"].replace("{", "{{").replace("}", "}}")
            kind = PydanticCustomError(kind, text, one.get("ctx"))
        found.append(
            InitErrorDetails(
                type=kind, loc=(name, *one["loc"]), input=one["input"], ctx=one.get("ctx", {})
            )
        )
    return ValidationError.from_exception_data("path", found)
