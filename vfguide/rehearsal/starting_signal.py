"""The start of a flight whose programs share nothing but a file: a judge writes it, emulators wait for it.

The file holds one number: Unix time of simulation time 0, s. One that is left from an earlier flight lies in
the past, and nobody who waits now takes it for his own.
"""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from vfguide.errors import InputError, VfguideError

LOOK_S = 0.05
"""Real time between looks at the file."""


def give_start(file: Path, *, epoch_s: float) -> None:
    """Write the signal, so that nobody ever reads half of it.

    Raises:
        InputError: the file cannot be written.
    """
    partial = file.with_name(file.name + ".partial")
    try:
        partial.write_text(f"{epoch_s!r}\n", encoding="ascii")
        partial.replace(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror})") from error


def await_start(
    file: Path,
    *,
    patience_s: float,
    clock: Callable[[], float] = time.time,
    sleep: Callable[[float], None] = time.sleep,
) -> float:
    """Unix time of simulation time 0, s, as soon as a signal is given for a time that is still to come.

    Args:
        file: where the signal appears.
        patience_s: how long to wait for it, s.
        clock: Unix time, s.
        sleep: lets time pass.

    Raises:
        VfguideError: none has come for this long.
    """
    began_s = clock()
    while clock() - began_s < patience_s:
        with suppress(OSError, ValueError):
            epoch_s = float(file.read_text(encoding="ascii"))
            if began_s < epoch_s < math.inf:
                return epoch_s
        sleep(LOOK_S)
    raise VfguideError(
        f"no flight has begun within {patience_s:g} s: {file} holds no start to come"
    )
