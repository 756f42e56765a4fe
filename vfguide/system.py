"""Sockets, signals and retry delays that differ between Linux, macOS and Windows."""

import asyncio
import ipaddress
import os
import re
import selectors
import signal
import socket
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, TypeVar

from vfguide.errors import InputError, VfguideError

Result = TypeVar("Result")

SEND_BUFFER = 8 * 1024
"""Bytes of the kernel's send buffer; the default would queue minutes of messages for a slow peer."""

LONGEST_SILENCE = 5_000
"""Time without acknowledgement until a connection counts as lost, ms: a pulled cable sends no notice."""

URGENT_TCP: tuple[tuple[int, int, int], ...] = (
    (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),
    (socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER),
    # Only Linux has this option; elsewhere, missing messages reveal a pulled cable.
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
"""Selector without a descriptor of its own; Windows has only `select`."""


LABELS = re.compile(
    r"(?!-)[a-z0-9_-]{1,63}(?<!-)(\.(?!-)[a-z0-9_-]{1,63}(?<!-))*", re.IGNORECASE | re.ASCII
)
"""Labels of a host name."""

LONGEST_HOST = 253
"""Maximum length of a host name by the rules of the domain name system, characters."""

BRACKETS = re.compile(r"\[[0-9a-fA-F:.]+(%[A-Za-z0-9_.-]+)?\]")
NUMERIC = re.compile(r"[0-9.]+")


def checked_host(text: str) -> str:
    """Return a host, numbers without brackets, checked as far as possible without a name server.

    Raises:
        InputError: it is neither a name nor a number.
    """
    with suppress(ValueError):
        if BRACKETS.fullmatch(text):
            return str(ipaddress.IPv6Address(text[1:-1]))
        if NUMERIC.fullmatch(text):
            return str(ipaddress.IPv4Address(text))
        if LABELS.fullmatch(text) and len(text) <= LONGEST_HOST:
            return text
    raise InputError("the host is no name or number; write a name, 192.168.1.10 or [fd00::10]")


def require_linux(what: str) -> None:
    """Refuse an operation that only Linux supports, detected by the memfd interface.

    Raises:
        VfguideError: this is another system.
    """
    if not hasattr(os, "memfd_create"):
        raise VfguideError(f"{what} needs Linux; on this computer run it in a container")


def run_watching_sockets(main: Coroutine[Any, Any, Result]) -> Result:
    """Run a coroutine like `asyncio.run`, with an event loop that watches sockets on every system."""
    with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        return runner.run(main)


def on_signals(do: Callable[[], object]) -> None:
    """Let the running loop call `do` at Ctrl-C and SIGTERM, instead of ending the program."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, do)
        except NotImplementedError:
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(do))


SHORTEST_DELAY = 0.2
"""Delay before the first retry, s: most losses are brief."""

LONGEST_DELAY = 1.0
"""Maximum delay, s: a formation flies blind until all are back, and 100 retries a second are no load."""

GROWTH = 1.5
"""Factor between successive delays."""

STEPS = 10
"""Bound of the exponent, beyond the growth from the shortest to the longest delay."""


def retry_delay(failures: int, share: float) -> float:
    """Return the delay (s) after some failures in a row: growing, bounded and random.

    `share` is random in [0, 1), so that companions that lost the same peer do not retry together. The delay
    is between half and the whole of 0.2, 0.3, 0.45, 0.675, 1, 1 ... s.
    """
    steps = min(max(failures - 1, 0), STEPS)
    whole = min(SHORTEST_DELAY * GROWTH**steps, LONGEST_DELAY)
    return whole * (0.5 + 0.5 * share)
