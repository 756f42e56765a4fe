"""One member on a shared radio: takes bytes from the radio, and returns a packet for each of its own turns.

Only the newest message of each kind waits. A new state replaces an unsent one, and a state that is a second
old is not sent. In its turn a follower sends its question if one waits and it did not ask lately. Otherwise
it sends its presence now and then, and its state the rest of the time. The leader sends its state, or only
the beat, at each beat. It answers one question per cycle, from the asker whose last answer is the oldest.

Time stamps of the clock comparison exclude the waiting for turns. An answer is stamped when it leaves. The
asker shifts the question's arrival back by the time that the question had waited for its turn.

A packet lost in a collision or otherwise is not sent again; messages about orders are sent in rounds. They
take at most every second turn of a follower, so that its states go on. An operator has turns of its own, and
otherwise sends only its question for the leader's clock.

A beat counts if its tag is right. After two seconds without one, a beat with an unverifiable tag counts, too.
Otherwise a member that starts, or whose leader has restarted, could not ask in its turn. A forged beat can do
no worse than any transmitter: cause a collision. The leader asks whether the beat's sender lives, soon once
in 5 s; a leader that starts waits for 5 s at most.

Nothing here owns a port; the only clock read is the member's, for time stamps.
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
"""Age at which a state is no longer sent, s."""

HURRIED_CYCLES, CALM_CYCLES = 2, 12
"""Cycles between a follower's questions: until its clock is settled, and later. Without a session of the
leader it asks in each turn, since it can send nothing else."""

ORDER_LEAD_S = 10.0
"""Lead of an order over its execution time, s. With twelve vehicles a round of its pieces takes 2 s; with
losses it takes three rounds, and replies wait for turns."""

GREETING_S = 8.0
"""Time until twelve companions that start together have all sent, s: under heavy loss it takes several
questions and answers to learn the time."""

PRESENCE_S, IDLE_S = 4.0, 1.0
"""Intervals between presences, s: in place of a state, and where there is no state to send."""

LEAST_LATE_S = 0.002
"""Minimum tolerance of a late turn, s, however short the slots: programs wait for the processor."""

REVOKED_REST_S = 30.0
"""Minimum interval at which a vehicle passes a revocation on, s: three rounds fill every second turn for 10
s."""

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
"""Kind of message that each kind of packet is checked as."""

OF_NO_SESSION = frozenset({PackedKind.QUESTION, PackedKind.REVOCATION})
"""Kinds sent under no session of the leader, so that members that know none hear them."""

UNKNOWN_SESSION = "another session or forged"
"""Reason of refusal where a tag is of no session of the leader that counts."""

STEP_TICKS = round(1.0 / (SAID_PER_S * TICK_S))
"""Unit of sequence numbers made from times, 0.1 ms: no sender sends two messages within it."""

OPERATOR_NAME = "the operator"
"""Name of an operator as a sender; no vehicle's name has a blank."""

LISTEN_CYCLES, TWIN_S = 2, 3.0
"""Cycles in which a starting member listens for its own name, and silence after hearing it, s."""

LONGEST_LISTEN_S = 5.0
"""Maximum silence of a starting leader while it hears an unauthenticated one, s."""

RECENT_S = 1.0
"""Maximum age of a message in the own name that proves another companion, s; older ones may be replays."""

REMEMBERED = 64
"""Number of own packets remembered, including all of the last `RECENT_S`."""

LONGEST_CYCLE_S = 10.0
"""Longest cycle of an unauthenticated beat that is obeyed, s: a slower one would cause long silence."""


