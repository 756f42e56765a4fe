"""From a guidance step to what the autopilot is sent: within limits, nothing twice, and whether it is obeyed.

The guard: setpoints are finite and inside the vehicle's limits, whatever the laws say. It does not depend
on what is heard of a leader's height, or learned of the speed: no height is below the mission's floor or
above its fence.

The monitor: the course has to follow the setpoints, the altitude to stay. An autopilot may acknowledge
every setpoint and fly none: PX4 1.16.0 ignored velocities of fixed wings, ArduPlane does not turn where
it is given no lateral acceleration.
"""

import math
from collections import Counter

from msgspec.structs import replace
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.alerts import Alerts
from vfguide.companion.own_vehicle import NavigatedState, OwnVehicle
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import RoleStep
from vfguide.elementwise import low_pass, wrap_angle
from vfguide.guidance.air_data import CreepingSpeed
from vfguide.guidance.airframe import bank_limited_turn_rate, held_direction
from vfguide.guidance.height import floor_of
from vfguide.mavlink.adapter import AutopilotAdapter, AutopilotSetpoint, SetpointStream
from vfguide.mavlink.announcements import WARNING
from vfguide.state import GAP_S, Airframe, Setpoint, VehicleState

GUARD_PATIENCE_S = 1.0
"""An autopilot holds its last setpoint: after this without any other it is better off by itself."""

STRONGEST_WIND = 0.75
"""Wind over the greatest airspeed that a ground speed is believed with: in more no formation can be flown."""

SLOWEST_GROUND = 0.25
"""Least ground speed over the least airspeed: an aircraft that all but stands in a headwind has no course."""

NO_HEIGHT = (
    "guidance asks for a height that is no number: the last one is held; take over, report the log"
)
"""What the pilot hears then."""

MEMORY_S = 3.0
"""Time constant of the turn rates that are compared."""

EXPECTED_LEAST = 0.05
"""rad/s: less than this is not asked for long enough to be judged."""

FOLLOWED_SHARE = 0.2
"""Below this share of the turn that is expected, a course does not follow."""

TRACKING_PATIENCE_S = 4.0
"""How long that has to last, on top of the memory."""

DISOBEDIENCE_S = 4.0
"""So long after the complaint nobody steers the vehicle, whatever its autopilot answers."""

DISOBEYED = (
    "the autopilot accepts courses and flies none: handed back; see that its firmware flies courses"
)
"""What the pilot hears then."""

ALTITUDE_M = 20.0
"""Farther from the altitude of the mission than this is worth a text."""

ALTITUDE_S = 5.0
"""Interval at which the altitude is repeated."""

ALTITUDE_STEP_M = 0.02
"""An altitude that has changed by less is not sent anew: in a steady climb of 3 m/s all are."""

ALTITUDE_DIGITS = 2
"""Decimals of an altitude: autopilots keep centimetres."""

CANNOT_CLIMB = "too near to another vehicle, and no height can be commanded in this mode: take over"
"""In the place of a step in height."""


def is_flyable(setpoint: Setpoint, plan: FlightPlan) -> bool:
    """Whether a setpoint is finite and its speed one that the vehicle may be asked for."""
    if not (math.isfinite(setpoint.course) and math.isfinite(setpoint.speed)):
        return False
    airframe = plan.airframe
    slowest, fastest = airframe.airspeed_min, airframe.airspeed_max
    if airframe.hold == "course-hold":
        slowest, fastest = SLOWEST_GROUND * slowest, fastest + STRONGEST_WIND * fastest
    return slowest <= setpoint.speed <= fastest


class SetpointGuard:
    """Lets pass what can be flown."""

    def __init__(self, plan: FlightPlan) -> None:
        self._plan = plan
        self._closed_s = math.inf
        self._floor = floor_of(plan.lowest)
        self._height = max(plan.height, self._floor)
        self._has_height = True
        self.counters: Counter[str] = Counter()
        """What did not pass."""

    def closed(self, now: float) -> bool:
        """Whether nothing has passed for so long that the autopilot is better off by itself."""
        return now - self._closed_s > GUARD_PATIENCE_S

    def pass_on(self, setpoint: Setpoint | None, now: float) -> tuple[Setpoint | None, str | None]:
        """(the setpoint if it can be flown, a complaint when one that cannot follows one that could)."""
        if setpoint is None or is_flyable(setpoint, self._plan):
            self._closed_s = math.inf
            return setpoint, None
        self.counters["setpoint not flyable"] += 1
        if math.isfinite(self._closed_s):
            return None, None
        self._closed_s = now
        return None, (
            f"guidance asks for a course of {math.degrees(setpoint.course):.0f} degrees at"
            f" {setpoint.speed:.1f} m/s, which cannot be flown: not passed on, handed back after"
            f" {GUARD_PATIENCE_S:g} s; take over, and report the log"
        )

    def height(self, asked: float, ceiling: float = math.inf) -> tuple[float, str | None]:
        """(a height that may be asked for, m above the origin; a complaint once guidance has none).

        In its place the last one is held.

        Args:
            asked: by guidance, m above the origin.
            ceiling: where the fence ends, m above the origin. Where it is below the floor, that counts.
        """
        if not math.isfinite(asked):
            self.counters["height not finite"] += 1
            complaint, self._has_height = self._has_height, False
            return self._height, NO_HEIGHT if complaint else None
        if asked < self._floor:
            self.counters["height below the floor"] += 1
        if asked > ceiling:
            self.counters["height above the fence"] += 1
        self._has_height, self._height = True, max(min(asked, ceiling), self._floor)
        return self._height, None


