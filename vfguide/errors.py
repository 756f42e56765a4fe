"""The exceptions that vfguide raises on purpose."""

import traceback
from pathlib import Path


class VfguideError(Exception):
    """Something vfguide can explain in one line; the root of all its exceptions."""


class InputError(VfguideError):
    """The input is wrong, and only its author can put it right: exit status 2."""


def described_error(error: BaseException) -> str:
    """An exception in one line: its kind, what it says, and where it came from."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" in {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}{place}" + (f": {text}" if text else "")
