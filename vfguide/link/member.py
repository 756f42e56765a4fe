"""One member of a formation on its links: says what it has to say, and hands on what it believes.

Bytes in, bytes out: a message comes in as `take`; what is to be sent goes to `send`, a copy over every link.
"""

import asyncio
import logging
import math
import secrets
from collections import Counter, deque
from collections.abc import Callable, Collection
from random import random
from typing import TypedDict, Unpack

import msgspec

from vfguide.link.codec import (
    ENVELOPE,
    LARGEST,
    SIGNATURE_SIZE,
    Ask,
    Envelope,
    Kind,
    LinkDataError,
    decode_ask,
    decode_tell,
    encode_ask,
)
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence, decode_presence, encode_presence, shorter_presences
from vfguide.link.trust import HEARD_BEFORE, LEADER_LOST_S, TWIN, Message, RefusedError, Trust

# Two companions of one name: the one that has spoken for less long finds that out, and steps back.
#
# Nothing here reads a clock. What is said in a member's own name by somebody else, signed with its own
# key, is another companion of the same vehicle, or a recording of this one or of an earlier run.

YOUNG_S = 10.0
"""A member that has spoken for longer was here before another of its name that speaks up."""

TWIN_QUIET_S, TWIN_SPREAD_S = 6.0, 4.0
"""So long another of one's name has to be silent before one speaks again; and up to so much longer, by
chance, since the other may have stepped back, too."""

AFTER_START_S = 1.0
"""A message in one's own name that is newer than one's own start by this is of no earlier run."""

ASK_EVERY_S, ASK_AGAIN_S = 1.0, 1.5
"""s from one question to the own name to the next: at first, and once it was answered; up to half as much
more or less, by chance, so that two on one radio do not go on in step."""

IN_VAIN, ASK_SELDOM_S = 6, 5.0
"""After so many questions that nobody has answered, as to a recording, they come more seldom."""

ANSWERED_S = 2.0
"""An answer comes within this, or it was kept back."""

ANSWER_EVERY_S = 0.4
"""s between two answers at least."""

REMEMBERED = 256
"""Numbers of questions, made up or answered."""