class TrackingMonitor:
    """Watches one vehicle while it is being steered."""

    def __init__(self, airframe: Airframe) -> None:
        self._airframe = airframe
        self._complained = self._astray = False
        self.reset()

    def retune(self, airframe: Airframe) -> None:
        """Expect another response from now on."""
        self._airframe = airframe

    def reset(self) -> None:
        """The vehicle is not being steered: nothing can be expected of it."""
        self._before: tuple[VehicleState, Setpoint] | None = None
        self._expected = self._turned = 0.0
        self._ignored_s = 0.0
        self.gives_up = False
        """Whether its autopilot flies none of its courses, and is better off by itself."""

    def watch(self, state: VehicleState, setpoint: Setpoint) -> str | None:
        """Take a state and the setpoint that goes out with it; a complaint, or None."""
        before, self._before = self._before, (state, setpoint)
        if before is None:
            return None
        earlier, asked = before
        period = state.time_s - earlier.time_s
        if not 0.0 < period <= GAP_S:
            return None
        # In a wind that swings the nose of a heading hold turns, so that the course need not.
        direction = held_direction(state, self._airframe)
        turned = wrap_angle(direction - held_direction(earlier, self._airframe)) / period
        expected = expected_turn_rate(earlier, asked, self._airframe)
        self._expected = low_pass(self._expected, expected, period, MEMORY_S)
        self._turned = low_pass(self._turned, turned, period, MEMORY_S)
        # A turn that is asked for no more need not be flown any more: its memory alone is no evidence.
        asks = expected * math.copysign(1.0, self._expected) >= EXPECTED_LEAST
        return self._judge(period if asks else 0.0)

    def watch_altitude(self, off: float) -> str | None:
        """Take how far above the wanted altitude (m) one is that cannot be told it; a complaint, or None."""
        if abs(off) <= ALTITUDE_M or self._astray:
            self._astray = abs(off) > ALTITUDE_M / 2.0 and self._astray
            return None
        self._astray = True
        side = "above" if off > 0.0 else "below"
        return (
            f"{abs(off):.0f} m {side} the mission's altitude, which this autopilot cannot be told:"
            " take it there by hand before it is engaged"
        )

    def _judge(self, asked_s: float) -> str | None:
        """Count for how long turns were asked for and not flown; a complaint, or None."""
        follows = abs(self._expected) < EXPECTED_LEAST or self._turned * math.copysign(
            1.0, self._expected
        ) > FOLLOWED_SHARE * abs(self._expected)
        if follows:
            self._ignored_s = 0.0
            if self._complained and abs(self._expected) >= EXPECTED_LEAST:
                self._complained = self.gives_up = False
                return "the course follows again, nothing to do"
            return None
        self._ignored_s += asked_s
        if self._ignored_s >= TRACKING_PATIENCE_S + DISOBEDIENCE_S and not self.gives_up:
            self.gives_up = True
            return DISOBEYED
        if self._ignored_s < TRACKING_PATIENCE_S or self._complained:
            return None
        self._complained = True
        return (
            "the course does not follow the setpoints: asked to turn at"
            f" {math.degrees(self._expected):.0f} degrees a second, turning at"
            f" {math.degrees(self._turned):.0f}; be ready to take over; does this autopilot fly courses?"
        )


def expected_turn_rate(state: VehicleState, setpoint: Setpoint, airframe: Airframe) -> float:
    """Turn rate (rad/s) that a setpoint should bring about: alpha times the course error, within the bank."""
    limit = bank_limited_turn_rate(airframe.max_bank, max(state.airspeed, 1.0))
    wanted = airframe.alpha * wrap_angle(setpoint.course - state.course)
    return min(max(wanted, -limit), limit)


def slowest_of(plan: FlightPlan) -> Airframe:
    """Return the slowest that an aircraft may turn, as far as its response is known: only less is ignored."""
    alpha = plan.airframe.alpha / plan.certainty.course.spread
    return replace(plan.airframe, alpha=alpha)


def creeping_speed_of(plan: FlightPlan) -> CreepingSpeed | None:
    """For a vehicle whose airspeed hold creeps."""
    return None if plan.creeping_hold is None else CreepingSpeed(plan.creeping_hold)


