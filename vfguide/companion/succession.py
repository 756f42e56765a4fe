"""Who leads a formation: terms, whose each is, and when a deputy leads on. Times come in; no clock is read.

A term is a number that every state carries. The highest that was heard counts, as in Raft (Ongaro and
Ousterhout, "In Search of an Understandable Consensus Algorithm", USENIX ATC 2014, section 5). No majority is
asked for: a part of the formation that hears no others has to fly on, too. Instead each term is one
vehicle's from the outset. Those who may lead stand in an order, the mission's leader first, then its
deputies: n of them. Term 0 is the leader's, and of every n terms from there on each has one, the last in the
order the lowest. So two parts that cannot hear each other never have two leaders of one term, and where both
have had one succession the part of the earlier deputy has the higher term.
"""

import math

STAGGER_S = 0.3
"""A deputy gives each who comes before it in the order so long to lead first: a message's way and some."""

UNSTEERED_S = 0.3
"""For so long a leader may say that its companion does not steer it."""

PATIENCE_S = 3.0
"""A leader that is not steered any more is carried on along its path for so long, since a deputy is about to
lead. If none can by then it is followed wherever it flies, as where there are no deputies."""

DEAF_S = 5.0
"""Who hears no vehicle at all is probably deaf itself. It flies on as predicted for so long, and then leads:
there may have been no other vehicle than the leader."""

WORKS_S = 0.6
"""The link works while another vehicle was heard this short a time ago."""

LATER_S = 0.3
"""Another that was heard by so much later than the leader shows that the link works without it."""

LISTEN_S = 1.5
"""A leader that has just started listens for so long: it may have been succeeded."""

VACANT_S = 3.0
"""A leader that hears for so long only that others obey a higher term, and not the vehicle that leads in it,
leads in a new one: that vehicle is gone, and who has heard it obeys no lower term any more."""

MOST_RENEWALS = 10
"""After so many it waits no longer each time: for some 50 minutes."""

GREATEST_TERM = 2**32 - 1

MOST_ROUNDS = 1_000
"""A state of any vehicle raises the terms that are known by at most so many rounds: a damaged or forged one
is not to use them all up, after which nobody could lead any more."""

LEADERS_ROUNDS = 1_000_000
"""The same of a leader's own. They are known where the leader was not heard for a long time, or never."""


def holder_of(term: int, order: tuple[str, ...]) -> str:
    """The vehicle whose a term is.

    Args:
        term: 0 or higher.
        order: who may lead, the mission's leader first.
    """
    if term == 0:
        return order[0]
    return order[-1 - (term - 1) % len(order)]


