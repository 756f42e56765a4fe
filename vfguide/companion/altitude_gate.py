"""Whether a reported altitude can be true, after those before.

Keeping clear leaves out vehicles that fly far above or below. A false altitude would make an aircraft that is
straight ahead look harmless, so a doubted one counts as not known, and a vehicle without a known altitude is
kept clear of in the plane.
"""

import math

STEP_M = 10.0
"""So far an altitude may be from where the ones before lead: noise, and a barometer that settles."""

CLIMB_M_S = 15.0
"""And by so much more for each second: faster than these aircraft climb or dive."""

RETURN_M_S = 0.5
"""How fast the true altitude may have left the last believed one, on average, while reports were doubted."""

RETURN_S = 2.0
"""For so long doubted reports have to agree with each other before they are believed again."""


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