class Steering:
    """What one autopilot is sent of what guidance asks for."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        own: OwnVehicle,
        alerts: Alerts | None = None,
    ) -> None:
        """Have sent nothing yet.

        Args:
            plan: its vehicle's part of the mission.
            adapter: how to speak to its autopilot.
            own: what is known of the vehicle: its airspeed sensor and its slip.
            alerts: takes what a pilot should know.
        """
        self._plan = plan
        self._adapter = adapter
        self._own = own
        self._guard = SetpointGuard(plan)
        self._stream = SetpointStream(adapter)
        self._tracking = TrackingMonitor(slowest_of(plan))
        self._creeping = creeping_speed_of(plan)
        self._height = plan.height
        self._ceiling = math.inf
        self._altitude, self._altitude_time = plan.altitude_amsl, -math.inf
        self._alerts = alerts or Alerts()
        self.setpoint: Setpoint | None = None
        """The last that was flown."""

    @property
    def counters(self) -> Counter[str]:
        """What was not passed on, by reason."""
        return self._guard.counters

    def retune(self, plan: FlightPlan) -> None:
        """Go on with another response of the same vehicle."""
        if plan.creeping_hold != self._plan.creeping_hold:
            self._creeping = creeping_speed_of(plan)
        self._plan = plan
        self._tracking.retune(slowest_of(plan))

    def closed(self, now: float) -> bool:
        """Whether nothing was passed on or flown for so long that the autopilot is better off by itself."""
        return self._guard.closed(now) or self._tracking.gives_up

    def _say(self, text: str | None) -> None:
        if text is not None:
            self._alerts.say("steering", WARNING, text)

    def begin(self) -> None:
        """Note that the vehicle is steered from now on: its autopilot may hold another altitude."""
        self._altitude_time = -math.inf

    def reset(self) -> None:
        """Forget what was sent: the autopilot has entered or left the mode in which it is heard."""
        self._stream.reset()
        self._tracking.reset()
        if self._creeping is not None:
            self._creeping.reset()

    def check(self, step: RoleStep, now: float, *, ceiling: float = math.inf) -> Setpoint | None:
        """What a step asks for, if it can be flown; no height above the ceiling (m above the origin)."""
        self._ceiling = ceiling
        setpoint, complaint = self._guard.pass_on(step.setpoint, now)
        self._say(complaint)
        if setpoint is not None:
            self._height = self._safe(step.height)
        return setpoint

    def fly(
        self, setpoint: Setpoint, climb_m: float, navigated: NavigatedState, now: float
    ) -> list[MAVLink_message]:
        """Messages that steer by a checked setpoint, and so much above its height."""
        wanted = self._amsl(self._height)
        altitude = self._amsl(self._safe(self._height + climb_m))
        self.setpoint = setpoint
        if climb_m != 0.0 and not self._adapter.holds_altitude:
            self._say(CANNOT_CLIMB)
        asked = self._asked(setpoint, altitude, navigated)
        asked = replace(asked, speed=self._brought_about(asked.speed, navigated, now))
        halved = self._own.radio.is_short(now)
        messages = self._stream.due(self._adapter.fly(asked), now, halved=halved)
        messages += self._altitude_due(asked.altitude_amsl, now)
        self._say(self._tracking.watch(navigated.state, setpoint))
        if not self._adapter.holds_altitude:
            off = navigated.place.altitude_amsl - wanted
            self._say(self._tracking.watch_altitude(off))
        return messages

    def stay_ready(
        self, setpoint: Setpoint, navigated: NavigatedState, now: float
    ) -> list[MAVLink_message]:
        """Messages by which an autopilot may be engaged, where it wants a setpoint before."""
        asked = self._asked(setpoint, self._amsl(self._height), navigated)
        return self._stream.due(self._adapter.stay_ready(asked), now)

    def _safe(self, height: float) -> float:
        """A height that may be asked for, m above the origin."""
        height, complaint = self._guard.height(height, self._ceiling)
        self._say(complaint)
        return height

    def _amsl(self, height: float) -> float:
        return self._plan.frame.altitude_m + height

    def _asked(
        self, setpoint: Setpoint, altitude: float, navigated: NavigatedState
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

    def _brought_about(self, speed: float, navigated: NavigatedState, now: float) -> float:
        """What a hold that creeps is asked for, to fly a speed (m/s, as its sensor shows it) now."""
        if self._creeping is None:
            return speed
        airframe = self._plan.airframe
        return self._creeping.asked_for(
            speed,
            self._reported(navigated.state.airspeed),
            now,
            slowest=airframe.airspeed_min,
            fastest=airframe.airspeed_max,
        )

    def _reported(self, speed: float) -> float:
        """A speed (m/s) as the autopilot's own sensor would show it, within the vehicle's limits."""
        airframe = self._plan.airframe
        if airframe.hold == "course-hold":
            return speed
        shown = speed / self._own.air.calibration.scale
        return min(max(shown, airframe.airspeed_min), airframe.airspeed_max)
