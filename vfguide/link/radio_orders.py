"""What waits for a turn on a radio: questions for the clock, and orders in pieces that fit into packets.

Questions for the leader's clock on a radio: they wait for a turn, and so do their answers. Nothing here
reads a clock: a member's own is `clock_s`, that of the turns is `now`.

Orders and what is said to them, in pieces that fit into the packets of a radio. A message about orders is
cut into pieces of 28 bytes: an operator's order in its envelope, as signed as on every link, an answer to
one, and an order that a vehicle repeats. A sender says the pieces one after the other, a turn each, and
begins again with the first: what a receiver has missed it hears in the next round. A receiver hands a
message on once it has all pieces, and their hash is the one that every piece names; before that nothing
comes of it. Each sender has one message of each kind on its way, a newer one takes its place.

Nothing here reads a clock.
"""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from vfguide.link.codec import Ask, Kind, LinkDataError, Tell, decode_ask
from vfguide.link.order_codec import decode_reply
from vfguide.link.packed import PIECE_SIZE, TICK_S, PackedKind, Packet, Piece
from vfguide.link.peer_clock import OPEN

ANSWERABLE_S = 1.5
"""A question that has waited for so long is not answered: its asker has asked again."""

MOST_PIECES = 24
"""Pieces of one message, at most: 672 bytes, a signed order to 11 followers with names of 18 characters."""

ROUNDS = 3
"""Times that all pieces of an answer, or of an order that is repeated, are said: nobody acknowledges them."""

FORGET_S = 2.0
"""An operator who has not given an order again for this long does not want it to be said any more."""

MOST_WAITING = 4
"""Messages that wait for their turns: one more, and the oldest is forgotten."""

PACKED_KINDS = {
    Kind.ORDER: PackedKind.ORDER,
    Kind.REPLY: PackedKind.REPLY,
    Kind.REPEAT: PackedKind.REPEAT,
    Kind.REVOCATION: PackedKind.REVOCATION,
}
"""Kinds of messages that are said in pieces."""


class Questions:
    """What one member asks, and what it is asked."""

    def __init__(self) -> None:
        """Ask nothing."""
        self._waiting: bytes | None = None
        self.asked_s = -math.inf
        """When the last question was asked, on the clock of the turns."""
        self._open: dict[int, tuple[float, float]] = {}
        self._heard: dict[int, tuple[int, float]] = {}
        self._answered_s: dict[int, float] = {}

    def post(self, question: bytes) -> None:
        """Have a question asked, in the place of the one before it."""
        self._waiting = question

    def ask(self, clock_s: float, now: float) -> Ask | None:
        """The question that is asked now; None where none waits."""
        if self._waiting is None:
            return None
        ask = decode_ask(self._waiting)
        self._waiting, self.asked_s = None, now
        self._open[ask.number] = ask.originate_s, clock_s - ask.originate_s
        while len(self._open) > OPEN:
            del self._open[next(iter(self._open))]
        return ask

    def answer_to(self, packet: Packet) -> Tell | None:
        """What a packet answers, as if the question had been heard when it was made; None to none."""
        asked = self._open.pop(packet.number, None)
        if asked is None:
            return None
        originate_s, waited_s = asked
        return Tell(
            number=packet.number,
            originate_s=originate_s,
            receive_s=packet.received * TICK_S - waited_s,
            transmit_s=packet.ticks * TICK_S,
        )

    def hear(self, asker: int, number: int, clock_s: float) -> None:
        """Keep a question of another member for a turn in which it can be answered."""
        self._heard[asker] = number, clock_s

    def next_to_answer(self, clock_s: float, now: float) -> tuple[int, int, float] | None:
        """(whom to answer, the question's number, when it was heard on the member's clock).

        It is the one who was not answered for the longest; None where nobody asks.
        """
        self._heard = {
            asker: (number, received_s)
            for asker, (number, received_s) in self._heard.items()
            if clock_s - received_s < ANSWERABLE_S
        }
        if not self._heard:
            return None
        asker = min(self._heard, key=lambda one: self._answered_s.get(one, -math.inf))
        self._answered_s[asker] = now
        return asker, *self._heard.pop(asker)


def mark_of(content: bytes) -> int:
    """What the pieces of a message name it by: 16 bits of its hash."""
    return int.from_bytes(hashlib.blake2b(content, digest_size=2).digest(), "little")


