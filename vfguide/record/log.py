"""Logs of a companion: comma-separated values, one line per entry, with its time in the column `time_s`.

A line is complete once its line feed is written; a file of a killed companion is read up to there. A damaged
line does not affect others. Unknown values (None, NaN) are empty.
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from io import SEEK_END, TextIOWrapper
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import msgspec

from vfguide.regular_file import open_regular, whole_lines

LONGEST_TEXT = 300
"""Maximum number of characters of a stored text."""

NEWEST_BYTES = 8192
"""Bytes read from the end of a growing file: some 40 steps of guidance, 2 s at 20 Hz."""


class Timed(Protocol):
    """Entry of a log."""

    @property
    def time_s(self) -> float:
        """Time on the companion's own clock, s."""


Entry = TypeVar("Entry", bound=Timed)


class CompanionLog(Generic[Entry]):
    """Format of one kind of log."""

    def __init__(self, kind: type[Entry], columns: Sequence[str]) -> None:
        """Describe a log whose lines have these columns in order.

        Fields of `kind` without a default are in every line. A file of an earlier version may have fewer
        columns.
        """
        self._kind = kind
        self._columns = columns
        self.header = (",".join(columns) + "\n").encode()
        """First line of a file."""

    def encode(self, entry: msgspec.Struct, **more: object) -> bytes:
        """Encode an entry as a line; `more` replaces fields or adds columns."""
        line = io.StringIO()
        values = msgspec.structs.asdict(entry) | more
        csv.writer(line, lineterminator="\n").writerow([written(values[n]) for n in self._columns])
        return line.getvalue().encode()

    def read(self, *paths: Path, **given: str) -> Iterator[Entry]:
        """Yield the readable entries of files in order; `given` are fields that are no columns.

        The files are those of one companion's starts, which may be missing or truncated.
        """
        for path in paths:
            with (
                suppress(OSError, csv.Error),
                TextIOWrapper(
                    open_regular(path), newline="", encoding="utf-8", errors="replace"
                ) as file,
            ):
                yield from self._entries(csv.DictReader(whole_lines(file)), given)

    def read_newest(self, *paths: Path) -> Iterator[Entry]:
        """Yield the entries at the ends of growing files."""
        for path in paths:
            with suppress(OSError, csv.Error), open_regular(path) as file:
                file.seek(max(file.seek(0, SEEK_END) - NEWEST_BYTES, 0))
                # The first and the last line may be incomplete.
                lines = file.read(NEWEST_BYTES).decode("utf-8", "replace").split("\n")[1:-1]
                yield from self._entries(csv.DictReader(lines, fieldnames=self._columns), {})

    def _entries(self, rows: Iterable[dict[str, str]], given: dict[str, str]) -> Iterator[Entry]:
        for row in rows:
            told = {name: plain(text) for name, text in row.items() if name and text}
            with suppress(msgspec.ValidationError):
                entry = msgspec.convert(told | given, self._kind, strict=False)
                if math.isfinite(entry.time_s):
                    yield entry


def written(value: object) -> str:
    """Format a value for a line."""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6f}"
    return "" if value is None else plain(str(value))


def plain(text: str) -> str:
    """Return the printable characters of a text in one line, up to the maximum length."""
    words = " ".join(text.split())
    return "".join(letter for letter in words if letter.isprintable())[:LONGEST_TEXT]
