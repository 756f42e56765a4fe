"""Faults of a mission file, and findings about what it says."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from vfguide.errors import InputError
from vfguide.mission.flight_path import Location, MissionSource, dotted


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
