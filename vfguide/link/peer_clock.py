"""Offset of a peer's clock from one's own.

It is found by exchanges of four time stamps as in RFC 5905, section 8. A question leaves at t0 and its answer
arrives at t3 on the own clock. The question arrives at t1 and the answer leaves at t2 on the peer's. Nothing
here reads a clock.
"""

import math
import secrets
from collections import Counter, deque
from collections.abc import Callable

from vfguide.guidance.other_clock import DRIFT, Bracket
from vfguide.link.codec import (
    Ask,
    LinkDataError,
    Tell,
    decode_ask,
    decode_tell,
    encode_ask,
    encode_tell,
)

KEPT = 16
"""Number of exchanges remembered."""

OPEN = 8
"""Maximum number of questions that await an answer."""

GREATEST_DELAY_S = 0.3
"""Maximum delay of an exchange that sets a clock, s: a delay of one way shifts the clock by half of it."""

ROUNDING_S = 1e-5
"""Bound of the rounding errors of time stamp sums, s, on clocks that count years."""

SETTLED = 5
"""Number of exchanges after which questions need no more hurry."""

HURRIED_S, CALM_S = 0.2, 2.0
"""Intervals between questions, s: at first or when an exchange disagrees, and otherwise."""

CERTAIN = 2
"""Consecutive exchanges that agree with each other against the rest, before the rest is forgotten."""


def bracket_of(tell: Tell, arrived_s: float) -> Bracket | None:
    """Return the offset bracket of four time stamps; None where they are impossible or took too long.

    RFC 5905, section 8: offset = ((t1 - t0) + (t2 - t3)) / 2, delay = (t3 - t0) - (t2 - t1), all in s.
    """
    least = tell.originate_s - tell.receive_s
    most = arrived_s - tell.transmit_s
    if tell.transmit_s < tell.receive_s or not -ROUNDING_S < most - least <= GREATEST_DELAY_S:
        return None
    return Bracket(asked_s=tell.originate_s, least=least, most=max(least, most))


def agree(one: Bracket, other: Bracket) -> bool:
    """Check whether both can be true of clocks that have not stepped in between."""
    apart = abs(one.middle - other.middle)
    # The later exchange took some time, too.
    slack = ROUNDING_S + DRIFT * GREATEST_DELAY_S
    return apart <= one.bound_s(other.asked_s) + other.bound_s(other.asked_s) + slack


class PeerClock:
    """Estimate of one peer's clock from exchanges with it."""

    def __init__(self, chance: Callable[[], int] = lambda: secrets.randbits(64)) -> None:
        """Create an estimate without any exchange.

        Args:
            chance: returns unpredictable numbers of 64 bits for questions.
        """
        self.counters: Counter[str] = Counter()
        """Counts of unused answers by reason, and of steps of either clock."""
        self._chance = chance
        self._open: dict[int, float] = {}
        self._kept: deque[Bracket] = deque(maxlen=KEPT)
        self._odd: list[Bracket] = []
        self._best: Bracket | None = None
        self._bound_s = math.inf

    @property
    def ready(self) -> bool:
        """Whether the offset is known."""
        return self._best is not None

    @property
    def offset_s(self) -> float:
        """Peer's clock minus the own clock, s; NaN while unknown."""
        return math.nan if self._best is None else -self._best.middle

    @property
    def bound_s(self) -> float:
        """Greatest error of the offset at the latest answer, s; infinite while unknown."""
        return self._bound_s

    @property
    def pause_s(self) -> float:
        """Time to wait before the next question, s."""
        hurried = len(self._kept) < SETTLED or self._odd
        return HURRIED_S if hurried else CALM_S

    def to_local(self, peer_time: float) -> float:
        """Convert a time of the peer's clock to the own clock, s; NaN while the offset is unknown."""
        return peer_time - self.offset_s

    def to_peer(self, local_time: float) -> float:
        """Convert a time of the own clock to the peer's clock, s; NaN while the offset is unknown."""
        return local_time + self.offset_s

    def request(self, now: float) -> bytes:
        """Return a question to send at once."""
        number = self._chance()
        self._open[number] = now
        while len(self._open) > OPEN:
            del self._open[next(iter(self._open))]
        return encode_ask(Ask(number=number, originate_s=now))

    def awaits(self, data: bytes) -> bool:
        """Check whether these bytes answer an open question."""
        return self._awaited(data) is not None

    def _awaited(self, data: bytes) -> Tell | None:
        """Decode the answer to an open question; None for any other bytes."""
        try:
            tell = decode_tell(data)
        except LinkDataError:
            self.counters["malformed"] += 1
            return None
        if self._open.get(tell.number) == tell.originate_s:
            return tell
        self.counters["not asked for"] += 1
        return None

    @staticmethod
    def answer(data: bytes, received: float, now: float) -> bytes:
        """Return the answer to a question, to be sent at once.

        Both times, of the question's arrival and now, are s on the clock asked for.

        Raises:
            LinkDataError: it is no question.
        """
        ask = decode_ask(data)
        tell = Tell(
            number=ask.number, originate_s=ask.originate_s, receive_s=received, transmit_s=now
        )
        return encode_tell(tell)

    def take(self, data: bytes, now: float) -> bool:
        """Learn from an answer that has just arrived; return whether one of the clocks has stepped."""
        tell = self._awaited(data)
        if tell is None:
            return False
        # Each question is answered once, whoever repeats the answer.
        del self._open[tell.number]
        exchange = bracket_of(tell, now)
        if exchange is None:
            self.counters["odd delay"] += 1
            return False
        stepped = self._weigh(exchange)
        self._choose(now)
        return stepped

    def _weigh(self, exchange: Bracket) -> bool:
        """Keep an exchange, or set it aside if it alone suggests a step; return whether a clock stepped."""
        if self._best is None or agree(self._best, exchange):
            self._kept.append(exchange)
            self._odd.clear()
            return False
        self._odd = [odd for odd in self._odd if agree(odd, exchange)]
        self._odd.append(exchange)
        self.counters["disagrees"] += 1
        if len(self._odd) < CERTAIN:
            return False
        self.counters["step"] += 1
        self._kept = deque(self._odd, maxlen=KEPT)
        self._best = None
        self._odd.clear()
        return True

    def _choose(self, now: float) -> None:
        """Take the offset from the best exchange at its present age; keep it until a better one comes."""
        known = [] if self._best is None else [self._best]
        self._best = min((*known, *self._kept), key=lambda exchange: exchange.bound_s(now))
        self._bound_s = self._best.bound_s(now)
