"""What an autopilot says of its own navigation: receiver, estimator, sensors.

What it does not say is unknown, not bad.
"""

import math
from dataclasses import dataclass

from vfguide.mavlink.reports import EstimatorReport, GpsReport, SensorsReport

BAD_S = 1.0
"""Something has to be bad for so long: estimators change lanes, and a receiver may drop one navigated."""

FRESH_S = 10.0
"""What was said longer ago than this says nothing any more."""

LEAST_FIX = 3
"""GPS_FIX_TYPE_3D_FIX: with less there is no height, or no position at all."""

GREATEST_ERROR_M = 15.0
"""A receiver that is less certain than this is no help to a formation."""


@dataclass(slots=True)
class Word:
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
