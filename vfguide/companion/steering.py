"""From guidance steps to messages: limits, no repetition, and a check that the autopilot obeys.

The guard keeps setpoints finite and inside the vehicle's limits, whatever the laws say. It does not depend on
the leader's reported height, or on learned speeds. No height is below the mission's floor or above its fence.

The monitor checks that the course follows the setpoints and the altitude stays. An autopilot may acknowledge
every setpoint and fly none: PX4 1.16.0 ignored velocities of fixed wings, and ArduPlane does not turn without
a lateral acceleration.
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
"""Time without setpoints after which the autopilot is handed back, s: until then it holds the last one."""

STRONGEST_WIND = 0.75
"""Strongest wind over maximum airspeed in which a ground speed is believed; no formation flies in more."""

SLOWEST_GROUND = 0.25
"""Minimum ground speed over minimum airspeed: an aircraft almost standing in a headwind has no course."""

NO_HEIGHT = (
    "guidance asks for a height that is no number: the last one is held; take over, report the log"
)
"""Message to the pilot when guidance has no finite height."""

MEMORY_S = 3.0
"""Time constant of the turn rates that are compared, s."""

EXPECTED_LEAST = 0.05
"""Minimum expected turn rate, rad/s: a smaller one does not last long enough to be judged."""

FOLLOWED_SHARE = 0.2
"""Share of the expected turn rate below which the course does not follow."""

TRACKING_PATIENCE_S = 4.0
"""Time for which the course must not follow before a complaint, s, in addition to the filter's delay."""

DISOBEDIENCE_S = 4.0
"""Time after the complaint until the vehicle is handed back, s, whatever its autopilot answers."""

DISOBEYED = (
    "the autopilot accepts courses and flies none: handed back; see that its firmware flies courses"
)
"""Message to the pilot at that hand-back."""

ALTITUDE_M = 20.0
"""Deviation from the mission's altitude that is worth a message, m."""

ALTITUDE_S = 5.0
"""Interval at which the altitude is repeated, s."""

ALTITUDE_STEP_M = 0.02
"""Altitude change below which nothing new is sent, m; a steady climb of 3 m/s exceeds it each time."""

ALTITUDE_DIGITS = 2
"""Decimals of an altitude: autopilots keep centimetres."""

CANNOT_CLIMB = "too near to another vehicle, and no height can be commanded in this mode: take over"
"""Message to the pilot in place of a step in height."""


def is_flyable(setpoint: Setpoint, plan: FlightPlan) -> bool:
    """Check whether a setpoint is finite and its speed is one that the vehicle may be asked for."""
    if not (math.isfinite(setpoint.course) and math.isfinite(setpoint.speed)):
        return False
    airframe = plan.airframe
    slowest, fastest = airframe.airspeed_min, airframe.airspeed_max
    if airframe.hold == "course-hold":
        slowest, fastest = SLOWEST_GROUND * slowest, fastest + STRONGEST_WIND * fastest
    return slowest <= setpoint.speed <= fastest


