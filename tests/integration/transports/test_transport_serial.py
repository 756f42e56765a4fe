import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.sockets import until
from tests.kit.terminal import Plug
from tests.kit.wire import beat


@pytest.fixture
def plug(tmp_path: Path) -> Iterator[Plug]:
    made = Plug(tmp_path / "ttyACM0")
    yield made
    made.pull_out()


async def test_frames_go_both_ways(opened, plug):
    plug.put_in()
    async with opened(plug.address) as (connection, inbox):
        assert connection.connected
        os.write(plug.near, beat(1)[:9])
        os.write(plug.near, beat(1)[9:] + b"noise" + beat(2))
        await inbox.holds(beat(1), beat(2))
        connection.send(beat(3))
        taken = bytearray()

        def has_come() -> bool:
            taken.extend(plug.taken())
            return taken == beat(3)

        await until(has_come)


async def test_every_byte_goes_through_as_it_is(opened, plug):
    plug.put_in()
    async with opened(plug.address) as (connection, _):
        connection.send(bytes(range(256)))
        taken = bytearray()

        def has_come() -> bool:
            taken.extend(plug.taken())
            return len(taken) >= 256

        await until(has_come)
        assert taken == bytes(range(256))


async def test_a_port_that_is_pulled_out_and_put_back_is_opened_again(opened, plug):
    async with opened(plug.address) as (connection, inbox):
        for system_id in (1, 2):
            assert not connection.connected
            connection.send(b"lost")
            plug.put_in()
            await until(lambda: connection.connected)
            os.write(plug.near, beat(system_id))
            await inbox.ends_with(beat(system_id))
            plug.pull_out()
            await until(lambda: not connection.connected)
        assert connection.counters["dropped: not connected"] == 2


async def test_a_port_that_takes_nothing_stops_nobody(opened, plug):
    plug.put_in()
    async with opened(plug.address) as (connection, _):
        began = time.monotonic()
        for _ in range(20_000):
            connection.send(bytes(100))
        assert connection.counters["dropped: slow peer"] > 10_000
        assert time.monotonic() - began < 60.0


async def test_a_port_belongs_to_one_program(opened, plug):
    plug.put_in()
    async with opened(plug.address) as (first, _), opened(plug.address) as (second, _):
        assert first.connected
        assert not second.connected


async def test_a_file_that_is_no_port_is_tried_again_and_not_harmed(opened, tmp_path):
    (tmp_path / "file").write_text("content")
    async with opened(f"serial://{tmp_path / 'file'}:57600") as (connection, _):
        assert not connection.connected
    assert (tmp_path / "file").read_text() == "content"
