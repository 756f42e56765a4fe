"""Exceptions of vfguide, and checks for optional libraries."""

import re
import traceback
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec
from pathlib import Path
from typing import Any


class VfguideError(Exception):
    """Root of vfguide's exceptions, each with a one-line explanation."""


class InputError(VfguideError):
    """Invalid input that only its author can correct: exit status 2."""


class MissingLibraryError(VfguideError, ImportError):
    """A library is not installed; the text names the extra that installs it."""


def described_error(error: BaseException) -> str:
    """Return an exception in one line: type, origin and message."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" in {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}{place}" + (f": {text}" if text else "")


PACKAGE = "vfguide"

IMPORTED_AS = {"pillow": "PIL", "eclipse-zenoh": "zenoh", "foxglove-sdk": "foxglove"}
"""Module names that differ from their packages' names."""

DEVELOPMENT = "dev"
"""Extra for developers of vfguide; its tools are never missing for users."""

PLOTTING = ("matplotlib", "PIL", "jinja2")
"""Modules for plots and reports."""

CONSOLE = ("starlette", "uvicorn")
"""Modules for the console."""

POSIX = "termios"
"""Module that identifies a system on which companions can run."""

LEARNING = ("gymnasium", "pettingzoo", "greenlet")
"""Modules for environments."""

REQUIREMENT = re.compile(r"([A-Za-z0-9_.-]+).*;.*extra\s*==\s*['\"]([a-z]+)['\"]")


@cache
def extras_by_module() -> dict[str, str]:
    """Return the extra that installs each optional module, from the package's metadata."""
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
    """Return what to install after a failed import, in one line; None if no extra helps."""
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
    """Check before long work that the modules needed at its end are installed.

    Raises:
        MissingLibraryError: a module is not installed; the text names the extra that installs it.
    """
    for module in modules:
        if find_spec(module) is None:
            error = ImportError(name=module)
            text = missing_library(error) or f"{module} is not installed"
            raise MissingLibraryError(text, name=module)


def import_extra(module: str) -> Any:  # noqa: ANN401 - such libraries have no types of their own
    """Import an optional module.

    Raises:
        MissingLibraryError: it is not installed; the text names the extra that installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingLibraryError(missing_library(error) or str(error), name=module) from error
