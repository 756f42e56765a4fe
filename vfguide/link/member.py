"""One member of a formation on its links: it seals its messages and hands on those that it believes.

A received message goes to `take`, a message to send to `send`, which puts a copy on every link.
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

# Of two companions with one name, the one that has spoken for less time finds that out and steps back.
#
# Nothing here reads a clock. A message in a member's own name, signed with its own key, may come from
# somebody else. It is then another companion of the same vehicle, or a recording of this or an earlier run.

YOUNG_S = 10.0
"""Speaking time up to which another companion of the same name may have been here first, s."""

TWIN_QUIET_S, TWIN_SPREAD_S = 6.0, 4.0
"""Least silence of another companion of one's name before speaking again, s, and its random extension, since
both may have stepped back."""

AFTER_START_S = 1.0
"""Margin after the own start beyond which a message in the own name is of no earlier run, s."""

ASK_EVERY_S, ASK_AGAIN_S = 1.0, 1.5
"""Mean intervals between questions to the own name, at first and once answered, s. Each varies by half, so
that two members on one radio do not stay in step."""

IN_VAIN, ASK_SELDOM_S = 6, 5.0
"""Questions without an answer, as to a recording, after which the interval grows to the second value, s."""

ANSWERED_S = 2.0
"""Time within which a genuine answer arrives, s; a later one was kept back."""

ANSWER_EVERY_S = 0.4
"""Minimum interval between two answers, s."""

REMEMBERED = 256
"""Number of question numbers remembered, asked as well as answered."""


class TwinWatch:
    """Detector of another companion with the member's name.

    A follower recognizes a recording by its time, which is the leader's. The leader has no such clock and
    asks in its own name. A random number of 64 bits, which no recording can answer, and its speaking time go
    with the question. Another leader that has spoken for longer answers, and the asker steps back.
    """

    def __init__(self, clock: Callable[[], float], *, asks: bool) -> None:
        """Create a detector that knows of no other companion; `asks` is True for the leader."""
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
        """Note that the member sends a state."""
        self._spoke_s = min(self._spoke_s, self._clock())

    @property
    def spoken_s(self) -> float:
        """Time for which the member has spoken, s."""
        return max(self._clock() - self._spoke_s, 0.0)

    @property
    def stands_back(self) -> bool:
        """Whether another companion was here first, so that this one must not steer."""
        return self._clock() - self._twin_s < self._quiet_s

    @property
    def is_young(self) -> bool:
        """Whether another companion may have been here first, so that own states are worth listening for."""
        return self._clock() - self._spoke_s < YOUNG_S

    def hear(self, said_ago_s: float) -> None:
        """Note an authentic message in the own name, said this long ago on the formation's clock, s."""
        live = said_ago_s < self._clock() - self._began_s - AFTER_START_S
        if live and not self.asks and (self.stands_back or self.is_young):
            self._step_back()

    def question(self) -> bytes | None:
        """Return a question to ask in the own name; None where none is due."""
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
        # The field of the asker's time holds the speaking time here.
        return encode_ask(Ask(number=number, originate_s=spoken_s))

    def awaits(self, answer: bytes) -> bool:
        """Check whether these bytes answer an open question of this member in its own name."""
        try:
            return decode_tell(answer).number in self._open
        except LinkDataError:
            return False

    def hear_answer(self, answer: bytes) -> None:
        """Take an answer in the own name, and step back if its sender has spoken for longer."""
        if not self.awaits(answer):
            return
        tell = decode_tell(answer)
        asked_s, spoken_s = self._open.pop(tell.number)
        if 0.0 <= self._clock() - asked_s <= ANSWERED_S and tell.transmit_s > spoken_s:
            self._in_vain = 0
            self._step_back()

    def may_answer(self, question: bytes) -> bool:
        """Check whether to answer, once, a question in the own name, which sends its asker back.

        Raises:
            LinkDataError: it is none.
        """
        ask, now = decode_ask(question), self._clock()
        if not self.asks or self.stands_back or now - self._answer_s < ANSWER_EVERY_S:
            return False
        if ask.number in self._made or ask.number in self._answered:
            # A replay.
            return False
        if self.spoken_s <= ask.originate_s:
            return False
        self._answer_s = now
        self._answered.append(ask.number)
        return True

    def _step_back(self) -> None:
        """Fall silent for a random time: two companions that drew alike once are parted the next time."""
        self._twin_s, self._spoke_s = self._clock(), math.inf
        self._quiet_s = TWIN_QUIET_S + TWIN_SPREAD_S * random()


