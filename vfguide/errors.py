"""The exceptions that vfguide raises on purpose, and the check for optional libraries."""

import re
import traceback
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec
from pathlib import Path
from typing import Any


class VfguideError(Exception):
    """Something vfguide can explain in one line; the root of all its exceptions."""


class InputError(VfguideError):
    """The input is wrong, and only its author can put it right: exit status 2."""


class MissingLibraryError(VfguideError, ImportError):
    """A library is not installed; the text says which extra brings it."""


def described_error(error: BaseException) -> str:
    """An exception in one line: its kind, what it says, and where it came from."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" in {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}{place}" + (f": {text}" if text else "")


PACKAGE = "vfguide"

IMPORTED_AS = {"pillow": "PIL", "eclipse-zenoh": "zenoh", "foxglove-sdk": "foxglove"}
"""Packages whose module has another name."""

DEVELOPMENT = "dev"
"""The extra of those who change vfguide itself: its tools are nothing that a user misses."""

PLOTTING = ("matplotlib", "PIL", "jinja2")
"""What a report is drawn by."""

CONSOLE = ("starlette", "uvicorn")
"""What a console is served by."""

POSIX = "termios"
"""The module by which a system that companions can run on is known."""

LEARNING = ("gymnasium", "pettingzoo", "greenlet")
"""What environments are made of."""

REQUIREMENT = re.compile(r"([A-Za-z0-9_.-]+).*;.*extra\s*==\s*['\"]([a-z]+)['\"]")


@cache
def extras_by_module() -> dict[str, str]:
    """The extra that brings each optional module, as the package's own metadata say."""
    try:
        requirements = requires(PACKAGE) or []
    except PackageNotFoundError:
        requirements = []
    found = [match.groups() for one in requirements if (match := REQUIREMENT.match(one))]
    return {
        IMPORTED_AS.get(package.lower(), package): extra
        for package, extra in found
        if extra != DEVELOPMENT
    }


def missing_library(error: BaseException) -> str | None:
    """What to install where an import failed, in one line; None where no extra would help."""
    if not isinstance(error, ImportError) or not error.name:
        return None
    module = error.name.partition(".")[0]
    if module == POSIX:
        return (
            f"this needs {POSIX}, which only Linux and macOS have: run it there, or in a container"
        )
    extra = extras_by_module().get(module)
    if extra is None:
        return None
    return f"this needs {module}, which is not installed: pip install '{PACKAGE}[{extra}]'"


def require(*modules: str) -> None:
    """Make sure, before a long work begins, that what it ends with is there.

    Raises:
        MissingLibraryError: a module is not installed; the text says which extra brings it.
    """
    for module in modules:
        if find_spec(module) is None:
            error = ImportError(name=module)
            text = missing_library(error) or f"{module} is not installed"
            raise MissingLibraryError(text, name=module)


def import_extra(module: str) -> Any:  # noqa: ANN401 - such libraries have no types of their own
    """An optional module.

    Raises:
        MissingLibraryError: it is not installed; the text says which extra brings it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingLibraryError(missing_library(error) or str(error), name=module) from error
