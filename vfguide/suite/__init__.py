"""A hundred fixed scenarios of formation flight, by which laws are judged: `vfguide bench suite`.

Each is a mission file; SHA256SUMS tells that nobody has changed one. docs/suite.md says how they were drawn.
"""

import hashlib
from importlib.resources import files

from vfguide.errors import InputError
from vfguide.mission import Mission, parse_mission
from vfguide.mission.overrides import Overrides
from vfguide.suite.draw import drawn

COUNT = 100
SUMS = "SHA256SUMS"

EVERY = 10
"""Of how many scenarios a quick run flies one."""

DRAWS = 1_000_000
"""Further draws of each seed."""


def digest() -> str:
    """Return the sum of all sums: results with the same one are of the same scenarios."""
    return hashlib.sha256((files(__name__) / SUMS).read_bytes()).hexdigest()


def numbers(*, quick: bool = False) -> range:
    """Numbers of the fixed scenarios, every tenth where it has to be quick."""
    return range(1, COUNT + 1, EVERY if quick else 1)


def further(count: int, seed: int) -> range:
    """Numbers of further draws: a million to each seed, none of them fixed."""
    return range(seed * DRAWS + 1, seed * DRAWS + count + 1)


def with_law(number: int, law: str) -> Mission:
    """Return a scenario, its followers flown by this law: a fixed one is read, any other one drawn.

    Raises:
        InputError: its file is not as it was drawn, or there is no such law.
    """
    name = f"{number:03}.yaml"
    content = kept(name) if number <= COUNT else drawn(number).encode()
    return parse_mission(content, file=name, overrides=Overrides(controller=law)).mission


def kept(name: str) -> bytes:
    """Read a fixed scenario's file.

    Raises:
        InputError: it is not as it was drawn.
    """
    content = (files(__name__) / name).read_bytes()
    sums = (files(__name__) / SUMS).read_text(encoding="ascii").splitlines()
    if f"{hashlib.sha256(content).hexdigest()}  {name}" not in sums:
        raise InputError(
            f"{files(__name__) / name}: is not the scenario as it was drawn, and its results could not be"
            " compared; install vfguide anew"
        )
    return content