logger = logging.getLogger(__name__)

ALARMS = {
    TWIN: "a companion calls itself %r, too, or its recording is played:"
    " see that each vehicle has one companion",
    "a second leader": "%r hears two companions of the leader: stop one of them",
}
"""Refusals that people must know of, with the log message of the first one."""

ELDER = "another companion of this name was here before: this one does not steer; stop one of them"
KEY_OUT = "its key is revoked, nobody hears it: it does not steer; make it a new one on the ground"
"""Reasons why a member stands back, for people."""

NOT_SAID = "not said: stands back"
"""Counter of messages that a member standing back has not sent."""

QUIET_S = 0.5
"""Silence after which the next presence of any vehicle is verified as a sign of life, s."""

EVERYBODY = ""
"""Broadcast recipient."""


class Parcel(msgspec.Struct, frozen=True, kw_only=True):
    """Sealed outgoing message."""

    kind: Kind
    to: str
    """Name of the recipient; empty for everybody."""
    data: bytes
    """Sealed envelope."""
    body: bytes
    """Encoded content, for links that have an envelope of their own."""


def ignore(*said: object) -> None:
    """Ignore a message."""
    del said


class Hearing(TypedDict, total=False):
    """Receivers of a member's messages; a message whose receiver is missing or None is ignored."""

    receive: Callable[[bytes], None]
    """Called with each new state of the leader."""
    receive_neighbour: Callable[[str, bytes], None]
    """Called with the name of a neighbour and its new state."""
    receive_presence: Callable[[str, Presence], None] | None
    """Called with the name of a vehicle and its presence."""
    receive_lead: Callable[[str, bytes], object] | None
    """Called with the name of a deputy that leads, and the state of the leader by which it leads."""
    receive_order: Callable[[bytes, bytes, bool], None] | None
    """Called with an operator's order, its envelope and whether another vehicle repeats it."""
    receive_reply: Callable[[str, bytes], None] | None
    """Called with the name of a member and its reply to an order."""
    receive_revocation: Callable[[str], object]
    """Called with the name of a vehicle whose key was just revoked."""


RECEIVERS = {
    Kind.PRESENCE: "receive_presence",
    Kind.WILL: "receive_presence",
    Kind.LEADER: "receive_lead",
    Kind.ORDER: "receive_order",
    Kind.REPEAT: "receive_order",
    Kind.REPLY: "receive_reply",
}
"""Receivers of the kinds that only members with such a receiver want."""


