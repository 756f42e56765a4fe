"""Questions for the leader's clock on a radio: they wait for a turn, and so do their answers.

Nothing here reads a clock: a member's own is `clock_s`, that of the turns is `now`.
"""

import math
from dataclasses import dataclass

from vfguide.link.clock_codec import Ask, Tell, decode_ask
from vfguide.link.packed import TICK_S, Packet
from vfguide.link.peer_clock import OPEN

ANSWERABLE_S = 1.5
"""A question that has waited for so long is not answered: its asker has asked again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """One that was heard."""

    number: int
    """Of the exchange."""
    received_s: float
    """When, s on the member's clock."""


class Questions:
    """What one member asks, and what it is asked."""

    def __init__(self) -> None:
        """Ask nothing."""
        self._waiting: bytes | None = None
        self.asked_s = -math.inf
        """When the last question was asked, on the clock of the turns."""
        self._open: dict[int, tuple[float, float]] = {}
        self._heard: dict[int, Question] = {}
        self._answered_s: dict[int, float] = {}

    def post(self, question: bytes) -> None:
        """Have a question asked, in the place of the one before it."""
        self._waiting = question

    def ask(self, clock_s: float, now: float) -> Ask | None:
        """The question that is asked now; None where none waits."""
        if self._waiting is None:
            return None
        ask = decode_ask(self._waiting)
        self._waiting, self.asked_s = None, now
        self._open[ask.number] = ask.originate_s, clock_s - ask.originate_s
        while len(self._open) > OPEN:
            del self._open[next(iter(self._open))]
        return ask

    def answer_to(self, packet: Packet) -> Tell | None:
        """What a packet answers, as if the question had been heard when it was made; None to none."""
        asked = self._open.pop(packet.number, None)
        if asked is None:
            return None
        originate_s, waited_s = asked
        return Tell(
            number=packet.number,
            originate_s=originate_s,
            receive_s=packet.received * TICK_S - waited_s,
            transmit_s=packet.ticks * TICK_S,
        )

    def hear(self, asker: int, number: int, clock_s: float) -> None:
        """Keep a question of another member for a turn in which it can be answered."""
        self._heard[asker] = Question(number=number, received_s=clock_s)

    def next_to_answer(self, clock_s: float, now: float) -> tuple[int, Question] | None:
        """Whom to answer what now: the one who was not answered for the longest; None where nobody asks."""
        self._heard = {
            asker: question
            for asker, question in self._heard.items()
            if clock_s - question.received_s < ANSWERABLE_S
        }
        if not self._heard:
            return None
        asker = min(self._heard, key=lambda one: self._answered_s.get(one, -math.inf))
        self._answered_s[asker] = now
        return asker, self._heard.pop(asker)
