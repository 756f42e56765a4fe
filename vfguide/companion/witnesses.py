"""Witnesses of one aircraft: values compared with predictions, altitudes, repeats and the autopilot's word.

A value that contradicts its prediction is not used until it has agreed again for `RETURN_S`.
"""

import math
from typing import NamedTuple

import msgspec

from vfguide.guidance.navigation import ReportedMotion, innovation
from vfguide.mavlink.reports import EstimatorReport, GpsReport, SensorsReport

RETURN_S = 2.0
"""Time of agreement after which a false value is believed again, s: longer than glitches come and go."""

CARRY_ERROR_M_S = 0.5
"""Drift of a position carried by velocities, m/s: 0.3 m/s in recordings."""

MOVING_M_S = 5.0
"""Least speed that is a witness of flight, m/s."""

REPEATED_S, REPEATED_COUNT = 0.12, 2
"""Duration (s) and count of identical reports above which they are no evidence. No estimator is as slow, but
links deliver twice."""

PARTED_M, PARTED_SIGMAS = 0.3, 3.0
"""Positions part from a velocity's track by more than this (m), plus so many standard deviations."""

STEP_M = 10.0
"""Tolerance of an altitude against those before, or of a low-flying leader's against the mission's, m. It
covers noise, and barometers set differently."""

CLIMB_M_S = 15.0
"""Growth of an altitude's tolerance, m/s: faster than these aircraft climb or dive."""

BESIDE_M, BESIDE_SHARE = 25.0, 0.5
"""Tolerance of a leader's first altitude against the mission's and the own one: m, and share of the flying
height. Heights above the ellipsoid or the ground differ by more."""

BAD_S = 1.0
"""Time for which an autopilot's word must be bad, s: estimators change lanes."""

FRESH_S = 10.0
"""Age at which a word expires, s."""

LEAST_FIX = 3
"""GPS_FIX_TYPE_3D_FIX: lesser fixes have no height, or no position at all."""

GREATEST_ERROR_M = 15.0
"""Receiver accuracy above which it is no help to a formation, m."""


class Witness:
    """Whether one kind of value can be used."""

    def __init__(self) -> None:
        self.doubted = False
        """Whether it must not be used now."""
        self._agrees_since = math.inf

    def judge(self, value: float, predicted: float, within: float, time_s: float) -> bool:
        """Compare a value with its prediction, within a tolerance (NaN fails); return if it is usable."""
        if not abs(value - predicted) <= within:
            self.doubted, self._agrees_since = True, math.inf
        elif self.doubted:
            self._agrees_since = min(self._agrees_since, time_s)
            self.doubted = time_s - self._agrees_since < RETURN_S
        return not self.doubted


class HeightWitnesses(NamedTuple):
    """Witnesses of a leader's altitude other than its own report."""

    planned: float
    """Its altitude by the mission, m above mean sea level."""
    own: float
    """Own altitude in flight, m above mean sea level; NaN while unknown."""
    above: float
    """The mission's flying height, m."""

    def bear_out(self, altitude_amsl: float) -> bool:
        """Check whether a witness is near an altitude, m above mean sea level."""
        within = min(max(BESIDE_SHARE * self.above, STEP_M), BESIDE_M)
        return any(abs(altitude_amsl - one) <= within for one in (self.planned, self.own))


class HeightBelief:
    """Belief in one vehicle's altitudes.

    Separation ignores vehicles that fly far above or below, so a false altitude would make an aircraft
    straight ahead look harmless. A doubted altitude therefore counts as unknown: its vehicle is kept clear of
    in the plane.

    A step is doubted until the reports are back where the vehicle can have climbed to at `CARRY_ERROR_M_S`. A
    lasting step is believed late, 3 minutes after a step of 100 m; until then separation is over-cautious.
    """

    def __init__(self) -> None:
        self._witness = Witness()
        self._known = self._seen = self._off = math.nan
        self._known_s = -math.inf

    @property
    def doubted(self) -> bool:
        """Whether the reported altitudes are disbelieved now."""
        return self._witness.doubted

    @property
    def is_known(self) -> bool:
        """Whether an altitude has been believed."""
        return not math.isnan(self._known)

    @property
    def sentence(self) -> str:
        """Predicate about the vehicle: the state of its altitudes, and the remedy."""
        if not self.doubted:
            return "reports an altitude that can be again: believed, nothing to do"
        if self.is_known:
            return (
                "reports an altitude that steps: not believed, kept clear of at every height;"
                " be ready to take over should it come near"
            )
        side = "above" if self._off > 0.0 else "below"
        return (
            f"reports an altitude of {self._seen:.0f} m, {abs(self._off):.0f} m {side} the mission's: own"
            " height kept; see that it reports heights above mean sea level, or set height_above_origin_m"
        )

    def judge(
        self, altitude_amsl: float, time_s: float, beside: HeightWitnesses | None = None
    ) -> float:
        """Take a reported altitude (m above mean sea level); return it, or NaN while it is doubted.

        Reports must come in order of time. The witnesses in `beside`, if any, must bear out the first
        altitude.
        """
        if not self.is_known:
            self._witness.doubted = beside is not None and not beside.bear_out(altitude_amsl)
            if beside is not None:
                self._seen, self._off = altitude_amsl, altitude_amsl - beside.planned
            if not self.doubted:
                self._known, self._known_s = altitude_amsl, time_s
            return math.nan if self.doubted else altitude_amsl
        passed_s, before = max(time_s - self._known_s, 0.0), self.doubted
        within = STEP_M + (CARRY_ERROR_M_S if before else CLIMB_M_S) * passed_s
        if not self._witness.judge(altitude_amsl, self._known, within, time_s):
            return math.nan
        # The known altitude follows only as fast as an aircraft climbs: steps do not add up.
        climb_m = math.inf if before else CLIMB_M_S * passed_s
        self._known += min(max(altitude_amsl - self._known, -climb_m), climb_m)
        self._known_s = time_s
        return altitude_amsl


