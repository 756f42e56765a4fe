"""One member on a radio that all share: bytes from the radio in, a packet for each of its own turns out.

Of each kind only the newest waits: a state that has not been sent gives way to the next, and one that is a
second old is not sent at all. At its turn a follower sends its question if it has one and did not ask
lately, else now and then its presence, else its state. The leader sends its state at each beat, or the beat
alone, and answers one question in a cycle: of those that wait, the one whose asker was answered longest ago.

Stamps of the clock comparison leave the waiting for turns out: the answer is stamped when it leaves, and the
asker takes the question's arrival for as much earlier as the question had waited for its turn.

What was in a collision, or lost otherwise, is not sent again; what is said about orders is said in rounds.
It takes every second turn of a follower at most, so that its states go on. An operator has turns of its own,
and says nothing else but its question for the leader's clock.

A beat counts if its tag is right. After two seconds without one, a beat counts whose tag cannot be checked:
a member that starts, or whose leader has started anew, has to ask in its turn. The worst that a forged beat
can do is what every transmitter can do, too: a collision. The leader asks whether its sender lives, soon once
in 5 s; one that starts waits for 5 s at most.

Nothing here owns a port or reads a clock but the member's, for stamps.
"""

import hmac
import math
from collections import deque

from msgspec.structs import astuple

from vfguide.link.codec import (
    Ask,
    Envelope,
    Kind,
    LinkDataError,
    Scheme,
    decode,
    encode,
    encode_ask,
    encode_tell,
)
from vfguide.link.member import Member, Parcel
from vfguide.link.packed import (
    ANSWER,
    BEAT_ALONE,
    PIECE,
    QUESTION,
    TICK_S,
    BeatInfo,
    PackedKind,
    Packet,
    decode_packet,
    encode_beat,
    encode_motion,
    encode_packed_presence,
    encode_packet,
    formation_key,
    formation_mark,
    state_flags,
    tag_of,
    ticks_of,
)
from vfguide.link.peer_clock import HURRIED_S
from vfguide.link.presence import Presence
from vfguide.link.radio_orders import PACKED_KINDS, OrderInbox, OrderOutbox, Questions
from vfguide.link.radio_schedule import (
    HANDOVER_S,
    LEADER,
    OPERATOR,
    OVERHEAD,
    Beat,
    Channel,
    Framer,
    Timetable,
    Turn,
    encode_frame,
)
from vfguide.link.trust import REVOKED, SAID_PER_S, TWIN, Message, RefusedError

STALE_S = 1.0
"""A state that has waited for so long is not sent."""

HURRIED_CYCLES, CALM_CYCLES = 2, 12
"""From one question of a follower to its next: while its clock is not settled, and later. One that knows no
session of the leader has nothing else to say, and asks in each of its turns."""

ORDER_LEAD_S = 10.0
"""An order is given so long before its time: with twelve vehicles each round of its pieces takes 2 s; where
some are lost all have heard it after three, and answers wait for their turns."""

GREETING_S = 8.0
"""Where much is lost it takes some questions and answers until a companion knows the formation's time,
without which it can say nothing: twelve that begin at once all speak by then."""

PRESENCE_S, IDLE_S = 4.0, 1.0
"""From one presence to the next: where it takes the turn of a state, and where there is none to be sent."""

LEAST_LATE_S = 0.002
"""s that a turn may be taken late, however short the slots are: programs have to wait for the processor."""

REVOKED_REST_S = 30.0
"""A vehicle passes on that a key is out so seldom: three rounds of pieces take every second turn for 10 s."""

PIECES = frozenset(PACKED_KINDS.values())
"""Kinds of packets about orders."""

KINDS = {
    PackedKind.STATE: Kind.STATE,
    PackedKind.BEAT: Kind.STATE,
    PackedKind.QUESTION: Kind.QUESTION,
    PackedKind.ANSWER: Kind.ANSWER,
    PackedKind.PRESENCE: Kind.PRESENCE,
    **{packed: kind for kind, packed in PACKED_KINDS.items()},
}
"""As what each kind of packets is believed."""

