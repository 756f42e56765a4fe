"""Handling of disbelieved reports: texts for the pilot, counts, and other places of a vehicle."""

import math
from collections import Counter
from collections.abc import Callable

from msgspec.structs import replace

from vfguide.companion.alerts import QUIET_S, Alerts
from vfguide.companion.belief import Belief, Believed, Life
from vfguide.companion.witnesses import BAD_S, FRESH_S, HeightWitnesses
from vfguide.guidance.navigation import ReportedMotion
from vfguide.mavlink.announcements import WARNING
from vfguide.state import HeardState

REMEDIES = {
    "the GPS": "wait, or see that its antenna has a clear sky",
    "the autopilot's estimator": "wait, or see its ground station",
    "the autopilot says that its GPS": "see that its antenna is connected",
    "the autopilot says that its attitude": "before take-off restart it",
}
"""Remedies of faults, by the beginning of the fault's text."""


def with_remedy(fault: str) -> str:
    """Return a fault's text with its remedy."""
    remedies = (remedy for beginning, remedy in REMEDIES.items() if fault.startswith(beginning))
    return f"{fault}: {next(remedies, 'see its GPS and its ground station')}"


class Doubt:
    """Texts on belief in the own position, and counts of reports that were not believed."""

    def __init__(self, alerts: Alerts) -> None:
        self._alerts = alerts
        self.counters: Counter[str] = Counter()
        """Reports that were not believed, by reason."""
        self._told: Life | None = None
        self._since = math.inf
        self._reported_s = -math.inf
        self._times = 0

    def note(self, believed: Believed, belief: Belief, now: float) -> None:
        """Process the belief after a report, and tell the pilot of changes."""
        if believed.is_reported:
            if believed.moved is not None:
                self._say(
                    f"the position is believed again, {believed.off:.0f} m from where it was expected:"
                    " steered by it where the autopilot is still in the guided mode; check it"
                )
            elif self._told is not None:
                self._say(
                    f"position and velocity are right again{self._count}: believed, nothing to do"
                )
            self._told, self._since = None, math.inf
            return
        coasts = believed.life is Life.COASTING
        self.counters["position carried on" if coasts else "position not believed"] += 1
        self._since = min(self._since, now)
        if self._told is None:
            apart_s = now - self._reported_s
            if apart_s >= QUIET_S:
                self._times = 0
            elif apart_s < FRESH_S and now - self._since < BAD_S * self._times:
                # A second fault is told once it has lasted, a third one after twice as long.
                return
            self._times += 1
        elif self._told is not Life.COASTING or coasts:
            return
        self._told, self._reported_s = believed.life, now
        self._say(sentence_of(believed, belief) + self._count)

    def _say(self, text: str) -> None:
        self._alerts.say("position", WARNING, text)

    @property
    def _count(self) -> str:
        """Number of the fault in a row as text: identical texts would be suppressed as one."""
        return f" (fault {self._times} in a row)" if self._times > 1 else ""


def sentence_of(believed: Believed, belief: Belief) -> str:
    """Return text on what is not believed, what the vehicle flies by, and what to do."""
    if believed.life is not Life.COASTING:
        steered = f"not steered until it has been right for {belief.agree_s:g} s"
    else:
        by = "velocity"
        if not believed.by_velocity:
            by = "positions and airspeed" if believed.by_place else "heading and airspeed"
        steered = f"flown on by {by} for {belief.lasts_s(believed):.0f} s"
    return f"{believed.reason}: {steered}; check the GPS, be ready to take over"


class HeardVehicle:
    """Belief in another vehicle's reports, from any source."""

    def __init__(
        self,
        belief: Belief,
        alerts: Alerts | None,
        whose: str,
        beside: Callable[[HeardState], HeightWitnesses] | None,
    ) -> None:
        """Begin with nothing heard; texts begin with `whose`, and `beside` finds an altitude's witnesses."""
        self.belief = belief
        """Belief in its motion and height."""
        self.alerts = alerts or Alerts()
        """Sink for alerts to the pilot."""
        self._whose, self._beside = whose, beside
        self.counters: Counter[str] = Counter()
        """Reports that were not used, by reason."""
        self.newest: HeardState | None = None
        """Newest believed state, on the own clock."""
        self.doubted: tuple[HeardState, HeardState] | None = None
        """Two possible places while its motion is not believed: as reported, and as its velocities lead."""

    def tell(self, text: str) -> None:
        """Tell the pilot a text that completes a sentence after the vehicle's name."""
        self.alerts.say(f"state of {self._whose}", WARNING, f"{self._whose} {text}")

    def turns(self, what: str, *, holds: bool) -> bool:
        """Note whether a condition holds for the vehicle; return whether that has changed."""
        return self.alerts.turns(f"{self._whose}: {what}", holds=holds)

    def believe(
        self, motion: ReportedMotion, said: HeardState, slack_s: float = 0.0
    ) -> HeardState | None:
        """Judge a report; return it without a doubted altitude, or None where it cannot be true.

        The times of `motion` are on an evenly running clock, those of `said` on the own one. The time since
        the previous report may be longer than its stamps say by `slack_s`, s.
        """
        believed = self.belief.take(motion, slack_s=slack_s)
        if math.isfinite(said.altitude_amsl):
            said = self._judge_altitude(said, motion.time_s)
        if believed.is_reported:
            self.doubted = None
        else:
            self.counters["impossible"] += 1
            if believed.leads:
                carried = replace(said, north=believed.north, east=believed.east)
                self.doubted = replace(said, steered=False), carried
        if self.turns("motion", holds=not believed.is_reported):
            self.tell(
                "reports what can be again: believed, nothing to do"
                if believed.is_reported
                else f"reports what cannot be ({believed.reason}): not believed;"
                " be ready to take over should it come near"
            )
        return said if believed.is_reported else None

    def _judge_altitude(self, said: HeardState, time_s: float) -> HeardState:
        """Return a state whose altitude and height are NaN while the altitude is doubted."""
        height, beside = self.belief.height, None
        if self._beside is not None and not height.is_known:
            beside = self._beside(said)
        altitude = height.judge(said.altitude_amsl, time_s, beside)
        if self.turns("altitude", holds=height.doubted):
            self.tell(height.sentence)
        if not height.doubted:
            return said
        self.counters["altitude not believed"] += 1
        return replace(said, altitude_amsl=altitude, height=math.nan)
