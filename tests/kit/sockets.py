"""Ports that nobody uses, and waiting for what comes over sockets."""

import asyncio
import socket
from collections.abc import Callable
from random import SystemRandom

PATIENCE_S = 120.0
"""Nothing that is waited for takes a tenth of this, unless the machine is very busy."""


async def until(condition: Callable[[], object], patience_s: float = PATIENCE_S) -> None:
    """Wait for a condition."""
    async with asyncio.timeout(patience_s):
        while not condition():
            await asyncio.sleep(0.005)


def free_port() -> int:
    """Find a port of 127.0.0.1 that neither UDP nor TCP uses, below those that callers are given."""
    ports = (SystemRandom().randrange(15_000, 32_000) for _ in range(1000))
    return next(port for port in ports if _is_free(port))


def _is_free(port: int) -> bool:
    with socket.socket(type=socket.SOCK_DGRAM) as udp, socket.socket() as tcp:
        try:
            udp.bind(("127.0.0.1", port))
            tcp.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True
