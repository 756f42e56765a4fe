"""Orders over a shared radio: heard by all, answered, repeated, and given by an operator alone."""

from random import Random

import pytest

from tests.kit.link import KEYS
from tests.unit.link.radio_crafts import CHANNEL, NAMES, Craft, Shared, formation
from vfguide.lab.rehearsal.emulated_radio import RadioQuality
from vfguide.link.envelope import Kind
from vfguide.link.order_codec import Reply, Verdict, decode_reply, encode_reply


def ordering(quality: RadioQuality | None = None) -> tuple[Shared, Craft, list[Craft]]:
    """A formation that flies, and an operator who has joined it late."""
    channel, *vehicles = formation(5.0, quality)
    operator = channel.craft("eye", session=9, orders=True, offset_s=333.0)
    channel.fly(4.0)
    assert operator.peer_clock.offset_s == pytest.approx(667.0, abs=0.002)
    return channel, operator, vehicles


def insist(channel: Shared, operator: Craft, body: bytes, seconds: float) -> None:
    """Give an order again and again, as operators do, for some seconds."""
    for _ in range(round(2 * seconds)):
        operator.member.say(Kind.ORDER, body)
        channel.fly(0.5)


def test_an_operator_joins_late_and_its_order_is_heard_by_all_and_answered():
    """300 bytes and an envelope of 111: 15 pieces, of which an operator says 12.5 in a second."""
    channel, operator, vehicles = ordering()
    body = Random(3).randbytes(300)
    insist(channel, operator, body, 3.0)
    for one in vehicles:
        assert one.orders[0] == (body, False)
        # Said on and on, in one envelope: once is enough.
        assert len(one.orders) == 1
        one.member.say(Kind.REPLY, encode_reply(Reply(number=7, verdict=Verdict.READY, check=9)))
    channel.fly(3.0)
    for hearer in (operator, *vehicles):
        said = {(name, decode_reply(data).number) for name, data in hearer.replies}
        assert said == {(one.name, 7) for one in vehicles if one is not hearer}
    assert channel.air.counters["in collisions"] == 0
    assert not operator.presences or set(operator.presences) <= set(NAMES)
    # States go on meanwhile, every second turn at least.
    assert all(one.counters["refused: not for its sender to say"] == 0 for one in vehicles)


def test_lost_pieces_of_an_order_are_heard_in_a_later_round():
    channel, operator, vehicles = ordering(RadioQuality(channel=CHANNEL, loss=0.3))
    body = Random(3).randbytes(300)
    insist(channel, operator, body, 2.0)
    assert not all(one.orders for one in vehicles)
    insist(channel, operator, body, 20.0)
    assert all(one.orders == [(body, False)] for one in vehicles)


def test_an_order_whose_last_piece_never_comes_is_heard_by_nobody():
    channel, operator, vehicles = ordering()
    operator.member.say(Kind.ORDER, Random(3).randbytes(300))
    # Fifteen pieces at five turns in each cycle of 0.4 s take 1.2 s; the operator falls silent before.
    channel.fly(0.8)
    channel.gone(operator)
    channel.fly(5.0)
    assert not any(one.orders for one in vehicles)
    partial = [part for one in vehicles for part in one.station._ordered]  # noqa: SLF001
    assert len(partial) == 3
    assert all(1 < len(part.parts) < 15 for part in partial)


def test_a_vehicle_repeats_an_order_as_its_operator_has_signed_it():
    channel, operator, (_, one, other) = ordering()
    insist(channel, operator, b"an order", 2.0)
    channel.gone(operator)
    channel.fly(3.0)
    other.orders.clear()
    one.member.say(Kind.REPEAT, one.sealed)
    channel.fly(8.0)
    assert other.orders
    assert set(other.orders) == {(b"an order", True)}
    changed = bytes([*one.sealed[:-1], one.sealed[-1] ^ 1])
    other.orders.clear()
    one.member.say(Kind.REPEAT, changed)
    channel.fly(8.0)
    assert not other.orders
    assert other.counters["refused: a forged order"] > 0


def test_whoever_has_the_radio_key_alone_cannot_order():
    """The tags of the pieces are right, the signature is that of a vehicle."""
    channel, operator, vehicles = ordering()
    operator.member.trust._key = KEYS["f2"]  # noqa: SLF001 - as one who has stolen the radio key
    insist(channel, operator, b"an order", 4.0)
    assert not any(one.orders for one in vehicles)
    assert all(one.counters["refused: forged"] > 0 for one in vehicles)


def test_an_order_that_is_too_long_for_a_radio_is_counted_and_not_sent():
    channel, operator, vehicles = ordering()
    insist(channel, operator, bytes(700), 2.0)
    assert operator.counters["radio: too long for its pieces"] == 4
    assert not any(one.orders for one in vehicles)
