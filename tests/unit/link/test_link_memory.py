from itertools import pairwise

import pytest

from vfguide.link.memory import LinkQuality, Mail, MemoryLink


def link_of(
    *, delay_s: float = 0.0, jitter_s: float = 0.0, loss: float = 0.0, seed: str = "seed"
) -> MemoryLink:
    return MemoryLink(LinkQuality(delay_s=delay_s, jitter_s=jitter_s, loss=loss), {"f1": seed})


def sent(data: bytes) -> list[Mail]:
    return [("f1", data)]


def received(link: MemoryLink, now: float) -> list[bytes]:
    return [data for _, data in link.receive(now)]


def arrivals(link: MemoryLink, count: int, interval_s: float = 10.0) -> dict[int, float]:
    """Time of flight of each message that arrives, to a thousandth of a second, by its number."""
    flights = {}
    for number in range(count):
        sent_s = number * interval_s
        link.send(sent(number.to_bytes(4, "big")), sent_s)
        for millisecond in range(1001):
            for data in received(link, sent_s + millisecond * 1e-3):
                flights[int.from_bytes(data, "big")] = millisecond * 1e-3
    return flights


@pytest.mark.parametrize(
    ("delay_s", "sent_s", "before_s", "arrives_s"),
    [
        (0.25, 1.0, [1.0, 1.2499], 1.25),
        (0.0, 1.0, [], 1.0),
        # 0.1 + 0.2 is a hair more than 0.3.
        (0.2, 0.1, [0.1], 0.3),
    ],
)
def test_a_message_arrives_once_after_the_delay_and_not_before(
    delay_s, sent_s, before_s, arrives_s
):
    link = link_of(delay_s=delay_s)
    link.send(sent(b"state"), sent_s)
    assert [received(link, now) for now in before_s] == [[]] * len(before_s)
    assert received(link, arrives_s) == [b"state"]
    assert received(link, 9.0) == []


def test_messages_sent_at_the_same_time_keep_their_order():
    link = link_of(delay_s=0.1)
    states = [bytes([number]) for number in range(255, 0, -1)]
    for state in states:
        link.send(sent(state), 1.0)
    assert received(link, 2.0) == states


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
        link.send(sent(bytes([number])), 5.0)
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
        link.send(sent(b"state"), float(number))
    assert len(received(link, 1e5)) == pytest.approx(arrive, abs=within)


def test_messages_that_overtake_each_other_come_in_the_order_of_arrival():
    flights = arrivals(link_of(delay_s=0.5, jitter_s=0.4), 60)
    link = link_of(delay_s=0.5, jitter_s=0.4)
    for number in range(60):
        link.send(sent(number.to_bytes(4, "big")), number * 0.05)
    order = [int.from_bytes(data, "big") for data in received(link, 100.0)]
    assert sorted(order) == list(range(60))
    assert order != sorted(order)
    times = [number * 0.05 + flights[number] for number in order]
    assert all(later - earlier > -2e-3 for earlier, later in pairwise(times))


def test_losses_do_not_change_the_flight_of_what_gets_through():
    lossless = arrivals(link_of(delay_s=0.3, jitter_s=0.2), 100)
    lossy = arrivals(link_of(delay_s=0.3, jitter_s=0.2, loss=0.5), 100)
    assert 25 < len(lossy) < 75
    assert all(lossless[number] == flight for number, flight in lossy.items())


def test_the_same_seed_repeats_a_link_and_another_does_not():
    first, again, other = (
        arrivals(link_of(delay_s=0.3, jitter_s=0.2, loss=0.2, seed=seed), 60)
        for seed in ("1 f1", "1 f1", "1 f2")
    )
    assert first == again
    assert first != other


def test_what_is_sent_at_once_arrives_at_once_and_from_those_who_are_listened_to():
    link = MemoryLink(LinkQuality(delay_s=0.1, jitter_s=0.0, loss=0.0), {"f1": "1", "f2": "2"})
    link.send([("f1", b"one"), ("stranger", b"?"), ("f2", b"two")], 1.0)
    assert link.receive(1.05) == []
    assert link.receive(1.1) == [("f1", b"one"), ("f2", b"two")]


def test_what_happens_to_one_senders_messages_does_not_depend_on_the_others():
    quality = LinkQuality(delay_s=0.3, jitter_s=0.2, loss=0.5)
    alone, among = (MemoryLink(quality, {"f1": "1", "f2": "2"}) for _ in range(2))
    for number in range(100):
        mail = ("f1", bytes([number]))
        alone.send([mail], float(number))
        among.send([("f2", b"state"), mail], float(number))
    assert [one for one in among.receive(1e3) if one[0] == "f1"] == alone.receive(1e3)
