"""Which packets on a radio are believed: by who may say what, by their tags, and in their order.

A tag is made with the formation's radio key and the leader's session that a packet is said under.
Nothing here owns a port or reads a clock but the member's.
"""

import hmac

from vfguide.link.member import Member
from vfguide.link.packed import (
    LEADER,
    OPERATOR,
    PackedKind,
    Packet,
    encode_packet,
    formation_key,
    formation_mark,
    tag_of,
    ticks_of,
)
from vfguide.link.trust import HEARD_BEFORE, REVOKED, RefusedError

VEHICLES_MAY = frozenset(
    {
        PackedKind.STATE,
        PackedKind.PRESENCE,
        PackedKind.ORDER,
        PackedKind.REPLY,
        PackedKind.REPEAT,
        PackedKind.REVOCATION,
    }
)
LEADER_MAY = VEHICLES_MAY | {PackedKind.BEAT, PackedKind.QUESTION, PackedKind.ANSWER}
FOLLOWERS_MAY = VEHICLES_MAY | {PackedKind.QUESTION}
OPERATOR_MAY = frozenset(
    {PackedKind.QUESTION, PackedKind.ORDER, PackedKind.REPLY, PackedKind.REVOCATION}
)
"""Kinds that a sender may say."""

OF_NO_SESSION = frozenset({PackedKind.QUESTION, PackedKind.REVOCATION})
"""Kinds that are said under no session of the leader: who knows none hears them."""

UNKNOWN_SESSION = "another session or forged"
"""Why a packet is refused whose tag is not of this session of the leader."""


class RadioTrust:
    """What one member knows to prove its own packets by, and to tell others' true ones."""

    def __init__(
        self,
        member: Member,
        *,
        number: int | None,
        formation: str,
        vehicles: tuple[str, ...],
        key: bytes,
    ) -> None:
        """Know no packet yet.

        Args:
            member: has the clock, and knows the leader's sessions.
            number: its own as a sender; None for one that sends nothing.
            formation: its name.
            vehicles: names of all vehicles, the leader first.
            key: the formation's radio key; empty to believe anybody.
        """
        self._member = member
        self._number = number
        self._names = vehicles
        self._mark = formation_mark(formation)
        self._key = formation_key(key, formation, vehicles)
        self._newest: dict[tuple[int, PackedKind], tuple[int, int]] = {}

    def check_sender(self, packet: Packet) -> None:
        """See that a packet is of this formation, and its sender one that may say such a thing.

        Raises:
            RefusedError: it is not.
        """
        if packet.formation != self._mark:
            raise RefusedError("another formation")
        leads, operates = packet.sender == LEADER, packet.sender == OPERATOR
        if packet.sender >= len(self._names) and not operates:
            raise RefusedError("a stranger")
        may = LEADER_MAY if leads else OPERATOR_MAY if operates else FOLLOWERS_MAY
        if packet.kind not in may:
            raise RefusedError("not for its sender to say")
        if not operates and self._names[packet.sender] in self._member.trust.statements:
            raise RefusedError(REVOKED)

    def epoch_of(self, packet: Packet) -> int | None:
        """The leader's session that a packet was said under; None where its tag is of none that counts."""
        trust = self._member.trust
        match packet.kind:
            case kind if kind in OF_NO_SESSION:
                epochs: tuple[int, ...] = (0,)
            case PackedKind.ANSWER:
                epochs = (packet.session,)
            case PackedKind.PRESENCE if trust.takes_all:
                epochs = (packet.session,)
            case _:
                epochs = trust.epochs(self._member.clock())
        for epoch in epochs:
            if hmac.compare_digest(tag_of(self._key, epoch, packet.tagged), packet.tag):
                return epoch
        return None

    def check_newer(self, packet: Packet, epoch: int) -> None:
        """See that a packet comes after all before of its sender and kind.

        Raises:
            RefusedError: it was heard before, or a newer one was.
        """
        if packet.kind in {PackedKind.ANSWER, PackedKind.REVOCATION}:
            # Whether an answer is new is for the number to say that it answers.
            return
        about = packet.sender, packet.kind
        order = packet.number if packet.kind is PackedKind.QUESTION else packet.ticks
        before = self._newest.get(about)
        if before is not None:
            known, newest = before
            repeated = order == newest if packet.kind is PackedKind.QUESTION else order <= newest
            if known == epoch and repeated:
                raise RefusedError(HEARD_BEFORE)
            # What is said under the leader's last session comes before what was said under this one.
            now = self._member.clock()
            if known != epoch and known == next(iter(self._member.trust.epochs(now)), 0):
                raise RefusedError("an earlier session")
        self._newest[about] = epoch, order

    def sealed(
        self, kind: PackedKind, body: bytes, time_s: float, *, steered: bool = True
    ) -> bytes:
        """A packet with its tag; nothing where the formation's time is not known."""
        epoch, free = 0, kind in OF_NO_SESSION
        if not free:
            epoch = next(iter(self._member.trust.epochs(self._member.clock())), 0)
        if self._number is None or (epoch == 0 and not free):
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
            steered=steered,
        )
        return packet + tag_of(self._key, epoch, packet)
