"""What waits to be sent, what a link in memory does to it, and whose orders are believed."""

import asyncio
from collections import Counter
from itertools import pairwise

import pytest
from aiomqtt import Message

from tests.kit.link import LEADER, Station, Wire, trust_of
from vfguide.link.client import MOST_TOPICS, Echo, Inbox, NewestOnly
from vfguide.link.codec import Kind
from vfguide.link.memory import LinkQuality, MemoryLink
from vfguide.link.mqtt import Topics
from vfguide.link.trust import RefusedError
from vfguide.system import retry_delay

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


def test_two_checks_without_an_echo_make_the_broker_deaf_until_one_comes_back():
    echo, found = Echo(), []
    echo.listen()
    for number in range(3):
        echo.speak(b"%d" % number)
        found.append(echo.check())
    assert found == [False, True, True]
    assert not echo.hear(b"of somebody else")
    assert not echo.heard
    assert echo.hear(b"1")
    assert echo.heard
    assert not echo.check()
    echo.listen()
    assert not echo.heard
    # Nor is it deaf to someone who says nothing.
    assert not any(echo.check() for _ in range(5))


def link_of(*, seed: str = "seed", **quality: float) -> MemoryLink:
    return MemoryLink(
        LinkQuality(**({"delay_s": 0.0, "jitter_s": 0.0, "loss": 0.0} | quality)), {"f1": seed}
    )


def received(link: MemoryLink, now: float) -> list[bytes]:
    return [data for _, data in link.receive(now)]


def arrivals(link: MemoryLink, count: int, interval_s: float = 10.0) -> dict[int, float]:
    """Time of flight of each message that arrives, to a thousandth of a second, by its number."""
    flights = {}
    for number in range(count):
        sent_s = number * interval_s
        link.send([("f1", number.to_bytes(4, "big"))], sent_s)
        for millisecond in range(1001):
            for data in received(link, sent_s + millisecond * 1e-3):
                flights[int.from_bytes(data, "big")] = millisecond * 1e-3
    return flights


@pytest.mark.parametrize(
    ("delay_s", "sent_s", "before_s", "arrives_s"),
    # 0.1 + 0.2 is a hair more than 0.3.
    [(0.25, 1.0, [1.0, 1.2499], 1.25), (0.0, 1.0, [], 1.0), (0.2, 0.1, [0.1], 0.3)],
)
def test_messages_arrive_once_in_order_after_the_delay_and_not_before(
    delay_s, sent_s, before_s, arrives_s
):
    link = link_of(delay_s=delay_s)
    states = [bytes([number]) for number in range(255, 0, -1)]
    for state in states:
        link.send([("f1", state)], sent_s)
    assert [received(link, now) for now in before_s] == [[]] * len(before_s)
    assert received(link, arrives_s) == states
    assert received(link, 9.0) == []


def test_jitter_stays_within_its_bounds_and_reaches_them():
    flights = list(arrivals(link_of(delay_s=0.3, jitter_s=0.1), 400).values())
    assert len(flights) == 400
    # Read to a millisecond, rounded up.
    assert 0.2 <= min(flights) < 0.205
    assert 0.396 < max(flights) <= 0.401
    assert sum(flights) / 400 == pytest.approx(0.3, abs=0.012)


def test_no_message_arrives_before_it_was_sent():
    link = link_of(delay_s=0.1, jitter_s=0.5)
    for number in range(200):
        link.send([("f1", bytes([number]))], 5.0)
    assert received(link, 4.999) == []
    # A flight of -0.4 to 0.6 s: four tenths of them are at their end at once.
    assert len(received(link, 5.0)) == pytest.approx(80, abs=25)
    assert len(received(link, 5.6)) > 90


@pytest.mark.parametrize(
    ("loss", "arrive", "within"),
    # Five standard deviations: 5 sqrt(0.3 * 0.7 * 10000) = 229.
    [(0.3, 7000, 229), (0.0, 10_000, 0), (1.0, 0, 0)],
)
def test_the_share_that_is_lost_is_the_one_that_was_asked_for(loss, arrive, within):
    link = link_of(loss=loss)
    for number in range(10_000):
        link.send([("f1", b"state")], float(number))
    assert len(received(link, 1e5)) == pytest.approx(arrive, abs=within)


def test_messages_that_overtake_each_other_come_in_the_order_of_arrival():
    flights = arrivals(link_of(delay_s=0.5, jitter_s=0.4), 60)
    link = link_of(delay_s=0.5, jitter_s=0.4)
    for number in range(60):
        link.send([("f1", number.to_bytes(4, "big"))], number * 0.05)
    order = [int.from_bytes(data, "big") for data in received(link, 100.0)]
    assert sorted(order) == list(range(60))
    assert order != sorted(order)
    times = [number * 0.05 + flights[number] for number in order]
    assert all(later - earlier > -2e-3 for earlier, later in pairwise(times))


