"""From a guidance step to what the autopilot is sent: nothing that cannot be flown, and nothing twice."""

import math
from collections import Counter

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import RoleStep
from vfguide.companion.setpoint_guard import SetpointGuard
from vfguide.companion.tracking_monitor import TrackingMonitor
from vfguide.mavlink.adapter import AutopilotAdapter, AutopilotSetpoint, SetpointStream
from vfguide.state import Setpoint

ALTITUDE_S = 5.0
"""Between repetitions of the altitude."""

ALTITUDE_STEP_M = 0.02
"""An altitude that has changed by less is not sent anew: in a steady climb of 3 m/s all are."""

ALTITUDE_DIGITS = 2
"""Decimals of an altitude: autopilots keep centimetres."""

CANNOT_CLIMB = "too near to another vehicle, and no height can be commanded in this mode: take over"
"""In the place of a step in height."""


class Steering:
    """What one autopilot is sent of what guidance asks for."""

    def __init__(self, plan: FlightPlan, adapter: AutopilotAdapter, own: OwnVehicle) -> None:
        """Have sent nothing yet.

        Args:
            plan: its vehicle's part of the mission.
            adapter: how to speak to its autopilot.
            own: what is known of the vehicle: its airspeed sensor and its slip.
        """
        self._plan = plan
        self._adapter = adapter
        self._own = own
        self._guard = SetpointGuard(plan)
        self._stream = SetpointStream(adapter)
        self._tracking = TrackingMonitor(plan.airframe)
        self._height = plan.height
        self._altitude, self._altitude_time = plan.altitude_amsl, -math.inf
        self._words: list[str | None] = []
        self.setpoint: Setpoint[float] | None = None
        """The last that was flown."""

    @property
    def counters(self) -> Counter[str]:
        """What was not passed on, by reason."""
        return self._guard.counters

    def closed(self, now: float) -> bool:
        """Whether nothing could be passed on for so long that the autopilot is better off by itself."""
        return self._guard.closed(now)

    def words(self) -> list[str]:
        """What a pilot should know since the last call, one sentence each."""
        words, self._words = self._words, []
        return [text for text in words if text is not None]

    def begin(self) -> None:
        """Note that the vehicle is steered from now on: its autopilot may hold another altitude."""
        self._altitude_time = -math.inf

    def reset(self) -> None:
        """Forget what was sent: the autopilot has entered or left the mode in which it is heard."""
        self._stream.reset()
        self._tracking.reset()

    def check(self, step: RoleStep, now: float) -> Setpoint[float] | None:
        """What a step asks for, if it can be flown."""
        setpoint, complaint = self._guard.pass_on(step.setpoint, now)
        self._words.append(complaint)
        if setpoint is not None:
            self._height = self._safe(step.height)
        return setpoint

    def fly(
        self, setpoint: Setpoint[float], climb_m: float, navigated: NavigatedState, now: float
    ) -> list[MAVLink_message]:
        """Messages that steer by a checked setpoint, and so much above its height."""
        wanted = self._amsl(self._height)
        altitude = self._amsl(self._safe(self._height + climb_m))
        self.setpoint = setpoint
        if climb_m != 0.0 and not self._adapter.holds_altitude:
            self._words.append(CANNOT_CLIMB)
        asked = self._asked(setpoint, altitude, navigated)
        messages = self._stream.due(self._adapter.fly(asked), now)
        messages += self._altitude_due(asked.altitude_amsl, now)
        self._words.append(self._tracking.watch(navigated.state, setpoint))
        if not self._adapter.holds_altitude:
            off = navigated.place.altitude_amsl - wanted
            self._words.append(self._tracking.watch_altitude(off))
        return messages

    def stay_ready(
        self, setpoint: Setpoint[float], navigated: NavigatedState, now: float
    ) -> list[MAVLink_message]:
        """Messages by which an autopilot may be engaged, where it wants a setpoint before."""
        asked = self._asked(setpoint, self._amsl(self._height), navigated)
        return self._stream.due(self._adapter.stay_ready(asked), now)

    def _safe(self, height: float) -> float:
        """A height that may be asked for, m above the origin."""
        height, complaint = self._guard.height(height)
        self._words.append(complaint)
        return height

    def _amsl(self, height: float) -> float:
        return self._plan.frame.altitude_m + height

    def _asked(
        self, setpoint: Setpoint[float], altitude: float, navigated: NavigatedState
    ) -> AutopilotSetpoint:
        """A setpoint as it is sent to the autopilot, with an altitude (m above mean sea level)."""
        return AutopilotSetpoint(
            course=setpoint.course + self._own.course_offset,
            speed=self._reported(setpoint.speed),
            altitude_amsl=round(altitude, ALTITUDE_DIGITS),
            latitude_deg=navigated.place.latitude_deg,
            longitude_deg=navigated.place.longitude_deg,
        )

    def _altitude_due(self, altitude: float, now: float) -> list[MAVLink_message]:
        """The altitude when it is new, and now and then."""
        moved = abs(altitude - self._altitude) >= ALTITUDE_STEP_M
        if not moved and now - self._altitude_time < ALTITUDE_S:
            return []
        self._altitude_time, self._altitude = now, altitude
        return self._adapter.hold_altitude(altitude)

    def _reported(self, speed: float) -> float:
        """A speed (m/s) as the autopilot's own sensor would show it, within the vehicle's limits."""
        airframe = self._plan.airframe
        if airframe.hold == "course-hold":
            return speed
        shown = speed / self._own.calibration.scale
        return min(max(shown, airframe.airspeed_min), airframe.airspeed_max)
