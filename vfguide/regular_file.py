"""Safe access to files that others may have replaced: opening never blocks."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, TextIO

GREATEST_TEXT = 256 * 1024**2
"""Maximum characters of a companion's log that are read; ten hours at 20 Hz are 60 to 120 MB."""

LONGEST_LINE = 2000
"""Maximum characters of a line; a companion's step takes a twentieth of it."""


class PipeOrDeviceError(OSError):
    """The path leads to no regular file."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading bytes.

    A pipe without a writer would block its reader forever, and some devices never end.

    Raises:
        PipeOrDeviceError: the path leads to a pipe, a socket or a device.
        OSError: the file cannot be opened.
    """
    stream = open(path, "rb", opener=open_at_once)  # noqa: SIM115
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        stream.close()
        raise PipeOrDeviceError(None, "this is a pipe or a device", str(path))
    return stream


def open_at_once(path: str, flags: int) -> int:
    """Return a file descriptor without waiting."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def whole_lines(file: TextIO) -> Iterator[str]:
    """Yield complete lines, up to the maximum size of a companion's log."""
    left = GREATEST_TEXT
    while (line := file.readline(LONGEST_LINE)).endswith("\n") and left > 0:
        left -= len(line)
        yield line


def replace_file(path: Path, content: bytes, *, mode: int = 0o666) -> None:
    """Replace a file atomically, and sync it to the disk.

    Raises:
        OSError: the file cannot be written.
    """
    partial = path.with_name(f".{path.name}.partial")
    # A partial file may be left from a crash, or be a pipe that would block.
    partial.unlink(missing_ok=True)
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    partial.replace(path)


def read_by_others(found: os.stat_result) -> bool:
    """Check whether a file's permissions let others access it; False on Windows, with its access lists."""
    return hasattr(os, "geteuid") and bool(found.st_mode & (stat.S_IRWXG | stat.S_IRWXO))
