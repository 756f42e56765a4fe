"""Where in a mission file something is: a way down the tree, and the lines it lies on."""

from collections.abc import Mapping
from dataclasses import dataclass, field

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
    """The file a mission was read from, and the line of each of its fields."""

    file: str
    """The file, as messages name it."""
    lines: Mapping[Location, int] = field(default_factory=dict)
    """Line of each field, counted from 1."""

    def line_of(self, location: Location) -> int | None:
        """Line of a field; of the innermost group around it if the file leaves the field out."""
        for length in range(len(location), -1, -1):
            line = self.lines.get(location[:length])
            if line is not None:
                return line
        return None
