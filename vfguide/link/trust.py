"""Trust of a formation's member: seals its own messages, and opens or refuses those of others.

Nothing here owns a socket or reads a clock. Carriers are not trusted. They may lose, keep, repeat, change and
forge messages; all that results is silence and counters.
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
"""Time after a leader's restart in which its old session still counts, s: members learn the new one in
turn."""

VEHICLES_MAY = frozenset({Kind.STATE, Kind.PRESENCE, Kind.WILL, Kind.REPLY, Kind.REPEAT})
LEADER_MAY = VEHICLES_MAY | {Kind.QUESTION, Kind.ANSWER}
DEPUTY_MAY = VEHICLES_MAY | {Kind.QUESTION, Kind.ANSWER, Kind.LEADER}
FOLLOWER_MAY = VEHICLES_MAY | {Kind.QUESTION}
OPERATOR_MAY = frozenset({Kind.QUESTION, Kind.ORDER, Kind.REPLY})
"""Kinds of messages that each role in the formation may send."""

RIVAL_S = 1.0
"""Silence of the leader below which another session is a second leader, not a restart, s."""

MOST_STRANGERS = 256
"""Maximum number of senders remembered without a roster, where anybody can make up names."""

REPEATABLE = frozenset({Kind.WILL})
"""Kinds that may come late: a broker keeps a will for as long as the connection lasts."""

TWIN = "another companion of this name"
"""Reason of refusal: signed with the own key by somebody else."""

HEARD_BEFORE = "heard before"
"""Reason of refusal: a copy, or older than a message of its kind."""

REVOKED = "a revoked key"
"""Reason of refusal: an operator has revoked the sender's key."""

AHEAD_S = 2.0
"""Greatest lead of a message's time over the formation's clock, s."""

SAID_PER_S, SAID_AT_ONCE = 400.0, 2000.0
"""Greatest rate, 1/s, and burst of a sender's messages and sequence numbers.

A thief of its key can silence the sender by exceeding them, but takes no more of a receiver's time.
"""

MET = 32
"""Number of the leader's sessions remembered: flights in one run of this program."""

SURE = 2
"""Number of members that must repeat an order of a session unknown to this one."""

LEADER_LOST_S = 3.0
"""Silence of the leader after which a deputy tells the time, s."""

FORGED_PER_S = 500
"""Maximum rate of failed signature checks, 1/s: a tenth of a core. A flood of forgeries hides messages, but
the vehicle is still steered."""


def new_session() -> int:
    """Return a number for one run of a program: 64 random bits, not 0."""
    return secrets.randbits(64) or 1


class RefusedError(Exception):
    """Refusal of a message; the text is the reason, short enough for a counter."""


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Believed message."""

    kind: Kind
    sender: str
    session: int
    """Sender's session, which is one run of its program."""
    body: bytes
    epoch: int = 0
    """The leader's session under which it was sent."""
    sealed: bytes = b""
    """Whole envelope of an order, which others may have to be shown; otherwise empty."""


@dataclass(slots=True)
class Heard:
    """Record of one sender's messages."""

    session: int
    """Session that is believed."""
    epoch: int
    """The leader's session under which the last message was sent."""
    time_s: float
    """Newest time of any message, s on the formation's clock."""
    sequences: dict[Kind, int] = field(default_factory=dict)
    """Highest sequence number of each kind."""
    newest: int = 0
    """Highest sequence number of all kinds."""
    noted_s: float = -math.inf
    """Local time of the latest message, s."""


@dataclass(slots=True)
class Allowance:
    """Messages that a sender may still send: time refills the allowance, and each message takes one."""

    left: float = SAID_AT_ONCE
    """Number of messages left."""
    time_s: float = -math.inf
    """Time of the last refill, s."""

    def fill(self, now: float) -> float:
        """Refill the allowance, and return the number of messages left."""
        # Limited to 0, so that a clock that was set back does not empty the allowance for ever.
        passed_s = max(now - self.time_s, 0.0)
        self.left, self.time_s = min(self.left + SAID_PER_S * passed_s, SAID_AT_ONCE), now
        return self.left