def pieces_of(content: bytes) -> tuple[Piece, ...]:
    """The pieces of a message, in order.

    Raises:
        ValueError: it is too long, or empty.
    """
    count = math.ceil(len(content) / PIECE_SIZE)
    if not 0 < count <= MOST_PIECES:
        raise ValueError(f"{len(content)} bytes about an order do not fit onto a radio")
    mark = mark_of(content)
    parts = (content[index * PIECE_SIZE :][:PIECE_SIZE] for index in range(count))
    return tuple(
        Piece(mark, index, len(content), part.ljust(PIECE_SIZE, b"\0"))
        for index, part in enumerate(parts)
    )


@dataclass(slots=True, kw_only=True)
class OutgoingMessage:
    """A message on its way out."""

    kind: PackedKind
    """What it is about."""
    body: bytes
    """What was to be said: the same again is the same message, whatever envelope it comes in."""
    pieces: tuple[Piece, ...]
    """Pieces of the message."""
    posted_s: float
    """When it was to be said last, s."""
    said: int = 0
    """Pieces that were said, of all rounds."""


class OrderOutbox:
    """What one member has to say about orders."""

    def __init__(self) -> None:
        """Begin with nothing to say."""
        self._waiting: dict[tuple[object, ...], OutgoingMessage] = {}

    def post(self, kind: Kind, body: bytes, content: bytes, now: float) -> None:
        """Say this from now on; what was said about the same order before is over.

        Args:
            kind: ORDER, REPLY, REPEAT or REVOCATION.
            body: what is said.
            content: how it is said: what an operator has signed in its envelope, else the body.
            now: on the clock of the turns, s.

        Raises:
            ValueError: it is too long.
        """
        about = about_of(kind, body)
        before = self._waiting.get(about)
        if before is not None and before.body == body:
            # Pieces of two envelopes would never become a whole.
            before.posted_s = now
            before.said %= len(before.pieces)
            return
        self._waiting.pop(about, None)
        self._waiting[about] = OutgoingMessage(
            kind=PACKED_KINDS[kind], body=body, pieces=pieces_of(content), posted_s=now
        )
        while len(self._waiting) > MOST_WAITING:
            del self._waiting[next(iter(self._waiting))]

    def next_piece(self, now: float) -> tuple[PackedKind, Piece] | None:
        """The piece to say in this turn; None where there is none."""
        for about, one in list(self._waiting.items()):
            if self._is_over(one, now):
                del self._waiting[about]
        for about, one in self._waiting.items():
            piece = one.pieces[one.said % len(one.pieces)]
            one.said += 1
            if one.said % len(one.pieces) == 0:
                # Whatever else waits has the next round.
                del self._waiting[about]
                self._waiting[about] = one
            return one.kind, piece
        return None

    @staticmethod
    def _is_over(one: OutgoingMessage, now: float) -> bool:
        if one.kind is PackedKind.ORDER:
            return now - one.posted_s > FORGET_S
        return one.said >= ROUNDS * len(one.pieces)


def about_of(kind: Kind, body: bytes) -> tuple[object, ...]:
    """What of one sender takes the place of what it has said before: an answer to the same order, say."""
    if kind is Kind.REPLY:
        try:
            reply = decode_reply(body)
        except LinkDataError:
            return (kind,)
        return kind, reply.number, reply.check
    return (kind, body) if kind is Kind.REVOCATION else (kind,)


@dataclass(slots=True, kw_only=True)
class PartialMessage:
    """A message of which some pieces have come."""

    mark: int
    """Mark of the message."""
    size: int
    """Bytes of the whole message."""
    parts: dict[int, bytes] = field(default_factory=dict)
    """By the numbers of the pieces."""


class OrderInbox:
    """What is on its way to one member, of all senders."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._partial: dict[tuple[int, PackedKind], PartialMessage] = {}

    def take(self, sender: int, kind: PackedKind, piece: Piece) -> bytes | None:
        """Take a piece; the whole message if it was the last that was missing.

        Raises:
            LinkDataError: the message is too long, or not the one that its pieces named.
        """
        count = math.ceil(piece.size / PIECE_SIZE)
        if count > MOST_PIECES:
            raise LinkDataError("longer than anything about an order")
        about = sender, kind
        partial = self._partial.get(about)
        if partial is None or (partial.mark, partial.size) != (piece.mark, piece.size):
            partial = self._partial[about] = PartialMessage(mark=piece.mark, size=piece.size)
        partial.parts[piece.index] = piece.data
        if len(partial.parts) < count:
            return None
        del self._partial[about]
        content = b"".join(partial.parts[index] for index in range(count))[: piece.size]
        if mark_of(content) != piece.mark:
            raise LinkDataError("pieces of two messages")
        return content

    def __iter__(self) -> Iterator[PartialMessage]:
        """The messages of which some pieces have come."""
        return iter(self._partial.values())
