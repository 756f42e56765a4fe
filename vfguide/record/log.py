"""A companion's logs: comma-separated values, a line for each entry, with its time in the column `time_s`.

A line is whole once its line feed is written: what a killed companion leaves is read up to there, and a line
that is damaged loses itself alone. What is not known (None, NaN) is an empty place.
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
"""Characters of a text that are kept."""

NEWEST_BYTES = 8192
"""Length of a growing file's end that is read: some 40 steps of guidance, 2 s at 20 Hz."""


class Timed(Protocol):
    """What a line holds."""

    @property
    def time_s(self) -> float:
        """On the companion's own clock, s."""


Entry = TypeVar("Entry", bound=Timed)


class CompanionLog(Generic[Entry]):
    """One kind of log."""

    def __init__(self, kind: type[Entry], columns: Sequence[str]) -> None:
        """Describe a log.

        Args:
            kind: of the entries, whose fields without a default stand in every line.
            columns: in the order of a line; a file of an earlier version may have fewer.
        """
        self._kind = kind
        self._columns = columns
        self.header = (",".join(columns) + "\n").encode()
        """First line of a file."""

    def encode(self, entry: msgspec.Struct, **more: object) -> bytes:
        """An entry as a line.

        Args:
            entry: whose fields are told.
            more: columns that are no fields of it, or told otherwise.
        """
        line = io.StringIO()
        values = msgspec.structs.asdict(entry) | more
        csv.writer(line, lineterminator="\n").writerow([written(values[n]) for n in self._columns])
        return line.getvalue().encode()

    def read(self, *paths: Path, **given: str) -> Iterator[Entry]:
        """The entries of files, as far as they can be read, in the order of their lines.

        Args:
            paths: of one companion's starts; one may be missing or cut off.
            given: fields that are no columns.
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
        """The entries at the ends of files that grow and may be long."""
        for path in paths:
            with suppress(OSError, csv.Error), open_regular(path) as file:
                file.seek(max(file.seek(0, SEEK_END) - NEWEST_BYTES, 0))
                # The first and the last line may not be whole.
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
    """A value as it stands in a line."""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6f}"
    return "" if value is None else plain(str(value))


def plain(text: str) -> str:
    """The printable characters of a text in one line, as long as it is kept."""
    words = " ".join(text.split())
    return "".join(letter for letter in words if letter.isprintable())[:LONGEST_TEXT]
