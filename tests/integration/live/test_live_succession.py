"""A leader that is killed over the real link: a deputy leads, others start anew, the leader comes back."""

import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
import zenoh

from tests.integration.live.conftest import Logged
from tests.kit.missions import on_the_circle, replaced
from tests.kit.programs import Mosquitto
from tests.kit.sockets import until
from vfguide.lab.rehearsal.live import companions_lost, live_flight
from vfguide.lab.rehearsal.processes import free_port

LEADS_S = 3.0
"""Simulation time within which a deputy has to lead."""

DEPUTIES = ["f1", "f2"]
"""Two who may lead in the leader's place."""

LEAD = "f1 leads the formation now"


@asynccontextmanager
async def link_of(kind: str, mosquitto: Callable[[], Mosquitto]) -> AsyncIterator[str]:
    """A link of this kind for as long as the context lasts."""
    if kind == "udp":
        port = free_port(socket.SOCK_DGRAM)
        yield f"udp://239.255.79.16:{port}?interface=127.0.0.1"
        return
    if kind == "zenoh":
        # All companions have one address: a router, by which they find each other.
        port, config = free_port(socket.SOCK_STREAM), zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{port}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        with zenoh.open(config):
            yield f"zenoh://127.0.0.1:{port}"
        return
    yield mosquitto().url


@pytest.mark.parametrize("kind", ["udp", "mqtt", "zenoh"])
async def test_a_deputy_leads_when_the_leaders_companion_is_killed(
    kind, mission, tmp_path, mosquitto, speedup
):
    mission = replaced(mission, deputies=DEPUTIES)
    async with (
        link_of(kind, mosquitto) as link,
        live_flight(mission, directory=tmp_path, links=[link], speedup=speedup) as flight,
    ):
        logs = Logged(flight, tmp_path)
        await logs.all_say("-> tracking")
        # It has to be heard that its companion steers it: else there is no leader to succeed.
        steered_s = flight.time_s
        await until(lambda: flight.time_s > steered_s + 3.0)
        await flight.companions["leader"].kill()
        killed_s = flight.time_s
        await logs.all_say("leads the formation in place of", "f1")
        assert flight.time_s - killed_s < LEADS_S
        await logs.all_say(LEAD, "f2", "f3")

        # The formation's time and the leader's session are to be had of the deputy now.
        await flight.companions["f3"].kill()
        await logs.start_again("f3")
        await until(lambda: logs.log("f3").count(LEAD) == 2)

        # Whose companion comes back finds another leader, and follows.
        await logs.start_again("leader")
        await logs.all_say(LEAD, "leader")
        assert "breakaway" not in "".join(logs.log(name) for name in flight.names)


async def test_a_mission_kills_a_companion_at_its_time_and_starts_it_again(
    tmp_path, mosquitto, speedup
):
    lost_s, back_s = 10.0, 16.0
    loss = {"vehicle": "f3", "at_s": lost_s, "for_s": back_s - lost_s}
    mission = replaced(on_the_circle(losses=[loss]), deputies=DEPUTIES)
    links = [mosquitto().url]
    async with (
        live_flight(mission, directory=tmp_path, links=links, speedup=speedup) as flight,
        companions_lost(flight),
    ):
        logs, companion = Logged(flight, tmp_path), flight.companions["f3"]
        await until(lambda: not companion.running)
        assert companion.exit_code is None
        assert flight.time_s >= lost_s
        flight.check()
        steering = logs.times_steering("f3")
        await until(lambda: companion.running)
        assert flight.time_s >= back_s
        await until(lambda: logs.times_steering("f3") > steering)
