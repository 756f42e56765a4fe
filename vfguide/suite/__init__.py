"""A hundred fixed scenarios of formation flight for comparing laws: `vfguide bench suite`.

Each is a mission file; SHA256SUMS detects changed files. docs/suite.md describes how they were drawn.
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
"""A quick run flies one in so many scenarios."""

DRAWS = 1_000_000
"""Number of further draws for each seed."""


def digest() -> str:
    """Return the hash of SHA256SUMS: equal hashes mean results of the same scenarios."""
    return hashlib.sha256((files(__name__) / SUMS).read_bytes()).hexdigest()


def numbers(*, quick: bool = False) -> range:
    """Return the numbers of the fixed scenarios; every tenth for a quick run."""
    return range(1, COUNT + 1, EVERY if quick else 1)


def further(count: int, seed: int) -> range:
    """Return the numbers of further draws: a million for each seed, none of them fixed."""
    return range(seed * DRAWS + 1, seed * DRAWS + count + 1)


def with_law(number: int, law: str) -> Mission:
    """Return a scenario flown by a law; fixed scenarios are read, others drawn.

    Raises:
        InputError: the scenario's file was changed, or there is no such law.
    """
    name = f"{number:03}.yaml"
    content = kept(name) if number <= COUNT else drawn(number).encode()
    return parse_mission(content, file=name, overrides=Overrides(controller=law)).mission


def kept(name: str) -> bytes:
    """Read a fixed scenario's file.

    Raises:
        InputError: the file was changed.
    """
    content = (files(__name__) / name).read_bytes()
    sums = (files(__name__) / SUMS).read_text(encoding="ascii").splitlines()
    if f"{hashlib.sha256(content).hexdigest()}  {name}" not in sums:
        raise InputError(
            f"{files(__name__) / name}: is not the scenario as it was drawn, and its results could not be"
            " compared; install vfguide anew"
        )
    return content
