"""Orders to a formation of real processes, given by the command as an operator types it."""

import asyncio
import socket

import pytest

from tests.kit.missions import in_place, replaced
from tests.kit.programs import vfguide
from vfguide.lab.rehearsal.live import LiveFlight, live_flight
from vfguide.lab.rehearsal.processes import free_port
from vfguide.lab.report.figures import pair_separations, seen_from_leader
from vfguide.link.keys import OPERATOR
from vfguide.mission import Mission

IN_SLOTS_S = 12.0


def mission_without_orders() -> Mission:
    """The vee of the mission `shapes`, everybody in its slot."""
    return replaced(in_place("shapes"), orders=[], deputies=["f1"])


async def ordered(flight: LiveFlight, link: str, *words: str) -> tuple[int, str]:
    """(exit status, output) of `vfguide order`."""
    keys = flight.keys
    reach = ("--link", link, "--roster", keys.roster, "--key", keys.private(OPERATOR))
    given = await vfguide("order", flight.mission_file, *words, *reach)
    return given.status, given.out + given.err


async def test_orders_are_flown_by_processes_over_whichever_real_link_they_come(
    mosquitto, tmp_path
):
    mission = mission_without_orders()
    udp = f"udp://239.255.78.1:{free_port(socket.SOCK_DGRAM)}?interface=127.0.0.1"
    broker = mosquitto()
    async with live_flight(mission, directory=tmp_path, links=[udp, broker.url]) as flight:
        await asyncio.sleep(IN_SLOTS_S)
        said = [
            await ordered(flight, udp, "trail", "--spacing", "20", "--dry-run"),
            await ordered(flight, udp, "trail", "--spacing", "4"),
            await ordered(flight, udp, "trail", "--spacing", "20"),
        ]
        await asyncio.sleep(20.0)
        # Another process on the other link: it hears of the order before from the vehicles.
        said.append(await ordered(flight, broker.url, "slot", "f1=-60,20"))
        await asyncio.sleep(18.0)
        said.append(await ordered(flight, broker.url, "lead", "f1"))
        await asyncio.sleep(3.0)
        await flight.stop_companions()
        record = flight.record(wall_s=0.0)
    (dry, dry_text), (refused, refused_text), (status, text), (last, last_text), lead = said
    assert dry == 0, dry_text
    assert "rehearsed: nearest" in dry_text
    assert "given" not in dry_text
    assert refused == 2
    assert "4.0 m apart, less than 7.5 m" in refused_text
    assert (status, last) == (0, 0), text + last_text
    assert lead[0] == 0, lead[1]
    for name in ("leader", "f1", "f2", "f3"):
        assert f"{name}: yes" in text
        assert f"{name}: flies it" in text
    forward, right = seen_from_leader(record.leader, record.followers[0])
    assert (forward[-20], right[-20]) == pytest.approx((-60.0, 20.0), abs=1.5)
    later = record.time_s > IN_SLOTS_S - 5.0
    assert min(pair.distance_m[later].min() for pair in pair_separations(record)) >= 7.0
