"""Doubts about reports: altitudes, the autopilot's own word of its navigation, and texts for the pilot.

Altitudes: keeping clear leaves out vehicles that fly far above or below. A false altitude would make an
aircraft that is straight ahead look harmless, so a doubted one counts as not known, and a vehicle without
a known altitude is kept clear of in the plane.

Receiver, estimator, sensors: what an autopilot does not say is unknown, not bad.
"""

import math
from collections import Counter

import msgspec

from vfguide.companion.alerts import Alerts
from vfguide.companion.plausibility import (
    CARRIED_S,
    OVERSPEED,
    RETURN_S,
    GateVerdict,
    Judgement,
)
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import EstimatorReport, GpsReport, SensorsReport
from vfguide.state import Airframe

STEP_M = 10.0
"""So far an altitude may be from where the ones before lead: noise, and a barometer that settles."""

CLIMB_M_S = 15.0
"""And by so much more for each second: faster than these aircraft climb or dive."""

RETURN_M_S = 0.5
"""How fast the true altitude may have left the last believed one, on average, while reports were doubted."""

ALTITUDE_RETURN_S = 2.0
"""For so long doubted reports have to agree with each other before they are believed again."""

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

FROZEN_S = 0.5
"""A position that does not change by a centimetre for longer, of a vehicle that moves, is frozen."""

MOVING_M_S = 5.0
"""Airspeed of a vehicle that moves for certain."""

AIRSPEED_OFF_M_S = 8.0
"""By so much an airspeed may differ from the one that ground velocity and wind come to."""

WIND_CHANGE_M_S2 = 0.5
"""And by so much more for each second for which no airspeed was believed."""

UNDERSPEED = 0.6
"""Share of the lowest airspeed: no fixed wing flies slower."""

AIRSPEED_SHARE = 0.6
"""But never by more than this share of it: a blocked tube shows nothing at all."""


class AltitudeGate:
    """Judges the altitudes of one vehicle.

    A step is doubted until the reports are back where the vehicle can have climbed to at `RETURN_M_S`. One
    that stays is believed late, 3 minutes after a step of 100 m. Until then its vehicle is kept clear of more
    than needed.
    """

    def __init__(self) -> None:
        self._known = math.nan
        self._known_time = -math.inf
        self._seen = math.nan
        self._seen_time = -math.inf
        self._seen_since = -math.inf
        self.doubted = False
        """Whether the reported altitudes are not believed now."""

    def judge(self, altitude_amsl: float, time_s: float) -> float:
        """Take a reported altitude.

        Args:
            altitude_amsl: m above mean sea level.
            time_s: of the report; not before that of the report before.

        Returns:
            the altitude, or NaN while it is doubted.
        """
        if math.isnan(self._known):
            return self._believe(altitude_amsl, time_s)
        if not self.doubted:
            if follows(self._known, altitude_amsl, time_s - self._known_time):
                return self._follow(altitude_amsl, time_s)
            self.doubted = True
            self._seen_since = time_s
        elif not follows(self._seen, altitude_amsl, time_s - self._seen_time):
            self._seen_since = time_s
        self._seen, self._seen_time = altitude_amsl, time_s
        left_m = STEP_M + RETURN_M_S * (time_s - self._known_time)
        agreed = time_s - self._seen_since >= ALTITUDE_RETURN_S
        if agreed and abs(altitude_amsl - self._known) <= left_m:
            return self._believe(altitude_amsl, time_s)
        return math.nan

    def _follow(self, altitude_amsl: float, time_s: float) -> float:
        """Believe an altitude; what is known follows as fast as an aircraft climbs: steps do not add up."""
        climb_m = CLIMB_M_S * max(time_s - self._known_time, 0.0)
        self._known += min(max(altitude_amsl - self._known, -climb_m), climb_m)
        self._known_time = time_s
        return altitude_amsl

    def _believe(self, altitude_amsl: float, time_s: float) -> float:
        self.doubted = False
        self._known, self._known_time = altitude_amsl, time_s
        return altitude_amsl


def follows(before: float, altitude_amsl: float, interval_s: float) -> bool:
    """Whether an altitude (m) can follow one from some time (s) before."""
    return abs(altitude_amsl - before) <= STEP_M + CLIMB_M_S * max(interval_s, 0.0)


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
    """Words for what an innovation gate decides, and counts."""

    def __init__(self, alerts: Alerts | None = None) -> None:
        self._alerts = alerts or Alerts()
        self.counters: Counter[str] = Counter()
        """Reports that were not believed, by reason."""
        self._told: GateVerdict | None = None
        self._since = math.inf
        self._reported_time = -math.inf
        self._times = 0

    def note(self, judgement: Judgement, now: float) -> None:
        """Take a judgement."""
        if judgement.verdict is GateVerdict.BELIEVED:
            if judgement.moved is not None:
                self._say(
                    f"the position is believed again, {judgement.off:.0f} m from where it was expected:"
                    " steered by it where the autopilot is still in the guided mode; check it"
                )
            elif self._told is not None:
                self._say(
                    f"position and velocity are right again{self._count}: believed, nothing to do"
                )
            self._told, self._since = None, math.inf
            return
        self.counters[
            "position carried on by velocity"
            if judgement.verdict is GateVerdict.CARRIED
            else "position not believed"
        ] += 1
        self._since = min(self._since, now)
        if self._told is None:
            self._begin(judgement, now)
        elif self._told is GateVerdict.CARRIED and judgement.verdict is not GateVerdict.CARRIED:
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
        self._say(self._sentence(judgement) + self._count)

    def _say(self, text: str) -> None:
        self._alerts.say("position", WARNING, text)

    @property
    def _count(self) -> str:
        """Which fault in a row it is: the same words twice would be taken for one."""
        return f" (fault {self._times} in a row)" if self._times > 1 else ""

    def _sentence(self, judgement: Judgement) -> str:
        if judgement.verdict is GateVerdict.CARRIED:
            return (
                f"{judgement.reason}: flown on by velocity for {CARRIED_S:g} s;"
                " check the GPS, be ready to take over"
            )
        return (
            f"{judgement.reason}: not steered until it has been right for {RETURN_S:g} s;"
            " check the GPS, be ready to take over"
        )
