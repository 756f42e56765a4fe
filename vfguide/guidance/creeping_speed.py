"""An airspeed hold that goes a part of the way at once and creeps on: what to ask of it for a speed now.

PX4 whose throttles for its least and greatest airspeed are not set (FW_THR_ASPD_MIN, FW_THR_ASPD_MAX) goes by
the one of FW_THR_TRIM at every airspeed. A new airspeed comes to a part within 2 s, and the rest as its
integrator creeps, within a minute. Asked for as much more as does not come, it flies what was wanted.
"""

import msgspec


class CreepingHold(msgspec.Struct, frozen=True, kw_only=True):
    """Steps of such a hold, as they were measured."""

    share: float
    """Of a new airspeed, what comes at once; above 0, at most 1."""
    time: float
    """Time constant with which it creeps on, s."""


class CreepingSpeed:
    """The airspeed that a hold is trimmed to, and what it is asked for."""

    def __init__(self, hold: CreepingHold) -> None:
        """Know nothing of the trim yet: the first airspeed that is flown is taken for it."""
        self._hold = hold
        self._trim: float | None = None
        self._asked = self._time_s = 0.0

    def asked_for(
        self, wanted: float, flown: float, now: float, *, slowest: float, fastest: float
    ) -> float:
        """What to ask for, m/s, within what may be asked for.

        Args:
            wanted: airspeed that is to be flown, m/s.
            flown: airspeed that is flown, m/s.
            now: s; later than at the call before.
            slowest: least that may be asked for, m/s.
            fastest: most, m/s.
        """
        if self._trim is None:
            self._trim = flown
        else:
            passed_s = min(now - self._time_s, self._hold.time)
            self._trim += (self._asked - self._trim) * passed_s / self._hold.time
        self._time_s = now
        more = (wanted - self._trim) / self._hold.share
        self._asked = min(max(self._trim + more, slowest), fastest)
        return self._asked

    def reset(self) -> None:
        """Forget the trim: somebody else has asked for other airspeeds meanwhile."""
        self._trim = None
