"""Witnesses of one aircraft: a number that is held against its prediction, heights, repeats, the autopilot.

What contradicts its prediction is not used until it has agreed with it again for `RETURN_S`.
"""

import math
from typing import NamedTuple

import msgspec

from vfguide.guidance.navigation import ReportedMotion, innovation
from vfguide.mavlink.reports import EstimatorReport, GpsReport, SensorsReport

RETURN_S = 2.0
"""What has been false is believed after having agreed for this: longer than glitches take to come and go."""

CARRY_ERROR_M_S = 0.5
"""How fast what is carried by velocities may leave the true place: recorded ones do by 0.3 m/s."""

MOVING_M_S = 5.0
"""A slower velocity is no witness of flight."""

REPEATED_S, REPEATED_COUNT = 0.12, 2
"""What is repeated to the digit for longer is no evidence: no estimator is as slow, and links say things
twice."""

PARTED_M, PARTED_SIGMAS = 0.3, 3.0
"""Positions part from the way that a velocity leads by this and as many standard deviations."""

STEP_M = 10.0
"""So far an altitude may be from where the ones before lead, or a leader's in low flight from the mission's:
noise, and barometers that are set apart."""

CLIMB_M_S = 15.0
"""And by so much more for each second: faster than these aircraft climb or dive."""

BESIDE_M, BESIDE_SHARE = 25.0, 0.5
"""So far a leader's first altitude may be from the mission's and from one's own, and by no more than this
part of the flying height. Heights above the ellipsoid, or the ground, differ by more."""

BAD_S = 1.0
"""An autopilot's word has to be bad for so long: estimators change lanes."""

FRESH_S = 10.0
"""A word that was said longer ago than this says nothing any more."""

LEAST_FIX = 3
"""GPS_FIX_TYPE_3D_FIX: with less there is no height, or no position at all."""

GREATEST_ERROR_M = 15.0
"""A receiver that is less certain than this is no help to a formation."""


class Witness:
    """Whether one kind of number can be used."""

    def __init__(self) -> None:
        self.doubted = False
        """Whether it is not to be used now."""
        self._agrees_since = math.inf

    def judge(self, value: float, predicted: float, within: float, time_s: float) -> bool:
        """Hold a number against its prediction; whether it can be used.

        Args:
            value: as reported; what is no number contradicts everything.
            predicted: the same by other witnesses.
            within: what noise and manoeuvres explain.
            time_s: of the report, s.
        """
        if not abs(value - predicted) <= within:
            self.doubted, self._agrees_since = True, math.inf
        elif self.doubted:
            self._agrees_since = min(self._agrees_since, time_s)
            self.doubted = time_s - self._agrees_since < RETURN_S
        return not self.doubted


class HeightWitnesses(NamedTuple):
    """What there is beside a leader's own altitude."""

    planned: float
    """Its altitude by the mission, m above mean sea level."""
    own: float
    """One's own in flight, m above mean sea level; NaN where it is not known."""
    above: float
    """Flying height by the mission, m."""

    def bear_out(self, altitude_amsl: float) -> bool:
        """Whether one of them is near an altitude, m above mean sea level."""
        within = min(max(BESIDE_SHARE * self.above, STEP_M), BESIDE_M)
        return any(abs(altitude_amsl - one) <= within for one in (self.planned, self.own))


class HeightBelief:
    """What is believed of the altitudes of one vehicle.

    Keeping clear leaves out vehicles that fly far above or below. A false altitude would make an aircraft
    that is straight ahead look harmless, so a doubted one counts as not known, and a vehicle without a
    known altitude is kept clear of in the plane.

    A step is doubted until the reports are back where the vehicle can have climbed to at `CARRY_ERROR_M_S`.
    One that stays is believed late, 3 minutes after a step of 100 m. Until then its vehicle is kept clear of
    more than needed.
    """

    def __init__(self) -> None:
        self._witness = Witness()
        self._known = self._seen = self._off = math.nan
        self._known_s = -math.inf

    @property
    def doubted(self) -> bool:
        """Whether the reported altitudes are not believed now."""
        return self._witness.doubted

    @property
    def is_known(self) -> bool:
        """Whether an altitude has been believed."""
        return not math.isnan(self._known)

    @property
    def sentence(self) -> str:
        """What became of the altitudes, as a sentence about their vehicle goes on, and the remedy."""
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
        """Take a reported altitude.

        Args:
            altitude_amsl: m above mean sea level.
            time_s: of the report; not before that of the report before.
            beside: other witnesses, which have to bear out the first altitude, where there are any.

        Returns:
            the altitude, or NaN while it is doubted.
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
        # What is known follows as fast as an aircraft climbs: steps do not add up.
        climb_m = math.inf if before else CLIMB_M_S * passed_s
        self._known += min(max(altitude_amsl - self._known, -climb_m), climb_m)
        self._known_s = time_s
        return altitude_amsl


class Repeats:
    """What is repeated to the digit by an aircraft that moves, or turns."""

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
        """Whether (place, velocity) are repeated.

        Args:
            newest: the report before.
            motion: the report.
            air: velocity through the air, m/s.
            noise: of the places, m.
        """
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
        # The velocity may be off by the one, positions by the other.
        return False, turned > CARRY_ERROR_M_S and parted > PARTED_M + PARTED_SIGMAS * noise


class Word(msgspec.Struct):
    """The newest word of receiver, estimator or sensors."""

    fault: str | None = None
    """What is bad, in words."""
    since: float = -math.inf
    """From when on it has been bad, s."""
    heard: float = -math.inf
    """When it was heard last, s."""


class OwnWord:
    """The autopilot's own word of its receiver, estimator and sensors; what it does not say is unknown."""

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


def fault_of(report: GpsReport | EstimatorReport | SensorsReport) -> str | None:
    """What is bad in a report, in words."""
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
