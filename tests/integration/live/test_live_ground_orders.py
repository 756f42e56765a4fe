"""An order that a ground station requests of a real process."""

import asyncio
import socket
from asyncio.subprocess import PIPE

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.programs import running
from tests.kit.sockets import PATIENCE_S, free_port

LARGEST = 2048


async def test_what_a_ground_station_calls_off_is_flown_without_another_program(tmp_path):
    port = free_port()
    words = ("companion", "leader", "--mission", "circle-calm", "--insecure", "--state", tmp_path)
    words = (*words, "--mavlink", f"udpin://127.0.0.1:{port}", "--link", "mqtt://127.0.0.1:1")
    abort = mavlink.MAVLink_command_long_message(1, 191, 31_010, 0, 1, 0, 0, 0, 0, 0, 0)
    request = abort.pack(mavlink.MAVLink(None, srcSystem=255, srcComponent=190))
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as router:
        router.bind(("127.0.0.1", 0))
        router.setblocking(False)  # noqa: FBT003

        async def route() -> None:
            """Pass on what the autopilot says and, after each tenth of it, the station's request."""
            count = 0
            while True:
                data = await loop.sock_recv(router, LARGEST)
                await loop.sock_sendto(router, data, ("127.0.0.1", port))
                count += 1
                if count % 10 == 0:
                    await loop.sock_sendto(router, request, ("127.0.0.1", port))

        here = f"udpout://127.0.0.1:{router.getsockname()[1]}"
        async with (
            running("vfguide", *words, "--ground-station-orders", stderr=PIPE) as companion,
            running("sitl_stub", "--system-id", 1, "--mavlink", here, "--airborne"),
            asyncio.timeout(PATIENCE_S),
        ):
            routing = asyncio.create_task(route())
            assert companion.stderr is not None
            async for line in companion.stderr:
                assert b"cannot be given" not in line, line
                if b"everybody back to the autopilot" in line:
                    break
            routing.cancel()
