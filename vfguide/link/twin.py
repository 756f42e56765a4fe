"""Two companions of one name: the one that has spoken for less long finds that out, and steps back.

Nothing here reads a clock. What is said in a member's own name by somebody else, signed with its own key, is
another companion of the same vehicle, or a recording of this one or of an earlier run.
"""

import math
import secrets
from collections import deque
from random import random

from vfguide.link.codec import Ask, LinkDataError, decode_ask, decode_tell, encode_ask

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

    def __init__(self, now: float, *, asks: bool) -> None:
        """Know of none.

        Args:
            now: of the start, s on the member's own clock, as everywhere here.
            asks: whether it is the leader.
        """
        self.asks = asks
        self._began_s = now
        self._spoke_s = math.inf
        self._twin_s = -math.inf
        self._quiet_s = TWIN_QUIET_S + TWIN_SPREAD_S * random()
        self._ask_s = self._answer_s = -math.inf
        self._in_vain = 0
        self._open: dict[int, tuple[float, float]] = {}
        self._made = deque[int](maxlen=REMEMBERED)
        self._answered = deque[int](maxlen=REMEMBERED)

    def note_speech(self, now: float) -> None:
        """Note that the member says a state."""
        self._spoke_s = min(self._spoke_s, now)

    def spoken_s(self, now: float) -> float:
        """For how long the member has spoken, s."""
        return max(now - self._spoke_s, 0.0)

    def stands_back(self, now: float) -> bool:
        """Whether another was here before: this one is not to steer then."""
        return now - self._twin_s < self._quiet_s

    def is_young(self, now: float) -> bool:
        """Whether another may have been here before: own states are worth listening for."""
        return now - self._spoke_s < YOUNG_S

    def hear(self, said_ago_s: float, now: float) -> None:
        """Note a true message in the own name that was said so long ago, on the formation's clock, s."""
        live = said_ago_s < now - self._began_s - AFTER_START_S
        if live and not self.asks and (self.stands_back(now) or self.is_young(now)):
            self._step_back(now)

    def question(self, now: float) -> bytes | None:
        """What to ask in the own name after a message in it; None where nothing is to be asked now."""
        if not self.asks or now < self._ask_s:
            return None
        every_s = ASK_AGAIN_S if self.stands_back(now) else ASK_EVERY_S
        self._in_vain += 1
        if self._in_vain > IN_VAIN:
            every_s = ASK_SELDOM_S
        self._ask_s = now + (0.5 + random()) * every_s
        number, spoken_s = secrets.randbits(64), self.spoken_s(now)
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

    def hear_answer(self, answer: bytes, now: float) -> None:
        """Note an answer in the own name: another program with its key says for how long it has spoken."""
        if not self.awaits(answer):
            return
        tell = decode_tell(answer)
        asked_s, spoken_s = self._open.pop(tell.number)
        if 0.0 <= now - asked_s <= ANSWERED_S and tell.transmit_s > spoken_s:
            self._in_vain = 0
            self._step_back(now)

    def may_answer(self, question: bytes, now: float) -> bool:
        """Whether to answer a question in the own name, which sends its asker back; each one once.

        Raises:
            LinkDataError: it is none.
        """
        ask = decode_ask(question)
        if not self.asks or self.stands_back(now) or now - self._answer_s < ANSWER_EVERY_S:
            return False
        if ask.number in self._made or ask.number in self._answered:
            # Played again.
            return False
        if self.spoken_s(now) <= ask.originate_s:
            return False
        self._answer_s = now
        self._answered.append(ask.number)
        return True

    def _step_back(self, now: float) -> None:
        self._twin_s, self._spoke_s = now, math.inf
