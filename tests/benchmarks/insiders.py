"""Attacks on orders by an insider: it holds a member's private key and hears every message."""

from random import Random
from typing import TYPE_CHECKING

from msgspec.structs import replace

from tests.kit.signed_flight import ELSEWHERE, Impostor, SignedFlight
from vfguide.formation.arrangement import Arrangement, Manoeuvre
from vfguide.lab.rehearsal.aircraft import OPERATOR
from vfguide.link.codec import Envelope, Kind, LinkDataError, decode, encode
from vfguide.link.order_codec import (
    Reply,
    Verdict,
    check_of,
    decode_order,
    encode_order,
    encode_reply,
)
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust

if TYPE_CHECKING:
    from collections.abc import Callable

EARLIER_EPOCH, EARLIER_SESSION = 5, 77
"""Epoch of the formation and session of the operator in the earlier, recorded flight."""

FLOODED = 40
"""Messages of a flood at each step: more than the 400 a second that a receiver checks."""

GREAT = 4_000_000_000
"""An order number greater than any in use."""


class Insider(Impostor):
    """An attacker of one form, active between `begin` and `end`."""

    def __init__(self, flight: SignedFlight, name: str, form: str, random: Random) -> None:
        """Hear all from now on.

        Args:
            flight: that it takes part in.
            name: whose key it has.
            form: one of those that this key allows.
            random: where chance comes from.
        """
        super().__init__(flight, name)
        self.form, self.random, self.attacks = form, random, False
        self._order: Arrangement | None = None
        self._recorded = b""
        self._offset_s = random.choice((-3.0, -0.5, 0.5, 3.0))
        self._act: dict[str, Callable[[], None]] = {
            "old order": self._play_old_order,
            "old abort": self._play_old_order,
            "number": self._say_number,
            "leap": self._leap,
            "flood": self._flood,
        }

    def begin(self) -> None:
        """Start attacking."""
        self.attacks = True
        if self.form == "silence":
            self.flight.members[self.name].silenced = frozenset({Kind.REPLY})

    def end(self) -> None:
        """Stop attacking."""
        if self.attacks:
            self.attacks = False
            self.flight.members[self.name].silenced = frozenset()

    def step(self) -> None:
        """Send what the attack sends by itself."""
        act = self._act.get(self.form)
        if act is not None and self.attacks:
            act()

    def hear(self, envelope: Envelope) -> None:
        """Answer a message where the attack is an answer."""
        if not self.attacks:
            return
        if envelope.kind is Kind.QUESTION and self.form == "clock":
            self._answer(envelope)
        elif envelope.kind is Kind.ORDER:
            order = decode_order(envelope.body)
            if self.form == "veto":
                reply = Reply(
                    number=order.number, verdict=Verdict.REFUSED, check=check_of(envelope.body)
                )
                self.say(Kind.REPLY, encode_reply(reply))
            elif self.form == "two orders" and order.number != self._number:
                self._give_another(order)
            self._order = order

    @property
    def _number(self) -> int:
        return 0 if self._order is None else self._order.number

    def record_earlier(self, order: Arrangement) -> None:
        """Record an order that the operator signed in an earlier flight."""
        mission = self.flight.mission
        earlier = Trust(
            formation=mission.name,
            name=OPERATOR,
            leader=mission.leader.vehicle,
            session=EARLIER_SESSION,
            roster=self.flight.roster,
            key=self.flight.keys[OPERATOR],
        )
        earlier.prove(EARLIER_EPOCH, 0.0)
        if self.form == "old abort":
            order = replace(order, flown=Manoeuvre.ABORT, places=(), across_s=0.0, climb_s=0.0)
        self._order = order
        self._recorded = earlier.seal(Kind.ORDER, encode_order(order), time_s=order.time_s)

    def _play_old_order(self) -> None:
        """Play it as it was recorded, repeat it, and fly by its number."""
        self.flight.carry(ELSEWHERE, self._recorded)
        if self.name != OPERATOR:
            self.say(Kind.REPEAT, self._recorded)
            self._tell(self._number)

    def _say_number(self) -> None:
        """Claim to fly by an order number that was never given, or is not decided yet."""
        self._tell(self.random.choice((GREAT, self._number)))

    def _tell(self, number: int) -> None:
        if self.state is not None:
            self.say(Kind.STATE, encode(replace(decode(self.state), arrangement=number)))

    def _leap(self) -> None:
        """Be the newest for good."""
        if self.state is not None:
            self.say(Kind.STATE, self.state, sequence=2**32 - 1)
            self.say(Kind.STATE, self.state, time_s=1e10)
            self.say(Kind.STATE, encode(replace(decode(self.state), time_s=1e10)))

    def _flood(self) -> None:
        for _ in range(FLOODED):
            self.say(Kind.STATE, self.random.randbytes(104))

    def _answer(self, question: Envelope) -> None:
        """Answer at once, and wrongly."""
        wrong_s = self.flight.now + self._offset_s
        try:
            body = PeerClock.answer(question.body, wrong_s, wrong_s)
        except LinkDataError:
            return
        self.say(Kind.ANSWER, body)

    def _give_another(self, order: Arrangement) -> None:
        """Give some of the vehicles another order of the same number, by the operator's key."""
        slow = replace(order, across_s=order.across_s + 2.0, time_s=order.time_s + 1.0)
        some = self.random.sample(self.flight.names, len(self.flight.names) // 2)
        self.say(Kind.ORDER, encode_order(slow), to=some)


VEHICLES_DO = ("old order", "old abort", "number", "silence", "veto", "leap", "flood")
LEADERS_DO = (*VEHICLES_DO, "clock")
OPERATORS_DO = ("old order", "old abort", "two orders", "leap", "flood")


def drawn_attack(flight: SignedFlight, random: Random) -> tuple[str, str]:
    """(name, form of the attack) of a follower, a deputy, the leader or the operator, by chance."""
    mission = flight.mission
    leader, deputies = mission.leader.vehicle, list(mission.deputies)
    others = [name for name in flight.names if name not in (leader, *deputies)]
    match random.choice(("follower", "deputy", "leader", "operator")):
        case "leader":
            return leader, random.choice(LEADERS_DO)
        case "deputy":
            return random.choice(deputies), random.choice(LEADERS_DO)
        case "operator":
            return OPERATOR, random.choice(OPERATORS_DO)
        case _:
            return random.choice(others), random.choice(VEHICLES_DO)


def strays(flight: SignedFlight, given: set[tuple[int, int]]) -> dict[str, str]:
    """Who flies an order that nobody has given in this flight, or another than the rest by one number.

    Args:
        flight: as it is now.
        given: (number, check) of all orders of the operator.
    """
    found, flown = {}, dict[int, int]()
    for name, one in flight.aircraft.items():
        order = one.companion._arrangements.flight.order  # noqa: SLF001
        if order is None:
            continue
        number, check = order.identity
        if order.identity not in given:
            found[name] = f"{name} flies order {number}, which nobody has given"
        elif flown.setdefault(number, check) != check:
            found[name] = f"{name} flies another order {number} than the rest"
    return found
