"""What is believed of the altitudes of one aircraft, and what bears out the first one of a leader."""

import math
from typing import NamedTuple

from vfguide.companion.belief import RETURN_S

STEP_M = 10.0
"""So far an altitude may be from where the ones before lead: noise, and a barometer that settles."""

CLIMB_M_S = 15.0
"""And by so much more for each second: faster than these aircraft climb or dive."""

RETURN_M_S = 0.5
"""How fast the true altitude may have left the last believed one, on average, while reports were doubted."""

BESIDE_M, LEAST_BESIDE_M = 25.0, 10.0
"""So far the altitude of a leader may be from the mission's and from one's own, in high and in low flight.
Barometers are set apart by 10 m; heights above the ellipsoid, or the ground, differ by more from those above
the sea."""

BESIDE_SHARE = 0.5
"""And no farther than this part of the flying height."""


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
        within = min(max(BESIDE_SHARE * self.above, LEAST_BESIDE_M), BESIDE_M)
        return any(abs(altitude_amsl - one) <= within for one in (self.planned, self.own))


class HeightBelief:
    """What is believed of the altitudes of one vehicle.

    Keeping clear leaves out vehicles that fly far above or below. A false altitude would make an aircraft
    that is straight ahead look harmless, so a doubted one counts as not known, and a vehicle without a
    known altitude is kept clear of in the plane.

    A step is doubted until the reports are back where the vehicle can have climbed to at `RETURN_M_S`. One
    that stays is believed late, 3 minutes after a step of 100 m. Until then its vehicle is kept clear of more
    than needed.
    """

    def __init__(self) -> None:
        self._known = math.nan
        self._known_time = -math.inf
        self._seen = self._off = math.nan
        self._seen_time = -math.inf
        self._seen_since = -math.inf
        self.doubted = False
        """Whether the reported altitudes are not believed now."""

    @property
    def is_known(self) -> bool:
        """Whether an altitude has been believed."""
        return not math.isnan(self._known)

    @property
    def sentence(self) -> str:
        """What became of the altitudes, as a sentence about their vehicle goes on, and the remedy."""
        if not self.doubted:
            return (
                "is as high as the mission says, or oneself: its height is followed, nothing to do"
            )
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
        if math.isnan(self._known):
            self.doubted = beside is not None and not beside.bear_out(altitude_amsl)
            self._seen = altitude_amsl
            self._off = 0.0 if beside is None else altitude_amsl - beside.planned
            return math.nan if self.doubted else self._believe(altitude_amsl, time_s)
        if not self.doubted:
            if follows(self._known, altitude_amsl, time_s - self._known_time):
                return self._follow(altitude_amsl, time_s)
            self.doubted = True
            self._seen_since = time_s
        elif not follows(self._seen, altitude_amsl, time_s - self._seen_time):
            self._seen_since = time_s
        self._seen, self._seen_time = altitude_amsl, time_s
        left_m = STEP_M + RETURN_M_S * (time_s - self._known_time)
        agreed = time_s - self._seen_since >= RETURN_S
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
