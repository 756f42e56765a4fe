"""Output directory of a flight: replaced as a whole, and only if it holds nothing else.

All files are written into a hidden directory inside and moved into place at the end. Moving replaces a name
and never writes through a symbolic link.
"""

import errno
import json
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError, VfguideError
from vfguide.record.archive import WRITE_REMEDY, writing_to
from vfguide.regular_file import open_regular

RECORD_NAME = "flight.npz"
SUMMARY_NAME = "summary.json"
PAGE_NAME = "report.html"
RECORDINGS = "recordings"
"""Directory of the companions' own recordings of a live flight."""

PLOT_NAMES = ("tracks", "errors", "setpoints", "heights", "separation", "wind")

REPORT_NAMES = (SUMMARY_NAME, PAGE_NAME, *(f"{name}.png" for name in PLOT_NAMES))

SHARED_NAMES = (*REPORT_NAMES, RECORD_NAME, RECORDINGS, "mission.yaml", "broker.log")
VEHICLE_ENDINGS = (".tlog", ".guidance.csv", ".companion.log", ".emulator.log")

PARTIAL = ".partial-"
"""Prefix of the hidden directory. One that a flight has left is never removed: it may hold recordings."""

LONGEST_SUMMARY = 4 * 1024**2
"""Greatest size of a summary, bytes."""


@contextmanager
def kept_in(out: Path, *, mission: str, vehicles: Collection[str], force: bool) -> Iterator[Path]:
    """Yield a directory to write a flight into; its contents are moved into `out` at the end.

    `out` is made if need be. `force` allows files of another flight, or of something else, to be replaced.

    Raises:
        InputError: nothing can be written there, or it holds what must not be replaced.
        VfguideError: the disk is full.
    """
    refuse_foreign(out, mission, own_names(vehicles), force=force)
    try:
        out.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=PARTIAL, dir=out))
    except OSError as error:
        reason = "it is a file" if isinstance(error, FileExistsError) else error.strerror
        raise InputError(
            f"{out}: cannot be written to ({reason}); give another directory with --out"
        ) from error
    partial.chmod(0o755)
    errors = Terminal(stderr=True)
    for left in sorted({path.parent for path in out.glob(f"{PARTIAL}*/*")}):
        errors.tell(f"{left}: left by a flight that did not end; remove it once nobody needs it")
    try:
        yield partial
        move_into(out, partial)
    except BaseException as error:
        # Keep the recordings of a stopped flight and the logs of a broken one.
        if any(partial.glob("*")):
            errors.tell(f"{partial}: holds what was written so far")
        elif partial.is_dir():
            partial.rmdir()
        if isinstance(error, OSError) and error.errno in {errno.ENOSPC, errno.EDQUOT}:
            raise VfguideError(f"{out}: {error.strerror}; {WRITE_REMEDY}") from error
        raise


def refuse_foreign(out: Path, mission: str, written: Collection[str], *, force: bool) -> None:
    """Check that no foreign file is replaced, unless `force` allows it.

    Raises:
        InputError: a file would be replaced that must not be; the message is one line.
    """
    if out.is_symlink():
        raise InputError(
            f"{out}: is a symbolic link; give the directory that it leads to, or another with --out"
        )
    found = flown_before(out)
    if found is not None and found[0] != mission and not force:
        raise InputError(
            f"{out}: holds a flight of the mission {found[0]!r}; "
            "give another directory with --out, or --force to replace it"
        )
    own = set() if found is None else own_names(found[1])
    for name in sorted(written):
        path = out / name
        if path.is_dir() and not path.is_symlink() and not (name == RECORDINGS and name in own):
            raise InputError(f"{path}: is a directory; give another directory with --out")
        if name not in own and not force and (path.exists() or path.is_symlink()):
            raise InputError(
                f"{path}: is there already, and no flight has written it; "
                "give another directory with --out, or --force to replace it"
            )


def refuse_file(path: Path, *, force: bool) -> None:
    """Check that a single file can be written without replacing another.

    Raises:
        InputError: it cannot; the message is one line.
    """
    if path.is_symlink() or path.is_dir():
        raise InputError(f"{path}: is a symbolic link or a directory; give another name")
    if path.exists() and not force:
        raise InputError(f"{path}: is there already; give another name, or --force to replace it")
    if not path.parent.is_dir():
        raise InputError(f"{path.parent}: no such directory; make it, or give another name")


def own_names(vehicles: Collection[str]) -> set[str]:
    """Return the names of all files that a flight of these vehicles may leave."""
    return {*SHARED_NAMES, *(name + end for name in vehicles for end in VEHICLE_ENDINGS)}


def flown_before(out: Path) -> tuple[str, list[str]] | None:
    """Return (mission, vehicles) of the flight that a directory holds; None where there is none."""
    path = out / SUMMARY_NAME
    try:
        if path.is_symlink():
            return None
        with open_regular(path) as file:
            summary = json.loads(file.read(LONGEST_SUMMARY))
        vehicles = [str(name) for name in summary["vehicles"]]
        # Nothing beside the directory is removed, whatever the file says.
        own = all(Path(name).name == name for name in vehicles)
        return (str(summary["mission"]), vehicles) if own else None
    except (OSError, ValueError, TypeError, LookupError, RecursionError):
        return None


def move_into(out: Path, partial: Path) -> None:
    """Replace the earlier flight in `out` by the files in `partial`.

    Raises:
        OSError: the file system refuses.
    """
    found = flown_before(out)
    if found is not None:
        for name in own_names(found[1]):
            remove(out / name)
    for path in partial.iterdir():
        path.replace(out / path.name)
    partial.rmdir()


def remove(path: Path) -> None:
    """Remove a file, a link or a directory of a flight, if it exists."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def written_beside(directory: Path) -> Iterator[Path]:
    """Yield a directory to write files into, which then replace files of the same names in `directory`.

    Raises:
        OSError: the file system refuses.
    """
    partial = Path(tempfile.mkdtemp(prefix=PARTIAL, dir=directory))
    try:
        yield partial
        for path in partial.iterdir():
            path.replace(directory / path.name)
    finally:
        remove(partial)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path to write a file at, which is then moved to `path`, or removed after an error.

    Raises:
        InputError: it cannot be written.
    """
    with writing_to(path), written_beside(path.parent) as partial:
        yield partial / path.name
