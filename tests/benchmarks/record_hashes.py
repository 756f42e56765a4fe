"""A hash for every shipped mission flown by every law in lockstep: what is moved must leave them as they are.

Run with `python -m tests.benchmarks.record_hashes [SECONDS] [LAW ...]`, before and after; minutes.
"""

import hashlib
import sys
from pathlib import Path

import numpy as np

from tests.kit.missions import MISSIONS
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.mission import load_mission
from vfguide.mission.load import with_overrides
from vfguide.mission.overrides import Overrides

LAWS = ("slot", "article", "pid", "mpc")
DURATION_S = 30.0

OF_THE_COMPUTER = {"wall_s", "latency"}
"""Fields of a record that differ from one flight to the next."""


def add(content: object, digest: "hashlib._Hash") -> None:
    """Add a value and all that is in it to a digest, arrays by their bytes."""
    names = getattr(content, "__struct_fields__", getattr(content, "__dataclass_fields__", None))
    if names is not None:
        for name in names:
            # What a flight has nothing of is no difference to a record that knows nothing of it.
            if name not in OF_THE_COMPUTER and getattr(content, name) is not None:
                digest.update(name.encode())
                add(getattr(content, name), digest)
    elif isinstance(content, np.ndarray):
        digest.update(content.tobytes())
    elif isinstance(content, list | tuple):
        for one in content:
            add(one, digest)
    else:
        digest.update(repr(content).encode())


def record_hash(file: Path, law: str, duration_s: float) -> str:
    """Sixteen digits of the hash of a mission's record."""
    overrides = Overrides(controller=law, duration_s=duration_s)
    mission = with_overrides(load_mission(file), overrides)
    digest = hashlib.sha256()
    add(fly_lockstep(mission).record, digest)
    return digest.hexdigest()[:16]


def main() -> None:
    """Fly and print, a line for each mission."""
    arguments = sys.argv[1:]
    duration_s = float(arguments.pop(0)) if arguments else DURATION_S
    laws = arguments or LAWS
    sys.stdout.write(f"{f'{duration_s:g} s':20}" + "".join(f"{law:18}" for law in laws) + "\n")
    for file in sorted(MISSIONS.glob("*.yaml")):
        sys.stdout.write(f"{file.stem:20}")
        for law in laws:
            sys.stdout.write(f"{record_hash(file, law, duration_s):18}")
            sys.stdout.flush()
        sys.stdout.write("\n")


if __name__ == "__main__":
    main()
