"""Sockets, signals and new tries, with abilities that Linux, macOS and Windows do not share."""

import asyncio
import os
import selectors
import signal
import socket
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from vfguide.errors import VfguideError

Result = TypeVar("Result")

SEND_BUFFER = 8 * 1024
"""Bytes in the kernel: by default minutes of messages would wait there for a peer that does not read."""

LONGEST_SILENCE = 5_000
"""ms without an acknowledgement until a connection counts as lost: a pulled cable says no goodbye."""

URGENT_TCP: tuple[tuple[int, int, int], ...] = (
    (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),
    (socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER),
    # Linux has it; elsewhere a pulled cable is found by the silence of what should be heard.
    *(
        (socket.IPPROTO_TCP, getattr(socket, name), LONGEST_SILENCE)
        for name in ("TCP_USER_TIMEOUT",)
        if hasattr(socket, name)
    ),
)
"""Options of a TCP socket for small, urgent messages."""

SocketSelector: type[selectors.SelectSelector] = getattr(
    selectors, "PollSelector", selectors.SelectSelector
)
"""Tells whether sockets are ready, without a descriptor of its own; Windows knows only `select`."""


def require_linux(what: str) -> None:
    """Refuse what only Linux can do, known by a kind of file that no other system has.

    Raises:
        VfguideError: this is another system.
    """
    if not hasattr(os, "memfd_create"):
        raise VfguideError(f"{what} needs Linux; on this computer run it in a container")


def run_watching_sockets(main: Coroutine[Any, Any, Result]) -> Result:
    """Run a coroutine as `asyncio.run` does, in the kind of loop that watches sockets on every system."""
    with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        return runner.run(main)


def on_signals(do: Callable[[], object]) -> None:
    """Have the running loop call `do` at Ctrl-C and at SIGTERM, instead of ending the program."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, do)
        except NotImplementedError:
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(do))


SHORTEST_DELAY = 0.2
"""s, before the first new try: most losses are a matter of a moment."""

LONGEST_DELAY = 1.0
"""s: a formation flies blind until all are back, and a hundred that call once a second are no load."""

GROWTH = 1.5
"""How many times longer each delay is than the one before."""

STEPS = 10
"""More than it takes from the shortest delay to the longest."""


def retry_delay(failures: int, share: float) -> float:
    """Seconds to wait after some failures in a row: growing, bounded, and never in step with others.

    Args:
        failures: in a row, from 1.
        share: random, in [0, 1): companions that lost the same peer do not all come back at once.

    Returns:
        Between half and the whole of 0.2, 0.3, 0.45, 0.675, 1, 1 ... s.
    """
    steps = min(max(failures - 1, 0), STEPS)
    whole = min(SHORTEST_DELAY * GROWTH**steps, LONGEST_DELAY)
    return whole * (0.5 + 0.5 * share)