OF_NO_SESSION = frozenset({PackedKind.QUESTION, PackedKind.REVOCATION})
"""Kinds that are said under no session of the leader: who knows none hears them."""

UNKNOWN_SESSION = "another session or forged"
"""Why a packet is refused whose tag is not of this session of the leader."""

STEP_TICKS = round(1.0 / (SAID_PER_S * TICK_S))
"""Times are taken for numbers in steps in which no sender says two things."""

OPERATOR_NAME = "the operator"
"""Who answers as one: no vehicle's name has a blank."""

LISTEN_CYCLES, TWIN_S = 2, 3.0
"""A member that starts listens for so many cycles whether its turns are taken, and is silent for so many s
after another of its name was heard."""

LONGEST_LISTEN_S = 5.0
"""For so long a leader that starts is silent at most while it hears one whom nothing vouches for."""

RECENT_S = 1.0
"""Another of one's own name is believed by what it said this short a time ago: what is older may be played
again by somebody who has recorded it ..."""

REMEMBERED = 64
"""... and of what was said since, so many own packets are known."""

LONGEST_CYCLE_S = 10.0
"""Longest cycle of an unsigned beat that is obeyed: a slower one would keep a member silent for long."""


class Station:
    """One member's part of what goes on a radio."""

    def __init__(
        self,
        member: Member,
        *,
        formation: str,
        vehicles: tuple[str, ...],
        key: bytes,
        channel: Channel,
        timetable: Timetable | None = None,
        listens_first: bool = True,
    ) -> None:
        """Make one that has heard nothing.

        Args:
            member: says and hears.
            formation: its name.
            vehicles: names of all vehicles, the leader first, the same everywhere.
            key: the formation's radio key; empty to believe anybody.
            channel: how fast the radio is.
            timetable: of the leader, who tells the others.
            listens_first: whether its turns may be taken by another of its name; not where all begin at once.
        """
        self._member = member
        self._listens_first = listens_first
        self._vehicles = vehicles
        self._channel = channel
        self._timetable = timetable
        known = member.name in vehicles and not member.watches
        self._number = vehicles.index(member.name) if known else None
        if member.watches and member.heeds_orders:
            self._number = OPERATOR
        self._mark, self._key = formation_mark(formation), formation_key(key, formation, vehicles)
        self._beat = Beat(self._number)
        self._proven_s = self._twin_s = -math.inf
        self._listens_since = math.inf
        self._framer = Framer(member.counters)
        self._sent: deque[bytes] = deque(maxlen=REMEMBERED)
        self._state: tuple[bytes, float] | None = None
        self._questions = Questions()
        self._presence: Presence | None = None
        self._told_s = -math.inf
        self._to_order, self._ordered = OrderOutbox(), OrderInbox()
        self._spoke_of_orders = False
        self._passed_on_s: dict[bytes, float] = {}

    def begin(self, now: float) -> None:
        """Begin to hear and, for the leader, to give the beat; at a time on the clock of the turns, s."""
        self._framer.clear()
        if self._timetable is not None and self._number == LEADER:
            self._beat.begin(self._timetable, now)
            self._listens_since = now

    def post(self, parcel: Parcel, now: float) -> None:
        """Have a message of the member sent at its next turn; the one before it of its kind is forgotten."""
        match parcel.kind:
            case Kind.STATE:
                if self._state is not None:
                    self._member.counters["radio: replaced before its turn"] += 1
                self._state = parcel.body, now
            case Kind.QUESTION:
                self._questions.post(parcel.body)
            case Kind.ORDER | Kind.REPLY | Kind.REPEAT | Kind.REVOCATION:
                self._post_about_order(parcel, now)
            case _:
                # Answers and presences are made here, where the turn is known.
                return

    def _post_about_order(self, parcel: Parcel, now: float) -> None:
        """Have something about an order said: an order as its operator has signed it."""
        if parcel.kind is Kind.REVOCATION and self._number != OPERATOR:
            if now - self._passed_on_s.get(parcel.body, -math.inf) < REVOKED_REST_S:
                return
            self._passed_on_s[parcel.body] = now
        content = parcel.data if parcel.kind is Kind.ORDER else parcel.body
        try:
            self._to_order.post(parcel.kind, parcel.body, content, now)
        except ValueError:
            self._member.counters["radio: too long for its pieces"] += 1

    def announce(self, presence: Presence) -> None:
        """Say now and then how the member is, and soon where that has changed."""
        if self._presence is None or presence.mode != self._presence.mode:
            self._told_s = -math.inf
        self._presence = presence

    def next_turn(self, now: float) -> Turn | None:
        """When to call `speak` next; None while there is no turn."""
        return self._beat.next_turn(now)

    def speak(self, turn: Turn, now: float) -> bytes:
        """What to send in a turn, if it is now; nothing where there is nothing to say."""
        self._beat.spoken(turn)
        if now - turn.at_s > self._spare_s():
            # It would run into the next one's.
            self._member.counters["radio: late for its turn"] += 1
            return b""
        if self._number == LEADER:
            packet = self._said_by_leader(turn, now)
        elif self._number == OPERATOR:
            packet = self._due_question(now) or self._piece(now)
        else:
            packet = self._said(now)
        if not packet:
            return b""
        frame = encode_frame(packet)
        self._sent.append(packet)
        return frame

    def hear(self, data: bytes, now: float) -> bool:
        """Take bytes from the radio; whatever is wrong with them ends up as a counter.

        Args:
            data: cut anywhere, and perhaps damaged.
            now: on the clock of the turns, s.

        Returns:
            Whether somebody of the formation was heard.
        """
        heard = False
        for packet in self._framer.feed(data):
            if packet in self._sent:
                self._member.counters["own packets heard"] += 1
                continue
            try:
                self._take(packet, now)
                heard = True
            except LinkDataError:
                self._member.note_refusal("malformed")
            except RefusedError as refusal:
                self._member.note_refusal(str(refusal))
        return heard

    def _take(self, data: bytes, now: float) -> None:
        """Take a packet.

        Raises:
            LinkDataError: it is none.
            RefusedError: it is not believed.
        """
        packet = decode_packet(data)
        sender = self._name_of(packet)
        began_s = now - self._channel.latency_s(len(data) + OVERHEAD)
        if packet.sender == self._number and not self._member.trust.proven:
            # What nothing vouches for yet is good enough to be silent by: speaking hits the other's turns.
            self._twin_s = now
            self._take_unproven(packet, began_s)
            raise RefusedError(TWIN)
        epoch = self._epoch_of(packet)
        if epoch is None:
            self._take_unproven(packet, began_s)
            raise RefusedError(UNKNOWN_SESSION)
        if packet.kind is not PackedKind.REVOCATION:
            self._check(packet, sender, epoch)
        if packet.kind not in OF_NO_SESSION | {PackedKind.ANSWER}:
            # Others' questions and answers prove no session to this member: one that joins late would wait
            # while others ask.
            self._proven_s = began_s
        if packet.beat is not None:
            self._count_from(packet, began_s)
        elif packet.kind not in OF_NO_SESSION and LEADER < packet.sender < OPERATOR:
            self._beat.hear_follower(packet.sender, began_s)
        self._use(packet, sender, epoch)

    def _name_of(self, packet: Packet) -> str:
        """Name of a packet's sender.

        Raises:
            RefusedError: it is none of this formation.
        """
        if packet.formation != self._mark:
            raise RefusedError("another formation")
        if packet.sender == OPERATOR:
            return self._member.name if self._number == OPERATOR else OPERATOR_NAME
        if packet.sender >= len(self._vehicles):
            raise RefusedError("a stranger")
        name = self._vehicles[packet.sender]
        if name in self._member.trust.statements:
            raise RefusedError(REVOKED)
        return name

    def _epoch_of(self, packet: Packet) -> int | None:
        """The leader's session that a packet was said under; None where its tag is of none that counts."""
        trust = self._member.trust
        epochs = trust.epochs(self._member.clock())
        if packet.kind in OF_NO_SESSION:
            epochs = (0,)
        elif packet.kind is PackedKind.ANSWER or (
            packet.kind is PackedKind.PRESENCE and trust.takes_all
        ):
            epochs = (packet.session,)
        for epoch in epochs:
            if hmac.compare_digest(tag_of(self._key, epoch, packet.tagged), packet.tag):
                return epoch
        return None

    def _check(self, packet: Packet, sender: str, epoch: int) -> None:
        """See that a packet with a true tag is believed, by the same rules as on every link.

        Raises:
            RefusedError: it is not.
        """
        own, kind, body = packet.sender == self._number, KINDS[packet.kind], b""
        time_s, session, sequence = (
            packet.ticks * TICK_S,
            ~epoch % 2**64,
            packet.ticks // STEP_TICKS,
        )
        if kind is Kind.QUESTION:
            # Each is told by its number, and takes the place of a session.
            session, sequence = packet.number, 1
            body = encode_ask(Ask(number=packet.number, originate_s=time_s))
        elif packet.sender == LEADER:
            session = epoch
        if own and kind is Kind.ANSWER and packet.to == self._number:
            body = self._answered(packet)
        elif own and body == b"" and abs(self._member.formation_time() - time_s) >= RECENT_S:
            raise RefusedError(TWIN)
        if packet.kind is PackedKind.ORDER and packet.sender != OPERATOR:
            # Which it passes on, as its operator has signed it.
            kind = Kind.REPEAT
        envelope = Envelope(
            scheme=Scheme.UNSIGNED,
            kind=kind,
            formation=0,
            sender=sender,
            session=session,
            epoch=epoch,
            sequence=sequence,
            time_s=time_s,
            body=body,
            signed=packet.tagged,
            tag=packet.tag,
        )
        try:
            self._member.vouch_for(envelope)
        except RefusedError as refusal:
            if (
                str(refusal) == TWIN
                and kind is Kind.QUESTION
                and self._member.twins.may_answer(body)
            ):
                self._questions.hear(packet.sender, packet.number, self._member.clock())
            raise

    def _answered(self, packet: Packet) -> bytes:
        """What a packet answers, as on every link; nothing where it answers no question of this member."""
        tell = self._questions.answer_to(packet)
        return b"" if tell is None else encode_tell(tell)

    def _take_unproven(self, packet: Packet, began_s: float) -> None:
        """Take a packet that nothing vouches for: a beat, where no true one was heard for a while."""
        if packet.sender != LEADER:
            return
        if self._number == LEADER:
            self._meet_unproven_twin(packet, began_s)
            return
        if packet.beat is None:
            return
        # The leader may have started anew: asking it tells.
        self._member.hurry.set()
        # By what was proven, not by the beat that is counted from: that may be a forger's, and a slow one.
        cycle_s = packet.beat.table.cycle_s
        if began_s - self._proven_s > HANDOVER_S and cycle_s <= LONGEST_CYCLE_S:
            self._count_from(packet, began_s)

    def _meet_unproven_twin(self, packet: Packet, began_s: float) -> None:
        """Ask a leader that nothing vouches for whether it lives: another run of this one, or nobody."""
        if packet.beat is not None and self._is_silent_leader(began_s):
            # In step with it, the answer's turn is one in which it listens.
            if packet.beat.table == self._timetable:
                self._beat.hear_leader(packet.beat.beat, packet.beat.table, began_s)
            self._twin_s = began_s
        self._member.ask_twin()

    def _count_from(self, packet: Packet, began_s: float) -> None:
        """Count from a beat.

        Raises:
            RefusedError: its timetable is not of this formation, or of no radio.
        """
        info = packet.beat
        if info is None or self._number == LEADER:
            return
        if info.table.members != len(self._vehicles):
            raise RefusedError("another number of vehicles")
        if info.table.slot_s < self._channel.line_s():
            raise RefusedError("a beat that is too fast")
        self._beat.hear_leader(info.beat, info.table, began_s)

    def _use(self, packet: Packet, sender: str, epoch: int) -> None:
        """Hand on what is believed."""
        match packet.kind:
            case PackedKind.QUESTION if self._number == LEADER:
                self._questions.hear(packet.sender, packet.number, self._member.clock())
            case PackedKind.ANSWER if packet.to == self._number:
                if answer := self._answered(packet):
                    self._accept(Kind.ANSWER, sender, packet.session, answer)
            case PackedKind.STATE if packet.state is not None:
                self._accept(Kind.STATE, sender, epoch, encode(packet.state))
            case PackedKind.PRESENCE if packet.presence is not None:
                self._member.accept_presence(sender, packet.presence)
            case kind if kind is PackedKind.REVOCATION or (
                kind in PIECES and self._member.heeds_orders
            ):
                self._take_piece(packet, sender, epoch)

    def _take_piece(self, packet: Packet, sender: str, epoch: int) -> None:
        """Take a piece about an order, and use the message once all of it has come.

        Raises:
            LinkDataError: it is of no message.
            RefusedError: it is no operator's order.
        """
        if packet.piece is None:
            return
        content = self._ordered.take(packet.sender, packet.kind, packet.piece)
        match packet.kind:
            case _ if content is None:
                return
            case PackedKind.ORDER | PackedKind.REVOCATION:
                # The operator's signature counts, as on every link.
                if PACKED_KINDS.get(self._member.trust.read(content).kind) is not packet.kind:
                    raise RefusedError("not what its operator has signed")
                self._member.take(content)
            case PackedKind.REPLY:
                self._accept(Kind.REPLY, sender, epoch, content)
            case PackedKind.REPEAT:
                self._accept(Kind.REPEAT, sender, epoch, content)

    def _accept(self, kind: Kind, sender: str, session: int, body: bytes) -> None:
        self._member.accept(Message(kind=kind, sender=sender, session=session, body=body))

    def _sealed(self, kind: PackedKind, body: bytes, time_s: float, *, flags: int = 0) -> bytes:
        """A packet with its tag; nothing where the formation's time is not known."""
        (epoch, *_) = self._member.trust.epochs(self._member.clock()) or (0,)
        if kind in OF_NO_SESSION:
            epoch = 0
        elif epoch == 0:
            return b""
        if self._number is None:
            return b""
        try:
            ticks = ticks_of(time_s)
        except ValueError:
            self._member.counters["radio: no time to tell"] += 1
            return b""
        packet = encode_packet(
            kind,
            formation=self._mark,
            sender=self._number,
            ticks=ticks,
            body=body,
            flags=flags,
        )
        return packet + tag_of(self._key, epoch, packet)

    def _said_by_leader(self, turn: Turn, now: float) -> bytes:
        """The leader's packet for a turn."""
        table = self._beat.timetable
        if turn.beat is None and table is not None:
            # To another of its name, which seldom speaks in this turn, and answers in the next one.
            question = self._asked(now, pause_s=2.5 * table.cycle_s)
            if question:
                return question
        if self._is_silent_leader(now):
            return b""
        if turn.beat is None or table is None:
            return self._answer(now) or self._own_presence(now, PRESENCE_S) or self._piece(now)
        beat, state = BeatInfo(turn.beat, table), self._fresh_state(now)
        if state is None:
            alone = encode_beat(beat, BEAT_ALONE)
            return self._sealed(PackedKind.BEAT, alone, self._member.clock())
        return self._sealed_state(state, encode_beat(beat))

    def _is_silent_leader(self, now: float) -> bool:
        """Whether this one, a leader, lets another of its name speak."""
        if self._member.stands_back:
            return True
        table, began_s = self._beat.timetable, self._listens_since
        if table is None or not self._listens_first or now - began_s > LONGEST_LISTEN_S:
            return False
        return now - max(began_s, self._twin_s) < LISTEN_CYCLES * table.cycle_s

    def _said(self, now: float) -> bytes:
        """A follower's packet for its turn."""
        question = self._due_question(now)
        if question:
            return question
        presence = self._own_presence(now, PRESENCE_S)
        if presence:
            return presence
        self._spoke_of_orders = not self._spoke_of_orders
        piece = self._piece(now) if self._spoke_of_orders else b""
        if piece:
            return piece
        state = self._fresh_state(now)
        return self._own_presence(now, IDLE_S) if state is None else self._sealed_state(state)

    def _spare_s(self) -> float:
        """What a slot has more than the longest packet needs, s."""
        table = self._beat.timetable
        spare_s = 0.0 if table is None else table.slot_s - self._channel.slot_s()
        return max(spare_s, LEAST_LATE_S)

    def _fresh_state(self, now: float) -> bytes | None:
        """The newest state, if it was not sent yet."""
        if self._state is None:
            return None
        (body, since_s), self._state = self._state, None
        if now - since_s > STALE_S:
            self._member.counters["radio: too old for its turn"] += 1
            return None
        return body

    def _sealed_state(self, body: bytes, beat: bytes = b"") -> bytes:
        """A state as a packet; nothing where its time is none."""
        message = decode(body)
        return self._sealed(
            PackedKind.STATE,
            beat + encode_motion(message),
            message.time_s,
            flags=state_flags(message),
        )

    def _is_free(self, now: float) -> bool:
        """Whether nobody else has this member's turns: heard before it speaks for the first time."""
        table = self._beat.timetable
        if table is None or self._member.trust.proven or not self._listens_first:
            return True
        self._listens_since = min(self._listens_since, now)
        listened = now - self._listens_since >= (LISTEN_CYCLES - 0.5) * table.cycle_s
        return listened and now - self._twin_s > TWIN_S

    def _due_question(self, now: float) -> bytes:
        """The question that waits, unless the last was asked a short time ago."""
        if not self._is_free(now):
            return b""
        clock, table = self._member.peer_clock, self._beat.timetable
        if clock is None or table is None:
            return b""
        hurried = clock.pause_s <= HURRIED_S or self._member.hurry.is_set()
        cycles = HURRIED_CYCLES if hurried else max(CALM_CYCLES, table.members)
        cycles = cycles if self._member.trust.proven else 1
        return self._asked(now, pause_s=(cycles - 0.5) * table.cycle_s)

    def _asked(self, now: float, *, pause_s: float) -> bytes:
        """The packet of the question that waits; nothing where none does, or one was asked so short ago."""
        if now - self._questions.asked_s < pause_s:
            return b""
        ask = self._questions.ask(self._member.clock(), now)
        if ask is None:
            return b""
        # A leader asks another of its name, and says for how long it has spoken.
        said_s = ask.originate_s if self._number == LEADER else 0.0
        return self._sealed(PackedKind.QUESTION, QUESTION.pack(ask.number), said_s)

    def _answer(self, now: float) -> bytes:
        """The answer to one of the questions that wait."""
        clock_s = self._member.clock()
        found = self._questions.next_to_answer(clock_s, now)
        if found is None:
            return b""
        asker, number, received_s = found
        (session, *_) = self._member.trust.epochs(clock_s)
        said_s = clock_s
        if asker == self._number:
            # Another of its name asks for how long it has spoken.
            received_s = said_s = self._member.twins.spoken_s
        received = ticks_of(received_s).to_bytes(6, "little")
        body = ANSWER.pack(asker, number, session, received)
        return self._sealed(PackedKind.ANSWER, body, said_s)

    def _piece(self, now: float) -> bytes:
        """The next piece of what is to be said about orders."""
        found = self._to_order.next_piece(now)
        if found is None:
            return b""
        kind, piece = found
        said_s = 0.0 if kind in OF_NO_SESSION else self._member.formation_time()
        return self._sealed(kind, PIECE.pack(*astuple(piece)), said_s)

    def _own_presence(self, now: float, every_s: float) -> bytes:
        """This vehicle's presence as a signed packet; nothing while it is not due."""
        trust, presence = self._member.trust, self._presence
        if presence is None or not trust.proven or now - self._told_s < every_s:
            return b""
        self._told_s = now
        (session, *_) = trust.epochs(self._member.clock())
        body = encode_packed_presence(presence, session)
        return self._sealed(PackedKind.PRESENCE, body, self._member.formation_time())
