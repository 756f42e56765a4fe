"""Beside a formation that flies, who watches and who orders writes nothing."""

import asyncio
import socket

from tests.integration.live.test_live_orders import IN_SLOTS_S, mission_without_orders
from tests.integration.surroundings import Surroundings
from vfguide.lab.rehearsal.live import live_flight
from vfguide.lab.rehearsal.processes import free_port
from vfguide.link.keys import OPERATOR


async def test_status_order_and_console_write_nothing(tmp_path):
    around = Surroundings(tmp_path / "watched")
    around.root.mkdir()
    link = f"udp://239.255.79.1:{free_port(socket.SOCK_DGRAM)}?interface=127.0.0.1"
    async with live_flight(mission_without_orders(), directory=tmp_path, links=[link]) as flight:
        await asyncio.sleep(IN_SLOTS_S)
        keys = flight.keys
        reach = ("--link", link, "--roster", keys.roster, "--key", keys.private(OPERATOR))
        mission = flight.mission_file
        status = await asyncio.to_thread(around.run, "status", mission, *reach)
        order = await asyncio.to_thread(
            around.run, "order", mission, "trail", "--spacing", "20", *reach
        )
        console = around.start("console", mission, "--operator", "--port", "0", *reach)
        await asyncio.to_thread(around.see_a_console_and_stop_it, console)
    assert "GO" in status
    assert "flies it" in order
    around.see_that_nothing_else_was_written()
