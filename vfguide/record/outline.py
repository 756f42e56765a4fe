"""What a flight is drawn with on the ground: edges of its fence, paths that may be ordered, rally points."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

from vfguide.elementwise import FloatArray
from vfguide.record.archive import AnyArray
from vfguide.record.vehicle import floats

OutlineKind = Literal["fence", "path", "rally"]

MOST_OUTLINES = 1000
"""In one record: more than a mission can name."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """One line on the ground, or some points.

    Raises:
        ValueError: it has not as many norths as easts.
    """

    kind: OutlineKind
    """`fence`: the edge of an area that has to be stayed in or out of; `path`: not the mission's first;
    `rally`: points to which an aircraft may go back, no line."""
    north_m: FloatArray
    """M points from its beginning to its end, m; of a closed line the last is the first."""
    east_m: FloatArray
    """M points, m."""

    def __post_init__(self) -> None:
        if self.north_m.ndim != 1 or self.north_m.shape != self.east_m.shape:
            raise ValueError("a drawn line has not as many norths as easts")


def describe_outlines(outlines: tuple[Outline, ...]) -> list[str]:
    """All of them that is no array, ready for JSON."""
    return [one.kind for one in outlines]


def outline_arrays(outlines: tuple[Outline, ...]) -> dict[str, AnyArray]:
    """The outlines' arrays by name."""
    arrays: dict[str, AnyArray] = {}
    for number, one in enumerate(outlines):
        arrays[f"outline_{number}_north_m"] = one.north_m
        arrays[f"outline_{number}_east_m"] = one.east_m
    return arrays


def compose_outlines(kinds: Any, arrays: dict[str, AnyArray]) -> tuple[Outline, ...]:  # noqa: ANN401
    """Outlines from their parts; LookupError or ValueError where one is missing or misshapen."""
    if not isinstance(kinds, list) or len(kinds) > MOST_OUTLINES:
        raise ValueError("its drawn lines are no list, or too many")
    unknown = [kind for kind in kinds if kind not in get_args(OutlineKind)]
    if unknown:
        raise ValueError(f"a drawn line is none of {', '.join(get_args(OutlineKind))}")
    return tuple(
        Outline(
            kind=kind,
            north_m=floats(arrays, f"outline_{number}_north_m"),
            east_m=floats(arrays, f"outline_{number}_east_m"),
        )
        for number, kind in enumerate(kinds)
    )
