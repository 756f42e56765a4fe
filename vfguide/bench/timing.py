"""What calls cost: the methods of a class, timed while something runs, by the processor time they take."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def calls_timed(owner: type, name: str) -> Iterator[list[float]]:
    """Processor time of every call of a method, s, as they happen; waiting for others does not count."""
    method: Callable[..., object] = getattr(owner, name)
    durations: list[float] = []

    def timed(*arguments: object, **options: object) -> object:
        began = time.thread_time()
        try:
            return method(*arguments, **options)
        finally:
            durations.append(time.thread_time() - began)

    setattr(owner, name, timed)
    try:
        yield durations
    finally:
        setattr(owner, name, method)