class Station:
    """One member's part in a shared radio."""

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
        """Create a station that has heard nothing.

        Args:
            member: member on the radio.
            formation: name of the formation.
            vehicles: names of all vehicles, the leader first, in the same order everywhere.
            key: the formation's radio key; empty to believe anybody.
            channel: speed of the radio.
            timetable: timetable for the leader, which announces it; None for all others.
            listens_first: whether to listen first for another member of its name; False where all start
                together.
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
        """Begin to receive and, for the leader, to give the beat; `now` is s on the clock of the turns."""
        self._framer.clear()
        if self._timetable is not None and self._number == LEADER:
            self._beat.begin(self._timetable, now)
            self._listens_since = now

    def post(self, parcel: Parcel, now: float) -> None:
        """Queue a message for the member's next turn, replacing an unsent one of its kind."""
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
        """Queue a message about orders: an order in its operator's envelope, others without one."""
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
        """Update the presence, which is sent now and then, and soon after a change of mode."""
        if self._presence is None or presence.mode != self._presence.mode:
            self._told_s = -math.inf
        self._presence = presence

    def next_turn(self, now: float) -> Turn | None:
        """Return the turn in which to call `speak` next; None while there is none."""
        return self._beat.next_turn(now)

    def speak(self, turn: Turn, now: float) -> bytes:
        """Return the frame to send in a turn; empty if the turn is over or there is nothing to send."""
        self._beat.spoken(turn)
        if now - turn.at_s > self._spare_s():
            # It would run into the next turn.
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
        """Take bytes, cut anywhere or damaged; count errors, and return whether a member was heard."""
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
            # Unverified packets suffice to fall silent: sending would collide with the other's turns.
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
            # Others' questions and answers prove no session to this member: otherwise one that joins late
            # would wait while others ask.
            self._proven_s = began_s
        if packet.beat is not None:
            self._count_from(packet, began_s)
        elif packet.kind not in OF_NO_SESSION and LEADER < packet.sender < OPERATOR:
            self._beat.hear_follower(packet.sender, began_s)
        self._use(packet, sender, epoch)

    def _name_of(self, packet: Packet) -> str:
        """Return the name of a packet's sender.

        Raises:
            RefusedError: it is a stranger or its key is revoked.
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
        """Return the leader's session that a packet's tag proves; None where it proves none that counts."""
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
        """Check a packet with a valid tag as on every link; raise RefusedError if it is not believed."""
        own, kind, body = packet.sender == self._number, KINDS[packet.kind], b""
        time_s, session, sequence = (
            packet.ticks * TICK_S,
            ~epoch % 2**64,
            packet.ticks // STEP_TICKS,
        )
        if kind is Kind.QUESTION:
            # Each question is identified by its number, which takes the place of a session.
            session, sequence = packet.number, 1
            body = encode_ask(Ask(number=packet.number, originate_s=time_s))
        elif packet.sender == LEADER:
            session = epoch
        if own and kind is Kind.ANSWER and packet.to == self._number:
            body = self._answered(packet)
        elif own and body == b"" and abs(self._member.formation_time() - time_s) >= RECENT_S:
            raise RefusedError(TWIN)
        if packet.kind is PackedKind.ORDER and packet.sender != OPERATOR:
            # The sender passes on an order as its operator has signed it.
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
        """Return the clock answer in a packet, encoded as on every link; empty if this member did not ask."""
        tell = self._questions.answer_to(packet)
        return b"" if tell is None else encode_tell(tell)

    def _take_unproven(self, packet: Packet, began_s: float) -> None:
        """Take an unauthenticated packet: a beat counts where no authentic one was heard for a while."""
        if packet.sender != LEADER:
            return
        if self._number == LEADER:
            self._meet_unproven_twin(packet, began_s)
            return
        if packet.beat is None:
            return
        # The leader may have restarted: its answer will tell.
        self._member.hurry.set()
        # Measured from the last proven packet, not from the beat counted from, which may be a forger's slow
        # one.
        cycle_s = packet.beat.table.cycle_s
        if began_s - self._proven_s > HANDOVER_S and cycle_s <= LONGEST_CYCLE_S:
            self._count_from(packet, began_s)

    def _meet_unproven_twin(self, packet: Packet, began_s: float) -> None:
        """Ask an unauthenticated leader whether it lives: it is another run of this one, or nobody."""
        if packet.beat is not None and self._is_silent_leader(began_s):
            # In step with the other leader, this one listens in the turn of the answer.
            if packet.beat.table == self._timetable:
                self._beat.hear_leader(packet.beat.beat, packet.beat.table, began_s)
            self._twin_s = began_s
        self._member.ask_twin()

    def _count_from(self, packet: Packet, began_s: float) -> None:
        """Count from a beat; raise RefusedError if its timetable fits no radio or another formation."""
        info = packet.beat
        if info is None or self._number == LEADER:
            return
        if info.table.members != len(self._vehicles):
            raise RefusedError("another number of vehicles")
        if info.table.slot_s < self._channel.line_s():
            raise RefusedError("a beat that is too fast")
        self._beat.hear_leader(info.beat, info.table, began_s)

    def _use(self, packet: Packet, sender: str, epoch: int) -> None:
        """Hand on the content of a believed packet."""
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
        """Take a piece of a message about orders, and use the message once it is complete.

        Raises:
            LinkDataError: the piece fits no message.
            RefusedError: the message is no operator's order or revocation.
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
        """Return a packet with its tag; empty where the formation's time is unknown."""
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
            kind, formation=self._mark, sender=self._number, ticks=ticks, body=body, flags=flags
        )
        return packet + tag_of(self._key, epoch, packet)

    def _said_by_leader(self, turn: Turn, now: float) -> bytes:
        table = self._beat.timetable
        if turn.beat is None and table is not None:
            # Ask another leader of its name, which seldom sends in this turn and answers in the next one.
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
        """Check whether this leader lets another of its name send."""
        if self._member.stands_back:
            return True
        table, began_s = self._beat.timetable, self._listens_since
        if table is None or not self._listens_first or now - began_s > LONGEST_LISTEN_S:
            return False
        return now - max(began_s, self._twin_s) < LISTEN_CYCLES * table.cycle_s

    def _said(self, now: float) -> bytes:
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
        """Return the time that a slot has beyond the longest packet's need, s."""
        table = self._beat.timetable
        spare_s = 0.0 if table is None else table.slot_s - self._channel.slot_s()
        return max(spare_s, LEAST_LATE_S)

    def _fresh_state(self, now: float) -> bytes | None:
        """Take the newest unsent state; None where there is none or it is too old."""
        if self._state is None:
            return None
        (body, since_s), self._state = self._state, None
        if now - since_s > STALE_S:
            self._member.counters["radio: too old for its turn"] += 1
            return None
        return body

    def _sealed_state(self, body: bytes, beat: bytes = b"") -> bytes:
        """Return a state as a packet; empty where its time is invalid."""
        message = decode(body)
        return self._sealed(
            PackedKind.STATE,
            beat + encode_motion(message),
            message.time_s,
            flags=state_flags(message),
        )

    def _is_free(self, now: float) -> bool:
        """Check whether the member's turns are free, by listening before it sends for the first time."""
        table = self._beat.timetable
        if table is None or self._member.trust.proven or not self._listens_first:
            return True
        self._listens_since = min(self._listens_since, now)
        listened = now - self._listens_since >= (LISTEN_CYCLES - 0.5) * table.cycle_s
        return listened and now - self._twin_s > TWIN_S

    def _due_question(self, now: float) -> bytes:
        """Return the packet of the waiting question, unless the latest was asked a short time ago."""
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
        """Return the packet of the waiting question; empty without one, or within `pause_s` of the last."""
        if now - self._questions.asked_s < pause_s:
            return b""
        ask = self._questions.ask(self._member.clock(), now)
        if ask is None:
            return b""
        # A leader that asks another of its name tells its speaking time.
        said_s = ask.originate_s if self._number == LEADER else 0.0
        return self._sealed(PackedKind.QUESTION, QUESTION.pack(ask.number), said_s)

    def _answer(self, now: float) -> bytes:
        clock_s = self._member.clock()
        found = self._questions.next_to_answer(clock_s, now)
        if found is None:
            return b""
        asker, number, received_s = found
        (session, *_) = self._member.trust.epochs(clock_s)
        said_s = clock_s
        if asker == self._number:
            # To another of its name the answer tells the speaking time.
            received_s = said_s = self._member.twins.spoken_s
        received = ticks_of(received_s).to_bytes(6, "little")
        body = ANSWER.pack(asker, number, session, received)
        return self._sealed(PackedKind.ANSWER, body, said_s)

    def _piece(self, now: float) -> bytes:
        """Return the packet of the next piece of messages about orders."""
        found = self._to_order.next_piece(now)
        if found is None:
            return b""
        kind, piece = found
        said_s = 0.0 if kind in OF_NO_SESSION else self._member.formation_time()
        return self._sealed(kind, PIECE.pack(*astuple(piece)), said_s)

    def _own_presence(self, now: float, every_s: float) -> bytes:
        """Return the packet of this vehicle's presence; empty while it is not due."""
        trust, presence = self._member.trust, self._presence
        if presence is None or not trust.proven or now - self._told_s < every_s:
            return b""
        self._told_s = now
        (session, *_) = trust.epochs(self._member.clock())
        body = encode_packed_presence(presence, session)
        return self._sealed(PackedKind.PRESENCE, body, self._member.formation_time())
