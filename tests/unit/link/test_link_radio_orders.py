"""Messages about orders in pieces: what a radio's packets have room for, and what becomes of lost ones."""

from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.link.codec import LinkDataError
from vfguide.link.envelope import Kind
from vfguide.link.order_codec import Reply, Verdict, encode_reply
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
