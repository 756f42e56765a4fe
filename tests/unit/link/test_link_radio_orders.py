"""Orders over a shared radio: in pieces, heard by all, answered, repeated, an operator's alone."""

from itertools import chain
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.link import KEYS
from tests.unit.link.radio_crafts import CHANNEL, NAMES, Craft, Shared, formation
from vfguide.lab.rehearsal.emulated_radio import RadioQuality
from vfguide.link.codec import Kind, LinkDataError
from vfguide.link.order_codec import Reply, Verdict, decode_reply, encode_reply
from vfguide.link.packed import PIECE_SIZE, PackedKind, Piece
from vfguide.link.radio_orders import (
    FORGET_S,
    MOST_PIECES,
    MOST_WAITING,
    ROUNDS,
    OrderInbox,
    OrderOutbox,
    pieces_of,
)

CONTENTS = st.binary(min_size=1, max_size=MOST_PIECES * PIECE_SIZE)


def ready(number: int, verdict: Verdict = Verdict.READY) -> bytes:
    return encode_reply(Reply(number=number, verdict=verdict, check=3))


def said(outbox: OrderOutbox, now: float, turns: int) -> list[tuple[PackedKind, Piece]]:
    found = (outbox.next_piece(now) for _ in range(turns))
    return [one for one in found if one is not None]


@given(CONTENTS, st.randoms(use_true_random=False))
def test_a_message_is_whole_whatever_the_order_of_its_pieces(content, random):
    pieces = list(pieces_of(content))
    random.shuffle(pieces)  # type: ignore[attr-defined]
    inbox = OrderInbox()
    found = [inbox.take(255, PackedKind.ORDER, piece) for piece in chain(pieces[:-1], pieces)]
    whole = [one for one in found if one is not None]
    assert whole[0] == content
    assert found.index(content) >= len(pieces) - 1


def test_pieces_are_these_bytes():
    """57 bytes are two full pieces and one byte, with 27 zeros behind it."""
    first, second, third = pieces_of(bytes(range(57)))
    assert (first.index, second.index, third.index) == (0, 1, 2)
    assert {first.size, second.size, third.size} == {57}
    assert first.data == bytes(range(28))
    assert third.data == bytes([56]) + bytes(27)


@pytest.mark.parametrize("size", [0, MOST_PIECES * PIECE_SIZE + 1])
def test_what_is_empty_or_too_long_has_no_pieces(size):
    with pytest.raises(ValueError, match="do not fit onto a radio"):
        pieces_of(bytes(size))


@given(
    st.lists(
        st.builds(
            Piece,
            mark=st.integers(0, 2),
            index=st.integers(0, 255),
            size=st.integers(1, 65535),
            data=st.binary(min_size=28, max_size=28),
        ),
        max_size=60,
    )
)
def test_whatever_pieces_come_nothing_is_whole_that_was_not_cut_and_nothing_grows(pieces):
    inbox = OrderInbox()
    for piece in pieces:
        if piece.index * PIECE_SIZE >= piece.size:
            # Such a piece is no packet.
            continue
        try:
            found = inbox.take(1, PackedKind.REPLY, piece)
        except LinkDataError:
            continue
        assert found is None or piece in pieces_of(found)
    assert sum(len(partial.parts) for partial in inbox) <= MOST_PIECES


def test_pieces_of_two_messages_never_become_one():
    inbox = OrderInbox()
    one, other = pieces_of(b"a" * 40), pieces_of(b"b" * 40)
    assert inbox.take(1, PackedKind.ORDER, one[0]) is None
    assert inbox.take(1, PackedKind.ORDER, other[1]) is None
    # The newer message has taken the place of the one before.
    assert inbox.take(1, PackedKind.ORDER, other[0]) == b"b" * 40
    forged = Piece(mark=one[1].mark, index=1, size=40, data=other[1].data)
    assert inbox.take(1, PackedKind.ORDER, one[0]) is None
    with pytest.raises(LinkDataError, match="two messages"):
        inbox.take(1, PackedKind.ORDER, forged)


def test_an_answer_is_said_three_times_and_an_order_as_long_as_its_operator_gives_it():
    outbox = OrderOutbox()
    outbox.post(Kind.REPLY, ready(1), ready(1), 0.0)
    assert len(said(outbox, 0.0, 20)) == ROUNDS
    outbox.post(Kind.ORDER, b"order", b"first envelope" * 4, 10.0)
    outbox.post(Kind.ORDER, b"order", b"second envelope" * 4, 11.0)
    found = said(outbox, 12.0, 20)
    assert len(found) == 20
    # Pieces of two envelopes would never become a whole.
    assert {piece for _, piece in found} == set(pieces_of(b"first envelope" * 4))
    assert not said(outbox, 11.0 + FORGET_S + 0.01, 20)


def test_a_newer_answer_takes_the_place_of_the_one_before_and_no_more_than_a_few_wait():
    outbox = OrderOutbox()
    flown = ready(1, Verdict.FLOWN)
    for now, answer in ((0.0, ready(1)), (0.0, ready(2)), (0.1, flown)):
        outbox.post(Kind.REPLY, answer, answer, now)
    found = {piece for _, piece in said(outbox, 0.1, 20)}
    assert found == {*pieces_of(ready(2)), *pieces_of(flown)}
    for number in range(1, 20):
        outbox.post(Kind.REPLY, ready(number), ready(number), 0.2)
    assert len(said(outbox, 0.2, 100)) == ROUNDS * MOST_WAITING


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