class TwinWatch:
    """What one member knows of another of its name.

    A follower tells a recording by its time, which is the leader's. The leader has no such clock: it asks in
    its own name, by a number of 64 bits of chance that no recording can answer, and says for how long it has
    spoken. Another leader that has spoken for longer answers, and that sends it back.
    """

    def __init__(self, clock: Callable[[], float], *, asks: bool) -> None:
        """Know of none.

        Args:
            clock: the member's own, s.
            asks: whether it is the leader.
        """
        self.asks = asks
        self._clock = clock
        self._began_s = clock()
        self._spoke_s = math.inf
        self._twin_s = -math.inf
        self._quiet_s = TWIN_QUIET_S
        self._ask_s = self._answer_s = -math.inf
        self._in_vain = 0
        self._open: dict[int, tuple[float, float]] = {}
        self._made = deque[int](maxlen=REMEMBERED)
        self._answered = deque[int](maxlen=REMEMBERED)

    def note_speech(self) -> None:
        """Note that the member says a state."""
        self._spoke_s = min(self._spoke_s, self._clock())

    @property
    def spoken_s(self) -> float:
        """For how long the member has spoken, s."""
        return max(self._clock() - self._spoke_s, 0.0)

    @property
    def stands_back(self) -> bool:
        """Whether another was here before: this one is not to steer then."""
        return self._clock() - self._twin_s < self._quiet_s

    @property
    def is_young(self) -> bool:
        """Whether another may have been here before: own states are worth listening for."""
        return self._clock() - self._spoke_s < YOUNG_S

    def hear(self, said_ago_s: float) -> None:
        """Note a true message in the own name that was said so long ago, on the formation's clock, s."""
        live = said_ago_s < self._clock() - self._began_s - AFTER_START_S
        if live and not self.asks and (self.stands_back or self.is_young):
            self._step_back()

    def question(self) -> bytes | None:
        """What to ask in the own name after a message in it; None where nothing is to be asked now."""
        now = self._clock()
        if not self.asks or now < self._ask_s:
            return None
        every_s = ASK_AGAIN_S if self.stands_back else ASK_EVERY_S
        self._in_vain += 1
        if self._in_vain > IN_VAIN:
            every_s = ASK_SELDOM_S
        self._ask_s = now + (0.5 + random()) * every_s
        number, spoken_s = secrets.randbits(64), self.spoken_s
        self._made.append(number)
        self._open = {
            one: asked for one, asked in self._open.items() if now - asked[0] <= ANSWERED_S
        }
        self._open[number] = now, spoken_s
        # Where others say when they ask, on their clocks, it says for how long it has spoken.
        return encode_ask(Ask(number=number, originate_s=spoken_s))

    def awaits(self, answer: bytes) -> bool:
        """Whether these bytes answer a question of this member in its own name."""
        try:
            return decode_tell(answer).number in self._open
        except LinkDataError:
            return False

    def hear_answer(self, answer: bytes) -> None:
        """Note an answer in the own name: another program with its key says for how long it has spoken."""
        if not self.awaits(answer):
            return
        tell = decode_tell(answer)
        asked_s, spoken_s = self._open.pop(tell.number)
        if 0.0 <= self._clock() - asked_s <= ANSWERED_S and tell.transmit_s > spoken_s:
            self._in_vain = 0
            self._step_back()

    def may_answer(self, question: bytes) -> bool:
        """Whether to answer a question in the own name, which sends its asker back; each one once.

        Raises:
            LinkDataError: it is none.
        """
        ask, now = decode_ask(question), self._clock()
        if not self.asks or self.stands_back or now - self._answer_s < ANSWER_EVERY_S:
            return False
        if ask.number in self._made or ask.number in self._answered:
            # Played again.
            return False
        if self.spoken_s <= ask.originate_s:
            return False
        self._answer_s = now
        self._answered.append(ask.number)
        return True

    def _step_back(self) -> None:
        """Be silent from now on, for a time of chance: two that drew alike once are parted the next time."""
        self._twin_s, self._spoke_s = self._clock(), math.inf
        self._quiet_s = TWIN_QUIET_S + TWIN_SPREAD_S * random()


logger = logging.getLogger(__name__)

ALARMS = {
    TWIN: "a companion calls itself %r, too, or its recording is played:"
    " see that each vehicle has one companion",
    "a second leader": "%r hears two companions of the leader: stop one of them",
}
"""Refusals that people have to know of, and what the log says the first time."""

ELDER = "another companion of this name was here before: this one does not steer; stop one of them"
KEY_OUT = "its key is revoked, nobody hears it: it does not steer; make it a new one on the ground"
"""Why a member stands back, in words."""

NOT_SAID = "not said: stands back"
"""Counter of what a member that stands back would have said."""

QUIET_S = 0.5
"""After this long without a message the next presence is looked at, whoever it is of."""

EVERYBODY = ""
"""To whom a parcel goes that is for all."""


class Parcel(msgspec.Struct, frozen=True, kw_only=True):
    """A sealed message on its way out."""

    kind: Kind
    """What it is about."""
    to: str
    """For whom it is; empty for everybody."""
    data: bytes
    """The envelope."""
    body: bytes
    """What is said, for links that have an envelope of their own."""


def ignore(*said: object) -> None:
    """Take what is of no use."""
    del said


class Hearing(TypedDict, total=False):
    """Receivers of what a member hears; what has none, or None, is of no use to it."""

    receive: Callable[[bytes], None]
    """Called with each new state of the leader."""
    receive_neighbour: Callable[[str, bytes], None]
    """Called with the name of a neighbour and its new state."""
    receive_presence: Callable[[str, Presence], None] | None
    """Called with a vehicle and what it says about itself."""
    receive_lead: Callable[[str, bytes], object] | None
    """Called with a vehicle that leads in the place of the mission's leader, and how the leader moves by
    which it does."""
    receive_order: Callable[[bytes, bytes, bool], None] | None
    """Called with an operator's order, its envelope and whether another vehicle repeats it."""
    receive_reply: Callable[[str, bytes], None] | None
    """Called with a member and what it says to an order."""
    receive_revocation: Callable[[str], object]
    """Called with a vehicle whose key is out from now on."""


