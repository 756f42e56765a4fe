import asyncio

import pytest

from tests.kit.sockets import free_port, until
from vfguide.errors import VfguideError
from vfguide.link.broker import embedded_broker


async def test_a_port_may_be_chosen_and_is_free_again_afterwards(opened):
    port = free_port()
    for _ in range(2):
        async with embedded_broker(port) as given, opened(given, "f1") as (link, _):
            assert given == port
            assert link.connected


async def test_a_port_that_is_taken_is_one_clear_line():
    async with embedded_broker() as port:
        with pytest.raises(VfguideError, match=rf"^embedded broker: port {port}: .*in use"):
            async with embedded_broker(port):
                pytest.fail("two brokers on one port")


@pytest.mark.parametrize("noise", [b"", b"\x10", b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 64])
async def test_noise_from_one_client_does_not_disturb_the_others(opened, noise, caplog):
    async with (
        embedded_broker() as port,
        opened(port, "lead") as (leader, _),
        opened(port, "f1", "lead") as (_, box),
    ):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(noise)
        await writer.drain()
        writer.close()
        await writer.wait_closed()
        leader.publish(b"state")
        await until(lambda: box)
    assert "Traceback" not in caplog.text


async def test_closing_under_its_clients_leaves_links_that_try_again(opened):
    port = free_port()
    async with embedded_broker(port):
        entered = opened(port, "f1", "lead")
        link, _ = await entered.__aenter__()
        assert link.connected
    try:
        await until(lambda: not link.connected)
        async with embedded_broker(port):
            await until(lambda: link.connected)
            await entered.__aexit__(None, None, None)
    finally:
        assert not link.connected


async def test_only_this_computer_is_let_in():
    async with embedded_broker() as port:
        with pytest.raises(OSError, match="Connect call failed"):
            # Another address of this computer, as the network would reach it.
            await asyncio.open_connection("127.0.0.2", port)
