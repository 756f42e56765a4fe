import asyncio
import time
from contextlib import AsyncExitStack

import aiomqtt

from tests.kit.sockets import until
from vfguide.link.codec import decode_envelope
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence, decode_presence


async def retained(port: int, topic: str) -> aiomqtt.Message:
    """The message that a broker keeps."""
    async with asyncio.timeout(60.0), aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe(topic, qos=1)
        return await anext(client.messages)


def said(data: bytes) -> Presence:
    """The presence in a message, signature and all."""
    return decode_presence(decode_envelope(data).body)


async def test_states_reach_everyone_who_listens(port, opened):
    async with AsyncExitStack() as stack:
        leader, unasked = await stack.enter_async_context(opened(port, "lead"))
        boxes = []
        for number in range(3):
            link, box = await stack.enter_async_context(opened(port, f"f{number}", "lead"))
            assert link.connected
            boxes.append(box)
        assert leader.connected
        for number in range(20):
            state = b"state %d" % number
            leader.publish(state)
            await until(lambda state=state: all(box[-1:] == [state] for box in boxes))
        assert all(len(box) == 20 for box in boxes)
        assert not unasked
        assert leader.counters == {"connected": 1}


async def test_a_state_is_not_kept_for_those_who_come_later(port, opened):
    async with opened(port, "lead") as (leader, _):
        async with opened(port, "f1", "lead") as (_, first):
            leader.publish(b"old")
            await until(lambda: first)
        async with opened(port, "f1", "lead") as (_, second):
            leader.publish(b"new")
            await until(lambda: second)
            assert second == [b"new"]


async def test_of_states_published_at_once_the_newest_is_sent(port, opened):
    async with opened(port, "lead") as (leader, _), opened(port, "f1", "lead") as (_, box):
        for number in range(1000):
            leader.publish(b"%d" % number)
        await until(lambda: box)
        assert box == [b"999"]
        assert leader.counters["replaced before it was sent"] == 999


async def test_formations_and_prefixes_do_not_hear_each_other(mosquitto, opened):
    port = mosquitto().port
    async with (
        opened(f"mqtt://127.0.0.1:{port}/a", "lead") as (one, _),
        opened(f"mqtt://127.0.0.1:{port}/a", "f1", "lead") as (_, heard),
        opened(f"mqtt://127.0.0.1:{port}/b", "lead") as (other, _),
        opened(f"mqtt://127.0.0.1:{port}/b", "f1", "lead") as (_, box),
    ):
        one.publish(b"of another")
        await until(lambda: heard)
        other.publish(b"own")
        await until(lambda: box)
        assert box == [b"own"]


async def test_presence_is_kept_and_says_offline_after_a_clean_end(port, opened):
    topic = "vfguide/test/f1/presence"
    async with opened(port, "f1", "lead", clock=lambda: 7.0) as (link, _):
        first = await retained(port, topic)
        assert first.retain
        assert said(first.payload).status == "online"
        link.announce(
            Presence(status="online", mode="tracking", time_s=8.0, version="1", figures={})
        )
        while said((await retained(port, topic)).payload).mode != "tracking":
            await asyncio.sleep(0.01)
    last = said((await retained(port, topic)).payload)
    assert (last.status, last.mode) == ("offline", "tracking")


async def test_what_does_not_belong_is_counted_and_does_no_harm(port, opened):
    async with (
        opened(port, "lead") as (leader, _),
        opened(port, "f1", "lead", peer_clock=PeerClock()) as (link, box),
        aiomqtt.Client("127.0.0.1", port) as stranger,
    ):
        await stranger.publish("vfguide/test/lead/state", b"x" * 4097)
        await stranger.publish("vfguide/test/lead/clock/ask/f2", b"what time is it?")
        await stranger.publish("vfguide/test/lead/clock/ask/f3", b"")
        await stranger.publish("vfguide/test/lead/clock/tell/f1", b"late")
        await until(lambda: link.counters["dropped: too long"])
        await until(lambda: leader.counters["refused: malformed"] == 2)
        await until(lambda: link.counters["refused: malformed"] == 1)
        # The leader, too, hears now and then what is said in its name.
        async with asyncio.timeout(60.0):
            while leader.counters["refused: malformed"] == 2:
                await stranger.publish("vfguide/test/lead/state", b"not what lead said")
                await asyncio.sleep(0.02)
        assert box == []
        leader.publish(b"still here")
        await until(lambda: box == [b"still here"])


async def test_a_receiver_that_raises_does_not_end_the_link(mosquitto, opened, caplog):
    port, heard = mosquitto().port, []

    def receive(data: bytes) -> None:
        heard.append(data)
        if data == b"bad":
            raise ValueError("no good")

    async with (
        opened(port, "lead") as (leader, _),
        opened(port, "f1", "lead", receive=receive) as (link, _),
    ):
        for data in (b"bad", b"good"):
            leader.publish(data)
            await until(lambda data=data: heard[-1:] == [data])
        assert link.connected
        assert link.counters["failed to use"] == 1
    assert "could not be used" in caplog.text


async def test_two_seconds_between_the_clocks_are_measured_and_a_step_is_followed(port, opened):
    skew_s = 2.0
    clock = PeerClock()

    def right() -> bool:
        return abs(clock.offset_s - skew_s) <= clock.bound_s + 1e-4

    async with (
        opened(port, "lead", clock=lambda: time.monotonic() + skew_s),
        opened(port, "f1", "lead", peer_clock=clock, clock=time.monotonic),
    ):
        await until(lambda: clock.ready)
        assert right()
        skew_s = 60.0
        await until(lambda: clock.counters["step"] == 1)
        assert right()
        assert clock.bound_s < 0.5


async def test_a_slow_consumer_gets_new_states_and_not_a_backlog(port, opened):
    """200 states in a second, 20 uses: whoever used each would be 2.7 s behind after three."""
    ages: list[float] = []

    def receive(data: bytes) -> None:
        time.sleep(0.05)
        ages.append(time.monotonic() - float(data) - 0.05)

    async def speak(port: int) -> None:
        async with opened(port, "lead") as (leader, _):
            for _ in range(600):
                leader.publish(repr(time.monotonic()).encode())
                await asyncio.sleep(0.005)

    # Each in a thread and loop of its own: the consumer holds up neither broker nor leader.
    spoken = asyncio.get_running_loop().create_task(asyncio.to_thread(asyncio.run, speak(port)))

    async def consumer() -> None:
        async with opened(port, "f1", "lead", receive=receive) as (link, _):
            while not spoken.done():
                await asyncio.sleep(0.01)
            assert link.counters["superseded by a newer one"] > len(ages)

    await asyncio.to_thread(asyncio.run, consumer())
    await spoken
    assert len(ages) > 10
    assert sorted(ages)[int(0.9 * len(ages))] < 1.0
