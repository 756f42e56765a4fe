"""Figures of README.md and docs/: measured, kept as rows in docs/results, written as tables.

    python -m tests.benchmarks.results measure [STUDY ...]    # appends rows; the cheap studies if none
    python -m tests.benchmarks.results tables                 # writes all tables from the newest rows
    python -m tests.benchmarks.results append STUDY CASE NAME=VALUE[,VALUE] ...  # a row flown by hand

docs/results/studies.yaml names each study: what measures it, the code that its figures speak of, and the
columns of its table. Rows of a study lie in docs/results/STUDY.jsonl. In Markdown a table stands between
`<!-- table STUDY -->` and `<!-- end -->`.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib import import_module
from math import isfinite
from pathlib import Path

import msgspec

from tests.kit.figures import tell

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"

MEASURED = ("vfguide", "sitl_stub", "missions", "pyproject.toml")
"""Whose last commit a row names."""

OLD = " †"
"""Mark of a row that is older than the code it speaks of."""

NOTHING = "-"
"""Cell of a figure that nobody measured."""

Value = float | str | list[float] | None
Figures = Mapping[str, Value]
Cases = Iterator[tuple[str, Figures]]
"""What a study's measurement gives: figures by case."""


class Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Figures of one case, and where they come from."""

    case: str
    command: str
    commit: str
    """Last commit that touched what was measured; with a + where files differed from it."""
    date: str
    """UTC, to the day or the second."""
    machine: str
    load: float | None
    """Of the machine, over the last minute; None where nobody noted it."""
    figures: dict[str, Value]
    """A list holds one value for each seed or flight."""
    note: str = ""


class Study(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A study and its table."""

    columns: dict[str, str]
    """Format of each column by its heading: fields are `case`, `load` and figures."""
    command: str
    """How it is measured, in words that can be typed."""
    code: list[str]
    """Files and folders whose change makes figures old."""
    measure: str = ""
    """`module:function` that yields the cases; empty where rows are appended by who flies them."""
    cheap: bool = False
    """Measured by `make results` without a name."""
    rows: str = ""
    """Study whose rows are shown; empty for its own."""
    cases: list[str] = []
    """Shown, in this order; all if empty."""


class Shown(tuple[float | str, ...]):
    """A figure of all seeds or flights of a case, as a table writes it."""

    __slots__ = ()

    def __format__(self, form: str) -> str:
        """Write one value, or the least and the greatest."""
        if any(isinstance(one, str) for one in self):
            return ", ".join(map(str, dict.fromkeys(self)))
        ends = dict.fromkeys(format(one, form) for one in sorted(self))
        return " to ".join(list(ends)[:: max(len(ends) - 1, 1)]) or NOTHING

    @property
    def worst(self) -> "Shown":
        """The greatest alone."""
        return Shown(sorted(self)[-1:])

    @property
    def number(self) -> int:
        """How many seeds or flights."""
        return len(self)


def studies(folder: Path = RESULTS) -> dict[str, Study]:
    """Return all studies by name."""
    return msgspec.yaml.decode((folder / "studies.yaml").read_bytes(), type=dict[str, Study])


def rows_of(name: str, folder: Path = RESULTS) -> list[Row]:
    """Return the rows of a study, oldest first.

    Raises:
        ValueError: a line is no row; the message names file and line.
    """
    file = folder / f"{name}.jsonl"
    lines = file.read_bytes().splitlines() if file.exists() else []
    found = []
    for number, line in enumerate(lines, 1):
        try:
            found.append(msgspec.json.decode(line, type=Row))
        except msgspec.DecodeError as error:
            raise ValueError(f"{file.name}, line {number}: {error}") from error
    return found


