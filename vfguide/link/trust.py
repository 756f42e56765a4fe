"""Whom a member of a formation believes: seals what it says; opens what others say, or says why not.

Nothing here owns a socket or reads a clock. What carries the messages is not trusted: it can lose, keep,
repeat, change and make up whatever it likes, and all that comes of it is silence and counters.
"""

import math
import secrets
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import msgspec

from vfguide.errors import InputError
from vfguide.link.codec import (
    Envelope,
    Kind,
    LinkDataError,
    Scheme,
    checksum,
    decode_envelope,
    encode_signed,
    formation_number,
)
from vfguide.link.keys import PUBLIC_SIZE, Roster, Verifier, public_bytes, verifier_of

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

GRACE_S = 3.0
"""For this long after a leader has started anew, what others say under its last session is heard too: they
learn of
the new one one after the other."""

VEHICLES_MAY = frozenset({Kind.STATE, Kind.PRESENCE, Kind.WILL, Kind.REPLY, Kind.REPEAT})
LEADER_MAY = VEHICLES_MAY | {Kind.QUESTION, Kind.ANSWER}
DEPUTY_MAY = VEHICLES_MAY | {Kind.QUESTION, Kind.ANSWER, Kind.LEADER}
FOLLOWER_MAY = VEHICLES_MAY | {Kind.QUESTION}
OPERATOR_MAY = frozenset({Kind.QUESTION, Kind.ORDER, Kind.REPLY})
"""Kinds of messages that a part in the formation may send."""

RIVAL_S = 1.0
"""A leader that was heard this short a time ago has not started anew: another session is a second leader."""

MOST_STRANGERS = 256
"""Senders that are kept in mind without a roster, where anybody can make up names."""

REPEATABLE = frozenset({Kind.WILL})
"""Kinds that may come late: a broker keeps a will for as long as the connection lasts."""

TWIN = "another companion of this name"
"""Why a message is refused that is signed with one's own key, and not by oneself."""

HEARD_BEFORE = "heard before"
"""Why a message is refused that came before, or a newer one of its kind."""

REVOKED = "a revoked key"
"""Why a message is refused whose sender's key an operator has declared to be out."""

AHEAD_S = 2.0
"""No message is of later than so far ahead on the formation's clock."""

SAID_PER_S, SAID_AT_ONCE = 400.0, 2000.0
"""Messages a second of one sender, and at once, by which its numbers rise at most and which are looked at.

Whoever has a sender's key and says more silences that sender, and takes no more of a receiver's time."""

MET = 32
"""Sessions of the leader that are kept in mind: flights in one run of this program."""

SURE = 2
"""Members that have to repeat an order of a session that this one has not met."""

LEADER_LOST_S = 3.0
"""A deputy tells the time once the leader was not heard for so long."""

FORGED_PER_S = 500
"""Signatures a second that are looked at in vain, at most: a tenth of a core. What a flood of forgeries hides
is not heard; the vehicle is steered all the same."""


def new_session() -> int:
    """A number for one run of a program: 64 bits of chance, not 0."""
    return secrets.randbits(64) or 1


class RefusedError(Exception):
    """A message that is not believed; the text is the reason, short enough for a counter."""


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Something that is believed."""

    kind: Kind
    """What it is about."""
    sender: str
    """Who says it."""
    session: int
    """The run of its sender in which it was said."""
    body: bytes
    """What is said."""
    epoch: int = 0
    """The leader's session that it was said under."""
    sealed: bytes = b""
    """The whole envelope, of an order: others may have to be shown it."""


@dataclass(slots=True)
class Heard:
    """What is known of the messages of one sender."""

    session: int
    """The run that is believed in."""
    epoch: int
    """The leader's session that the last message was said under."""
    time_s: float
    """The newest time of any message, s on the formation's clock."""
    sequences: dict[Kind, int] = field(default_factory=dict)
    """The newest of each kind."""
    newest: int = 0
    """The newest of all."""
    noted_s: float = -math.inf
    """When that came, s."""


@dataclass(slots=True)
class Allowance:
    """How much a sender may say now: it fills with time, and each message takes one."""

    left: float = SAID_AT_ONCE
    """Messages."""
    time_s: float = -math.inf
    """When it was filled last, s."""

    def fill(self, now: float) -> float:
        """Return what is left now, messages."""
        # Not "passed": a clock that was set back must not empty it for ever.
        passed_s = max(now - self.time_s, 0.0)
        self.left, self.time_s = min(self.left + SAID_PER_S * passed_s, SAID_AT_ONCE), now
        return self.left


