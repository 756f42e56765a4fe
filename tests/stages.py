"""Runs the stages of `make test`: a line for each when it ends, and one at the end for all.

What a stage prints goes into test-logs/STAGE.log. A stage that fails shows its failures, too. The longest
tests of all stages are listed in test-logs/longest.txt.
"""

import os
import re
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

LOGS = Path("test-logs")

SHOWN_LINES = 150
"""Last lines of a failed stage's log that are shown."""

LISTED = 40
"""Longest tests that are listed."""

FAILURES = re.compile(r"^=+ (FAILURES|ERRORS) =+$")
"""Where a log begins to tell what failed."""

PLACE = re.compile(r"^\S+:\d+: ")
"""Where a test was skipped, before the reason."""

NOT_PASSED = {"MFLAGS", "MAKELEVEL", "PYTHONDONTWRITEBYTECODE"}
"""Variables of the environment that no stage sees."""

ENDS = (("failed", "failures"), ("errors", "errors"), ("skipped", "skipped"))
"""How tests end, by our words and by those of the results' file; the others have passed."""


@dataclass(frozen=True, slots=True)
class Stage:
    """Something that runs by itself and succeeds or fails."""

    name: str
    command: Sequence[str]


@dataclass(frozen=True, slots=True)
class Ended:
    """A stage that has ended."""

    name: str
    seconds: float
    status: int
    """Exit status; 0 for success."""
    counts: Counter[str] = field(default_factory=Counter)
    """Tests by how they ended; none of a stage without tests."""
    reasons: Counter[str] = field(default_factory=Counter)
    """Skipped tests by the reason."""
    lasted_s: Mapping[str, float] = field(default_factory=dict)
    """How long each test took, its fixtures and repetitions included."""


def made(name: str) -> Stage:
    """A target of the Makefile as a stage."""
    return Stage(name, ("make", "--no-print-directory", f"test-{name}"))


Rows = Sequence["Row"]
"""Side by side."""
Row = Sequence[Stage | Rows]
"""One after the other."""

ROWS: Rows = (
    (made("lockstep"),),
    (made("lint"),),
    (((made("sockets"),), (made("containers"),)), made("live")),
)
"""Lint and the flights in lockstep take what processor is left. What runs in real time needs it.

Formations that fly live, two at a time, do so alone. Of those in containers one flies at a time, for half a
core, and programs on sockets wait most of the time: these two stages go beside each other.
"""


def main(rows: Rows = ROWS) -> int:
    """Run all stages; return 0 where each has succeeded, else 1."""
    began_s = time.monotonic()
    LOGS.mkdir(exist_ok=True)
    ended = run_rows(rows)
    (LOGS / "longest.txt").write_text(longest(ended))
    say(total_line(ended, time.monotonic() - began_s))
    return int(any(one.status for one in ended))


def run_rows(rows: Rows) -> list[Ended]:
    """Run rows side by side."""
    with ThreadPoolExecutor(max_workers=len(rows)) as pool:
        return [one for row in pool.map(run_row, rows) for one in row]


def run_row(row: Row) -> list[Ended]:
    """Run stages one after the other, and tell how each ended."""
    ended = []
    for stage in row:
        if isinstance(stage, Stage):
            ended.append(run(stage))
            tell(ended[-1])
        else:
            ended += run_rows(stage)
    return ended


def run(stage: Stage) -> Ended:
    """Run a stage to its end."""
    began_s = time.monotonic()
    results = LOGS / f"{stage.name}.xml"
    results.unlink(missing_ok=True)
    with log_of(stage.name).open("wb") as log:
        done = subprocess.run(
            stage.command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=environment(os.environ, results),
            check=False,
        )
    told = counted(results.read_text()) if results.exists() else ()
    return Ended(stage.name, time.monotonic() - began_s, done.returncode, *told)


