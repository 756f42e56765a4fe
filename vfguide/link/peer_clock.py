"""How far the clock of another computer is from one's own.

By exchanges of four stamps as in RFC 5905, section 8: a question leaves at t0 and its answer arrives at t3
on one's own clock, the question arrives at t1 and the answer leaves at t2 on the peer's. Nothing here reads
a clock.
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
"""Exchanges that are remembered."""

OPEN = 8
"""Questions that an answer is still awaited for."""

GREATEST_DELAY_S = 0.3
"""An exchange that took longer sets no clock: a delay of one way shifts it by half of that."""

ROUNDING_S = 1e-5
"""More than sums and differences of stamps round to, on clocks that count years."""

SETTLED = 5
"""Exchanges after which there is no more hurry."""

HURRIED_S, CALM_S = 0.2, 2.0
"""Between questions: at first or when something is odd, and else."""

CERTAIN = 2
"""Exchanges in a row that disagree with the rest, and agree with each other, before the rest is forgotten."""


def bracket_of(tell: Tell, arrived_s: float) -> Bracket | None:
    """What four stamps say, RFC 5905 section 8; None where they cannot be, or took too long.

    Offset = ((t1 - t0) + (t2 - t3)) / 2, delay = (t3 - t0) - (t2 - t1), all in s.
    """
    least = tell.originate_s - tell.receive_s
    most = arrived_s - tell.transmit_s
    if tell.transmit_s < tell.receive_s or not -ROUNDING_S < most - least <= GREATEST_DELAY_S:
        return None
    return Bracket(asked_s=tell.originate_s, least=least, most=max(least, most))


def agree(one: Bracket, other: Bracket) -> bool:
    """Whether both can be true of clocks that have not stepped between them."""
    apart = abs(one.middle - other.middle)
    # The later one took some time too.
    slack = ROUNDING_S + DRIFT * GREATEST_DELAY_S
    return apart <= one.bound_s(other.asked_s) + other.bound_s(other.asked_s) + slack


class PeerClock:
    """The clock of one peer, as known from exchanges with it."""

    def __init__(self, chance: Callable[[], int] = lambda: secrets.randbits(64)) -> None:
        """Know nothing yet.

        Args:
            chance: numbers of 64 bits for questions, which nobody can foresee.
        """
        self.counters: Counter[str] = Counter()
        """Answers that were not used, by reason, and steps of either clock."""
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
        """The peer's clock less one's own, s; NaN while not known."""
        return math.nan if self._best is None else -self._best.middle

    @property
    def bound_s(self) -> float:
        """Greatest error of the offset when the last answer came, s; infinite while it is not known."""
        return self._bound_s

    @property
    def pause_s(self) -> float:
        """How long to wait before the next question, s."""
        hurried = len(self._kept) < SETTLED or self._odd
        return HURRIED_S if hurried else CALM_S

    def to_local(self, peer_time: float) -> float:
        """A time of the peer's clock on one's own, s; NaN while the offset is not known."""
        return peer_time - self.offset_s

    def to_peer(self, local_time: float) -> float:
        """A time of one's own clock on the peer's, s; NaN while the offset is not known."""
        return local_time + self.offset_s

    def request(self, now: float) -> bytes:
        """A question to send at once."""
        number = self._chance()
        self._open[number] = now
        while len(self._open) > OPEN:
            del self._open[next(iter(self._open))]
        return encode_ask(Ask(number=number, originate_s=now))

    def awaits(self, data: bytes) -> bool:
        """Whether these bytes are the answer to a question that is still open."""
        return self._awaited(data) is not None

    def _awaited(self, data: bytes) -> Tell | None:
        """The answer to a question that is still open; None where these bytes are none."""
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
        """The answer to a question, to be sent at once.

        Args:
            data: the question.
            received: when it came, s on the clock that it asks for.
            now: what that clock shows, s.

        Raises:
            LinkDataError: it is no question.
        """
        ask = decode_ask(data)
        tell = Tell(
            number=ask.number, originate_s=ask.originate_s, receive_s=received, transmit_s=now
        )
        return encode_tell(tell)

    def take(self, data: bytes, now: float) -> bool:
        """Learn from an answer that has just come.

        Returns:
            Whether it shows that one of the clocks has stepped.
        """
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
        """Keep an exchange, or put it aside for as long as only it says that a clock has stepped."""
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
        """The exchange of the least possible error, aged as it is, tells the offset.

        The best is kept for as long as none is better, however many slow ones follow it.
        """
        known = [] if self._best is None else [self._best]
        self._best = min((*known, *self._kept), key=lambda exchange: exchange.bound_s(now))
        self._bound_s = self._best.bound_s(now)
