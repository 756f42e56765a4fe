"""What height to ask of one vehicle's autopilot: the wanted one, as far as speed leaves energy for it.

Throttle and height share one energy. An aircraft at full throttle that climbs cannot fly faster as well, and
one that glides down at idle cannot fly slower. Speed keeps the slot and with it the distances, so height
gives way: by the climb rate V a / g that sets the missing acceleration a free.
"""

from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan
from vfguide.elementwise import low_pass
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.height import HeightTarget
from vfguide.state import Setpoint

MEMORY_S = 3.0
"""Of the missing acceleration: delays of the speed hold are over by then."""

LEAST_MISSING = 0.3
"""m/s²: speed holds that are not quite what is declared miss as much."""

GAIN = 3.0
"""Climb rate given up for each m/s that the missing acceleration takes."""

LEAST_CLIMB = 0.3
"""m/s: slower climbs and descents take no energy that is worth a word."""

CATCH_UP_SHARE = 0.25
"""Of the vehicle's limit: so fast height that was given up is taken back."""

MOST_M = 100.0
"""Most height that is given up."""

GAP_S = 1.0


class HeightKeeper:
    """Of one vehicle."""

    def __init__(self, plan: FlightPlan) -> None:
        """Make one for a plan whose autopilot has all the energy that it needs so far."""
        self._plan = plan
        self._missing = 0.0
        self._given_up = 0.0
        self._airspeed: float | None = None

    @property
    def given_up(self) -> float:
        """Height that is left to the speed now, m; negative in a descent."""
        return self._given_up

    def delay_s(self, navigated: NavigatedState) -> float:
        """From a report to when the height that it leads to is flown, s."""
        return self._plan.airframe.height_delay + 0.5 * navigated.period

    def step(
        self,
        navigated: NavigatedState,
        target: HeightTarget,
        setpoint: Setpoint[float] | None,
        *,
        steered: bool,
    ) -> float:
        """The height to ask for now, m above the mission's origin.

        Args:
            navigated: the vehicle.
            target: its wanted height.
            setpoint: of the speed, as it goes out with the height.
            steered: whether the autopilot flies by it: else nothing is learned.
        """
        airspeed, before = navigated.state.airspeed, self._airspeed
        self._airspeed = airspeed
        held = self._plan.airframe.hold == "heading-hold"
        known = setpoint is not None and before is not None and navigated.interval <= GAP_S
        if not (steered and held and known) or setpoint is None or before is None:
            self._missing = self._given_up = 0.0
            return target.ahead
        airframe, period = self._plan.airframe, navigated.interval
        limit = airframe.max_acceleration
        wanted = min(max(airframe.beta * (setpoint.speed - airspeed), -limit), limit)
        missing = wanted - (airspeed - before) / period
        self._missing = low_pass(self._missing, missing, period, MEMORY_S)
        given = self._climb_given_up(target.climb_rate)
        if given * self._given_up >= 0.0 and given != 0.0:
            self._given_up += given * period
        else:
            catch_up = CATCH_UP_SHARE * period
            up, down = catch_up * airframe.climb_max, catch_up * airframe.sink_max
            # A target that comes back to the vehicle is waited for: below one that descends nothing is safe.
            up = max(up, -target.climb_rate * period)
            down = max(down, target.climb_rate * period)
            self._given_up -= min(max(self._given_up, -down), up)
        self._given_up = min(max(self._given_up, -MOST_M), MOST_M)
        return target.ahead - self._given_up - given * airframe.height_delay

    def _climb_given_up(self, climb_rate: float) -> float:
        """Of a wanted climb rate (m/s), what the speed needs; at most all of it."""
        per_acceleration = GAIN * (self._airspeed or 0.0) / GRAVITY
        if climb_rate > LEAST_CLIMB and self._missing > LEAST_MISSING:
            return min(per_acceleration * (self._missing - LEAST_MISSING), climb_rate)
        if climb_rate < -LEAST_CLIMB and self._missing < -LEAST_MISSING:
            return max(per_acceleration * (self._missing + LEAST_MISSING), climb_rate)
        return 0.0
