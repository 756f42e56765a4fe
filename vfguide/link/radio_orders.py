"""Messages that wait for a turn on a radio: clock questions, and orders in pieces that fit into packets.

Questions for the leader's clock wait for a turn, and so do their answers. A member's own clock is `clock_s`,
the clock of the turns is `now`; nothing here reads a clock.

Orders in their signed envelopes, replies, repeated orders and revocations are cut into pieces of 28 bytes. A
sender sends the pieces one per turn and then begins again, so that a receiver hears in the next round what it
has missed. A receiver hands a message on once it has all pieces and their hash is the one that every piece
names. Each sender has one message of each kind under way, which a newer one replaces.
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
"""Age at which a question is no longer answered, s: its asker has asked again."""

MOST_PIECES = 24
"""Maximum number of pieces of a message: 672 bytes, a signed order to 11 followers with 18-letter names."""

ROUNDS = 3
"""Rounds in which a reply or a repeated order is sent, since nobody acknowledges pieces."""

FORGET_S = 2.0
"""Time without a renewed order after which it is no longer sent, s."""

MOST_WAITING = 4
"""Maximum number of messages that wait for turns; beyond it the oldest is dropped."""

PACKED_KINDS = {
    Kind.ORDER: PackedKind.ORDER,
    Kind.REPLY: PackedKind.REPLY,
    Kind.REPEAT: PackedKind.REPEAT,
    Kind.REVOCATION: PackedKind.REVOCATION,
}
"""Kinds of messages that are sent in pieces."""


class Questions:
    """Clock questions that one member asks and receives."""

    def __init__(self) -> None:
        """Create it without any question."""
        self._waiting: bytes | None = None
        self.asked_s = -math.inf
        """Time of the latest question, s on the clock of the turns."""
        self._open: dict[int, tuple[float, float]] = {}
        self._heard: dict[int, tuple[int, float]] = {}
        self._answered_s: dict[int, float] = {}

    def post(self, question: bytes) -> None:
        """Queue a question, replacing the one before it."""
        self._waiting = question

    def ask(self, clock_s: float, now: float) -> Ask | None:
        """Return the question to ask now; None where none waits."""
        if self._waiting is None:
            return None
        ask = decode_ask(self._waiting)
        self._waiting, self.asked_s = None, now
        self._open[ask.number] = ask.originate_s, clock_s - ask.originate_s
        while len(self._open) > OPEN:
            del self._open[next(iter(self._open))]
        return ask

    def answer_to(self, packet: Packet) -> Tell | None:
        """Return an answer as if its question had arrived when made; None where it was not asked for."""
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
        """Keep another member's question for a turn in which it can be answered."""
        self._heard[asker] = number, clock_s

    def next_to_answer(self, clock_s: float, now: float) -> tuple[int, int, float] | None:
        """Return (asker, number of its question, member's clock when it was heard); None if nobody asks.

        It is the asker that has waited longest for an answer.
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
    """Return 16 bits of a message's hash, by which its pieces name it."""
    return int.from_bytes(hashlib.blake2b(content, digest_size=2).digest(), "little")


def pieces_of(content: bytes) -> tuple[Piece, ...]:
    """Cut a message into pieces, in order; raise ValueError if it is too long, or empty."""
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
    """Message on its way out."""

    kind: PackedKind
    body: bytes
    """Content: the same content again is the same message, whatever its envelope."""
    pieces: tuple[Piece, ...]
    posted_s: float
    """Time of the latest request to send it, s."""
    said: int = 0
    """Number of pieces sent, in all rounds."""


class OrderOutbox:
    """One member's outgoing messages about orders."""

    def __init__(self) -> None:
        """Create an empty outbox."""
        self._waiting: dict[tuple[object, ...], OutgoingMessage] = {}

    def post(self, kind: Kind, body: bytes, content: bytes, now: float) -> None:
        """Send this message from now on, and stop sending the one that it replaces.

        Args:
            kind: ORDER, REPLY, REPEAT or REVOCATION.
            body: content of the message.
            content: bytes to send: an operator's signed envelope, otherwise the body.
            now: present time on the clock of the turns, s.

        Raises:
            ValueError: it is too long.
        """
        about = about_of(kind, body)
        before = self._waiting.get(about)
        if before is not None and before.body == body:
            # Pieces of two envelopes would never make a whole.
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
        """Return the piece to send in this turn; None where there is none."""
        for about, one in list(self._waiting.items()):
            if self._is_over(one, now):
                del self._waiting[about]
        for about, one in self._waiting.items():
            piece = one.pieces[one.said % len(one.pieces)]
            one.said += 1
            if one.said % len(one.pieces) == 0:
                # The next round belongs to whatever else waits.
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
    """Return a key: a sender's new message replaces its earlier one with the same key."""
    if kind is Kind.REPLY:
        try:
            reply = decode_reply(body)
        except LinkDataError:
            return (kind,)
        return kind, reply.number, reply.check
    return (kind, body) if kind is Kind.REVOCATION else (kind,)


@dataclass(slots=True, kw_only=True)
class PartialMessage:
    """Message of which some pieces have arrived."""

    mark: int
    size: int
    """Size of the whole message, bytes."""
    parts: dict[int, bytes] = field(default_factory=dict)
    """Received bytes by number of the piece."""


class OrderInbox:
    """Incoming messages about orders, from all senders."""

    def __init__(self) -> None:
        """Create an empty inbox."""
        self._partial: dict[tuple[int, PackedKind], PartialMessage] = {}

    def take(self, sender: int, kind: PackedKind, piece: Piece) -> bytes | None:
        """Take a piece; return the whole message once it is complete.

        Raises:
            LinkDataError: the message is too long, or its pieces are of two messages.
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
        """Iterate over the incomplete messages."""
        return iter(self._partial.values())