class Trust:
    """Signing, verification and memory of one member; `now` is s on the same steady clock in all methods."""

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
        """Create it with nothing heard.

        Args:
            formation: name of the formation.
            name: name of this member.
            leader: name of the leader.
            session: 64 random bits, new at each start; not 0.
            roster: public keys of all members; None to sign nothing and to believe anybody.
            key: the own private key; None for one that only listens.
            watches: True for an observer, who also hears vehicles that have found no leader, and anything
                plausible until a leader answers.
            deputies: names of vehicles that may lead, and tell the time, in the leader's place.

        Raises:
            InputError: the roster is another formation's, lacks the leader's key, or names another own key.
        """
        self.name = name
        self.leader = leader
        self.deputies = frozenset(deputies)
        """Names of vehicles that may lead in the leader's place."""
        self.counters: Counter[str] = Counter()
        """Numbers of refused messages, by reason."""
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
        """Operators' signed revocations by vehicle."""
        if roster is not None:
            check_roster(roster, formation=formation, name=name, leader=leader, key=key)
            public = {**roster.vehicles, **roster.operators}
            self._verifiers = {one: verifier_of(data) for one, data in public.items()}

    @property
    def signs(self) -> bool:
        """Whether messages are signed; otherwise anybody is believed."""
        return self._roster is not None

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the roster's vehicles, the leader first; empty without a roster."""
        if self._roster is None:
            return ()
        return (self.leader, *sorted(set(self._roster.vehicles) - {self.leader}))

    @property
    def leads(self) -> bool:
        """Whether this member is the leader."""
        return self.name == self.leader

    @property
    def proven(self) -> bool:
        """Whether the leader's session is known to live, or to have lived since this member started."""
        return self._epoch != 0

    def seal(self, kind: Kind, body: bytes, *, time_s: float) -> bytes:
        """Seal a message; `time_s` is now on the formation's clock, NaN while unknown.

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
        """Vehicles whose keys are revoked."""
        return tuple(self.statements)

    @property
    def is_revoked(self) -> bool:
        """Whether the own key is revoked: members that know that do not hear this one."""
        return self.name in self.statements

    def revocation(self, vehicle: str) -> bytes:
        """Return an operator's revocation of a vehicle's present key, for any flight.

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
        """Take a revocation, whenever made and whoever passes it on; return the vehicle if it is new.

        It names the key itself, and changes nothing if that key was replaced or revoked since.

        Raises:
            RefusedError: it is no operator's statement about a key of the roster.
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
        """Take stored revocations; return how many are damaged or not of this roster's keys."""
        refused = 0
        for data in statements:
            try:
                self.revoke(self.read(data), 0.0)
            except RefusedError:
                refused += 1
        return refused

    def read(self, data: bytes) -> Envelope:
        """Decode a message to this formation without verifying it; raise RefusedError if it is none."""
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
        """Verify a message.

        The cheapest checks come first: a repeated message is refused before its signature is verified.

        Args:
            envelope: the message.
            now: present time, s on any steady clock, the same each time.
            time_s: present time, s on the formation's clock; NaN while unknown.
            tagged: whether the link has verified a tag of its own in place of a signature.

        Raises:
            RefusedError: it cannot be believed; the text says why.
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
        """Check that a message is signed by a member where due; raise RefusedError if it is not."""
        if envelope.scheme is not (Scheme.ED25519 if self.signs else Scheme.UNSIGNED):
            raise RefusedError("not signed" if self.signs else "signed, where --insecure was typed")
        if self.signs and envelope.sender not in self._verifiers:
            raise RefusedError("a stranger")

    def vouch(self, sealed: bytes, speaker: str) -> Message:
        """Verify an operator's order of this flight that another member repeats.

        The operator has signed the session of the leader under which the order was given. Where this member
        has not met that session, two others must repeat the order. Its number, which fresh states carry,
        tells whether it is flown now.

        Args:
            sealed: the operator's envelope.
            speaker: name of the member that repeats it.

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
        """Check whether enough members have repeated an order, as a restarted companion requires."""
        known, speakers = self._repeated
        if known != sealed:
            known, speakers = self._repeated = sealed, set()
        speakers.add(speaker)
        # In a formation of two there is only one other.
        return len(speakers) >= min(SURE, max(len(self.vehicles) - 1, 1))

    def _check_leaps(
        self, envelope: Envelope, heard: Heard | None, now: float, time_s: float
    ) -> None:
        """Check that times and numbers rise as time allows, and limit the rate.

        Raises:
            RefusedError: they leap or are too many.
        """
        allowed = self._allowed.get(envelope.sender)
        if allowed is None:
            if len(self._allowed) >= MOST_STRANGERS + len(self._verifiers):
                raise RefusedError("too many senders")
            allowed = self._allowed[envelope.sender] = Allowance()
        # Questions and answers establish the clocks that tell the times.
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
        """Verify a tag; limit failed checks, to leave time for all else.

        Raises:
            RefusedError: it is wrong, or too many were wrong within the last second.
        """
        verifies = self._verifiers.get(envelope.sender)
        if verifies is None:
            if checksum(envelope.signed) != envelope.tag:
                raise RefusedError("damaged")
            return
        # Limited to 0, so that a clock that was set back does not stop the count.
        passed_s = max(now - self._vain_s, 0.0)
        self._vain, self._vain_s = max(self._vain - FORGED_PER_S * passed_s, 0.0), now
        if self._vain >= FORGED_PER_S:
            raise RefusedError("in a flood of forgeries")
        if not verifies(envelope.tag, envelope.signed):
            self._vain += 1.0
            raise RefusedError("forged")

    def prove(self, session: int, now: float) -> None:
        """Take a session of the leader as the live one: it has answered this member's own question.

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
        """Whether everything plausible is accepted: by an observer, while no leader has answered."""
        return self._watches and not self.proven

    def epochs(self, now: float) -> tuple[int, ...]:
        """Return the leader's sessions under which a message may have been sent, the live one first."""
        if not self.proven:
            return ()
        graced = self._epoch_before != 0 and now < self._grace_ends_s
        return (self._epoch, self._epoch_before) if graced else (self._epoch,)

    def hears_leader(self, now: float) -> bool:
        """Check whether the leader was heard lately, so that no deputy tells the time in its place."""
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
        """Return the sender's record, or None for a new session.

        Raises:
            RefusedError: it is repeated, or of another flight.
        """
        made_here = envelope.sender == self.name and envelope.sequence <= self._sequence
        if envelope.session == self._session and (made_here or envelope.sender != self.name):
            raise RefusedError("one's own")
        if envelope.sender == self.name:
            # Its signature decides whether it is authentic; it is not believed in any case.
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
        # No message of so late a time was heard. A thief of the key that ran ahead with sequence numbers thus
        # silences the sender no longer than the thief sends.
        later = envelope.time_s > heard.time_s
        if envelope.sequence <= newest and not later and envelope.kind not in REPEATABLE:
            raise RefusedError(HEARD_BEFORE)
        return heard

    def _check_flight(self, envelope: Envelope, now: float) -> None:
        """Check that a message is of this flight.

        Raises:
            RefusedError: it is of another flight, or of another run of the leader.
        """
        # The number of an answer decides whether it answers this member's question.
        answers = envelope.kind is Kind.ANSWER
        if envelope.sender == self.leader:
            if not (answers or envelope.session == self._epoch or self.takes_all):
                raise RefusedError("another session of the leader")
            return
        # A deputy's answer tells under which of the leader's sessions the formation flies.
        if not (answers and envelope.epoch) and not self._under(envelope.epoch, now):
            raise RefusedError("another flight")

    def _under(self, epoch: int, now: float) -> bool:
        """Check whether a message under a session of the leader is of this flight."""
        if epoch == 0 or not self.proven:
            # Recordings of every flight begin like that: good enough to watch, not to fly by.
            return self._watches
        if epoch == self._epoch:
            return True
        return now < self._grace_ends_s and epoch == self._epoch_before

    def _check_newer(self, envelope: Envelope, heard: Heard) -> None:
        """Check that a new session is newer than the last one heard; raise RefusedError if it is not."""
        if self.takes_all:
            newer = True
        elif envelope.epoch == heard.epoch:
            newer = envelope.time_s > heard.time_s or math.isnan(heard.time_s)
        else:
            newer = envelope.epoch == self._epoch
        if not newer:
            raise RefusedError("an earlier session")

    def _note(self, heard: Heard | None, envelope: Envelope, now: float) -> None:
        if heard is None:
            if envelope.kind is Kind.ANSWER and self._epoch not in (
                envelope.session,
                envelope.epoch,
            ):
                # Its session may be proven by it, and is recorded once it is.
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
    """See that a roster fits a member; raise InputError if it does not."""
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
