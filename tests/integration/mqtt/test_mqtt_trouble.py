import asyncio
import logging
import os
import signal
import sys
import time
from contextlib import suppress

import aiomqtt
import pytest

from tests.kit.crew import speak
from tests.kit.sockets import until
from vfguide.link.codec import decode_envelope
from vfguide.link.member import NOT_SAID
from vfguide.link.presence import decode_presence

PROMPT_S = 10.0
"""What takes one to four seconds takes less than this even where the processor is slow to come."""

VEHICLE = """
import asyncio, sys
from random import Random
from vfguide.link.carrier import parse_link
from vfguide.link.member import NOT_SAID, Member
from vfguide.link.opening import open_link
from vfguide.link.trust import Trust

async def main():
    address = parse_link(sys.argv[1])
    trust = Trust(formation="test", name="f1", leader="lead", session=1, roster=None)
    member = Member(trust, clock=asyncio.get_running_loop().time)
    async with open_link((address,), formation="test", member=member, random=Random(1)):
        await asyncio.Event().wait()

asyncio.run(main())
"""


async def test_a_broker_that_restarts_is_found_again_and_told_what_is_wanted(mosquitto, opened):
    broker = mosquitto()
    async with (
        opened(broker.port, "lead") as (leader, _),
        opened(broker.port, "f1", "lead") as (link, box),
    ):
        await speak(leader, lambda: box)
        broker.kill()
        lost = time.monotonic()
        await until(lambda: not leader.connected and not link.connected)
        leader.publish(b"into the void")
        assert leader.counters["dropped: not connected"] == 1
        # An outage of two seconds, which is what a restart takes.
        await asyncio.sleep(max(lost + 2.0 - time.monotonic(), 0.0))
        broker.start()
        box.clear()
        await speak(leader, lambda: box)
        assert time.monotonic() - lost < PROMPT_S
        assert leader.counters["disconnected"] == link.counters["disconnected"] == 1
        assert leader.counters["connected"] == link.counters["connected"] == 2
        assert b"into the void" not in box


async def test_a_broker_that_comes_late_is_found(mosquitto, opened, caplog):
    broker = mosquitto()
    broker.kill()
    began = time.monotonic()
    async with opened(broker.port, "f1", "lead") as (link, _):
        assert time.monotonic() - began < PROMPT_S
        assert not link.connected
        assert "refused" in link.detail
        broker.start()
        await until(lambda: link.connected)
        assert link.detail == ""
    # However many tries it took, one line says that the broker is away.
    assert caplog.text.count("not connected") == 1


async def test_a_broker_that_hangs_is_noticed_and_found_again(mosquitto, opened):
    broker = mosquitto()
    async with (
        opened(broker.port, "lead") as (leader, _),
        opened(broker.port, "f1", "lead") as (link, box),
    ):
        await speak(leader, lambda: box)
        broker.freeze()
        frozen = time.monotonic()
        while leader.connected or link.connected:
            leader.publish(b"unheard")
            await asyncio.sleep(0.02)
        assert time.monotonic() - frozen < PROMPT_S
        broker.thaw()
        box.clear()
        await speak(leader, lambda: box)
        await until(lambda: link.connected and leader.connected)


async def test_a_link_ends_soon_even_if_the_broker_hangs(mosquitto, opened):
    broker = mosquitto()
    async with opened(broker.port, "lead") as (link, _):
        assert link.connected
        broker.freeze()
        ends = time.monotonic()
    assert time.monotonic() - ends < PROMPT_S


