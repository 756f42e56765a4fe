"""Whether a vehicle flies, and when its flight has ended: from what its autopilot reports."""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.reports import HeartbeatReport, LandedReport, PositionReport
from vfguide.state import VehicleState

FRESH_S = 3.0
"""Reports older than this show nothing."""

LEAST_SPEED_SHARE = 0.5
"""Slower than this share of its lowest airspeed it does not fly."""

LEAST_HEIGHT_SHARE = 0.5
"""Lower than this share of the mission's height it is still taking off."""

MOST_OFF_M = 20.0
"""How far from the mission's altitude an autopilot may be engaged that cannot be told one."""

STANDING_S = 5.0
"""Disarmed, on the ground and in one place for so long: the flight is over."""

STANDING_REBOOTED_S = 60.0
"""The same once the autopilot has started anew: in the air it may show all that until it has a position."""

STANDING_M_S = 4.0
"""Faster than this nothing stands."""

STANDING_M = 15.0
"""Farther than this from where it came to a stand nothing stands: estimators wander by less."""

GROUND_M = 20.0
"""Higher than this above the mission's ground nothing stands: altitudes drift by less in a flight."""


class FlightPhase:
    """Of one vehicle."""

    def __init__(
        self,
        adapter: AutopilotAdapter,
        *,
        airspeed_min: float,
        altitude_amsl: float,
        ground_amsl: float,
    ) -> None:
        """Before anything is heard.

        Args:
            adapter: says what a heartbeat shows.
            airspeed_min: lowest airspeed that the vehicle is asked for, m/s.
            altitude_amsl: of the mission, m.
            ground_amsl: of the mission's origin, m.
        """
        self._adapter = adapter
        self._least_speed = LEAST_SPEED_SHARE * airspeed_min
        self._altitude = altitude_amsl
        self._ground = ground_amsl
        self._lowest = ground_amsl + LEAST_HEIGHT_SHARE * (altitude_amsl - ground_amsl)
        self._beat: HeartbeatReport | None = None
        self._landed: int | None = None
        self._landed_time = -math.inf
        self._speed = self._height = math.nan
        self._position_time = -math.inf
        self._stand: tuple[float, float, float] | None = None
        self._standing_s = STANDING_S

    def hear_landed(self, report: LandedReport, now: float) -> None:
        """Take what the autopilot says about ground and air."""
        self._landed, self._landed_time = report.state, now

    @property
    def is_over(self) -> bool:
        """Whether it has been seen, to the newest believed position, to stand for long enough."""
        return self._stand is not None and self._position_time - self._stand[0] >= self._standing_s

    def hear_position(self, report: PositionReport, state: VehicleState, now: float) -> None:
        """Take a position that is believed: one that is not shows neither flight nor standing.

        Args:
            report: as it came, for speed and altitude.
            state: as navigated, for the place.
            now: s.
        """
        if now - self._position_time > FRESH_S:
            self._stand = None
        self._speed = math.hypot(report.velocity_north, report.velocity_east)
        self._height = report.altitude_amsl
        self._position_time = now
        # Not "faster" or "higher": what is no number does not stand.
        low = self._height - self._ground <= GROUND_M
        if not (low and self._speed <= STANDING_M_S and self._is_grounded(now)):
            self._stand = None
        elif self._stand is None:
            self._stand = (now, state.north, state.east)
        elif not math.dist(self._stand[1:], (state.north, state.east)) <= STANDING_M:
            self._stand = None

    def doubt_position(self) -> None:
        """A position was reported that is not believed."""
        self._stand = None

    def forget(self) -> None:
        """The autopilot has started anew: what it said before shows nothing, and it may do so in the air.

        While it comes up it may well report that it stands on the ground: it has to do so for longer.
        """
        self._standing_s = STANDING_REBOOTED_S
        self._beat = self._landed = self._stand = None
        self._landed_time = self._position_time = -math.inf

    def hear(self, report: HeartbeatReport, now: float) -> bool:
        """Take a heartbeat; whether a flight has ended, as this and the positions before show."""
        self._beat = report
        if not self._is_grounded(now) or now - self._position_time > FRESH_S:
            self._stand = None
        return self.is_over

    def obstacle(self, now: float, *, holds_altitude: bool) -> str | None:
        """Why this is no time to engage, in words; None in the air and at a height to begin at."""
        if not self.flies(now):
            return "not engaged on the ground: take off, it is engaged in the air"
        if holds_altitude:
            if self._height >= self._lowest:
                return None
            return f"not engaged so low: climb above {self._lowest:.0f} m above sea level"
        if abs(self._height - self._altitude) <= MOST_OFF_M:
            return None
        return (
            f"not engaged at this altitude, which the autopilot would keep: fly within"
            f" {MOST_OFF_M:.0f} m of the mission's {self._altitude:.0f} m above sea level"
        )

    def is_on_ground(self, now: float) -> bool:
        """Whether the autopilot says that it is on the ground, armed or not; False where it is unknown."""
        state, beat = self._landed_state(now), self._beat
        if beat is None:
            return False
        shown = self._adapter.heartbeat_shows_flight
        if state is None:
            return bool(shown and beat.status == mavlink.MAV_STATE_STANDBY)
        contradicted = shown and beat.status == mavlink.MAV_STATE_ACTIVE
        return bool(state == mavlink.MAV_LANDED_STATE_ON_GROUND and not contradicted)

    def flies(self, now: float) -> bool:
        """Whether everything heard shows flight."""
        state, beat = self._landed_state(now), self._beat
        moves = now - self._position_time <= FRESH_S and self._speed >= self._least_speed
        if beat is None or not beat.armed or not moves:
            return False
        shown = self._adapter.heartbeat_shows_flight
        if state is None:
            return bool(shown and beat.status == mavlink.MAV_STATE_ACTIVE)
        if shown and beat.status == mavlink.MAV_STATE_STANDBY:
            return False
        return bool(state == mavlink.MAV_LANDED_STATE_IN_AIR)

    def _landed_state(self, now: float) -> int | None:
        return self._landed if now - self._landed_time <= FRESH_S else None

    def _is_grounded(self, now: float) -> bool:
        """Whether the autopilot says so, disarmed: one that reboots in the air does, too."""
        state, beat = self._landed_state(now), self._beat
        if beat is None or beat.armed:
            return False
        if state is not None:
            return bool(state == mavlink.MAV_LANDED_STATE_ON_GROUND)
        if not self._adapter.heartbeat_shows_flight:
            return False
        return bool(beat.status != mavlink.MAV_STATE_ACTIVE)
