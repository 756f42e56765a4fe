"""The path that a leader is sent along, as a mission file describes it.

Local frame: x north, y east (m). Courses are degrees clockwise from north. The kinds of paths and their
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
"""At which a path is looked at for its lowest and its highest."""

FieldGain = Annotated[Gain, Field(le=10.0)]


class PathShape(Section):
    """What every path of a mission says."""

    type: str
    """Which kind of path it is."""

    gain: FieldGain = 0.03
    """k of the article: how sharply the field turns onto the path, 1/m."""

    @property
    def approach_angle(self) -> float:
        """chi_inf, rad: the angle to the path at which the field approaches it from far away."""
        return math.pi / 2.0

    @property
    def fence(self) -> Fence | None:
        """That it brings along, if it does."""
        return None

    @property
    def rally_points(self) -> tuple[Place, ...]:
        """That it brings along."""
        return ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """What its file asks for and a formation does not do."""
        return ()

    @property
    def curve(self) -> Mapping[str, Any]:
        """What curve and field follow from: numbers, texts, lists, sets and tables of them."""
        return self.model_dump()

    def misfits(self) -> Iterable[Misfit]:
        """What keeps it from being flown although each field is sound by itself."""
        return ()

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to other processes as plain fields: the model of a path is made anew in each of them."""
        return shape_of, (self.model_dump(exclude_unset=True),)


def shape_model(name: str) -> type[PathShape]:
    """The fields that `path:` may hold for a kind of path.

    Raises:
        InputError: there is no such kind.
    """
    return named_shape(name, paths.find(name).Shape)


@cache
def named_shape(name: str, shape: type[PathShape]) -> type[PathShape]:
    """The fields of a shape, and a `type` of this name."""
    kind: Any = (Annotated[Literal[name], Field(description=f"`{name}`.")], ...)
    title = "".join(word.capitalize() for word in name.split("-"))
    return create_model(
        f"{title}Path", __base__=shape, __module__=__name__, __doc__=shape.__doc__, type=kind
    )


def shape_of(content: Mapping[str, Any]) -> PathShape:
    """The path that the fields of a mission file stand for.

    Raises:
        pydantic.ValidationError: the kind or a field is not known, or a value is out of its range; as of a
            union that is told apart by its `type`, locations begin with the kind.
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
    """A mapping as the path that it stands for; anything else as it is."""
    return shape_of(value) if isinstance(value, Mapping) else value


def path_of(shape: PathShape) -> Path:
    """The path of a mission as guidance sees it."""
    kind: Any = paths.find(shape.type)
    return made_path(kind, shape)


@lru_cache(maxsize=32)
def made_path(kind: type[Path], shape: PathShape) -> Path:
    """A path of a kind; a curve takes a while to look at."""
    return kind.of(shape)


def height_span(path: Path) -> tuple[float, float]:
    """The lowest and the highest place of a path, m above the flying height, as far as its outline shows."""
    heights = np.atleast_1d(path.at(path.outline(PLACES)).height)
    return float(heights.min()), float(heights.max())


def curve_check(shape: PathShape, origin: Section, height: float) -> int:
    """What tells a path from any other of its name: CRC-32 of what it follows from; not 0.

    Numbers count to nine digits: two computers may find the last one of a radius differently.

    Args:
        shape: its fields.
        origin: that it counts from.
        height: above the origin, m, at which the mission flies.

    Raises:
        InputError: a path of one's own has a field that cannot be compared.
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
    """Plain data as a text that is the same on every computer.

    Raises:
        TypeError: it is none.
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
    """The fields of every known kind of path; of those that cannot be loaded nothing is known."""
    models = []
    for name in paths.names():
        with suppress(InputError):
            models.append(shape_model(name))
    return models


def fault(kind: str, value: object, **context: str) -> ValidationError:
    """One finding about a path as a whole."""
    details = InitErrorDetails(type=kind, loc=(), input=value, ctx=dict(context))
    return ValidationError.from_exception_data("path", [details])


def below(name: str, error: ValidationError) -> ValidationError:
    """Findings of a section, placed one step further down."""
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
