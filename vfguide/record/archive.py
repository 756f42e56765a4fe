"""Archives of named arrays with a JSON description: NumPy `.npz` files without pickles.

Readers trust no content: every fault of a file becomes an `InputError` with a one-line message.
"""

import json
import os
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, BinaryIO

import msgspec
import numpy as np
from numpy.typing import NDArray

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.errors import InputError
from vfguide.regular_file import open_regular

AnyArray = NDArray[np.generic]
IntegerArray = NDArray[np.integer[Any]]

GREATEST = 1e15
"""Bound of every number of a flight, in any unit; its square can still be summed."""

Figure = Annotated[float, msgspec.Meta(ge=-GREATEST, le=GREATEST)]
"""Bounded number of a flight."""

DTYPES: dict[object, tuple[type[np.generic], type[np.generic]]] = {
    FloatArray: (np.floating, np.float64),
    IntegerArray: (np.integer, np.int64),
    BoolArray: (np.bool_, np.bool_),
}
"""Accepted and resulting data type of an array, by the type of its field."""

DESCRIPTION = "description"
"""Name of the array that holds the JSON text."""

GREATEST_SIZE = 1024**3
"""Maximum bytes of all arrays: four vehicles for a whole day at 20 Hz. Compressed zeros take a thousandth."""

REMEDY = "give the directory of another flight, or fly it again"
"""Remedy for an unreadable record."""

WRITE_REMEDY = "make room there, or give another directory with --out"
"""Remedy for a directory that takes no record."""

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
"""Exceptions of NumPy, zipfile and zlib on bytes that are no archive, or a damaged one."""


@contextmanager
def writing_to(path: Path) -> Iterator[None]:
    """Convert write errors to a one-line message.

    Raises:
        InputError: the place cannot be written to.
    """
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written: {error.strerror or error}; {WRITE_REMEDY}"
        ) from error


def write_archive(
    path: Path, description: Mapping[str, object], arrays: Mapping[str, AnyArray]
) -> None:
    """Write an archive atomically: an interrupted write leaves the previous file.

    Raises:
        InputError: the place cannot be written to.
    """
    partial = path.with_name(path.name + ".partial")
    text = json.dumps(description, ensure_ascii=True, allow_nan=False)
    contents: dict[str, Any] = {DESCRIPTION: np.array(text), **arrays}
    with writing_to(path):
        try:
            with partial.open("wb") as stream:
                np.savez_compressed(stream, **contents)
                stream.flush()
                os.fsync(stream.fileno())
            partial.replace(path)
        except OSError:
            partial.unlink(missing_ok=True)
            raise


def read_archive(path: Path) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    """Return the description and the arrays of an archive.

    Raises:
        InputError: the file is missing, unreadable, damaged or no archive.
    """
    try:
        # Given a path, NumPy leaves the file open if the content is no archive.
        with open_regular(path) as stream:
            if (size := unpacked_size(stream)) > GREATEST_SIZE:
                raise InputError(
                    f"{path}: is no flight record: unpacked it would be {size / 1e6:.0f} MB, "
                    f"more than {GREATEST_SIZE / 1e6:.0f} MB; {REMEDY}"
                )
            # NumPy warns when it guesses the meaning of a Python 2 header; no valid record has one.
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
    """Return the total size of an archive's members by its directory; the file size if it is no archive.

    Reading a member stops at the size in the directory, so a wrong size only yields a damaged record.
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


def described(
    value: Any,  # noqa: ANN401 - any dataclass
    arrays: dict[str, AnyArray],
    prefix: str = "",
    without: Collection[str] = (),
) -> dict[str, Any]:
    """Return the fields of a dataclass for JSON; arrays go into `arrays` under `prefix` + name."""
    plain: dict[str, Any] = {}
    for name in (field.name for field in fields(value) if field.name not in without):
        content = getattr(value, name)
        if isinstance(content, np.ndarray):
            arrays[prefix + name] = content
        else:
            plain[name] = msgspec.to_builtins(content)
    return plain


def joined(
    kind: type, plain: Mapping[str, Any], arrays: Mapping[str, AnyArray], prefix: str = ""
) -> dict[str, Any]:
    """Return the field contents of a dataclass that `described` has split."""
    names = [field.name for field in fields(kind)]
    return {**plain, **{n: arrays[prefix + n] for n in names if prefix + n in arrays}}


def sound_array(kind: type, value: Any) -> AnyArray:  # noqa: ANN401
    """Return a valid array of a flight, converted to the data type of its field.

    Raises:
        ValueError: the value is no such array, or exceeds the bound.
    """
    wanted, read_as = DTYPES[kind]
    if not isinstance(value, np.ndarray) or not np.issubdtype(value.dtype, wanted):
        raise ValueError("this is no array of its kind")
    if wanted is np.floating and np.any(np.abs(value) > GREATEST):
        raise ValueError("it holds a number that nothing in a flight can be")
    array: AnyArray = value.astype(read_as)
    return array