def test_a_seed_repeats_flights_whatever_else_is_lost_and_another_seed_does_not():
    lossless, other, lossy = (
        arrivals(link_of(delay_s=0.3, jitter_s=0.2, loss=loss, seed=seed), 100)
        for loss, seed in ((0.0, "1 f1"), (0.0, "1 f2"), (0.5, "1 f1"))
    )
    assert lossless != other
    assert 25 < len(lossy) < 75
    assert all(lossless[number] == flight for number, flight in lossy.items())


def test_what_happens_to_one_senders_messages_does_not_depend_on_the_others():
    quality = LinkQuality(delay_s=0.3, jitter_s=0.2, loss=0.5)
    alone, among = (MemoryLink(quality, {"f1": "1", "f2": "2"}) for _ in range(2))
    for number in range(100):
        mail = ("f1", bytes([number]))
        alone.send([mail], float(number))
        among.send([("stranger", b"?"), ("f2", b"state"), mail], float(number))
    heard = among.receive(1e3)
    assert {name for name, _ in heard} == {"f1", "f2"}
    assert [one for one in heard if one[0] == "f1"] == alone.receive(1e3)


@pytest.fixture
def wire() -> Wire:
    """A leader, two followers and an operator, who all know that the leader lives."""
    wire = Wire()
    for number, name in enumerate((LEADER, "f1", "f2", "eye"), 1):
        wire.station(name, session=number)
    for one in wire.stations[1:]:
        one.member.ask()
    wire.run(0.1)
    return wire


def say(wire: Wire, station: Station, kind: Kind, body: bytes) -> bytes:
    """Say something that everybody hears; return its envelope."""
    envelope = station.member.say(kind, body).data
    wire.run(0.1)
    return envelope


def test_an_operators_order_reaches_everybody_with_its_envelope(wire):
    *vehicles, operator = wire.stations
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    for one in vehicles:
        assert one.orders == [(b"vee", envelope, False)]


def test_a_vehicle_may_not_order(wire):
    leader, one, other, _ = wire.stations
    say(wire, one, Kind.ORDER, b"trail")
    assert other.orders == leader.orders == []
    assert other.counters["refused: not for its sender to say"] == 1


def test_an_answer_reaches_the_leader_and_the_operator(wire):
    leader, _, other, operator = wire.stations
    say(wire, other, Kind.REPLY, b"yes")
    assert leader.replies == operator.replies == [("f2", b"yes")]


def test_an_order_is_not_heard_twice_but_may_be_repeated_by_a_vehicle(wire):
    _, one, other, operator = wire.stations
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    other.member.take(envelope)
    assert len(other.orders) == 1
    say(wire, one, Kind.REPEAT, envelope)
    assert other.orders == [(b"vee", envelope, False), (b"vee", envelope, True)]


def test_what_a_vehicle_repeats_has_to_be_an_operators(wire):
    _, one, other, operator = wire.stations
    own = one.member.trust.seal(Kind.ORDER, b"trail", time_s=0.0)
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    changed = envelope.replace(b"vee", b"vex")
    state = operator.member.trust.seal(Kind.REPLY, b"vee", time_s=0.0)
    for data in (own, changed, state, b"", b"noise"):
        say(wire, one, Kind.REPEAT, data)
    assert other.orders == [(b"vee", envelope, False)]
    assert other.counters["refused: a forged order"] == 1
    assert other.counters["refused: not an operator's order"] == 2
    assert other.counters["refused: malformed"] == 2


def test_an_order_of_another_flight_needs_two_members_that_have_met_it(wire):
    envelope = say(wire, wire.stations[-1], Kind.ORDER, b"vee")
    later = trust_of("f2", 99)
    with pytest.raises(RefusedError, match="another flight"):
        later.believe(later.read(envelope), 0.0)
    for speaker in ("f1", "f1"):
        with pytest.raises(RefusedError, match="an order of another flight"):
            later.vouch(envelope, speaker)
    # As of a leader that was started anew since: those who have flown by it tell of it.
    assert later.vouch(envelope, LEADER).body == b"vee"


def test_an_order_of_this_flight_is_vouched_for_by_one_also_after_the_leader_was_started_anew(wire):
    *_, other, operator = wire.stations
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    other.member.trust.prove(55, 100.0)
    assert other.member.trust.vouch(envelope, "f1").body == b"vee"
