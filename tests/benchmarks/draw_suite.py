"""Write the fixed scenarios of `vfguide bench suite`, and the sums of all.

python -m tests.benchmarks.draw_suite DIRECTORY
"""

import hashlib
import sys
from pathlib import Path

from vfguide.suite import COUNT, SUMS
from vfguide.suite.draw import drawn


def write(directory: Path) -> None:
    """Write every scenario, and the sums of all."""
    sums = []
    for number in range(1, COUNT + 1):
        text = drawn(number)
        name = f"{number:03}.yaml"
        (directory / name).write_text(text, encoding="utf-8")
        sums.append(f"{hashlib.sha256(text.encode()).hexdigest()}  {name}\n")
    (directory / SUMS).write_text("".join(sums), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
