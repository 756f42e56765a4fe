"""Locations in mission files, faults of a file, and findings about its content."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from vfguide.errors import InputError

Location = tuple[str | int, ...]
"""Field names and list indices from the top of the file, such as ("path", "type")."""


def dotted(location: Location) -> str:
    """Return the location as messages write it: ``followers[0].slot.forward_m``."""
    text = ""
    for step in location:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += f".{step}" if text else step
    return text


@dataclass(frozen=True, slots=True)
class MissionSource:
    """Source of a mission: its file, the line of each field, and overriding options."""

    file: str | None
    """File name for messages; None for a mission without a file."""
    lines: Mapping[Location, int] = field(default_factory=dict)
    """Line of each field, counted from 1."""
    options: Mapping[Location, str] = field(default_factory=dict)
    """Command-line option that gave each overridden field its value."""

    def option_of(self, location: Location) -> str | None:
        """Return the option that set a field, or the group around or below it; None if no option did.

        If the option set a group around the field, the remaining steps to the field are appended.
        """
        for length in range(len(location), 0, -1):
            if (option := self.options.get(location[:length])) is not None:
                rest = dotted(location[length:])
                return f"{option}, {rest}" if rest else option
        if not location or location in self.lines:
            return None
        depth = len(location)
        return next((one for at, one in self.options.items() if at[:depth] == location), None)

    def with_options(self, text: str) -> str:
        """Replace field names in a text by the specific options that set them.

        The name of a whole group, such as `wind`, stays, since it may be an ordinary word.
        """
        for place, option in self.options.items():
            if len(place) > 1 and not option.startswith("--set"):
                text = text.replace(dotted(place), option)
        return text

    def line_of(self, location: Location) -> int | None:
        """Return the line of a field, or of the innermost group around it if the file omits the field."""
        for length in range(len(location), -1, -1):
            line = self.lines.get(location[:length])
            if line is not None:
                return line
        return None


@dataclass(frozen=True, slots=True)
class Misfit:
    """A field that is invalid, or inconsistent with others."""

    location: Location
    """Location in the mission; relative to `path` for misfits that a path reports."""
    message: str
    remedy: str


def refuse(misfits: Iterable[Misfit], value: object, *outer: str) -> None:
    """Refuse a section whose fields are inconsistent, with each misfit at its location.

    `outer` holds the steps that precede the location of each misfit.

    Raises:
        pydantic.ValidationError: there is a misfit.
    """
    found = [
        InitErrorDetails(
            type=PydanticCustomError(
                "misfit", "{text}", {"text": one.message, "remedy": one.remedy}
            ),
            loc=(*outer, *one.location),
            input=value,
        )
        for one in misfits
    ]
    if found:
        raise ValidationError.from_exception_data("mission", found)


def no_more_than(value: float) -> str:
    """Format a positive number with three significant digits, rounded down: a limit that a remedy names."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return f"{math.floor(value / step) * step:.6g}"


def told_apart(first: float, second: float, digits: int) -> tuple[str, str]:
    """Format two numbers with `digits` decimals, or up to two more where only these distinguish them."""
    for decimals in range(digits, digits + 3):
        texts = f"{first:.{decimals}f}", f"{second:.{decimals}f}"
        if texts[0] != texts[1]:
            break
    return texts


def printable(text: str) -> str:
    """Return the text with unprintable characters, including line breaks, as escapes."""
    return "".join(
        character if character.isprintable() else f"\\u{ord(character):04x}" for character in text
    )


def shortened(text: str, limit: int = 60) -> str:
    """Return the beginning of a long text."""
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


Severity = Literal["error", "warning", "note"]
"""error: cannot be flown; warning: can be flown, but not well; note: what to expect."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding before take-off."""

    severity: Severity
    location: Location
    """Field to look at."""
    message: str
    remedy: str = ""
    file: str | None = None
    """Mission file, None if unknown."""
    line: int | None = None
    """Line of the field in the file, None if unknown."""
    option: str | None = None
    """Command-line option that gave the field its value, or None."""

    @property
    def field(self) -> str:
        """Field name as messages write it."""
        return dotted(self.location)

    def placed(self, source: MissionSource) -> "Finding":
        """Return this finding with its position in the mission file, or with the option it comes from."""
        option = source.option_of(self.location)
        return replace(
            self,
            message=source.with_options(self.message),
            remedy=source.with_options(self.remedy),
            file=source.file if option is None else None,
            line=source.line_of(self.location) if option is None else None,
            option=option,
        )

    def as_json(self) -> dict[str, object]:
        """Return the finding as JSON data."""
        return {
            "severity": self.severity,
            "file": self.file,
            "line": self.line,
            "field": self.field,
            "message": self.message,
            "remedy": self.remedy,
        }

    def __str__(self) -> str:
        return self.line_with(f"{self.severity}: ")

    def line_with(self, kind: str = "") -> str:
        """Return the finding in one line; `kind`, such as its severity, precedes the field."""
        place = ":".join(str(part) for part in (self.file, self.line) if part is not None)
        where = f"{place}: " if place else ""
        field = self.option or self.field
        subject = f"{shortened(field, 120)}: " if field else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return printable(f"{where}{kind}{subject}{self.message}{remedy}")


class MissionError(InputError):
    """The mission file cannot be flown as written."""

    def __init__(self, faults: tuple[Finding, ...]) -> None:
        super().__init__("\n".join(fault.line_with() for fault in faults))
        self.faults = faults
        """All faults, in the order of the file."""


def worst_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Sort errors before warnings before notes, otherwise keeping the order."""
    rank = {"error": 0, "warning": 1, "note": 2}
    return tuple(sorted(findings, key=lambda one: rank[one.severity]))