class Trust:
    """One member's: what it signs with, and what it has heard."""

    def __init__(
        self,
        *,
        formation: str,
        name: str,
        leader: str,
        session: int,
        roster: Roster | None,
        key: "Ed25519PrivateKey | None" = None,
        watches: bool = False,
        deputies: Collection[str] = (),
    ) -> None:
        """Make it, with nothing heard.

        Args:
            formation: name of the formation.
            name: of this member.
            leader: name of the leader.
            session: 64 bits of chance, new at each start; not 0.
            roster: everybody's public keys; None to sign nothing and to believe anybody.
            key: the own private key; None for one who only listens.
            watches: whether this is no vehicle, but somebody who wants to know how the vehicles are: also
            of one that
                has not found its leader, and, while no leader has answered, of all that sounds right.
            deputies: who may lead in the leader's place, and answer in it what its clock shows.

        Raises:
            InputError: the roster is another formation's, the leader has no key in it, or the own key is
            not the
                one that it names.
        """
        self.name = name
        self.leader = leader
        self.deputies = frozenset(deputies)
        """Who may lead in the leader's place."""
        self.counters: Counter[str] = Counter()
        """Messages that were not believed, by reason."""
        self._formation = formation_number(formation)
        self._roster = roster
        self._key = key
        self._session = session
        self._sequence = 0
        self._verifiers: dict[str, Verifier] = {}
        self._heard: dict[str, Heard] = {}
        self._asked: dict[str, Heard] = {}
        self._epoch = session if name == leader else 0
        self._epoch_before, self._grace_ends_s = 0, -math.inf
        self._leader_s = -math.inf
        self._met = {self._epoch: None} if self._epoch else {}
        self._repeated: tuple[bytes, set[str]] = (b"", set())
        self._allowed: dict[str, Allowance] = {}
        self._vain, self._vain_s = 0.0, -math.inf
        self._watches = watches
        self.statements: dict[str, bytes] = {}
        """By which an operator has revoked vehicles' keys, as they were signed."""
        if roster is not None:
            check_roster(roster, formation=formation, name=name, leader=leader, key=key)
            public = {**roster.vehicles, **roster.operators}
            self._verifiers = {one: verifier_of(data) for one, data in public.items()}

    @property
    def signs(self) -> bool:
        """Whether messages are signed; else anybody is believed."""
        return self._roster is not None

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the roster's vehicles, the leader first; none without a roster."""
        if self._roster is None:
            return ()
        return (self.leader, *sorted(set(self._roster.vehicles) - {self.leader}))

    @property
    def leads(self) -> bool:
        """Whether this member is the leader."""
        return self.name == self.leader

    @property
    def proven(self) -> bool:
        """Whether the leader's session is known to live, or to have lived since this member has started."""
        return self._epoch != 0

    def seal(self, kind: Kind, body: bytes, *, time_s: float) -> bytes:
        """Put a body into an envelope of one's own.

        Args:
            kind: what it is about.
            body: what to say.
            time_s: now, s on the formation's clock; NaN while not known.

        Raises:
            ValueError: it is too long.
        """
        self._sequence += 1
        scheme = Scheme.UNSIGNED if self._key is None else Scheme.ED25519
        signed = encode_signed(
            scheme,
            kind,
            formation=self._formation,
            sender=self.name,
            session=self._session,
            epoch=self._epoch,
            sequence=self._sequence % 2**32,
            time_s=time_s,
            body=body,
        )
        return signed + (checksum(signed) if self._key is None else self._key.sign(signed))

    @property
    def revoked(self) -> tuple[str, ...]:
        """Vehicles whose keys are out."""
        return tuple(self.statements)

    @property
    def is_revoked(self) -> bool:
        """Whether the own key is out: nobody who knows that hears this member."""
        return self.name in self.statements

    def revocation(self, vehicle: str) -> bytes:
        """An operator's statement that a vehicle's key is out: that very key, in any flight.

        Raises:
            InputError: the roster names no such vehicle.
        """
        public = None if self._roster is None else self._roster.vehicles.get(vehicle)
        if public is None:
            raise InputError(
                f"{vehicle} has no key in the roster that could be revoked; there are"
                f" {', '.join(self.vehicles) or 'none'}"
            )
        return self.seal(Kind.REVOCATION, public + vehicle.encode(), time_s=math.nan)

    def revoke(self, envelope: Envelope, now: float) -> str | None:
        """Take a statement that a vehicle's key is out, whenever it was made and whoever passes it on.

        It names the key itself: of one that was replaced since, or is out already, it changes nothing.

        Args:
            envelope: the statement.
            now: s, on the clock of `believe`.

        Returns:
            The vehicle; None where that was known.

        Raises:
            RefusedError: it is none.
        """
        public, vehicle = (
            envelope.body[:PUBLIC_SIZE],
            envelope.body[PUBLIC_SIZE:].decode(errors="replace"),
        )
        if vehicle in self.statements:
            return None
        if self._roster is None or envelope.scheme is not Scheme.ED25519:
            raise RefusedError("not signed")
        if envelope.sender not in self._roster.operators:
            raise RefusedError("not for its sender to say")
        if not public or self._roster.vehicles.get(vehicle) != public:
            raise RefusedError("no key of this roster")
        self._check_tag(envelope, now)
        self.statements[vehicle] = envelope.signed + envelope.tag
        return vehicle

    def recall(self, statements: Iterable[bytes]) -> int:
        """Take statements that were kept; return how many are damaged or not of this roster's keys."""
        refused = 0
        for data in statements:
            try:
                self.revoke(self.read(data), 0.0)
            except RefusedError:
                refused += 1
        return refused

    def read(self, data: bytes) -> Envelope:
        """The envelope of a message to this formation, which is not believed yet.

        Raises:
            RefusedError: it is none.
        """
        try:
            envelope = decode_envelope(data)
        except LinkDataError:
            raise RefusedError("malformed") from None
        if envelope.formation != self._formation:
            raise RefusedError("another formation")
        return envelope

    def believe(
        self, envelope: Envelope, now: float, time_s: float = math.nan, *, tagged: bool = False
    ) -> Message:
        """Find out whether a message can be believed.

        What costs least is asked first: a repeated message is refused before its signature is looked at.

        Args:
            envelope: the message.
            now: s on any clock that goes on evenly, the same each time.
            time_s: now on the formation's clock, s; NaN while it is not known.
            tagged: whether the link has found it to be true, by a tag of its own in a signature's place.

        Raises:
            RefusedError: it cannot be; the text says why.
        """
        if not tagged:
            self._check_scheme(envelope)
        if envelope.kind not in self._may(envelope.sender):
            raise RefusedError("not for its sender to say")
        if envelope.sender in self.statements:
            raise RefusedError(REVOKED)
        heard = self._in_order(envelope, now)
        self._check_leaps(envelope, heard, now, time_s)
        if not tagged:
            self._check_tag(envelope, now)
        self._allowed[envelope.sender].left -= 1.0
        if envelope.sender == self.name:
            raise RefusedError(TWIN)
        self._note(heard, envelope, now)
        if envelope.session == self._epoch:
            self._leader_s = now
        return Message(
            kind=envelope.kind,
            sender=envelope.sender,
            session=envelope.session,
            body=envelope.body,
            epoch=envelope.epoch,
            sealed=envelope.signed + envelope.tag if envelope.kind is Kind.ORDER else b"",
        )

    def _check_scheme(self, envelope: Envelope) -> None:
        """See that a message is signed where that is due, by a member.

        Raises:
            RefusedError: it is not.
        """
        if envelope.scheme is not (Scheme.ED25519 if self.signs else Scheme.UNSIGNED):
            raise RefusedError("not signed" if self.signs else "signed, where --insecure was typed")
        if self.signs and envelope.sender not in self._verifiers:
            raise RefusedError("a stranger")

    def vouch(self, sealed: bytes, speaker: str) -> Message:
        """Return an operator's order of this flight that another member repeats.

        It was given under a session of the leader, which the operator has signed. Where this member has not
        met that session, two others have to repeat the order. That it is the one that is flown now is for its
        number to say, which fresh states carry.

        Args:
            sealed: the operator's envelope.
            speaker: who repeats it.

        Raises:
            RefusedError: it is none, no operator's of this formation, or of another flight.
        """
        envelope = self.read(sealed)
        if envelope.kind is not Kind.ORDER or Kind.ORDER not in self._may(envelope.sender):
            raise RefusedError("not an operator's order")
        expected = Scheme.ED25519 if self.signs else Scheme.UNSIGNED
        verifies = self._verifiers.get(envelope.sender)
        if envelope.scheme is not expected or (self.signs and verifies is None):
            raise RefusedError("not an operator's order")
        if verifies is None:
            if checksum(envelope.signed) != envelope.tag:
                raise RefusedError("damaged")
        elif not verifies(envelope.tag, envelope.signed):
            raise RefusedError("a forged order")
        if envelope.epoch not in self._met and not self._is_sure(sealed, speaker):
            raise RefusedError("an order of another flight")
        return Message(
            kind=envelope.kind,
            sender=envelope.sender,
            session=envelope.session,
            body=envelope.body,
            sealed=sealed,
        )

    def _is_sure(self, sealed: bytes, speaker: str) -> bool:
        """Whether enough members have repeated an order, as a companion that was started anew needs it."""
        known, speakers = self._repeated
        if known != sealed:
            known, speakers = self._repeated = sealed, set()
        speakers.add(speaker)
        # In a formation of two there is only one other.
        return len(speakers) >= min(SURE, max(len(self.vehicles) - 1, 1))

    def _check_leaps(
        self, envelope: Envelope, heard: Heard | None, now: float, time_s: float
    ) -> None:
        """See that a sender's times and numbers rise as time allows, and that it leaves time for others.

        Raises:
            RefusedError: they leap, or it says too much.
        """
        allowed = self._allowed.get(envelope.sender)
        if allowed is None:
            if len(self._allowed) >= MOST_STRANGERS + len(self._verifiers):
                raise RefusedError("too many senders")
            allowed = self._allowed[envelope.sender] = Allowance()
        # By questions and answers the clocks are found that times are told by.
        timed = envelope.kind not in {Kind.QUESTION, Kind.ANSWER}
        if timed and envelope.time_s > time_s + AHEAD_S:
            raise RefusedError("of a time to come")
        if allowed.fill(now) < 1.0:
            raise RefusedError("says too much")
        if heard is not None:
            most = SAID_AT_ONCE + SAID_PER_S * max(now - heard.noted_s, 0.0)
            if envelope.sequence - heard.newest > most:
                raise RefusedError("a number that leaps")

    def _check_tag(self, envelope: Envelope, now: float) -> None:
        """See that a message is as its sender has said it; looking at signatures leaves time for all else.

        Raises:
            RefusedError: it is not, or too many were forged within the last second.
        """
        verifies = self._verifiers.get(envelope.sender)
        if verifies is None:
            if checksum(envelope.signed) != envelope.tag:
                raise RefusedError("damaged")
            return
        # Not "passed": a clock that was set back must not stop the count.
        passed_s = max(now - self._vain_s, 0.0)
        self._vain, self._vain_s = max(self._vain - FORGED_PER_S * passed_s, 0.0), now
        if self._vain >= FORGED_PER_S:
            raise RefusedError("in a flood of forgeries")
        if not verifies(envelope.tag, envelope.signed):
            self._vain += 1.0
            raise RefusedError("forged")

    def prove(self, session: int, now: float) -> None:
        """Take a session of the leader for the one that lives: it has answered this member's own question.

        Args:
            session: of the answer.
            now: s, on the clock of `believe`.

        Raises:
            RefusedError: another session of the leader lives, too.
        """
        if session == self._epoch:
            return
        if now - self._leader_s < RIVAL_S:
            raise RefusedError("a second leader")
        self._met[session] = None
        if len(self._met) > MET:
            del self._met[next(iter(self._met))]
        self._epoch_before, self._grace_ends_s = self._epoch, now + GRACE_S
        self._epoch = session
        self._heard.pop(self.leader, None)

    @property
    def takes_all(self) -> bool:
        """Whether all that sounds right is good enough: for who watches, while no leader has answered."""
        return self._watches and not self.proven

    def epochs(self, now: float) -> tuple[int, ...]:
        """Sessions of the leader that a message may have been said under, the one that lives first.

        Args:
            now: s, on the clock of `believe`.
        """
        if not self.proven:
            return ()
        graced = self._epoch_before != 0 and now < self._grace_ends_s
        return (self._epoch, self._epoch_before) if graced else (self._epoch,)

    def hears_leader(self, now: float) -> bool:
        """Whether the leader was heard lately: no deputy tells the time in its place."""
        return now - self._leader_s < LEADER_LOST_S

    def _may(self, sender: str) -> frozenset[Kind]:
        if sender == self.leader:
            return LEADER_MAY | {Kind.LEADER} if self.deputies else LEADER_MAY
        if sender in self.deputies:
            return DEPUTY_MAY
        if self._roster is None:
            return FOLLOWER_MAY | OPERATOR_MAY
        return FOLLOWER_MAY if sender in self._roster.vehicles else OPERATOR_MAY

    def _in_order(self, envelope: Envelope, now: float) -> Heard | None:
        """What is known of the sender, if it may have said this after all before; None for a new session.

        Raises:
            RefusedError: it is repeated, or was said in another flight.
        """
        made_here = envelope.sender == self.name and envelope.sequence <= self._sequence
        if envelope.session == self._session and (made_here or envelope.sender != self.name):
            raise RefusedError("one's own")
        if envelope.sender == self.name:
            # Whether it is a true one is for its signature to say; it is not believed in any case.
            return None
        asks = envelope.kind is Kind.QUESTION
        heard = (self._asked if asks else self._heard).get(envelope.sender)
        if not asks:
            self._check_flight(envelope, now)
        if heard is None or heard.session != envelope.session:
            if heard is not None and not asks and envelope.sender != self.leader:
                self._check_newer(envelope, heard)
            return None
        newest = heard.sequences.get(envelope.kind, 0)
        # Nothing was heard of so late a time: who has its key, and ran ahead with its numbers, silences it no
        # longer than it speaks.
        later = envelope.time_s > heard.time_s
        if envelope.sequence <= newest and not later and envelope.kind not in REPEATABLE:
            raise RefusedError(HEARD_BEFORE)
        return heard

    def _check_flight(self, envelope: Envelope, now: float) -> None:
        """See that a message is of this flight.

        Raises:
            RefusedError: it is of another, or of another run of the leader.
        """
        # Whether an answer is one to this member's question is for its number to say.
        answers = envelope.kind is Kind.ANSWER
        if envelope.sender == self.leader:
            if not (answers or envelope.session == self._epoch or self.takes_all):
                raise RefusedError("another session of the leader")
            return
        # A deputy answers under which of the leader's sessions the formation flies.
        if not (answers and envelope.epoch) and not self._under(envelope.epoch, now):
            raise RefusedError("another flight")

    def _under(self, epoch: int, now: float) -> bool:
        """Whether a message that was said under a leader's session is of this flight."""
        if epoch == 0 or not self.proven:
            # Recordings of every flight begin like that: it is good enough to look at, not to fly by.
            return self._watches
        if epoch == self._epoch:
            return True
        return now < self._grace_ends_s and epoch == self._epoch_before

    def _check_newer(self, envelope: Envelope, heard: Heard) -> None:
        """A new session has to be newer than what was heard of the one before.

        Raises:
            RefusedError: it is not.
        """
        if self.takes_all:
            newer = True
        elif envelope.epoch == heard.epoch:
            newer = envelope.time_s > heard.time_s or math.isnan(heard.time_s)
        else:
            newer = envelope.epoch == self._epoch
        if not newer:
            raise RefusedError("an earlier session")

    def _note(self, heard: Heard | None, envelope: Envelope, now: float) -> None:
        """Keep in mind what was just believed."""
        if heard is None:
            if envelope.kind is Kind.ANSWER and self._epoch not in (
                envelope.session,
                envelope.epoch,
            ):
                # It may prove this session, and is kept in mind once it has.
                return
            book = self._asked if envelope.kind is Kind.QUESTION else self._heard
            if envelope.sender not in book and len(book) >= MOST_STRANGERS + len(self._verifiers):
                raise RefusedError("too many senders")
            heard = Heard(envelope.session, envelope.epoch, math.nan)
            book[envelope.sender] = heard
        heard.epoch = envelope.epoch
        heard.sequences[envelope.kind] = max(
            envelope.sequence, heard.sequences.get(envelope.kind, 0)
        )
        heard.newest, heard.noted_s = max(heard.newest, envelope.sequence), now
        if envelope.time_s > heard.time_s or math.isnan(heard.time_s):
            heard.time_s = envelope.time_s


def check_roster(
    roster: Roster, *, formation: str, name: str, leader: str, key: "Ed25519PrivateKey | None"
) -> None:
    """See that a roster fits a member.

    Raises:
        InputError: it does not.
    """
    remedy = "run `vfguide keys make`, and give everybody the same roster"
    if roster.formation != formation:
        raise InputError(
            f"the roster is of the formation {roster.formation!r}, the mission's is {formation!r}; {remedy}"
        )
    if leader not in roster.vehicles:
        raise InputError(f"the roster has no key of the leader {leader!r}; {remedy}")
    if key is not None and roster.public(name) != public_bytes(key):
        raise InputError(
            f"the private key of {name!r} is not the one that the roster names; {remedy}"
        )
