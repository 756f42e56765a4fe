"""One file of named arrays with a JSON description: a NumPy `.npz` archive without pickles.

Reading trusts nothing. Whatever is wrong with a file becomes one `InputError` with one line.
"""

import json
import os
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from vfguide.errors import InputError
from vfguide.regular_file import open_regular

AnyArray = NDArray[np.generic]

DESCRIPTION = "description"
"""Name of the array that holds the JSON text."""

GREATEST_SIZE = 1024**3
"""Bytes of all arrays: four vehicles for a whole day at 20 Hz. Packed, zeros take a thousandth of it."""

REMEDY = "give the directory of another flight, or fly it again"
"""What to do about a record that cannot be read."""

WRITE_REMEDY = "make room there, or give another directory with --out"
"""What to do where there is no room for a record."""

UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    tokenize.TokenError,
    EOFError,
    MemoryError,
    NotImplementedError,
    RuntimeError,
    UserWarning,
    SyntaxError,
    TypeError,
    ValueError,
    LookupError,
)
"""What NumPy, zipfile and zlib raise on bytes that are no archive, or a damaged one."""


def write_archive(
    path: Path, description: Mapping[str, object], arrays: Mapping[str, AnyArray]
) -> None:
    """Write an archive whole or not at all: an interrupted write leaves the file that was there.

    Raises:
        InputError: the place cannot be written to.
    """
    partial = path.with_name(path.name + ".partial")
    text = json.dumps(description, ensure_ascii=True, allow_nan=False)
    contents: dict[str, Any] = {DESCRIPTION: np.array(text), **arrays}
    try:
        with partial.open("wb") as stream:
            np.savez_compressed(stream, **contents)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise InputError(
            f"{path}: cannot be written: {error.strerror or error}; {WRITE_REMEDY}"
        ) from error


def read_archive(path: Path) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    """The description and the arrays of an archive.

    Raises:
        InputError: the file is missing, unreadable, damaged or something else.
    """
    try:
        # Given a path, NumPy leaves the file open when what it holds is no archive.
        with open_regular(path) as stream:
            if (size := unpacked_size(stream)) > GREATEST_SIZE:
                raise InputError(
                    f"{path}: is no flight record: unpacked it would be {size / 1e6:.0f} MB, "
                    f"more than {GREATEST_SIZE / 1e6:.0f} MB; {REMEDY}"
                )
            # NumPy warns where it guesses what a header means that Python 2 wrote: no record of ours has one.
            with warnings.catch_warnings(action="error", category=UserWarning):
                stored = np.load(stream, allow_pickle=False)
                if not isinstance(stored, np.lib.npyio.NpzFile):
                    raise InputError(
                        f"{path}: is no flight record, but a single NumPy array; {REMEDY}"
                    )
                arrays: dict[str, AnyArray] = {name: stored[name] for name in stored.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}; {REMEDY}") from error
    except UNREADABLE as error:
        raise InputError(f"{path}: is no flight record, or a damaged one; {REMEDY}") from error
    try:
        description = json.loads(str(arrays.pop(DESCRIPTION)))
    except (LookupError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no flight record: it has no description; {REMEDY}") from error
    if not isinstance(description, dict):
        raise InputError(
            f"{path}: is no flight record: its description is no JSON object; {REMEDY}"
        )
    return description, arrays


def unpacked_size(stream: BinaryIO) -> int:
    """Bytes that the arrays of an archive would take, by its directory; 0 where it has none.

    Reading a member stops at the size that the directory tells: what lies about it is a damaged record.
    """
    if not zipfile.is_zipfile(stream):
        size = stream.seek(0, os.SEEK_END)
        stream.seek(0)
        return size
    stream.seek(0)
    with zipfile.ZipFile(stream) as archive:
        size = sum(member.file_size for member in archive.infolist())
    stream.seek(0)
    return size
