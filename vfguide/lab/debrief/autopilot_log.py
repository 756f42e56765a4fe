"""What an autopilot's own log tells of a flight, whichever autopilot wrote it."""

import errno
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.debrief.telemetry import Telemetry
from vfguide.regular_file import open_regular

GREATEST_SIZE = 1024**3
"""Bytes: an hour of PX4 at its usual rates is 500 MB."""

DAMAGE = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
)
"""What the readers of foreign formats raise on bytes that are none of theirs, or damaged."""

REMEDY = "give the log of one flight, as the autopilot wrote it"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AutopilotLog:
    """One log, read."""

    path: Path
    """Where it is."""
    autopilot: str
    """Who wrote it, such as ArduPlane."""
    system_id: int
    """MAVLink system of the vehicle."""
    telemetry: Telemetry
    """What the autopilot knew of itself; its clock begins when it was started."""
    setpoints: FloatArray
    """Rows of time in s, course over ground in rad and airspeed in m/s that it was asked for."""


@contextmanager
def foreign_file(path: Path, kind: str, damage: type[Exception]) -> Iterator[None]:
    """Whatever is wrong with a file becomes one line; what its reader prints is thrown away.

    Args:
        path: of the file.
        kind: what it should be.
        damage: what its reader raises of its own.

    Raises:
        InputError: it cannot be read, is too large, or something else.
    """
    try:
        refuse_large(path)
        with (
            Path(os.devnull).open("w", encoding="utf-8") as nowhere,
            redirect_stderr(nowhere),
            redirect_stdout(nowhere),
        ):
            yield
    except InputError:
        raise
    except OSError as error:
        # What a damaged log says of its own length is no place in the file.
        if error.errno == errno.EINVAL:
            raise InputError(f"{path}: is no {kind}, or a damaged one; {REMEDY}") from error
        raise InputError(f"{path}: cannot be read: {error.strerror or error}; {REMEDY}") from error
    except (*DAMAGE, damage) as error:
        raise InputError(f"{path}: is no {kind}, or a damaged one; {REMEDY}") from error


def refuse_large(path: Path) -> None:
    """See that a file is no larger than a log can be.

    Raises:
        InputError: it is.
        OSError: it cannot be opened.
    """
    with open_regular(path) as file:
        size = file.seek(0, os.SEEK_END)
    if size > GREATEST_SIZE:
        raise InputError(
            f"{path}: has {size / 1e6:.0f} MB, more than the {GREATEST_SIZE / 1e6:.0f} MB "
            f"that are read; {REMEDY}"
        )


def at_times(moments: FloatArray, rows: FloatArray) -> FloatArray:
    """Second column of some rows at other times, by interpolation; NaN without rows, or outside them."""
    if len(rows) < 2:
        return np.full(moments.shape, np.nan)
    values: FloatArray = np.interp(moments, rows[:, 0], rows[:, 1], left=np.nan, right=np.nan)
    return values


def newest(moments: FloatArray, rows: FloatArray) -> FloatArray:
    """Second column of the newest row before each moment; NaN before the first."""
    if not len(rows):
        return np.full(moments.shape, np.nan)
    found = np.searchsorted(rows[:, 0], moments, side="right") - 1
    values: FloatArray = np.where(found >= 0, rows[np.maximum(found, 0), 1], np.nan)
    return values


def unwrapped(rows: FloatArray) -> FloatArray:
    """Rows of time and an angle, without jumps."""
    whole = rows.copy()
    whole[:, 1] = np.unwrap(rows[:, 1])
    return whole


def in_order(rows: FloatArray) -> FloatArray:
    """Rows whose numbers are known, in the order of their times."""
    known = rows[np.all(np.isfinite(rows), axis=1)]
    return known[np.argsort(known[:, 0], kind="stable")]
