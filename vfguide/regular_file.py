"""Files that somebody else may have put in place of one's own: opened without waiting for anybody."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, TextIO

GREATEST_TEXT = 256 * 1024**2
"""Characters of a companion's log; ten hours at 20 Hz are 60 to 120 MB. Nothing is read beyond."""

LONGEST_LINE = 2000
"""Characters; a step of a companion takes a twentieth of it."""


class PipeOrDeviceError(OSError):
    """What lies at a path is no regular file."""


def open_regular(path: Path) -> BinaryIO:
    """A regular file, to read bytes from.

    A pipe that nobody writes to would have its reader wait for ever, and some devices never end.

    Raises:
        PipeOrDeviceError: it is a pipe, a socket or a device.
        OSError: it cannot be opened.
    """
    stream = open(path, "rb", opener=open_at_once)  # noqa: SIM115
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        stream.close()
        raise PipeOrDeviceError(None, "this is a pipe or a device", str(path))
    return stream


def open_at_once(path: str, flags: int) -> int:
    """A descriptor of a file that is not waited for."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def whole_lines(file: TextIO) -> Iterator[str]:
    """Lines with their line feed, of as much as a companion could have written."""
    left = GREATEST_TEXT
    while (line := file.readline(LONGEST_LINE)).endswith("\n") and left > 0:
        left -= len(line)
        yield line


def replace_file(path: Path, content: bytes, *, mode: int = 0o666) -> None:
    """Put a file in the place of any before it, whole and on the disk whatever happens meanwhile.

    Raises:
        OSError: it cannot be written.
    """
    partial = path.with_name(f".{path.name}.partial")
    # What lies there may be of a crash, or a pipe that would block.
    partial.unlink(missing_ok=True)
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    partial.replace(path)


def read_by_others(found: os.stat_result) -> bool:
    """Whether a file's permissions let others read it; Windows keeps access lists instead."""
    return hasattr(os, "geteuid") and bool(found.st_mode & (stat.S_IRWXG | stat.S_IRWXO))
