import asyncio
import socket

import pytest

from tests.kit.sockets import free_port
from tests.kit.terminal import Plug


@pytest.mark.parametrize("kind", ["udpin", "udpout", "tcpin", "tcpout", "serial"])
async def test_opening_can_be_given_up_at_any_moment(opened, tmp_path, kind):
    async def stay(address: str) -> None:
        async with opened(address):
            await asyncio.Event().wait()

    port, plug = free_port(), Plug(tmp_path / "tty")
    address = plug.address if kind == "serial" else f"{kind}://127.0.0.1:{port}"
    plug.put_in()
    with socket.socket() as somebody:
        if kind == "tcpout":
            somebody.bind(("127.0.0.1", port))
            somebody.listen(100)
        async with asyncio.timeout(60.0):
            for rounds in range(25):
                staying = asyncio.create_task(stay(address))
                for _ in range(rounds):
                    await asyncio.sleep(0.0002)
                staying.cancel()
                await asyncio.wait([staying])
                assert staying.cancelled()
    plug.pull_out()