@pytest.mark.parametrize("word", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\x20\x02"])
async def test_a_server_that_is_no_broker_is_given_up_and_tried_again(opened, word):
    calls: list[asyncio.StreamWriter] = []

    async def take(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        calls.append(writer)
        writer.write(word)

    server = await asyncio.start_server(take, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    try:
        async with opened(port, "f1", "lead") as (link, _):
            await until(lambda: len(calls) >= 2)
            assert not link.connected
            await until(lambda: link.counters["failed to connect"] >= 1)
            assert link.detail
    finally:
        server.close()
        for writer in calls:
            writer.transport.abort()


async def test_a_wrong_password_is_named_and_tried_again(guarded, opened, caplog):
    broker = guarded("crew")
    url = "mqtt://crew:{}@127.0.0.1:{}"
    async with opened(url.format("wrong-hunter2", broker.port), "f1", "lead") as (link, _):
        await until(lambda: link.counters["refused"] >= 3)
        assert not link.connected
        assert "wrong user name or password" in link.detail
    async with opened(url.format("word", broker.port), "f1", "lead") as (link, _):
        assert link.connected
    warnings = [record for record in caplog.records if record.levelno >= logging.WARNING]
    assert [record.exc_info for record in warnings] == [None]
    assert "wrong user name or password" in caplog.text
    assert "VFGUIDE_LINK_PASSWORD" in caplog.text
    assert "hunter2" not in caplog.text


async def test_a_broker_that_does_not_let_a_vehicle_speak_is_found_out(
    mosquitto, opened, tmp_path, caplog
):
    rules = tmp_path / "rules"
    rules.write_text("topic read vfguide/#\ntopic write vfguide/+/+/presence\n")
    broker = mosquitto(f"acl_file {rules}\n")
    async with opened(broker.port, "lead") as (link, _):
        await speak(link, lambda: link.counters["not heard"])
        # The connection itself is all right.
        assert link.connected
        assert link.counters["connected"] == 1
    assert "own states do not come back" in caplog.text
    assert "vfguide/test/lead/state" in caplog.text


async def test_two_vehicles_of_the_same_name_are_found_out(mosquitto, opened, caplog):
    port = mosquitto().port
    async with opened(port, "f1", "lead") as (one, _), opened(port, "f1", "lead") as (other, _):
        number = 0
        async with asyncio.timeout(60.0):
            while not one.counters["refused: another companion of this name"]:
                number += 1
                one.publish(b"one %d" % number)
                other.publish(b"other %d" % number)
                await asyncio.sleep(0.02)
    assert "a companion calls itself 'f1', too" in caplog.text


async def test_a_second_companion_of_the_leader_asks_the_first_by_the_broker_and_steps_back(
    mosquitto, opened
):
    port = mosquitto().port
    async with opened(port, "lead") as (first, _):
        async with asyncio.timeout(60.0):
            # It has spoken for longer, by whatever this computer takes its time.
            for number in range(25):
                first.publish(b"first %d" % number)
                await asyncio.sleep(0.02)
            async with opened(port, "lead") as (second, _):
                number = 0
                while not second.counters[NOT_SAID]:
                    number += 1
                    first.publish(b"first, later %d" % number)
                    second.publish(b"second %d" % number)
                    await asyncio.sleep(0.02)
        assert not first.counters[NOT_SAID]


async def test_who_may_only_read_cannot_throw_the_leader_out(guarded, opened):
    rules = "user eye\ntopic read #\nuser lead\ntopic readwrite #\n"
    broker = guarded("lead", "eye", rules=rules)
    names, word = ("vfguide/test/lead", "lead"), "word"
    async with opened(f"mqtt://lead:word@127.0.0.1:{broker.port}", "lead") as (link, _):
        assert link.connected
        for name in names * 3:
            async with aiomqtt.Client(
                "127.0.0.1", broker.port, identifier=name, username="eye", password=word
            ) as eye:
                await eye.subscribe("vfguide/test/lead/state")
                link.publish(name.encode())
                heard = await asyncio.wait_for(anext(eye.messages), 60.0)
                assert decode_envelope(heard.payload).body == name.encode()
        assert link.counters["connected"] == 1
        assert link.counters["disconnected"] == 0


async def test_a_vehicle_that_is_killed_goes_offline(port):
    victim = await asyncio.create_subprocess_exec(
        sys.executable, "-c", VEHICLE, f"mqtt://127.0.0.1:{port}"
    )
    seen: list[str] = []

    async def watch() -> None:
        async with aiomqtt.Client("127.0.0.1", port) as client:
            await client.subscribe("vfguide/test/f1/presence", qos=1)
            while True:
                message = await anext(client.messages)
                presence = decode_presence(decode_envelope(message.payload).body)
                seen.append(presence.status)

    watching = asyncio.create_task(watch())
    try:
        await until(lambda: seen)
        assert seen[-1] == "online"
        os.kill(victim.pid, signal.SIGKILL)
        await until(lambda: seen[-1] == "offline")
    finally:
        with suppress(ProcessLookupError):
            victim.kill()
        await victim.wait()
        watching.cancel()
        await asyncio.wait({watching})
