"""What calls cost: the methods of a class, timed while something runs."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def calls_timed(owner: type, name: str) -> Iterator[list[float]]:
    """Durations of every call of a method, s, as they happen."""
    method: Callable[..., object] = getattr(owner, name)
    durations: list[float] = []

    def timed(*arguments: object, **options: object) -> object:
        began = time.perf_counter()
        try:
            return method(*arguments, **options)
        finally:
            durations.append(time.perf_counter() - began)

    setattr(owner, name, timed)
    try:
        yield durations
    finally:
        setattr(owner, name, method)