def term_above(highest: int, name: str, order: tuple[str, ...]) -> int:
    """The lowest term of a vehicle in the next round of terms.

    Args:
        highest: of all terms that it has heard of.
        name: of a vehicle in the order.
        order: who may lead, the mission's leader first.
    """
    rounds = -(-highest // len(order))
    return rounds * len(order) + len(order) - order.index(name)


class Succession:
    """One vehicle's view of who leads."""

    def __init__(self, name: str, order: tuple[str, ...], *, silence_s: float) -> None:
        """Know of the mission's leader only.

        Args:
            name: of the vehicle.
            order: who may lead, the mission's leader first; the vehicle need not be among them.
            silence_s: how long nothing may be heard of a leader (`timeouts.leader_s`).
        """
        self._name = name
        self._order = order
        self._silence_s = silence_s
        self.term = 0
        """Highest term of which a leader was heard, or one's own."""
        self.highest = 0
        """Highest term that any state has carried."""
        self.listens = name == order[0]
        """Whether this is the mission's leader, just started, and may have been succeeded."""
        self._began_s = self._unsteered_s = self._outranked_s = math.inf
        self._heard_s = self._others_s = self._works_since = -math.inf
        self._steered = False
        self._renewals = 0

    @property
    def holder(self) -> str:
        """The vehicle that leads, as far as is known."""
        return holder_of(self.term, self._order)

    @property
    def leads(self) -> bool:
        """Whether this vehicle leads."""
        return self.holder == self._name and not self.listens

    @property
    def was_heard(self) -> bool:
        """Whether a leader was heard: only it can be succeeded."""
        return math.isfinite(self._heard_s)

    def is_leaving(self, now: float) -> bool:
        """Whether the leader was steered by its companion, and is not any more since a short while."""
        return self._steered and 0.0 <= now - self._unsteered_s < PATIENCE_S

    def may_obey(self, vehicle: str, term: int) -> bool:
        """Whether a vehicle that says that it leads in a term is the one to be obeyed."""
        in_reach = self.term <= term <= self._reach(LEADERS_ROUNDS)
        return in_reach and self._holds(vehicle, term)

    def _holds(self, vehicle: str, term: int) -> bool:
        """Whether a term is that of another vehicle."""
        return vehicle != self._name and vehicle == holder_of(term, self._order)

    def _reach(self, rounds: int) -> int:
        """The highest term within so many rounds of terms from the one that is obeyed."""
        return self.term + rounds * len(self._order)

    def hear_leader(self, vehicle: str, term: int, now: float, *, steered: bool) -> bool:
        """Take notice of a leader's state.

        Args:
            vehicle: whose message it is.
            term: that it says it leads in.
            now: s.
            steered: whether its own companion steers it.

        Returns:
            Whether it is the one to be obeyed.
        """
        if not self._holds(vehicle, term):
            return False
        if not self.may_obey(vehicle, term):
            self.hear_other(term, now)
            return False
        self._hear(term, now)
        if term > self.term:
            self.term, self._steered, self._unsteered_s = term, False, math.inf
        self.listens = False
        self._renewals = 0
        self._heard_s = now
        self._steered |= steered
        self._unsteered_s = math.inf if steered else min(self._unsteered_s, now)
        return True

    def hear_other(self, term: int, now: float) -> None:
        """Take notice of a state of any other vehicle, which obeys a leader of this term."""
        # Who has just started knows of no term, and learns it from others.
        rounds = LEADERS_ROUNDS // 2 if self.listens else MOST_ROUNDS
        self._hear(term if term <= self._reach(rounds) else 0, now)

    def _hear(self, term: int, now: float) -> None:
        if now - self._others_s > WORKS_S:
            self._works_since = now
        self._others_s, self.highest = now, max(self.highest, term)

    def step(self, now: float, *, eligible: bool, ordered: bool = False) -> bool:
        """Let time pass.

        Args:
            now: s.
            eligible: whether the own companion steers this vehicle.
            ordered: whether this vehicle is to lead now, whoever leads.

        Returns:
            Whether this vehicle leads from now on, and did not before.
        """
        if self.listens:
            return self._listen(now)
        if self.leads:
            self._renew_term(now)
            return False
        if self._name not in self._order:
            return False
        if not (eligible and (ordered or self._is_gone(now))):
            return False
        return self._take_lead()

    def _listen(self, now: float) -> bool:
        """Whether a leader that has just started leads now."""
        self._began_s = min(self._began_s, now)
        if self.highest == 0 and now - self._began_s >= LISTEN_S:
            self.listens = False
            return True
        return now - self._began_s >= VACANT_S and self._take_lead()

    def _renew_term(self, now: float) -> None:
        """Lead on in a new term, if others obey a higher one and nobody is heard to lead in it.

        Each time twice as late: two leaders that do not hear each other, and whom others hear, are not to
        take turns.
        """
        self._outranked_s = min(self._outranked_s, now) if self.highest > self.term else math.inf
        if now - self._outranked_s >= VACANT_S * 2.0**self._renewals and self._take_lead():
            self._renewals = min(self._renewals + 1, MOST_RENEWALS)

    def _is_gone(self, now: float) -> bool:
        """Whether the leader has been silent, or not steered, for too long for this vehicle's turn."""
        absent_s = now - self._heard_s
        before = self._order[: self._order.index(self._name)]
        wait_s = STAGGER_S * sum(1 for one in before if one != self.holder)
        silence_s = self._silence_s + wait_s
        # While no other vehicle is heard either, silence says nothing of the leader.
        works = now - self._others_s <= WORKS_S and self._others_s > self._heard_s + LATER_S
        silent_s = min(absent_s, now - self._works_since) if works else 0.0
        silent = silent_s >= silence_s or absent_s >= DEAF_S + silence_s
        left = self._steered and now - self._unsteered_s >= UNSTEERED_S + wait_s
        return left or (silent and self.was_heard)

    def _take_lead(self) -> bool:
        """Lead in a term of one's own above all that were heard of; not where there is none left."""
        term = term_above(self.highest, self._name, self._order)
        if term > GREATEST_TERM:
            return False
        self.term = self.highest = term
        self.listens = False
        self._unsteered_s = self._outranked_s = math.inf
        return True
