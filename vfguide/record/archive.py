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
"""Nothing of a flight is as large, in whichever unit; its square can still be added up."""

Figure = Annotated[float, msgspec.Meta(ge=-GREATEST, le=GREATEST)]
"""A number of a flight."""

DTYPES: dict[object, tuple[type[np.generic], type[np.generic]]] = {
    FloatArray: (np.floating, np.float64),
    IntegerArray: (np.integer, np.int64),
    BoolArray: (np.bool_, np.bool_),
}
"""What an array in a file may be, and as what it is read, by the type of the field."""

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


@contextmanager
def writing_to(path: Path) -> Iterator[None]:
    """Say in one line that a place cannot be written to.

    Raises:
        InputError: it cannot.
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
    """Write an archive whole or not at all: an interrupted write leaves the file that was there.

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


def described(
    value: Any,  # noqa: ANN401 - any dataclass
    arrays: dict[str, AnyArray],
    prefix: str = "",
    without: Collection[str] = (),
) -> dict[str, Any]:
    """What of a dataclass is no array, ready for JSON; arrays go into `arrays`, by prefix and name."""
    plain: dict[str, Any] = {}
    for name in (field.name for field in fields(value) if field.name not in without):
        content = getattr(value, name)
        if isinstance(content, np.ndarray):
            arrays[prefix + name] = content
        else:
            plain[name] = msgspec.to_builtins(content)
    return plain


def joined(
    kind: type,
    plain: Mapping[str, Any],
    arrays: Mapping[str, AnyArray],
    prefix: str = "",
) -> dict[str, Any]:
    """The contents of a dataclass's fields, as `described` has parted them."""
    names = [field.name for field in fields(kind)]
    return {**plain, **{n: arrays[prefix + n] for n in names if prefix + n in arrays}}


def sound_array(kind: type, value: Any) -> AnyArray:  # noqa: ANN401
    """An array of numbers of a flight.

    Raises:
        ValueError: it is none.
    """
    wanted, read_as = DTYPES[kind]
    if not isinstance(value, np.ndarray) or not np.issubdtype(value.dtype, wanted):
        raise ValueError("this is no array of its kind")
    if wanted is np.floating and np.any(np.abs(value) > GREATEST):
        raise ValueError("it holds a number that nothing in a flight can be")
    array: AnyArray = value.astype(read_as)
    return array
