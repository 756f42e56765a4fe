import asyncio
from typing import Any

import pytest

from sitl_stub import links
from sitl_stub.server import precise_event_loop

STREAMED = (30, 74, 33)
NAMES = {"ATTITUDE", "VFR_HUD", "GLOBAL_POSITION_INT"}


EVENT_LOOP = precise_event_loop


def contents(messages: list[Any]) -> tuple[set[str], set[int]]:
    """(names, times since boot) of messages."""
    times = {message.time_boot_ms for message in messages if hasattr(message, "time_boot_ms")}
    return {message.get_type() for message in messages}, times


async def test_who_listens_is_heard_first_and_then_gets_telemetry_and_answers(served, station):
    async with served() as address, station(address) as ground:
        ground.send(ground.heartbeat())
        heartbeat = await ground.message("HEARTBEAT")
        assert heartbeat.get_srcSystem() == 7
        ground.send(ground.command(176, 1, 15))
        ack = await ground.message("COMMAND_ACK")
        assert (ack.command, ack.result) == (176, 0)
        assert (await ground.message("HEARTBEAT")).custom_mode == 15


async def test_who_is_spoken_to_first_gets_telemetry_unasked(served, station):
    async with station() as ground, served(f"udpout://127.0.0.1:{ground.port}"):
        await ground.message("HEARTBEAT")
        ground.send(ground.command(512, 148))
        assert (await ground.message("COMMAND_ACK")).result == 0
        await ground.message("AUTOPILOT_VERSION")


async def test_two_peers_both_get_every_frame(served, station):
    async with served() as address, station(address) as first, station(address) as second:
        first.send(first.heartbeat())
        await first.message("HEARTBEAT")
        second.send(second.heartbeat())
        await second.message("HEARTBEAT")
        second.send(second.command(176, 1, 15))
        # Who flies learns at once what somebody else has told the aircraft.
        while (await first.message("HEARTBEAT")).custom_mode != 15:
            pass
        first.heard_already()
        first.send(first.command(511, 33, 20_000))
        positions = [await first.message("GLOBAL_POSITION_INT") for _ in range(20)]
        sequence = [position.get_seq() for position in positions]
        heard = [message.get_seq() for message in second.heard_already()]
        assert set(sequence[:-1]) <= set(heard)


async def test_a_peer_that_fell_silent_is_forgotten_unless_it_spoke_last(
    served, station, monkeypatch
):
    monkeypatch.setattr(links, "PEER_REMEMBERED_S", 0.0)

    async with (
        served(speedup=10.0) as address,
        station(address) as first,
        station(address) as second,
    ):
        first.send(first.heartbeat())
        await first.message("HEARTBEAT")
        await first.message("HEARTBEAT")
        second.send(second.heartbeat())
        await second.message("HEARTBEAT")
        first.heard_already()
        await second.message("HEARTBEAT")
        assert not first.heard_already()


async def test_what_is_due_at_one_instant_is_one_datagram(served, station):
    async with served(speedup=10.0) as address, station(address) as ground:
        for message_id in STREAMED:
            ground.send(ground.command(511, message_id, 20_000))
            await ground.message("COMMAND_ACK")
        ground.datagrams.clear()
        while len(ground.datagrams) < 120:
            await ground.message("GLOBAL_POSITION_INT")
        instants = []
        for datagram in ground.datagrams:
            ground.heard_already()
            ground.hear(datagram)
            instants.append(contents(ground.heard_already()))
        assert all(names >= NAMES and len(times) == 1 for names, times in instants)
        stamps = [times.pop() for _, times in instants]
        assert stamps == list(range(stamps[0], stamps[0] + 20 * len(stamps), 20))


@pytest.mark.parametrize("speedup", [1.0, 10.0])
async def test_time_since_boot_passes_as_fast_as_it_is_told(served, station, speedup):
    async with served(speedup=speedup) as address, station(address) as ground:
        ground.send(ground.command(511, 33, 100_000))
        await ground.message("COMMAND_ACK")
        loop = asyncio.get_running_loop()
        first, started_s = await ground.message("GLOBAL_POSITION_INT"), loop.time()
        last = first
        while loop.time() - started_s < 1.5:
            last = await ground.message("GLOBAL_POSITION_INT")
        passed_s = (last.time_boot_ms - first.time_boot_ms) * 1e-3
        assert passed_s / (loop.time() - started_s) == pytest.approx(speedup, rel=0.3)


async def test_a_command_acts_at_the_time_of_its_arrival(served, station):
    async with served(speedup=10.0) as address, station(address) as ground:
        ground.send(ground.command(511, 33, -1))
        await ground.message("COMMAND_ACK")
        await ground.message("HEARTBEAT")
        # Between two heartbeats nothing is due; the aircraft has flown all the same.
        ground.send(ground.command(512, 33))
        position = await ground.message("GLOBAL_POSITION_INT")
        assert position.time_boot_ms % 1000 != 0


async def test_a_flood_of_garbage_neither_ends_it_nor_is_answered(served, station):
    async with served() as address, station(address) as ground:
        for size in range(0, 1400, 7):
            ground.send(b"\xfd" * size)
        ground.send(ground.command(512, 148))
        await ground.message("AUTOPILOT_VERSION")