def environment(own: Mapping[str, str], results: Path) -> dict[str, str]:
    """What a stage runs in: pytest writes its results, and make's processes are not shared out anew.

    Of make's own flags only variables of its command line are passed on: stages run side by side here. What
    Python has compiled is kept: hundreds of processes import the same modules.
    """
    passed = {name: value for name, value in own.items() if name not in NOT_PASSED}
    variables = passed.pop("MAKEFLAGS", "").partition("-- ")[2]
    if variables:
        passed["MAKEFLAGS"] = f"-- {variables}"
    options = f"{own.get('PYTEST_ADDOPTS', '')} --junit-xml={results.absolute()}"
    return {**passed, "PYTEST_ADDOPTS": options.strip()}


def counted(results: str) -> tuple[Counter[str], Counter[str], dict[str, float]]:
    """(tests by how they ended, skipped ones by the reason, seconds of each) of pytest's JUnit results."""
    counts: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    root = ET.fromstring(results)  # noqa: S314 - pytest itself wrote it
    for suite in root.iter("testsuite"):
        ends = {word: int(suite.get(name, 0)) for word, name in ENDS}
        counts.update(passed=int(suite.get("tests", 0)) - sum(ends.values()), **ends)
    for skipped in root.iter("skipped"):
        reasons[PLACE.sub("", skipped.get("message", "")).removeprefix("Skipped: ")] += 1
    lasted_s: defaultdict[str, float] = defaultdict(float)
    for case in root.iter("testcase"):
        name = f"{case.get('classname', '')}::{case.get('name', '')}"
        lasted_s[name] += float(case.get("time", 0.0))
    return counts, reasons, dict(lasted_s)


def outcome(counts: Counter[str], *, failed: bool) -> str:
    """How many tests ended how; of a stage without any, whether it succeeded."""
    told = [f"{counts[word]} {word}" for word in ("passed", "failed", "errors", "skipped")]
    told = [words for words in told if not words.startswith("0 ")]
    if failed and not counts["failed"] and not counts["errors"]:
        told.insert(0, "FAILED")
    return ", ".join(told) or "ok"


def stage_line(one: Ended) -> str:
    """The line of a stage that has ended."""
    log = f"  see {log_of(one.name)}" if one.status else ""
    return (
        f"{one.name:<12}{one.seconds:6.0f} s  {outcome(one.counts, failed=bool(one.status))}{log}"
    )


def total_line(ended: Sequence[Ended], seconds: float) -> str:
    """The line of all stages, with the reasons why tests were skipped."""
    counts: Counter[str] = sum((one.counts for one in ended), Counter())
    reasons: Counter[str] = sum((one.reasons for one in ended), Counter())
    why = "; ".join(f"{count}: {reason}" for reason, count in reasons.most_common())
    failed = any(one.status for one in ended)
    told = outcome(counts, failed=failed) + (f" ({why})" if why else "")
    return f"{'all':<12}{seconds:6.0f} s  {told}"


def longest(ended: Sequence[Ended]) -> str:
    """The longest tests of all stages, a line each."""
    rows = [(seconds, one.name, name) for one in ended for name, seconds in one.lasted_s.items()]
    rows = sorted(rows, reverse=True)[:LISTED]
    return "".join(f"{seconds:7.1f} s  {stage:<12}{name}\n" for seconds, stage, name in rows)


def failures(log: str) -> str:
    """The end of a log, from where it begins to tell what failed."""
    lines = log.splitlines()
    first = next((n for n, line in enumerate(lines) if FAILURES.match(line)), 0)
    return "\n".join(lines[first:][-SHOWN_LINES:])


def tell(one: Ended) -> None:
    """Say how a stage ended, and what failed in it, at once: others end meanwhile."""
    told = [stage_line(one)]
    if one.status:
        told.append(failures(log_of(one.name).read_text(errors="replace")))
    say("\n".join(told))


def log_of(name: str) -> Path:
    """Where a stage's output goes."""
    return LOGS / f"{name}.log"


def say(text: str) -> None:
    """Print at once: others wait for the line."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