RECEIVERS = {
    Kind.PRESENCE: "receive_presence",
    Kind.WILL: "receive_presence",
    Kind.LEADER: "receive_lead",
    Kind.ORDER: "receive_order",
    Kind.REPEAT: "receive_order",
    Kind.REPLY: "receive_reply",
}
"""Receivers of kinds that are of use only to who has one."""


class Member:
    """What one program says and hears, whatever carries it."""

    def __init__(
        self,
        trust: Trust,
        *,
        clock: Callable[[], float],
        neighbours: Collection[str] = (),
        peer_clock: PeerClock | None = None,
        **hears: Unpack[Hearing],
    ) -> None:
        """Make one that is on no link yet.

        Args:
            trust: what it signs with, and whom it believes.
            clock: its own, s.
            neighbours: other vehicles whose states are wanted.
            peer_clock: learns the leader's clock; None for the leader, and for those who do not ask.
            **hears: what it hands on, and to whom.
        """
        self.trust = trust
        self.clock = clock
        self.peer_clock = peer_clock
        self.neighbours = frozenset(neighbours)
        self._hears = hears
        wanted = {name for name, receive in hears.items() if receive is not None}
        self.watches = "receive_presence" in wanted
        """Whether presences are wanted."""
        self.listens = hears.get("receive", ignore) is not ignore
        """Whether the leader's states are wanted."""
        self.send: Callable[[Parcel], None] = lambda _: None
        """Called with each message that is to go out."""
        self.hurry = asyncio.Event()
        """Set when the leader's clock should be asked for at once."""
        self._believed_s = -math.inf
        self._asked_first_s = math.nan
        self._passed_on = 0
        self.stands_in = False
        """Whether this deputy leads: it answers what the formation's clock shows while the leader cannot."""
        self._useful = frozenset(
            kind for kind, receive in RECEIVERS.items() if receive in wanted
        ) | ({Kind.QUESTION} if trust.leads else set())
        self.twins = TwinWatch(clock, asks=trust.leads)
        """What is known of another of its name."""
        self.heeds_orders = bool(wanted & {"receive_order", "receive_reply"})
        """Whether orders and what is said to them are wanted."""

    @property
    def is_operator(self) -> bool:
        """Whether this is no vehicle of the roster: several programs may use an operator's name and key."""
        return self.trust.signs and self.name not in self.trust.vehicles

    @property
    def stands_back(self) -> bool:
        """Whether this one is not to steer."""
        return bool(self.standing_back)

    @property
    def standing_back(self) -> str:
        """Why it is not to steer, in words; empty where it may."""
        if self.trust.is_revoked:
            return KEY_OUT
        return ELDER if self.twins.stands_back else ""

    def note_twin(self, said_s: float) -> None:
        """Note a true message in one's own name that somebody else has said, at a time of the formation, s.

        An operator's program steers nothing: it may have as many of its name as it likes.
        """
        if not self.is_operator:
            self.twins.hear(self.formation_time() - said_s)
            self.ask_twin()

    def ask_twin(self) -> None:
        """Ask another of the own name whether it lives, where that is how to tell."""
        question = self.twins.question()
        if question is not None:
            self._send(Kind.QUESTION, self.name, question)

    @property
    def candidates(self) -> tuple[str, ...]:
        """All others who may lead or do."""
        others = self.trust.deputies - {self.name, self.trust.leader}
        return (*([] if self.trust.leads else [self.trust.leader]), *sorted(others))

    @property
    def hears_leads(self) -> bool:
        """Whether it is of use how those move by whom deputies lead."""
        return Kind.LEADER in self._useful and bool(self.trust.deputies)

    @property
    def name(self) -> str:
        """Name of this member."""
        return self.trust.name

    @property
    def counters(self) -> Counter[str]:
        """What was not believed or could not be used, by reason."""
        return self.trust.counters

    def publish(self, body: bytes) -> Parcel:
        """Seal the own state, and send it, unless another of this name was here before."""
        if self.stands_back:
            self.counters[NOT_SAID] += 1
            return self._seal(Kind.STATE, EVERYBODY, body)
        self.twins.note_speech()
        return self._send(Kind.STATE, EVERYBODY, body)

    def say(self, kind: Kind, body: bytes) -> Parcel:
        """Seal an order, what is said to one or a repeated one, or how a leader moves, and send it to all.

        Another companion of this name answers for the vehicle, if it was here before.
        """
        if self.stands_back and kind in {Kind.REPLY, Kind.REPEAT, Kind.LEADER}:
            self.counters[NOT_SAID] += 1
            return self._seal(kind, EVERYBODY, body)
        return self._send(kind, EVERYBODY, body)

    def give(self, operator: Trust, body: bytes) -> None:
        """Say an order that an operator's key signs here, and take it as everybody does.

        Raises:
            RefusedError: no session of the leader is known, under which it could be given.
        """
        now = self.clock()
        (epoch, *_) = self.trust.epochs(now) or (0,)
        if epoch == 0:
            raise RefusedError("the leader has not answered yet")
        operator.prove(epoch, now)
        data = operator.seal(Kind.ORDER, body, time_s=self.formation_time())
        self.send(Parcel(kind=Kind.ORDER, to=EVERYBODY, data=data, body=body))
        self.take(data)

    def ask(self) -> None:
        """Ask for the leader's clock."""
        if self.peer_clock is not None:
            self.hurry.clear()
            if math.isnan(self._asked_first_s):
                self._asked_first_s = self.clock()
            question = self.peer_clock.request(self.clock())
            self._send(Kind.QUESTION, self.trust.leader, question)

    def presence(self, presence: Presence, *, most: int = LARGEST, will: bool = False) -> Parcel:
        """Seal a presence, or what a broker is to say once it has lost this member; it is not sent.

        What is longer than `most` bytes in its envelope goes with less in it.
        """
        kind, body = Kind.WILL if will else Kind.PRESENCE, b""
        room = most - ENVELOPE.size - len(self.name.encode()) - SIGNATURE_SIZE
        for one in shorter_presences(presence):
            body = encode_presence(one)
            if len(body) <= room:
                break
        return self._seal(kind, EVERYBODY, body)

    def take(self, data: bytes) -> bool:
        """Take a message from a link; whatever is wrong with it ends up as a counter.

        Returns:
            Whether it shows that somebody of the formation is heard, be it by a copy of what came before.
        """
        return self._guarded(lambda: self._take(data))

    def vouch_for(self, envelope: Envelope) -> None:
        """See that a message is to be believed whose tag the link itself has found to be true.

        Raises:
            RefusedError: it is not.
        """
        try:
            self.trust.believe(envelope, self.clock(), self.formation_time(), tagged=True)
        except RefusedError as refusal:
            # On a radio the answer to another of the own name waits for a turn.
            if str(refusal) == TWIN and envelope.kind is not Kind.QUESTION:
                self._meet_twin(envelope)
            raise

    def accept(self, message: Message) -> None:
        """Take a message that is believed, by `vouch_for`."""
        self._believed_s = self.clock()
        if self._wants(message.kind, message.sender, message.body):
            self._guarded(lambda: self._use(message))

    def _take(self, data: bytes) -> bool:
        """Take a message, and tell whether it shows that somebody is heard.

        Raises:
            RefusedError: it is not believed.
        """
        envelope = self.trust.read(data)
        if envelope.kind is Kind.REVOCATION:
            return self._take_revocation(envelope)
        wanted = self._wants(envelope.kind, envelope.sender, envelope.body)
        if not (wanted or self._is_sign_of_life(envelope)):
            return False
        try:
            message = self.trust.believe(envelope, self.clock(), self.formation_time())
        except RefusedError as refusal:
            if str(refusal) == TWIN:
                self._meet_twin(envelope)
                if wanted and self.is_operator and envelope.kind is Kind.ORDER:
                    self._learn_order(data)
            raise
        self._believed_s = self.clock()
        if wanted:
            self._use(message)
        return True

    def _take_revocation(self, envelope: Envelope) -> bool:
        """Take it that a key is out, and say so to those who may not have heard it; whether that is new.

        Raises:
            RefusedError: it is no operator's statement about a key of this formation.
        """
        vehicle = self.trust.revoke(envelope, self.clock())
        if vehicle is None:
            self.counters["copies"] += 1
            return False
        if not self.watches:
            self.send(self._statement(vehicle))
        self._hears.get("receive_revocation", ignore)(vehicle)
        return True

    def revoke(self, vehicle: str) -> Parcel:
        """As an operator, say that a vehicle's key is out: the same statement, however often.

        Raises:
            InputError: it has none.
        """
        if vehicle not in self.trust.statements:
            self.trust.revoke(self.trust.read(self.trust.revocation(vehicle)), self.clock())
        parcel = self._statement(vehicle)
        self.send(parcel)
        return parcel

    def pass_on(self) -> None:
        """Say again that a key is out, as it was signed, of one key after the other."""
        if self.trust.statements:
            self._passed_on += 1
            names = self.trust.revoked
            self.send(self._statement(names[self._passed_on % len(names)]))

    def _statement(self, vehicle: str) -> Parcel:
        data = self.trust.statements[vehicle]
        return Parcel(kind=Kind.REVOCATION, to=EVERYBODY, data=data, body=data)

    def _meet_twin(self, envelope: Envelope) -> None:
        """React to a true message in the own name that somebody else has said."""
        match envelope.kind:
            case Kind.QUESTION:
                self._answer_twin(envelope.body)
            case Kind.ANSWER:
                self.twins.hear_answer(envelope.body)
            case _:
                self.note_twin(envelope.time_s)

    def _answer_twin(self, question: bytes) -> None:
        """Say for how long this one has spoken, where that is longer."""
        try:
            if self.twins.may_answer(question):
                spoken_s = self.twins.spoken_s
                self._send(Kind.ANSWER, self.name, PeerClock.answer(question, spoken_s, spoken_s))
        except LinkDataError:
            self.counters["refused: no question"] += 1

    def _learn_order(self, sealed: bytes) -> None:
        """Take an order that another program of this operator gives, as one that a vehicle repeats.

        Raises:
            RefusedError: it is none of an operator.
        """
        if (receive := self._hears.get("receive_order")) is not None:
            order = self.trust.vouch(sealed, self.name)
            receive(order.body, order.sealed, True)  # noqa: FBT003

    def _guarded(self, use: Callable[[], object]) -> bool:
        """Do something with a message; whether it shows that somebody is heard."""
        try:
            return use() is not False
        except RefusedError as refusal:
            self.note_refusal(str(refusal))
            return str(refusal) == HEARD_BEFORE
        except Exception:
            # What comes over the network must not end the link, whatever a receiver makes of it.
            if not self.counters["failed to use"]:
                logger.exception("a message from the link could not be used")
            self.counters["failed to use"] += 1
        return True

    def accept_presence(self, vehicle: str, presence: Presence) -> None:
        """Take a presence that the link itself has found to be true."""
        if (receive := self._hears.get("receive_presence")) is not None:
            receive(vehicle, presence)

    def _is_sign_of_life(self, envelope: Envelope) -> bool:
        """Whether a presence is worth a look only because nothing else was heard for a while."""
        quiet = self.clock() - self._believed_s > QUIET_S
        return quiet and envelope.kind is Kind.PRESENCE and envelope.sender != self.name

    def note_refusal(self, reason: str) -> None:
        """Count a message that is not believed; people hear of some reasons the first time."""
        if reason == HEARD_BEFORE:
            # Over several links that is what becomes of every second copy.
            self.counters["copies"] += 1
            return
        self.counters[f"refused: {reason}"] += 1
        if reason == "another session of the leader":
            self.hurry.set()
        if reason == TWIN and self.is_operator:
            return
        text = ALARMS.get(reason)
        if text is not None and self.counters[f"refused: {reason}"] == 1:
            logger.warning(text, self.name)

    def _wants(self, kind: Kind, sender: str, body: bytes) -> bool:
        """Whether a message is about something that this member has a use for."""
        leads = sender == self.trust.leader
        match kind:
            case Kind.STATE:
                return (leads and self.listens) or sender in self.neighbours or sender == self.name
            case Kind.QUESTION:
                return kind in self._useful or self.stands_in
            case Kind.ANSWER:
                # On a wire that all share, others' answers are no news: they are not worth a look at the
                # signature.
                clock = self.twins if sender == self.name else self.peer_clock
                return clock is not None and clock.awaits(body)
            case _:
                return kind in self._useful

    def _use(self, message: Message) -> None:
        hears, sender = self._hears, message.sender
        match message.kind:
            case Kind.STATE if sender == self.trust.leader:
                hears.get("receive", ignore)(message.body)
            case Kind.STATE:
                hears.get("receive_neighbour", ignore)(sender, message.body)
            case Kind.QUESTION:
                if not self.stands_back:
                    self._answer(sender, message.body)
            case Kind.ANSWER:
                self._learn(message)
            case Kind.LEADER if receive := hears.get("receive_lead"):
                receive(sender, message.body)
            case Kind.ORDER | Kind.REPEAT if hand_on := hears.get("receive_order"):
                repeated = message.kind is Kind.REPEAT
                order = self.trust.vouch(message.body, sender) if repeated else message
                hand_on(order.body, order.sealed, repeated)
            case Kind.REPLY if reply := hears.get("receive_reply"):
                reply(sender, message.body)
            case _:
                self._note_presence(message)

    def _answer(self, asker: str, question: bytes) -> None:
        now = self.formation_time()
        if math.isnan(now):
            return
        try:
            answer = PeerClock.answer(question, now, now)
        except LinkDataError:
            self.counters["refused: no question"] += 1
            return
        self._send(Kind.ANSWER, asker, answer)

    def _learn(self, message: Message) -> None:
        now = self.clock()
        if self.peer_clock is None:
            return
        # The number that it answers was made up by this member, by chance: no recording has it.
        leads = message.sender == self.trust.leader
        if not leads and (
            self.trust.hears_leader(now) or now - self._asked_first_s < LEADER_LOST_S
        ):
            raise RefusedError("a deputy's clock while the leader may live")
        self.trust.prove(message.session if leads else message.epoch, now)
        if self.peer_clock.take(message.body, now):
            logger.warning("the clock of %r has stepped", self.trust.leader)

    def _note_presence(self, message: Message) -> None:
        try:
            presence = decode_presence(message.body)
        except LinkDataError:
            self.counters["refused: no presence"] += 1
            return
        self.accept_presence(message.sender, presence)

    def formation_time(self) -> float:
        """Now on the formation's clock, s; NaN while not known."""
        if self.trust.leads:
            return self.clock()
        return math.nan if self.peer_clock is None else self.peer_clock.to_peer(self.clock())

    def _seal(self, kind: Kind, to: str, body: bytes) -> Parcel:
        data = self.trust.seal(kind, body, time_s=self.formation_time())
        return Parcel(kind=kind, to=to, data=data, body=body)

    def _send(self, kind: Kind, to: str, body: bytes) -> Parcel:
        parcel = self._seal(kind, to, body)
        self.send(parcel)
        return parcel
