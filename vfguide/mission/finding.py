"""Where in a mission file something is, faults of the file, and findings about what it says."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from vfguide.errors import InputError

Location = tuple[str | int, ...]
"""Names of fields and indices of list entries from the top of the file, such as ("path", "type")."""


def dotted(location: Location) -> str:
    """The location as messages write it: ``followers[0].slot.forward_m``."""
    text = ""
    for step in location:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += f".{step}" if text else step
    return text


@dataclass(frozen=True, slots=True)
class MissionSource:
    """The file a mission was read from, the line of each of its fields, and options instead of them."""

    file: str | None
    """The file, as messages name it; None of a mission that is no file's."""
    lines: Mapping[Location, int] = field(default_factory=dict)
    """Line of each field, counted from 1."""
    options: Mapping[Location, str] = field(default_factory=dict)
    """The option of the command line that gave a field its value."""

    def option_of(self, location: Location) -> str | None:
        """The option that gave a field its value, or made the group, with the way down from what it gave."""
        for length in range(len(location), 0, -1):
            if (option := self.options.get(location[:length])) is not None:
                rest = dotted(location[length:])
                return f"{option}, {rest}" if rest else option
        if not location or location in self.lines:
            return None
        depth = len(location)
        return next((one for at, one in self.options.items() if at[:depth] == location), None)

    def with_options(self, text: str) -> str:
        """A text that names fields, with the options of their own that gave them in their places.

        The name of a whole group, such as `wind`, is a word like others.
        """
        for place, option in self.options.items():
            if len(place) > 1 and not option.startswith("--set"):
                text = text.replace(dotted(place), option)
        return text

    def line_of(self, location: Location) -> int | None:
        """Line of a field; of the innermost group around it if the file leaves the field out."""
        for length in range(len(location), -1, -1):
            line = self.lines.get(location[:length])
            if line is not None:
                return line
        return None


@dataclass(frozen=True, slots=True)
class Misfit:
    """A field that is wrong by itself, or does not fit to others."""

    location: Location
    """Where it is: in the mission; of a path's own misfits, below `path`."""
    message: str
    """What is wrong."""
    remedy: str
    """What would be right."""


def refuse(misfits: Iterable[Misfit], value: object, *outer: str) -> None:
    """Refuse a section whose fields do not fit together, each misfit at its place.

    Args:
        misfits: of the section.
        value: of the section, for the error.
        outer: steps of the location before those of a misfit.

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


def printable(text: str) -> str:
    """The text on one line, with whatever a terminal could not show written as an escape."""
    return "".join(
        character if character.isprintable() else f"\\u{ord(character):04x}" for character in text
    )


def shortened(text: str, limit: int = 60) -> str:
    """The beginning of a long text."""
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


Severity = Literal["error", "warning", "note"]
"""error: it cannot be flown so; warning: it can, but not well; note: what to expect."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing known before take-off."""

    severity: Severity
    """How bad it is."""
    location: Location
    """The field to look at."""
    message: str
    """What is the case."""
    remedy: str = ""
    """What would be better."""
    file: str | None = None
    """The mission file, where known."""
    line: int | None = None
    """Line of the field in it, where known."""
    option: str | None = None
    """The option of the command line that gave the field its value, if one did."""

    @property
    def field(self) -> str:
        """The field as messages write it."""
        return dotted(self.location)

    def placed(self, source: MissionSource) -> "Finding":
        """This finding with its place in the mission file, or with the option that it comes from."""
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
        """The finding as JSON holds it."""
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
        """The finding in a line, with what it is before its field; nothing for a fault of a file."""
        place = ":".join(str(part) for part in (self.file, self.line) if part is not None)
        where = f"{place}: " if place else ""
        field = self.option or self.field
        subject = f"{shortened(field, 120)}: " if field else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return printable(f"{where}{kind}{subject}{self.message}{remedy}")


class MissionError(InputError):
    """The mission file cannot be flown as it is written."""

    def __init__(self, faults: tuple[Finding, ...]) -> None:
        super().__init__("\n".join(fault.line_with() for fault in faults))
        self.faults = faults
        """Everything found wrong, in the order of the file."""


def worst_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Errors before warnings before notes, otherwise in the order they were found."""
    rank = {"error": 0, "warning": 1, "note": 2}
    return tuple(sorted(findings, key=lambda one: rank[one.severity]))