class SetpointGuard:
    """Filter that only passes setpoints that can be flown."""

    def __init__(self, plan: FlightPlan) -> None:
        self._plan = plan
        self._closed_s = math.inf
        self._floor = floor_of(plan.lowest)
        self._height = max(plan.height, self._floor)
        self._has_height = True
        self.counters: Counter[str] = Counter()
        """Setpoints that were refused or limited, by reason."""

    def closed(self, now: float) -> bool:
        """Check whether nothing has passed for so long that the vehicle should be handed back."""
        return now - self._closed_s > GUARD_PATIENCE_S

    def pass_on(self, setpoint: Setpoint | None, now: float) -> tuple[Setpoint | None, str | None]:
        """Return (the setpoint if it can be flown, a complaint at the first that cannot)."""
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
        """Return (a permitted height, a complaint when guidance first has none), m above the origin.

        Without a finite height the last one is held. A ceiling below the floor yields to the floor.
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
    """Check that the vehicle obeys while it is steered."""

    def __init__(self, airframe: Airframe) -> None:
        self._airframe = airframe
        self._complained = self._astray = False
        self.reset()

    def retune(self, airframe: Airframe) -> None:
        """Use another response of the same vehicle."""
        self._airframe = airframe

    def reset(self) -> None:
        """Expect nothing, as the vehicle is not being steered."""
        self._before: tuple[VehicleState, Setpoint] | None = None
        self._expected = self._turned = 0.0
        self._ignored_s = 0.0
        self.gives_up = False
        """Whether the autopilot flies none of its courses and should be handed back."""

    def watch(self, state: VehicleState, setpoint: Setpoint) -> str | None:
        """Process a state and the setpoint sent with it; return a complaint or None."""
        before, self._before = self._before, (state, setpoint)
        if before is None:
            return None
        earlier, asked = before
        period = state.time_s - earlier.time_s
        if not 0.0 < period <= GAP_S:
            return None
        # In a swinging wind the nose of a heading hold turns, so that the course need not.
        direction = held_direction(state, self._airframe)
        turned = wrap_angle(direction - held_direction(earlier, self._airframe)) / period
        expected = expected_turn_rate(earlier, asked, self._airframe)
        self._expected = low_pass(self._expected, expected, period, MEMORY_S)
        self._turned = low_pass(self._turned, turned, period, MEMORY_S)
        # A turn that is no longer asked for need not be flown: the filtered rate alone is no evidence.
        asks = expected * math.copysign(1.0, self._expected) >= EXPECTED_LEAST
        return self._judge(period if asks else 0.0)

    def watch_altitude(self, off: float) -> str | None:
        """Return a complaint, or None, on a vehicle `off` m above an altitude that it cannot be sent."""
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
        """Accumulate the time of unflown turns; return a complaint or None."""
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
    """Return the turn rate, rad/s, due to a setpoint: alpha times course error, within the bank limit."""
    limit = bank_limited_turn_rate(airframe.max_bank, max(state.airspeed, 1.0))
    wanted = airframe.alpha * wrap_angle(setpoint.course - state.course)
    return min(max(wanted, -limit), limit)


def slowest_of(plan: FlightPlan) -> Airframe:
    """Return an airframe with the slowest turn response compatible with what is known of it."""
    alpha = plan.airframe.alpha / plan.certainty.course.spread
    return replace(plan.airframe, alpha=alpha)


def creeping_speed_of(plan: FlightPlan) -> CreepingSpeed | None:
    """Return the compensation for an airspeed hold that creeps; None for any other."""
    return None if plan.creeping_hold is None else CreepingSpeed(plan.creeping_hold)


class Steering:
    """Conversion of guidance steps to the messages for one autopilot."""

    def __init__(
        self,
        plan: FlightPlan,
        adapter: AutopilotAdapter,
        own: OwnVehicle,
        alerts: Alerts | None = None,
    ) -> None:
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
        """Last setpoint that was flown."""

    @property
    def counters(self) -> Counter[str]:
        """Setpoints that were not passed on, by reason."""
        return self._guard.counters

    def retune(self, plan: FlightPlan) -> None:
        """Use another response of the same vehicle."""
        if plan.creeping_hold != self._plan.creeping_hold:
            self._creeping = creeping_speed_of(plan)
        self._plan = plan
        self._tracking.retune(slowest_of(plan))

    def closed(self, now: float) -> bool:
        """Check whether to hand the autopilot back: setpoints were refused, or not flown, for too long."""
        return self._guard.closed(now) or self._tracking.gives_up

    def _say(self, text: str | None) -> None:
        if text is not None:
            self._alerts.say("steering", WARNING, text)

    def begin(self) -> None:
        """Note that the vehicle is steered from now on: its autopilot may hold another altitude."""
        self._altitude_time = -math.inf

    def reset(self) -> None:
        """Forget what was sent, as the autopilot has entered or left its guided mode."""
        self._stream.reset()
        self._tracking.reset()
        if self._creeping is not None:
            self._creeping.reset()

    def check(self, step: RoleStep, now: float, *, ceiling: float = math.inf) -> Setpoint | None:
        """Return a step's setpoint if it can be flown; heights stay below the ceiling, m above the origin."""
        self._ceiling = ceiling
        setpoint, complaint = self._guard.pass_on(step.setpoint, now)
        self._say(complaint)
        if setpoint is not None:
            self._height = self._safe(step.height)
        return setpoint

    def fly(
        self, setpoint: Setpoint, climb_m: float, navigated: NavigatedState, now: float
    ) -> list[MAVLink_message]:
        """Return messages for a checked setpoint, with a height raised by `climb_m`."""
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
        """Return messages for an autopilot that wants a setpoint before it can be engaged."""
        asked = self._asked(setpoint, self._amsl(self._height), navigated)
        return self._stream.due(self._adapter.stay_ready(asked), now)

    def _safe(self, height: float) -> float:
        """Return the permitted height, m above the origin, and tell the pilot if guidance has none."""
        height, complaint = self._guard.height(height, self._ceiling)
        self._say(complaint)
        return height

    def _amsl(self, height: float) -> float:
        return self._plan.frame.altitude_m + height

    def _asked(
        self, setpoint: Setpoint, altitude: float, navigated: NavigatedState
    ) -> AutopilotSetpoint:
        """Return a setpoint in the autopilot's units; `altitude` is in m above mean sea level."""
        return AutopilotSetpoint(
            course=setpoint.course + self._own.course_offset,
            speed=self._reported(setpoint.speed),
            altitude_amsl=round(altitude, ALTITUDE_DIGITS),
            latitude_deg=navigated.place.latitude_deg,
            longitude_deg=navigated.place.longitude_deg,
        )

    def _altitude_due(self, altitude: float, now: float) -> list[MAVLink_message]:
        """Return the altitude command if it is new, or due for repetition."""
        moved = abs(altitude - self._altitude) >= ALTITUDE_STEP_M
        if not moved and now - self._altitude_time < ALTITUDE_S:
            return []
        self._altitude_time, self._altitude = now, altitude
        return self._adapter.hold_altitude(altitude)

    def _brought_about(self, speed: float, navigated: NavigatedState, now: float) -> float:
        """Return the speed to ask of a creeping hold for a `speed` on its sensor, m/s."""
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
        """Return a speed, m/s, as the autopilot's own sensor shows it, within the vehicle's limits."""
        airframe = self._plan.airframe
        if airframe.hold == "course-hold":
            return speed
        shown = speed / self._own.air.calibration.scale
        return min(max(shown, airframe.airspeed_min), airframe.airspeed_max)