def together(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return by case the newest row and those that belong to it: of the same commit and command.

    Later lines are newer. Several rows of a case are its flights.
    """
    found: dict[str, list[Row]] = {}
    for row in rows:
        kept = found.setdefault(row.case, [])
        if kept and (kept[-1].commit, kept[-1].command) != (row.commit, row.command):
            kept.clear()
        kept.append(row)
    return found


def shown(rows: Sequence[Row]) -> dict[str, Shown]:
    """Return the figures of rows that belong together; those that nobody knows are left out."""
    values: dict[str, list[float | str]] = defaultdict(list)
    for row in rows:
        for name, value in row.figures.items():
            values[name] += value if isinstance(value, list) else [] if value is None else [value]
    figures: dict[str, Shown] = defaultdict(Shown)
    return figures | {name: Shown(several) for name, several in values.items()}


def table(study: Study, rows: Sequence[Row], is_old: Callable[[str], bool]) -> str:
    """Return a study's table in Markdown; a date that all rows share stands below it.

    Args:
        study: columns, and the cases that are shown.
        rows: oldest first.
        is_old: whether the code has changed since a commit.
    """
    known = together(rows)
    groups = {case: known[case] for case in study.cases or known}
    dates = {group[-1].date[:10] for group in groups.values()}
    headings = [*study.columns, "measured"] if len(dates) > 1 else [*study.columns]
    lines = [f"| {' | '.join(headings)} |", "|---" * len(headings) + "|"]
    olds = {commit: is_old(commit) for commit in (group[-1].commit for group in groups.values())}
    for case, group in groups.items():
        figures = shown(group)
        figures["case"] = Shown([case])
        figures["load"] = Shown(one.load for one in group if one.load is not None)
        cells = [form.format_map(figures) for form in study.columns.values()]
        if len(dates) > 1:
            cells.append(f"{group[-1].date[:10]}{OLD if olds[group[-1].commit] else ''}")
        lines.append(f"| {' | '.join(cells)} |")
    when = f", {dates.pop()}{OLD if any(olds.values()) else ''}" if len(dates) == 1 else ""
    return "\n".join([*lines, "", f"`{study.command}`{when}", ""])


def age_of(code: Sequence[str]) -> Callable[[str], bool]:
    """Return whether some code was committed after a commit; never, where there is no history."""
    known = git("rev-parse", "--verify", "HEAD") is not None

    @cache
    def is_old(commit: str) -> bool:
        since = git("log", "-1", "--format=%h", f"{commit}..HEAD", "--", *code)
        return known and since != ""

    return is_old


def git(*words: str) -> str | None:
    """Return what git says of this checkout, or None where it cannot."""
    try:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)  # noqa: S607 - whichever is installed
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


PLACE = re.compile(r"(?<=<!-- table )(\S+)( -->\n).*?(?=<!-- end -->)", re.DOTALL)


def written(text: str, tables: Callable[[str], str]) -> str:
    """Return a page with all its tables written anew."""
    return PLACE.sub(lambda place: f"{place[1]}{place[2]}\n{tables(place[1])}\n", text)


def pages() -> Iterator[Path]:
    """Yield the pages that have tables."""
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        if PLACE.search(page.read_text(encoding="utf-8")):
            yield page


def table_named(name: str, folder: Path = RESULTS) -> str:
    """Return the table of a study, from its file."""
    study = studies(folder)[name]
    return table(study, rows_of(study.rows or name, folder), age_of(study.code))


def row(case: str, figures: Figures, command: str) -> Row:
    """Return a row of what was measured just now, in this checkout."""
    commit = git("log", "-1", "--format=%h", "--abbrev=8", "--", *MEASURED) or "unknown"
    changed = git("status", "--porcelain", "--", *MEASURED)
    known = {
        name: None if isinstance(value, float) and not isfinite(value) else value
        for name, value in figures.items()
    }
    return Row(
        case=case,
        command=command,
        commit=commit + ("+" if changed else ""),
        date=f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
        machine=f"{os.cpu_count()} processors, {platform.machine()}, Python {platform.python_version()}",
        load=round(os.getloadavg()[0], 1),
        figures={name: rounded(value) for name, value in known.items()},
    )


def rounded(value: Value) -> Value:
    """Return a figure to five digits: more of them tell nothing."""
    if isinstance(value, list):
        return [float(f"{one:.5g}") for one in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value


def append(name: str, rows: Iterable[Row], folder: Path = RESULTS) -> None:
    """Append rows to a study's file, each as soon as it is there."""
    for one in rows:
        with (folder / f"{name}.jsonl").open("ab") as file:
            file.write(msgspec.json.encode(one) + b"\n")
        tell(f"{name}: {one.case}: {one.figures}")


def measured(study: Study) -> Iterator[Row]:
    """Yield the rows of a study that is measured now."""
    module, _, function = study.measure.partition(":")
    cases: Cases = getattr(import_module(module), function)()
    for case, figures in cases:
        yield row(case, figures, study.command)


def figure_of(word: str) -> tuple[str, Value]:
    """Return (name, value) of NAME=VALUE: a number, several with commas, or a text.

    Raises:
        ValueError: a part is missing.
    """
    name, _, text = word.partition("=")
    if not name or not text:
        raise ValueError(f"{word!r} is no figure; write NAME=VALUE, such as mean_m=0.25")
    try:
        numbers = [float(one) for one in text.split(",")]
    except ValueError:
        return name, text
    return name, numbers if len(numbers) > 1 else numbers[0]


def refuse_unknown(
    parser: argparse.ArgumentParser, names: Sequence[str], known: Collection[str]
) -> None:
    """End with a line that names all studies, where one is unknown."""
    for name in names:
        if name not in known:
            parser.error(f"there is no study {name!r}; known are {', '.join(sorted(known))}")


def main() -> None:
    """Measure studies, write all tables, or append a row."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("what", choices=["measure", "tables", "append"])
    parser.add_argument(
        "words", nargs="*", metavar="WORD", help="studies; or study, case and figures"
    )
    options, known = parser.parse_args(), studies()
    if options.what == "append":
        if len(options.words) < 3:
            parser.error("append: give a study, a case and figures, such as NAME=0.25")
        name, case, *figures = options.words
        refuse_unknown(parser, [name], known)
        try:
            values = dict(map(figure_of, figures))
        except ValueError as error:
            parser.error(f"append: {error}")
        append(name, [row(case, values, known[name].command)])
        return
    if options.what == "measure":
        refuse_unknown(parser, options.words, known)
        for name in options.words or [name for name, one in known.items() if one.cheap]:
            append(name, measured(known[name]))
        return
    for page in pages():
        text = page.read_text(encoding="utf-8")
        page.write_text(written(text, table_named), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
