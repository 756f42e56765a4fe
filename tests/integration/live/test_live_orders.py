"""Orders to a formation of real processes, given by the command as an operator types it."""

import asyncio
import socket

import pytest

from tests.integration.live.conftest import Logged
from tests.integration.surroundings import Surroundings
from tests.kit.missions import in_place, replaced
from tests.kit.programs import vfguide
from vfguide.lab.rehearsal.live import live_flight
from vfguide.lab.rehearsal.processes import free_port
from vfguide.lab.report.figures import pair_separations, seen_from_leader
from vfguide.link.keys import OPERATOR


async def test_orders_are_flown_by_processes_over_whichever_real_link_they_come(
    mosquitto, tmp_path
):
    """Who watches and who orders writes nothing."""
    around = Surroundings(tmp_path / "watched")
    around.root.mkdir()
    # The vee, everybody in its slot.
    mission = replaced(in_place("shapes"), orders=[], deputies=["f1"])
    udp = f"udp://239.255.78.1:{free_port(socket.SOCK_DGRAM)}?interface=127.0.0.1"
    broker = mosquitto()
    async with live_flight(mission, directory=tmp_path, links=[udp, broker.url]) as flight:
        keys = flight.keys
        who = ("--roster", keys.roster, "--key", keys.private(OPERATOR))
        by_udp, by_broker = (("--link", link, *who) for link in (udp, broker.url))
        file = flight.mission_file
        await Logged(flight, tmp_path).all_say("-> tracking")
        in_slots_s = flight.truth_collector.time_s
        dry = await vfguide("order", file, "trail", "--spacing", 20, "--dry-run", *by_udp)
        refused = await vfguide("order", file, "trail", "--spacing", 4, *by_udp)
        trail = ("order", file, "trail", "--spacing", "20", *by_udp)
        trail_said = await asyncio.to_thread(around.run, *trail)
        console = around.start("console", file, "--operator", "--port", "0", *by_udp)
        await asyncio.to_thread(around.see_a_console_and_stop_it, console)
        assert "GO" in await asyncio.to_thread(around.run, "status", file, *by_udp)
        await asyncio.sleep(12.0)
        # Another process on the other link: it hears of the order before from the vehicles.
        slot = await vfguide("order", file, "slot", "f1=-60,20", *by_broker)
        await asyncio.sleep(18.0)
        lead = await vfguide("order", file, "lead", "f1", *by_broker)
        await asyncio.sleep(3.0)
        await flight.stop_companions()
        record = flight.record(wall_s=0.0)
    assert dry.status == 0, dry.err
    assert "rehearsed: nearest" in dry.out
    assert "given" not in dry.out
    assert refused.status == 2
    assert "4.0 m apart, less than 7.5 m" in refused.out + refused.err
    assert slot.status == lead.status == 0, slot.err + lead.err
    for name in flight.names:
        assert f"{name}: yes" in trail_said
        assert f"{name}: flies it" in trail_said
    forward, right = seen_from_leader(record.leader, record.followers[0])
    assert (forward[-20], right[-20]) == pytest.approx((-60.0, 20.0), abs=1.5)
    later = record.time_s > in_slots_s
    assert min(pair.distance_m[later].min() for pair in pair_separations(record)) >= 7.0
    around.see_that_nothing_else_was_written()
