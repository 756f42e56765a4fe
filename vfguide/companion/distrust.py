"""Doubts about reports: the autopilot's own word of its navigation, airspeeds, and texts for the pilot.

Receiver, estimator, sensors: what an autopilot does not say is unknown, not bad.
"""

import math
from collections import Counter

import msgspec

from vfguide.companion.alerts import Alerts
from vfguide.companion.belief import RETURN_S, Belief, Believed, Life
from vfguide.guidance.navigation import OVERSPEED
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import EstimatorReport, GpsReport, SensorsReport
from vfguide.state import Airframe

BAD_S = 1.0
"""Something has to be bad for so long: estimators change lanes, and a receiver may drop one navigated."""

FRESH_S = 10.0
"""What was said longer ago than this says nothing any more."""

LEAST_FIX = 3
"""GPS_FIX_TYPE_3D_FIX: with less there is no height, or no position at all."""

GREATEST_ERROR_M = 15.0
"""A receiver that is less certain than this is no help to a formation."""

QUIET_S = 10.0
"""Shortest interval of two texts that something is not believed."""

LASTING_S = 1.0
"""A second fault that lasts for longer is told all the same, a third one after twice as long."""

ROW_S = 30.0
"""Faults that follow each other within this time are counted: texts that say the same are sent once in it."""

AIRSPEED_OFF_M_S = 8.0
"""By so much an airspeed may differ from the one that ground velocity and wind come to."""

WIND_CHANGE_M_S2 = 0.5
"""And by so much more for each second for which no airspeed was believed."""

UNDERSPEED = 0.6
"""Share of the lowest airspeed: no fixed wing flies slower."""

AIRSPEED_SHARE = 0.6
"""But never by more than this share of it: a blocked tube shows nothing at all."""


class Word(msgspec.Struct):
    """The newest word of one of them."""

    fault: str | None = None
    """What is bad, in words."""
    since: float = -math.inf
    """From when on it has been bad, s."""
    heard: float = -math.inf
    """When it was heard last, s."""


class NavigationHealth:
    """The newest words of receiver, estimator and sensors."""

    def __init__(self) -> None:
        self._words: dict[type, Word] = {}

    def take(self, report: GpsReport | EstimatorReport | SensorsReport, now: float) -> None:
        """Take a report."""
        word = self._words.setdefault(type(report), Word())
        fault = fault_of(report)
        if fault is not None and (word.fault is None or now - word.heard > FRESH_S):
            word.since = now
        word.fault, word.heard = fault, now

    def fault(self, now: float) -> str | None:
        """What has been bad for a while, in words; None where nothing is, or nothing is known."""
        for word in self._words.values():
            if word.fault is not None and now - word.heard <= FRESH_S and now - word.since >= BAD_S:
                return word.fault
        return None


def fault_of_gps(report: GpsReport) -> str | None:
    """What is bad about the receiver, in words."""
    if report.fix_type < LEAST_FIX:
        return "the GPS has no fix"
    if report.accuracy is not None and report.accuracy > GREATEST_ERROR_M:
        return f"the GPS is certain to {report.accuracy:.0f} m only"
    return None


def fault_of(report: GpsReport | EstimatorReport | SensorsReport) -> str | None:
    """What is bad in a report, in words."""
    match report:
        case GpsReport():
            return fault_of_gps(report)
        case EstimatorReport():
            if not report.has_position:
                return "the autopilot's estimator has no position"
            if not report.has_velocity:
                return "the autopilot's estimator has no velocity"
        case SensorsReport():
            if not report.gps:
                return "the autopilot says that its GPS fails"
            if not report.attitude:
                return "the autopilot says that its attitude estimate fails"
    return None


REMEDIES = {
    "the GPS": "wait, or see that its antenna has a clear sky",
    "the autopilot's estimator": "wait, or see its ground station",
    "the autopilot says that its GPS": "see that its antenna is connected",
    "the autopilot says that its attitude": "before take-off restart it",
}
"""What to do about a fault, by how it begins."""


def with_remedy(fault: str) -> str:
    """Why no position is used, and what to do."""
    remedies = (remedy for beginning, remedy in REMEDIES.items() if fault.startswith(beginning))
    return f"{fault}: {next(remedies, 'see its GPS and its ground station')}"


class AirspeedGate:
    """Passes airspeeds that can be true."""

    def __init__(self, airframe: Airframe, alerts: Alerts | None = None) -> None:
        self._alerts = alerts or Alerts()
        self._fastest = OVERSPEED * airframe.airspeed_max
        self._slowest = UNDERSPEED * airframe.airspeed_min
        self._good_time = self._bad_time = -math.inf
        self.counters: Counter[str] = Counter()
        """Airspeeds that were not passed."""

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
            text = f"{fault}: flown by the wind known before; check the airspeed sensor"
            self._alerts.say("airspeed", WARNING, text, quiet_s=QUIET_S)
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
    """Words for what becomes of a belief, and counts."""

    def __init__(self, alerts: Alerts | None = None) -> None:
        self._alerts = alerts or Alerts()
        self.counters: Counter[str] = Counter()
        """Reports that were not believed, by reason."""
        self._told: Life | None = None
        self._since = math.inf
        self._reported_time = -math.inf
        self._times = 0

    def note(self, believed: Believed, belief: Belief, now: float) -> None:
        """Take what a report left of a belief."""
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
            self._begin(believed, belief, now)
        elif self._told is Life.COASTING and not coasts:
            self._tell(believed, belief, now)

    def _begin(self, believed: Believed, belief: Belief, now: float) -> None:
        """Tell of a fault that has not been told of, unless it is a short one among others."""
        apart_s = now - self._reported_time
        if apart_s >= ROW_S:
            self._times = 0
        elif apart_s < QUIET_S and now - self._since < LASTING_S * self._times:
            return
        self._times += 1
        self._tell(believed, belief, now)

    def _tell(self, believed: Believed, belief: Belief, now: float) -> None:
        self._told, self._reported_time = believed.life, now
        self._say(sentence_of(believed, belief) + self._count)

    def _say(self, text: str) -> None:
        self._alerts.say("position", WARNING, text)

    @property
    def _count(self) -> str:
        """Which fault in a row it is: the same words twice would be taken for one."""
        return f" (fault {self._times} in a row)" if self._times > 1 else ""


def sentence_of(believed: Believed, belief: Belief) -> str:
    """What is not believed, what the vehicle flies by, and what to do."""
    if believed.life is not Life.COASTING:
        return (
            f"{believed.reason}: not steered until it has been right for {belief.agree_s:g} s;"
            " check the GPS, be ready to take over"
        )
    carried_by = "velocity"
    if not believed.by_velocity:
        carried_by = "positions and airspeed" if believed.by_place else "heading and airspeed"
    return (
        f"{believed.reason}: flown on by {carried_by} for {belief.lasts_s(believed):.0f} s;"
        " check the GPS, be ready to take over"
    )
