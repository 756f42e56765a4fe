"""What waits to be sent, and what one who only watches holds: each sender's newest true state."""

import asyncio
from collections import Counter

import pytest
from aiomqtt import Message

from tests.kit.link import trust_of
from vfguide.backoff import retry_delay
from vfguide.link.client import MOST_TOPICS, Echo, Inbox, NewestOnly
from vfguide.link.datagrams import MOST_HELD, MOST_SENDERS, HeldMail
from vfguide.link.envelope import Kind
from vfguide.link.member import Member
from vfguide.link.session import Topics
from vfguide.link.trust import Trust

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


def state(trust: Trust, body: bytes) -> bytes:
    return trust.seal(Kind.STATE, body, time_s=0.0)


def forged(sealed: bytes) -> bytes:
    """The same with another signature."""
    return sealed[:-1] + bytes([sealed[-1] ^ 1])


@pytest.fixture
def heard() -> list[tuple[str, bytes]]:
    return []


@pytest.fixture
def watcher(heard: list[tuple[str, bytes]]) -> Member:
    return Member(
        trust_of("eye", 9, watches=True),
        clock=lambda: 0.0,
        neighbours=("f1", "f2"),
        receive_neighbour=lambda vehicle, data: heard.append((vehicle, data)),
        receive_presence=lambda _vehicle, _presence: None,
    )


def look(mail: HeldMail, watcher: Member) -> None:
    for newest_first in mail.take():
        watcher.take_newest(newest_first)


def test_of_each_sender_the_newest_is_looked_at_alone(watcher, heard):
    mail, first, second = HeldMail(), trust_of("f1", 1), trust_of("f2", 2)
    for number in range(4):
        assert mail.put(state(first, b"f1 %d" % number))
        assert mail.put(state(second, b"f2 %d" % number))
    look(mail, watcher)
    assert heard == [("f1", b"f1 3"), ("f2", b"f2 3")]
    look(mail, watcher)
    assert len(heard) == 2


def test_a_forged_state_does_not_stand_before_a_true_one(watcher, heard):
    mail, trust = HeldMail(), trust_of("f1", 1)
    mail.put(state(trust, b"true"))
    mail.put(forged(state(trust, b"another")))
    look(mail, watcher)
    assert heard == [("f1", b"true")]
    assert watcher.counters["refused: forged"] == 1


def test_a_repeated_old_state_does_not_stand_before_a_new_one(watcher, heard):
    mail, trust = HeldMail(), trust_of("f1", 1)
    old, new = state(trust, b"old"), state(trust, b"new")
    mail.put(old)
    look(mail, watcher)
    mail.put(new)
    mail.put(old)
    look(mail, watcher)
    assert heard == [("f1", b"old"), ("f1", b"new")]


def test_what_is_no_state_is_not_held():
    mail, trust = HeldMail(), trust_of("f1", 1)
    for data in (b"", b"VFE1", b"x" * 200, trust.seal(Kind.PRESENCE, b"", time_s=0.0)):
        assert not mail.put(data)
    assert len(mail) == 0


def test_a_flood_of_names_or_of_one_is_bounded():
    mail, sealed = HeldMail(), state(trust_of("f1", 1), b"")
    for number in range(MOST_SENDERS + 50):
        name = b"%02x" % (number % 256)
        assert mail.put(sealed.replace(b"f1", name, 1)) is (number < MOST_SENDERS)
    for _ in range(MOST_HELD + 50):
        mail.put(sealed)
    assert len(mail) == MOST_SENDERS
    assert max(len(states) for states in mail.take()) <= MOST_HELD + 1
