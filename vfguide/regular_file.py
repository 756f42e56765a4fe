"""Files that somebody else may have put in place of one's own: opened without waiting for anybody."""

import os
import stat
from pathlib import Path
from typing import BinaryIO


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
    return os.open(path, flags | os.O_NONBLOCK)
