import asyncio
from collections import Counter

import pytest
from aiomqtt import Message

from vfguide.backoff import retry_delay
from vfguide.link.client import MOST_TOPICS, Echo, Inbox, NewestOnly
from vfguide.link.session import Topics

TOPICS = Topics(prefix="p/q", formation="circle", vehicle="f1")


def message(topic: str, payload: bytes) -> Message:
    return Message(topic, payload, 0, retain=False, mid=1, properties=None)


def test_only_the_newest_of_each_topic_is_kept_and_a_flood_of_topics_is_bounded():
    counters: Counter[str] = Counter()
    mail = NewestOnly(lambda: counters.update(["replaced"]))
    for number in range(5):
        mail.put("a", b"a%d" % number)
        mail.put("b", b"b%d" % number)
    assert [mail.take() for _ in range(3)] == [("a", b"a4"), ("b", b"b4"), None]
    assert counters == {"replaced": 8}
    for number in range(1000):
        mail.put(f"topic {number}", b"")
    assert len(mail) == MOST_TOPICS
    assert counters == {"replaced": 8 + 1000 - MOST_TOPICS}


async def test_whoever_waits_for_mail_is_woken_and_not_twice():
    mail = NewestOnly(lambda: None)
    waiting = asyncio.create_task(mail.wait())
    await asyncio.sleep(0)
    assert not waiting.done()
    mail.put("a", b"1")
    await asyncio.wait_for(waiting, 60.0)
    mail.clear()
    waiting = asyncio.create_task(mail.wait())
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert not waiting.done()
    waiting.cancel()


def test_what_is_too_long_is_counted_and_replaces_nothing():
    counters: Counter[str] = Counter()
    inbox = Inbox(counters)
    inbox.deliver(message("a", b"x" * 4096))
    inbox.deliver(message("a", b"y" * 4097))
    assert inbox.mail.take() == ("a", b"x" * 4096)
    assert counters == {"dropped: too long": 1}


async def test_a_flood_does_not_keep_the_inbox_from_settling():
    inbox = Inbox(Counter())
    inbox.deliver(message("a", b""))
    await asyncio.wait_for(inbox.settle(lambda: True), 60.0)


async def test_what_waits_in_the_socket_is_read_before_anything_is_used():
    inbox = Inbox(Counter())
    waiting = [message("a", b"2"), message("b", b"3")]

    async def read() -> None:
        # As the client does: one message in a turn of the event loop.
        while waiting:
            await asyncio.sleep(0)
            inbox.deliver(waiting.pop(0))

    inbox.deliver(message("a", b"1"))
    reading = asyncio.create_task(read())
    await inbox.settle(lambda: bool(waiting))
    assert (inbox.mail.take(), inbox.mail.take()) == (("a", b"2"), ("b", b"3"))
    await reading


def test_delays_grow_by_half_from_a_fifth_of_a_second_to_one_however_long_the_outage():
    delays = [round(retry_delay(failures, 1.0), 3) for failures in range(1, 7)]
    assert delays == [0.2, 0.3, 0.45, 0.675, 1.0, 1.0]
    assert (retry_delay(10**9, 1.0), retry_delay(1, 0.0)) == (1.0, 0.1)
    assert all(retry_delay(failures, 0.999) <= 1.0 for failures in range(1, 100))


@pytest.mark.parametrize(
    ("topic", "expected"),
    [
        (TOPICS.state("lead"), "p/q/circle/lead/state"),
        (TOPICS.presence("f1"), "p/q/circle/f1/presence"),
        (TOPICS.ask("lead"), "p/q/circle/lead/clock/ask/f1"),
        (TOPICS.answer_of("lead"), "p/q/circle/lead/clock/tell/f1"),
        (TOPICS.every_ask("f1"), "p/q/circle/f1/clock/ask/+"),
        (TOPICS.answer("f2"), "p/q/circle/f1/clock/tell/f2"),
        # Names cannot reach into other topics.
        (TOPICS.answer("../+"), "p/q/circle/f1/clock/tell/..%2F%2B"),
        (TOPICS.state("a/b+#%"), "p/q/circle/a%2Fb%2B%23%25/state"),
    ],
)
def test_topics_of_a_vehicle(topic, expected):
    assert topic == expected


def test_a_state_that_comes_back_is_heard_until_the_next_time_of_listening():
    echo = Echo()
    echo.listen()
    for number in range(3):
        echo.speak(b"%d" % number)
    assert not echo.hear(b"of somebody else")
    assert not echo.heard
    assert echo.hear(b"1")
    assert echo.heard
    echo.listen()
    assert not echo.heard


def test_two_checks_without_an_echo_make_the_broker_deaf():
    echo, found = Echo(), []
    echo.listen()
    for _ in range(3):
        echo.speak(b"own")
        found.append(echo.check())
    assert found == [False, True, True]
    echo.hear(b"own")
    assert not echo.check()


def test_a_broker_is_not_deaf_to_someone_who_says_nothing():
    echo = Echo()
    echo.listen()
    assert not any(echo.check() for _ in range(5))