class Repeats:
    """Detector of reports that repeat to the digit although the aircraft moves or turns."""

    def __init__(self) -> None:
        self._place_s = 0.0
        self._place_count = self._velocity_count = 0
        self._held_from = ReportedMotion(0.0, math.nan, math.nan, math.nan, math.nan)
        self._turned_from: tuple[float, float] | None = None

    def take(
        self,
        newest: ReportedMotion | None,
        motion: ReportedMotion,
        air: tuple[float, float] | None,
        noise: float,
    ) -> tuple[bool, bool]:
        """Return whether (position, velocity) repeat, by air velocity (m/s) and position noise (m)."""
        now = motion.time_s
        same_place = same_velocity = False
        if newest is not None:
            same_place = newest.north == motion.north and newest.east == motion.east
            same_velocity = (
                newest.velocity_north == motion.velocity_north
                and newest.velocity_east == motion.velocity_east
            )
        self._place_count += 1
        self._velocity_count += 1
        if not same_place:
            self._place_s, self._place_count = now, 0
        if not same_velocity:
            self._velocity_count, self._held_from, self._turned_from = 0, motion, air
            if not same_place:
                return False, False
        place = now - self._place_s > REPEATED_S and self._place_count >= REPEATED_COUNT
        velocity_s = now - self._held_from.time_s
        velocity = velocity_s > REPEATED_S and self._velocity_count >= REPEATED_COUNT
        if not velocity or air is None:
            place = place and motion.speed > MOVING_M_S
            return place, place and velocity
        place = place and max(motion.speed, math.hypot(*air)) > MOVING_M_S
        if place or self._turned_from is None:
            return place, place
        turned = math.hypot(air[0] - self._turned_from[0], air[1] - self._turned_from[1])
        parted = math.hypot(*innovation(self._held_from, motion))
        # The velocity may be off by the first bound, positions by the second.
        return False, turned > CARRY_ERROR_M_S and parted > PARTED_M + PARTED_SIGMAS * noise


class Word(msgspec.Struct):
    """Newest word of receiver, estimator or sensors."""

    fault: str | None = None
    """Fault in words; None without one."""
    since: float = -math.inf
    """Beginning of the fault, s."""
    heard: float = -math.inf
    """When it was heard last, s."""


class OwnWord:
    """Autopilot's own word of its receiver, estimator and sensors; unmentioned ones count as unknown."""

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
        """Return a fault that has lasted; None without one, or if nothing is known."""
        for word in self._words.values():
            if word.fault is not None and now - word.heard <= FRESH_S and now - word.since >= BAD_S:
                return word.fault
        return None


def fault_of(report: GpsReport | EstimatorReport | SensorsReport) -> str | None:
    """Return the fault in a report, in words."""
    match report:
        case GpsReport():
            accuracy = report.accuracy or 0.0
            found = {
                "the GPS has no fix": report.fix_type < LEAST_FIX,
                f"the GPS is certain to {accuracy:.0f} m only": accuracy > GREATEST_ERROR_M,
            }
        case EstimatorReport():
            found = {
                "the autopilot's estimator has no position": not report.has_position,
                "the autopilot's estimator has no velocity": not report.has_velocity,
            }
        case SensorsReport():
            found = {
                "the autopilot says that its GPS fails": not report.gps,
                "the autopilot says that its attitude estimate fails": not report.attitude,
            }
    return next((words for words, holds in found.items() if holds), None)
