"""Runs over all processors, or over other machines, with the same call."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, TypeVar

from vfguide.errors import VfguideError
from vfguide.extras import import_extra

Task = TypeVar("Task")
Result = TypeVar("Result")

THREADS = "OPENBLAS_NUM_THREADS"
"""One thread for each worker: with several, the numerical libraries of all would share the processors."""

CONNECT_S = 10
"""Patience with a scheduler."""


@contextmanager
def executor_on(scheduler: str | None = None, processes: int | None = None) -> Iterator[Executor]:
    """Processes of this computer, or a Dask cluster: both take tasks by `concurrent.futures`' interface.

    Args:
        scheduler: address of a Dask scheduler, such as tcp://host:8786; None for this computer.
        processes: of this computer; as many as it has processors if absent.

    Raises:
        VfguideError: a scheduler is named and Dask is not installed, or nothing answers there.
    """
    if scheduler is not None:
        with dask_executor(scheduler) as cluster:
            yield cluster
        return
    os.environ.setdefault(THREADS, "1")
    # Not forked: from a program with threads a worker may inherit a lock that nobody ever releases.
    with ProcessPoolExecutor(processes or os.cpu_count(), get_context("spawn")) as pool:
        yield pool


@contextmanager
def dask_executor(scheduler: str) -> Iterator[Executor]:
    """The workers of a Dask cluster; vfguide has to be installed there too."""
    # By its name, because the package has no types.
    connect: Callable[..., Any] = import_extra("distributed").Client
    try:
        client = connect(scheduler, timeout=CONNECT_S)
    except OSError as error:
        raise VfguideError(f"{scheduler}: no Dask scheduler answers ({error})") from error
    with client, client.get_executor() as cluster:
        yield cluster


def flown_by(
    executor: Executor, fly: Callable[[Task], Result], tasks: Iterable[Task]
) -> Iterator[Result]:
    """Results in the order of the tasks, as soon as each is there."""
    yield from executor.map(fly, tasks)