class Member:
    """Messages in and out of one program, independent of the carrier."""

    def __init__(
        self,
        trust: Trust,
        *,
        clock: Callable[[], float],
        neighbours: Collection[str] = (),
        peer_clock: PeerClock | None = None,
        **hears: Unpack[Hearing],
    ) -> None:
        """Create a member that is on no link yet.

        Args:
            trust: signs its messages and decides which messages it believes.
            clock: its own clock, s.
            neighbours: names of other vehicles whose states are wanted.
            peer_clock: estimates the leader's clock; None for the leader, and for members that do not ask.
            **hears: receivers of the messages.
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
        """Called with each message to send."""
        self.hurry = asyncio.Event()
        """Set when the leader's clock should be asked for at once."""
        self._believed_s = -math.inf
        self._asked_first_s = math.nan
        self._passed_on = 0
        self.stands_in = False
        """Whether this deputy leads, and so tells the formation's time while the leader cannot."""
        self._useful = frozenset(
            kind for kind, receive in RECEIVERS.items() if receive in wanted
        ) | ({Kind.QUESTION} if trust.leads else set())
        self.twins = TwinWatch(clock, asks=trust.leads)
        """Detector of another companion with the same name."""
        self.heeds_orders = bool(wanted & {"receive_order", "receive_reply"})
        """Whether orders and replies to them are wanted."""

    @property
    def is_operator(self) -> bool:
        """Whether this is no vehicle of the roster; several programs may use an operator's name and key."""
        return self.trust.signs and self.name not in self.trust.vehicles

    @property
    def stands_back(self) -> bool:
        """Whether this member must not steer."""
        return bool(self.standing_back)

    @property
    def standing_back(self) -> str:
        """Reason, for people, why this member must not steer; empty where it may."""
        if self.trust.is_revoked:
            return KEY_OUT
        return ELDER if self.twins.stands_back else ""

    def note_twin(self, said_s: float) -> None:
        """Note an authentic message of somebody else in the own name, unless this is an operator.

        An operator's programs steer nothing and may share a name. `said_s` is on the formation's clock.
        """
        if not self.is_operator:
            self.twins.hear(self.formation_time() - said_s)
            self.ask_twin()

    def ask_twin(self) -> None:
        """If a question is due, ask another companion of the own name whether it lives."""
        question = self.twins.question()
        if question is not None:
            self._send(Kind.QUESTION, self.name, question)

    @property
    def candidates(self) -> tuple[str, ...]:
        """Names of all other members that lead or may lead."""
        others = self.trust.deputies - {self.name, self.trust.leader}
        return (*([] if self.trust.leads else [self.trust.leader]), *sorted(others))

    @property
    def hears_leads(self) -> bool:
        """Whether states of the leaders by which deputies lead are wanted."""
        return Kind.LEADER in self._useful and bool(self.trust.deputies)

    @property
    def name(self) -> str:
        """Name of this member."""
        return self.trust.name

    @property
    def counters(self) -> Counter[str]:
        """Numbers of messages that were refused or could not be used, by reason."""
        return self.trust.counters

    def publish(self, body: bytes) -> Parcel:
        """Seal the own state, and send it unless this member stands back."""
        if self.stands_back:
            self.counters[NOT_SAID] += 1
            return self._seal(Kind.STATE, EVERYBODY, body)
        self.twins.note_speech()
        return self._send(Kind.STATE, EVERYBODY, body)

    def say(self, kind: Kind, body: bytes) -> Parcel:
        """Seal and send to all an order, a reply, a repeated order or the state of a leader.

        A member that stands back sends only orders: another companion of its name answers for the vehicle.
        """
        if self.stands_back and kind in {Kind.REPLY, Kind.REPEAT, Kind.LEADER}:
            self.counters[NOT_SAID] += 1
            return self._seal(kind, EVERYBODY, body)
        return self._send(kind, EVERYBODY, body)

    def give(self, operator: Trust, body: bytes) -> None:
        """Send an order signed here by an operator's key, and take it as every member does.

        Raises:
            RefusedError: the leader's session is unknown.
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
        """Seal a presence or a last will, without sending it; beyond `most` bytes it is shortened."""
        kind, body = Kind.WILL if will else Kind.PRESENCE, b""
        room = most - ENVELOPE.size - len(self.name.encode()) - SIGNATURE_SIZE
        for one in shorter_presences(presence):
            body = encode_presence(one)
            if len(body) <= room:
                break
        return self._seal(kind, EVERYBODY, body)

    def take(self, data: bytes) -> bool:
        """Take a message, counting errors; return whether a member was heard, be it by a copy."""
        return self._guarded(lambda: self._take(data))

    def vouch_for(self, envelope: Envelope) -> None:
        """Check a message whose tag the link itself has verified.

        Raises:
            RefusedError: it is not believed.
        """
        try:
            self.trust.believe(envelope, self.clock(), self.formation_time(), tagged=True)
        except RefusedError as refusal:
            # On a radio the answer to another companion of the own name waits for a turn.
            if str(refusal) == TWIN and envelope.kind is not Kind.QUESTION:
                self._meet_twin(envelope)
            raise

    def accept(self, message: Message) -> None:
        """Use a message that `vouch_for` believes."""
        self._believed_s = self.clock()
        if self._wants(message.kind, message.sender, message.body):
            self._guarded(lambda: self._use(message))

    def _take(self, data: bytes) -> bool:
        """Take a message; return whether a member is heard.

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
        """Take a revocation and pass it on; return whether it is new.

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
        """As an operator, send the revocation of a vehicle's key, the same statement each time.

        Raises:
            InputError: the vehicle has no key.
        """
        if vehicle not in self.trust.statements:
            self.trust.revoke(self.trust.read(self.trust.revocation(vehicle)), self.clock())
        parcel = self._statement(vehicle)
        self.send(parcel)
        return parcel

    def pass_on(self) -> None:
        """Send one of the known revocations again as it was signed, each in turn."""
        if self.trust.statements:
            self._passed_on += 1
            names = self.trust.revoked
            self.send(self._statement(names[self._passed_on % len(names)]))

    def _statement(self, vehicle: str) -> Parcel:
        data = self.trust.statements[vehicle]
        return Parcel(kind=Kind.REVOCATION, to=EVERYBODY, data=data, body=data)

    def _meet_twin(self, envelope: Envelope) -> None:
        """React to an authentic message in the own name that somebody else has sent."""
        match envelope.kind:
            case Kind.QUESTION:
                self._answer_twin(envelope.body)
            case Kind.ANSWER:
                self.twins.hear_answer(envelope.body)
            case _:
                self.note_twin(envelope.time_s)

    def _answer_twin(self, question: bytes) -> None:
        """Answer with the speaking time, where it is longer than the asker's."""
        try:
            if self.twins.may_answer(question):
                spoken_s = self.twins.spoken_s
                self._send(Kind.ANSWER, self.name, PeerClock.answer(question, spoken_s, spoken_s))
        except LinkDataError:
            self.counters["refused: no question"] += 1

    def _learn_order(self, sealed: bytes) -> None:
        """Take another program's order of this operator as a repeated one.

        Raises:
            RefusedError: it is none.
        """
        if (receive := self._hears.get("receive_order")) is not None:
            order = self.trust.vouch(sealed, self.name)
            receive(order.body, order.sealed, True)  # noqa: FBT003

    def _guarded(self, use: Callable[[], object]) -> bool:
        """Use a message and count errors; return whether it shows that a member is heard."""
        try:
            return use() is not False
        except RefusedError as refusal:
            self.note_refusal(str(refusal))
            return str(refusal) == HEARD_BEFORE
        except Exception:
            # A message from the network must not end the link, whatever a receiver makes of it.
            if not self.counters["failed to use"]:
                logger.exception("a message from the link could not be used")
            self.counters["failed to use"] += 1
        return True

    def accept_presence(self, vehicle: str, presence: Presence) -> None:
        """Take a presence that the link itself has verified."""
        if (receive := self._hears.get("receive_presence")) is not None:
            receive(vehicle, presence)

    def _is_sign_of_life(self, envelope: Envelope) -> bool:
        """Check whether a presence is worth verifying only because nothing else was heard for a while."""
        quiet = self.clock() - self._believed_s > QUIET_S
        return quiet and envelope.kind is Kind.PRESENCE and envelope.sender != self.name

    def note_refusal(self, reason: str) -> None:
        """Count a refused message; some reasons are logged the first time."""
        if reason == HEARD_BEFORE:
            # Over several links every second message is a copy.
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
        """Check whether this member wants a message."""
        leads = sender == self.trust.leader
        match kind:
            case Kind.STATE:
                return (leads and self.listens) or sender in self.neighbours or sender == self.name
            case Kind.QUESTION:
                return kind in self._useful or self.stands_in
            case Kind.ANSWER:
                # On a shared medium, answers to others are not worth verifying.
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
        # This member made up the answer's number at random: no recording has it.
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
        """Return the present time of the formation's clock, s; NaN while unknown."""
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
