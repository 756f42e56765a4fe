import asyncio
import socket

import pytest

from sitl_stub.links import LinkError
from tests.integration.sitl_stub.conftest import Dialogue


async def test_a_client_gets_telemetry_and_answers(served, client):
    ground = Dialogue()
    async with served("tcpin://127.0.0.1:0") as address, client(address, ground) as writer:
        await ground.message("HEARTBEAT")
        writer.write(ground.command(176, 1, 15))
        assert (await ground.message("COMMAND_ACK")).result == 0


async def test_two_clients_both_get_telemetry_and_one_may_leave(served, client):
    first, second = Dialogue(), Dialogue()
    async with served("tcpin://127.0.0.1:0", speedup=10.0) as address, client(address, first):
        async with client(address, second):
            await first.message("HEARTBEAT")
            await second.message("HEARTBEAT")
        await first.message("HEARTBEAT")
        await first.message("HEARTBEAT")


async def test_a_client_that_does_not_read_holds_up_nobody(served, client):
    ground = Dialogue()
    async with served("tcpin://127.0.0.1:0", speedup=100.0) as address:
        with socket.create_connection((address.host, address.port)) as deaf:
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            async with client(address, ground) as writer:
                for message_id in (30, 32, 33, 74, 168, 242):
                    writer.write(ground.command(511, message_id, 10_000))
                for _ in range(3000):
                    await ground.message("GLOBAL_POSITION_INT")


async def test_it_connects_once_there_is_a_server_and_again_after_a_loss(served):
    ground = Dialogue()
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        port = reserved.getsockname()[1]
    connections: asyncio.Queue[asyncio.StreamWriter] = asyncio.Queue()

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connections.put_nowait(writer)
        await ground.listen(reader)
        writer.close()

    async with served(f"tcpout://127.0.0.1:{port}"), asyncio.timeout(60.0):
        await asyncio.sleep(0)  # the first attempt finds nobody
        server = await asyncio.start_server(accept, "127.0.0.1", port)
        async with server:
            lost = await connections.get()
            await ground.message("HEARTBEAT")
            lost.close()
            writer = await connections.get()
            writer.write(ground.command(176, 1, 15))
            assert (await ground.message("COMMAND_ACK")).result == 0


async def test_a_port_in_use_is_refused_in_one_line(served):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(LinkError, match="address already in use") as caught:
            async with served(f"tcpin://127.0.0.1:{taken.getsockname()[1]}"):
                pass
        assert len(str(caught.value).splitlines()) == 1
