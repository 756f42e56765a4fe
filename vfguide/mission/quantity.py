"""Types of numbers and names in a mission file.

Numbers are strict: text in quotes, yes/no values, NaN and infinities are refused. Units are in the field
names (``_m``, ``_m_s``, ``_deg``, ``_s``).
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from functools import cache
from itertools import pairwise
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import PydanticKnownError

from vfguide.registry import EmulatorNames, Registry

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
WholeNumber = Annotated[int, Field(strict=True)]
Switch = Annotated[bool, Field(strict=True)]
"""true or false only."""

Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0)]
Coordinate = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-100e3, le=100e3)]
"""A local coordinate, m; beyond 100 km the flat local frame no longer describes the earth."""

Course = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-360.0, le=360.0)]
"""A direction, degrees clockwise from north."""

Speed = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1.0, le=300.0)]
"""A speed of flight, m/s."""

Gain = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-6, le=1000.0)]
"""A feedback gain: positive, so that the loop is stable; below 1e-6 the loop is not closed."""

Duration = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=60.0)]
"""A delay or time constant, s; all of vfguide's are far below a minute."""

VEHICLE_NAME = r"^[A-Za-z][A-Za-z0-9_-]{0,31}$"
MISSION_NAME = r"^[a-z0-9][a-z0-9-]{0,63}$"
PATH_NAME = r"^[a-z][a-z0-9-]{0,31}$"
NAME_RULES = {
    PATH_NAME: "a lower-case letter and up to 31 more, digits and hyphens",
    VEHICLE_NAME: "a letter and up to 31 more letters, digits, hyphens or underscores",
    MISSION_NAME: "up to 64 lower-case letters, digits and hyphens",
}
"""Rule of each name pattern, for messages."""

VehicleName = Annotated[str, Field(pattern=VEHICLE_NAME)]
"""A vehicle name, also used in link topics and file names, hence the narrow alphabet."""

MissionName = Annotated[str, Field(pattern=MISSION_NAME)]
"""A mission name, also used for its record."""


PathName = Annotated[str, Field(pattern=PATH_NAME)]
"""The name of one of a mission's other paths."""


def known_in(registry: Registry | EmulatorNames) -> Callable[[str], str]:
    """Return a validator that accepts the names of a registry; its error lists them."""

    def known(name: str) -> str:
        if name not in registry:
            names = " or ".join(f"'{one}'" for one in registry.names())
            raise PydanticKnownError("literal_error", {"expected": names})
        return name

    return known


class Section(BaseModel):
    """A group of fields in a mission file: immutable, without unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


@cache
def field_meanings(section: type[BaseModel]) -> Mapping[str, str]:
    """Return the docstring of each field of a section, by field name.

    They are read from the source on demand, for the schema and for messages. Pydantic's own
    `use_attribute_docstrings` parses the source of each class when it is defined. In an aircraft's companion
    that takes 0.08 s and 2 MB, and nobody reads them there.
    """
    found: dict[str, str] = {}
    for one in reversed(section.__mro__):
        for name in inspect.get_annotations(one):
            found.pop(name, None)
        found |= docstrings_below_fields(one)
    return found


def docstrings_below_fields(section: type) -> dict[str, str]:
    """Return the docstring below each annotated name in a class's own body; empty without source."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(section)))
    except (OSError, TypeError, SyntaxError):
        return {}
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    return {
        field.target.id: inspect.cleandoc(below.value.value)
        for field, below in pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }


class Position(Section):
    """A point in the local frame of the mission."""

    north_m: Coordinate = 0.0
    """Metres north of the mission's origin."""

    east_m: Coordinate = 0.0
    """Metres east of the mission's origin."""
