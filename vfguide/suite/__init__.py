"""A hundred fixed scenarios of formation flight, by which laws are judged: `vfguide bench suite`.

Each is a mission file; SHA256SUMS tells that nobody has changed one. docs/suite.md says how they were drawn.
"""

import hashlib
from importlib.resources import files

from vfguide.errors import InputError
from vfguide.mission import Mission, parse_mission

COUNT = 100
SUMS = "SHA256SUMS"

EVERY = 10
"""Of how many scenarios a quick run flies one."""

LAW = b"controller: {type: slot}\n"
"""The line of every scenario that names the law."""


def digest() -> str:
    """Return the sum of all sums: results with the same one are of the same scenarios."""
    return hashlib.sha256((files(__name__) / SUMS).read_bytes()).hexdigest()


def names(*, quick: bool = False) -> list[str]:
    """File names of the scenarios, every tenth where it has to be quick."""
    return [f"{number:03}.yaml" for number in range(1, COUNT + 1, EVERY if quick else 1)]


def with_law(name: str, law: str) -> Mission:
    """Read a scenario, its followers flown by this law.

    Args:
        name: of its file.
        law: name of a law.

    Raises:
        InputError: its file is not as it was drawn, or there is no such law.
    """
    content = (files(__name__) / name).read_bytes()
    sums = (files(__name__) / SUMS).read_text(encoding="ascii").splitlines()
    if f"{hashlib.sha256(content).hexdigest()}  {name}" not in sums:
        raise InputError(
            f"{files(__name__) / name}: is not the scenario as it was drawn, and its results could not be"
            " compared; install vfguide anew"
        )
    named = LAW.replace(b"slot", law.encode())
    return parse_mission(content.replace(LAW, named), file=name).mission
