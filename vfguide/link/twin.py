"""Two companions of one name: the one that has spoken for less long finds that out, and steps back.

Nothing here reads a clock. What is said in a member's own name by somebody else, signed with its own key, is
either another companion of the same vehicle or a recording of an earlier run of this one.
"""

import math
from random import random

from vfguide.link.peer_clock import PeerClock

YOUNG_S = 10.0
"""A member that has spoken for longer was here before another of its name that speaks up."""

TWIN_QUIET_S, TWIN_SPREAD_S = 6.0, 4.0
"""So long another of one's name has to be silent before one speaks again; and up to so much longer, by
chance, since the other may have stepped back, too."""

AFTER_START_S = 1.0
"""What was said by so much later than one's own start is of no run of this companion before."""

ASK_EVERY_S, ASK_AGAIN_S, ANSWER_EVERY_S = 0.5, 1.5, 0.4
"""s from one question to the own name to the next: at first, and once it was answered; up to half as much
more or less, by chance, so that two on one radio do not go on in step. And between answers."""


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
        self._ask_s = self._answered_s = -math.inf
        self._questions = PeerClock()

    def note_speech(self, now: float) -> None:
        """Note that the member says a state."""
        self._spoke_s = min(self._spoke_s, now)

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
        every_s = ASK_AGAIN_S if self.stands_back(now) else ASK_EVERY_S
        if not self.asks or now < self._ask_s:
            return None
        self._ask_s = now + (0.5 + random()) * every_s
        # Where others say when they ask, on their clocks, it says for how long it has spoken.
        return self._questions.request(self._spoken_s(now))

    def awaits(self, answer: bytes) -> bool:
        """Whether these bytes answer a question of this member in its own name."""
        return self.asks and self._questions.awaits(answer)

    def hear_answer(self, answer: bytes, now: float) -> None:
        """Note an answer to a question in the own name, from somebody who has its key: it lives."""
        if self.awaits(answer):
            self._questions.take(answer, now)
            self._step_back(now)

    def may_answer(self, asker_spoken_s: float, now: float) -> bool:
        """Whether to answer a question in the own name, which sends its asker back.

        Args:
            asker_spoken_s: for how long the asker has spoken, s.
            now: s.
        """
        stays = self.asks and not self.stands_back(now) and self._spoken_s(now) > asker_spoken_s
        if not stays or now - self._answered_s < ANSWER_EVERY_S:
            return False
        self._answered_s = now
        return True

    def _spoken_s(self, now: float) -> float:
        return max(now - self._spoke_s, 0.0)

    def _step_back(self, now: float) -> None:
        self._twin_s, self._spoke_s = now, math.inf
