"""What is wrong with a mission file, one line for each fault."""

from dataclasses import dataclass

from vfguide.errors import InputError
from vfguide.mission.flight_path import Location, dotted


def printable(text: str) -> str:
    """The text on one line, with whatever a terminal could not show written as an escape."""
    return "".join(
        character if character.isprintable() else f"\\u{ord(character):04x}" for character in text
    )


def shortened(text: str, limit: int = 60) -> str:
    """The beginning of a long text."""
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong."""

    file: str
    """The mission file."""
    line: int | None
    """Line in it, counted from 1; None where the fault is the file's own."""
    location: Location
    """The field; empty where the fault is the file's own."""
    message: str
    """What is wrong."""
    remedy: str
    """What would be right; may be empty."""

    @property
    def field(self) -> str:
        """The field as messages write it."""
        return dotted(self.location)

    def __str__(self) -> str:
        where = self.file if self.line is None else f"{self.file}:{self.line}"
        subject = f"{shortened(self.field, 120)}: " if self.location else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return printable(f"{where}: {subject}{self.message}{remedy}")


class MissionError(InputError):
    """The mission file cannot be flown as it is written."""

    def __init__(self, faults: tuple[Fault, ...]) -> None:
        super().__init__("\n".join(str(fault) for fault in faults))
        self.faults = faults
        """Everything found wrong, in the order of the file."""
