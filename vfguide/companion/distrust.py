"""Doubts about an autopilot's reports beside their innovations, and texts for the pilot about all of them."""

import math
from collections import Counter

from vfguide.companion.plausibility import (
    CARRIED_S,
    OVERSPEED,
    RETURN_S,
    Judgement,
    Verdict,
)
from vfguide.state import Airframe

QUIET_S = 10.0
"""Between two texts that something is not believed."""

LASTING_S = 1.0
"""A second fault that lasts for longer is told all the same, a third one after twice as long."""

ROW_S = 30.0
"""Faults that follow each other within this time are counted: texts that say the same are sent once in it."""

FROZEN_S = 0.5
"""A position that does not change by a centimetre for longer, of a vehicle that moves, is frozen."""

MOVING_M_S = 5.0
"""Airspeed of a vehicle that moves for certain."""

AIRSPEED_OFF_M_S = 8.0
"""By so much an airspeed may differ from the one that ground velocity and wind come to."""

WIND_CHANGE_M_S2 = 0.5
"""And by so much more for each second for which no airspeed was believed."""

UNDERSPEED = 0.6
"""Of the lowest airspeed: no fixed wing flies slower."""

AIRSPEED_SHARE = 0.6
"""But never by more than this share of it: a blocked tube shows nothing at all."""


class FrozenPosition:
    """Finds positions that stay the same, without a ground velocity, in flight."""

    def __init__(self) -> None:
        self._place = (math.nan, math.nan)
        self._since = 0.0

    def fault(self, place: tuple[float, float], airspeed: float, time_s: float) -> str | None:
        """What is wrong with a position, if it is, in words.

        Args:
            place: latitude and longitude as reported, degrees.
            airspeed: m/s.
            time_s: s.
        """
        if place != self._place:
            self._place, self._since = place, time_s
        # An airspeed that is no number says nothing.
        if airspeed > MOVING_M_S and time_s - self._since > FROZEN_S:
            return "the position does not change in flight"
        return None


class AirspeedGate:
    """Passes airspeeds that can be true."""

    def __init__(self, airframe: Airframe) -> None:
        self._fastest = OVERSPEED * airframe.airspeed_max
        self._slowest = UNDERSPEED * airframe.airspeed_min
        self._good_time = self._bad_time = self._reported_time = -math.inf
        self._word: str | None = None
        self.counters: Counter[str] = Counter()
        """Airspeeds that were not passed."""

    @property
    def word(self) -> str | None:
        """What a pilot should know, once."""
        word, self._word = self._word, None
        return word

    def passes(self, airspeed: float, expected: float | None, now: float) -> bool:
        """Whether an airspeed can be used.

        Args:
            airspeed: as reported, m/s.
            expected: what ground velocity and wind come to, on the same sensor, m/s; None while not known.
            now: s.
        """
        fault = self._fault(airspeed, expected, now)
        if fault is not None:
            self._bad_time = now
            self.counters["airspeed not believed"] += 1
            if now - self._reported_time >= QUIET_S:
                self._reported_time = now
                self._word = f"{fault}: flown by the wind known before; check the airspeed sensor"
        if now - self._bad_time < RETURN_S:
            return False
        self._good_time = now
        return True

    def _fault(self, airspeed: float, expected: float | None, now: float) -> str | None:
        """What is wrong with it, in words."""
        # Not "outside": what is no number fails.
        if not 0.0 <= airspeed <= self._fastest:
            return f"an airspeed of {airspeed:.0f} m/s"
        if expected is None or not math.isfinite(self._good_time):
            return None
        if not self._slowest <= expected <= self._fastest:
            # No aircraft flies like that: it is the known wind that is wrong.
            return None
        off = AIRSPEED_OFF_M_S + WIND_CHANGE_M_S2 * (now - self._good_time)
        if abs(airspeed - expected) > min(off, max(AIRSPEED_SHARE * expected, AIRSPEED_OFF_M_S)):
            return f"an airspeed of {airspeed:.0f} m/s instead of {expected:.0f}"
        return None


class Doubt:
    """Words for what an innovation gate decides, and counts."""

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        """Reports that were not believed, by reason."""
        self._words: list[str] = []
        self._told: Verdict | None = None
        self._since = math.inf
        self._reported_time = -math.inf
        self._times = 0

    def words(self) -> list[str]:
        """What a pilot should know, each once."""
        words, self._words = self._words, []
        return words

    def say(self, word: str) -> None:
        """Add a sentence of another gate."""
        self._words.append(word)

    def note(self, judgement: Judgement, now: float) -> None:
        """Take a judgement."""
        if judgement.verdict is Verdict.BELIEVED:
            if judgement.moved is not None:
                self._words.append(
                    f"the position is believed again, {judgement.off:.0f} m from where it was expected:"
                    " steered by it where the autopilot is still in the guided mode; check it"
                )
            elif self._told is not None:
                self._words.append(
                    f"position and velocity are right again{self._count}: believed, nothing to do"
                )
            self._told, self._since = None, math.inf
            return
        self.counters[
            "position carried on by velocity"
            if judgement.verdict is Verdict.CARRIED
            else "position not believed"
        ] += 1
        self._since = min(self._since, now)
        if self._told is None:
            self._begin(judgement, now)
        elif self._told is Verdict.CARRIED and judgement.verdict is not Verdict.CARRIED:
            self._tell(judgement, now)

    def _begin(self, judgement: Judgement, now: float) -> None:
        """Tell of a fault that has not been told of, unless it is a short one among others."""
        apart_s = now - self._reported_time
        if apart_s >= ROW_S:
            self._times = 0
        elif apart_s < QUIET_S and now - self._since < LASTING_S * self._times:
            return
        self._times += 1
        self._tell(judgement, now)

    def _tell(self, judgement: Judgement, now: float) -> None:
        self._told, self._reported_time = judgement.verdict, now
        self._words.append(self._sentence(judgement) + self._count)

    @property
    def _count(self) -> str:
        """Which fault in a row it is: the same words twice would be taken for one."""
        return f" (fault {self._times} in a row)" if self._times > 1 else ""

    def _sentence(self, judgement: Judgement) -> str:
        if judgement.verdict is Verdict.CARRIED:
            return (
                f"{judgement.reason}: flown on by velocity for {CARRIED_S:g} s;"
                " check the GPS, be ready to take over"
            )
        return (
            f"{judgement.reason}: not steered until it has been right for {RETURN_S:g} s;"
            " check the GPS, be ready to take over"
        )
