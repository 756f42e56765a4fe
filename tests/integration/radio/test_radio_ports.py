"""Formations on a radio, by real serial ports: pseudo terminals whose far ends are one shared channel."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from random import Random

import pytest

from tests.kit.crew import Crew, crews_on
from tests.kit.link import FORMATION, LEADER, ROSTER
from tests.kit.radio import SharedAir, state_at
from tests.kit.sockets import PATIENCE_S, until
from vfguide.errors import InputError
from vfguide.link.carrier import parse_links
from vfguide.link.opening import WatchedFormation, open_link, presences
from vfguide.link.presence import Presence

OUTAGE_S = 5.0
"""For so long a radio is unplugged."""


async def publish(crew: Crew) -> None:
    """20 states a second, for ever."""
    while True:
        time_s = crew.member.formation_time()
        if time_s > 0.0:
            crew.link.publish(state_at(time_s))
        await asyncio.sleep(0.05)


@asynccontextmanager
async def crews_at(air: SharedAir, *names: str) -> AsyncIterator[list[Crew]]:
    """Members that publish on their radios."""
    async with AsyncExitStack() as stack:
        stack.callback(air.close)
        links = {name: [air.address(name)] for name in names}
        crews = await stack.enter_async_context(crews_on(links))
        for crew in crews:
            stack.callback(asyncio.create_task(publish(crew)).cancel)
        yield crews


@pytest.fixture
def air(tmp_path: Path) -> SharedAir:
    return SharedAir(tmp_path)


async def test_a_formation_hears_itself_over_its_radios(air):
    names = (LEADER, "f1", "f2")
    for name in names:
        air.plug(name)
    async with crews_at(air, *names) as (leader, one, other):
        await until(lambda: one.heard and other.heard)
        await until(
            lambda: {"f1", "f2"} <= dict(leader.neighbours).keys() and "f2" in dict(one.neighbours)
        )
        assert one.member.peer_clock is not None
        # All read one clock here.
        assert abs(one.member.peer_clock.offset_s) <= one.member.peer_clock.bound_s < 0.1
        assert leader.link.connected
        assert one.link.connected


async def test_a_radio_that_is_unplugged_for_five_seconds_is_told_and_comes_back_by_itself(
    air, caplog
):
    for name in (LEADER, "f1"):
        air.plug(name)
    async with crews_at(air, LEADER, "f1") as (leader, one):
        await until(lambda: one.heard)
        one.link.news()
        air.plugs["f1"].pull_out()
        await until(lambda: not one.link.connected)
        assert "tty-f1:57600 is lost" in "".join(one.link.news())
        await asyncio.sleep(OUTAGE_S)
        assert not one.link.connected
        assert "No such file or directory" in one.link.detail
        assert not one.link.news()
        one.heard.clear()
        air.plugs["f1"].put_in()
        await until(lambda: one.heard)
        assert one.link.connected
        assert "is back" in "".join(one.link.news())
        assert one.counters["disconnected"] == 1
        assert leader.counters["failed to use"] == 0
    # That it has gone, and that it is not there: each once, however often it is tried.
    assert 1 <= caplog.text.count("tty-f1:57600: not connected") <= 2


async def test_a_port_that_is_not_there_is_one_line_and_tried_again(air, caplog):
    async with crews_at(air, "f1") as (one,):
        await until(lambda: one.counters["failed to connect"] >= 3)
        assert "No such file or directory" in one.link.detail
    assert caplog.text.count("not connected") == 1


async def test_noise_and_cut_packets_hide_nothing(air):
    random = Random(2)
    for name in (LEADER, "f1"):
        air.plug(name)
    async with crews_at(air, LEADER, "f1") as (_, one):
        await until(lambda: one.heard)
        for _ in range(100):
            air.plugs["f1"].hear(random.randbytes(random.randrange(60)))
            await asyncio.sleep(0.01)
        one.heard.clear()
        await until(lambda: len(one.heard) > 5)
        assert one.counters["refused: damaged on the air"] > 5
        assert one.counters["failed to use"] == 0


async def test_who_watches_hears_how_everybody_is(air):
    watched = WatchedFormation(
        addresses=parse_links([air.address("eye")]),
        formation=FORMATION,
        leader=LEADER,
        roster=ROSTER,
    )
    for name in (LEADER, "f1", "f2", "eye"):
        air.plug(name)
    async with crews_at(air, LEADER, "f1", "f2") as (_, one, other):
        await until(lambda: one.heard and other.heard)
        found = dict[str, Presence]()
        async with asyncio.timeout(PATIENCE_S):
            while set(found) != {LEADER, "f1", "f2"}:
                found = await presences(watched, seconds=5.0, random=Random(1))
        assert {presence.status for presence in found.values()} == {"online"}


async def test_without_the_radio_key_nothing_is_opened(air):
    crew = Crew("f1")
    (address,) = parse_links([air.address("f1", key=False)])
    with pytest.raises(InputError, match="a radio needs the formation's radio key"):
        async with open_link((address,), formation=FORMATION, member=crew.member, random=Random(1)):
            pass
