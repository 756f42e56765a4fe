import asyncio
import os
import socket
from collections.abc import Iterator

import pytest

from tests.kit.sockets import free_port


@pytest.fixture
def terminal() -> Iterator[str]:
    near, far = os.openpty()
    yield os.ttyname(far)
    os.close(near)
    os.close(far)


@pytest.mark.parametrize("kind", ["udpin", "udpout", "tcpin", "tcpout", "serial"])
def test_opening_can_be_given_up_at_any_moment(opened, terminal, kind):
    async def stay(address: str) -> None:
        async with opened(address):
            await asyncio.Event().wait()

    async def scenario() -> None:
        port = free_port()
        address = f"serial://{terminal}:57600" if kind == "serial" else f"{kind}://127.0.0.1:{port}"
        if kind == "tcpout":
            somebody.bind(("127.0.0.1", port))
            somebody.listen(100)
        for rounds in range(25):
            staying = asyncio.create_task(stay(address))
            for _ in range(rounds):
                await asyncio.sleep(0.0002)
            staying.cancel()
            await asyncio.wait([staying])
            assert staying.cancelled()

    with socket.socket() as somebody:
        asyncio.run(asyncio.wait_for(scenario(), 60.0))
