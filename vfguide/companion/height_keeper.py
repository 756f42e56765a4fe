"""Commanded height of one vehicle: as planned, in guided flight, and after it is handed back.

**Planned** is the leader's height along its path, in a hold, and between the heights of two paths. The leader
and each follower compute it by themselves from the leader's place, and so climb together. A change begins
when the leader goes over to another path, or from a hold back to its path. It starts with the height and
climb rate planned until then. It starts at the leader's own if that differs, or if a companion learns of the
order late, as after a restart. It ends once the planned height has reached the path's and the leader is
beside the path. Until then, the path's point nearest to the leader may jump from one leg to another. While
the leader is not steered, a change waits at the leader's own height. A hold ends a climb evenly, at the
height to which that leads.

**In guided flight** the wanted height is commanded as far as speed leaves energy for it, since throttle and
height share one energy. An aircraft climbing at full throttle cannot also fly faster, and one gliding at idle
cannot fly slower. Speed keeps the slot and with it the distances, so height gives way. The climb rate V a / g
is given up, which makes the missing acceleration a available.

**Handed back**, each vehicle loiters at its own height, since the circles may cross. An autopilot loiters at
the height at which it begins. A heartbeat shows that an order that calls everything off, or the end of the
route, has handed the vehicle back. Then it is told another height, above the leader by a step per rank. That
is sent a few times at most, and nothing depends on it. A vehicle in any other mode, by its pilot or its own
choice, is told nothing.
"""

import math

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan
from vfguide.elementwise import low_pass
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.height import (
    BesidePath,
    ClimbLimits,
    HeightMotion,
    HeightTarget,
    changed_height,
    held_height,
    path_height,
    stopping_way,
    target_on_the_way,
)
from vfguide.mavlink.adapter import AutopilotAdapter
from vfguide.mavlink.reports import CommandReport
from vfguide.state import GAP_S, LeaderState, Setpoint

BESIDE_M = 30.0
"""Distance from its path beyond which a leader is still on its way to it, m."""

ELSEWHERE_M = 5.0
"""Deviation from the planned height from which a leader starts a change at its own height, m."""

LONGEST_S, LONGEST_BACK_S = 60.0, 2.0
"""Longest silence, and clock setback, that a change bridges, s; else it goes on from where it was."""


class PlannedHeight:
    """Planned height of one leader, as one companion computes it."""

    def __init__(self, limits: ClimbLimits) -> None:
        self._limits = limits
        self._beside: BesidePath | None = None
        self._held: float | None = None
        """Height of the present hold, m above the origin."""
        self._last: HeightMotion | None = None
        self._changes = False
        self._as_planned = False
        """Whether the leader was steered, so that it flies the last planned height."""
        self.began_anew = False
        """Whether the last call began a change at the leader's own height, with its deviation in the plan."""

    @property
    def height(self) -> float | None:
        """Last planned height, m above the origin; None before the first."""
        return None if self._last is None else self._last.height

    @property
    def changes(self) -> bool:
        """Whether a change of height is under way, or waits."""
        return self._changes

    def hold(self, motion: LeaderState, *, ahead_s: float, late: bool) -> HeightTarget:
        """Return the height planned on the circle of a hold, where the climb before has come to rest.

        Args:
            motion: motion of the leader; its height counts if the beginning of the hold is unknown.
            ahead_s: from the motion's time to when a setpoint takes effect, s.
            late: whether the order to hold became known after it began.
        """
        self.began_anew = False
        if self._held is None:
            known = self._as_planned and not late
            if self._last is None or (math.isfinite(motion.height) and not known):
                self._begin_anew(motion)
            last = self._last or own_height(motion)
            self._held = last.height + stopping_way(last.climb_rate)
        self._beside, self._as_planned = None, True
        target = held_height(self._held)
        self._follow(target, motion.time_s)
        return self._on_the_way(target, ahead_s)

    def along(self, leader: BesidePath, *, steered: bool, late: bool) -> HeightTarget:
        """Return the height planned for a leader beside a point of its path.

        Args:
            leader: its place, and how far ahead to look.
            steered: whether the leader's companion steers it.
            late: whether the order to fly along this path became known after it began.
        """
        target, own = path_height(leader), own_height(leader.motion)
        self._held, self.began_anew = None, False
        before, self._beside = self._beside, leader
        if before is None or leader.path is not before.path:
            last = self._last
            self._changes = last is not None
            elsewhere = last is not None and abs(own.height - last.height) > ELSEWHERE_M
            if elsewhere or (late and math.isfinite(own.height)):
                self._begin_anew(leader.motion)
        self._as_planned = steered
        if not steered and math.isfinite(own.height):
            # The pilot determines its height, from which the plan goes on.
            self._last = own
            return carried_on(own, leader.ahead_s) if self._changes else target
        if self._last is None or not self._changes:
            self._last = HeightMotion(
                time_s=own.time_s, height=target.height, climb_rate=target.climb_rate
            )
            return target
        self._follow(target, own.time_s)
        if abs(leader.point.cross_track_error) > BESIDE_M:
            self._changes = True
        return self._on_the_way(target, leader.ahead_s)

    def _begin_anew(self, motion: LeaderState) -> None:
        """Begin a change at the leader's own height."""
        self._last, self._changes, self.began_anew = own_height(motion), True, True

    def _follow(self, target: HeightTarget, time_s: float) -> None:
        """Plan up to a time (s) on the way to a target; a change ends on reaching it."""
        last = self._last
        if last is None:
            return
        if not -LONGEST_BACK_S <= time_s - last.time_s <= LONGEST_S:
            last = replace(last, time_s=time_s)
        self._last = changed_height(last, target, time_s, self._limits)
        self._changes = not self._last.is_at(target)

    def _on_the_way(self, target: HeightTarget, ahead_s: float) -> HeightTarget:
        """Return the height to fly now and `ahead_s` seconds ahead."""
        if self._last is None:
            return target
        return target_on_the_way(self._last, target, ahead_s, self._limits)


def own_height(motion: LeaderState) -> HeightMotion:
    """Return a leader's actual height and climb rate."""
    return HeightMotion(time_s=motion.time_s, height=motion.height, climb_rate=motion.climb_rate)


def carried_on(motion: HeightMotion, ahead_s: float) -> HeightTarget:
    """Return a height extrapolated at its climb rate, now and `ahead_s` seconds ahead."""
    ahead = motion.height + motion.climb_rate * ahead_s
    return HeightTarget(height=motion.height, climb_rate=motion.climb_rate, ahead=ahead)


MEMORY_S = 3.0
"""Memory of the missing acceleration, s: delays of the speed hold are over by then."""

LEAST_MISSING = 0.3
"""Missing acceleration without effect, m/s²: speed holds that are not quite as declared miss as much."""

GAIN = 3.0
"""Factor on the climb rate that the missing acceleration costs."""

LEAST_CLIMB = 0.3
"""Climb or descent rate below which the energy is negligible, m/s."""

CATCH_UP_SHARE = 0.25
"""Share of the vehicle's limit at which height that was given up is regained."""

MOST_M = 100.0
"""Greatest height given up, m."""

TRIES = 4
"""Heartbeats answered with the height, as long as it is not accepted."""


class HeightKeeper:
    """Trade of one vehicle's height for speed, where its energy is not enough for both."""

    def __init__(self, plan: FlightPlan) -> None:
        self._plan = plan
        self._missing = 0.0
        self._given_up = 0.0
        self._airspeed: float | None = None

    @property
    def given_up(self) -> float:
        """Height given up for speed now, m; negative in a descent."""
        return self._given_up

    def delay_s(self, navigated: NavigatedState) -> float:
        """Return the delay from a report to the flight of the height that it leads to, s."""
        return self._plan.airframe.height_delay + 0.5 * navigated.period

    def step(
        self,
        navigated: NavigatedState,
        target: HeightTarget,
        setpoint: Setpoint | None,
        *,
        steered: bool,
    ) -> float:
        """Return the height to command now, m above the mission's origin; learn only while steered."""
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
            # Wait for a target that comes back to the vehicle: below a descending one nothing is safe.
            up = max(up, -target.climb_rate * period)
            down = max(down, target.climb_rate * period)
            self._given_up -= min(max(self._given_up, -down), up)
        self._given_up = min(max(self._given_up, -MOST_M), MOST_M)
        return target.ahead - self._given_up - given * airframe.height_delay

    def _climb_given_up(self, climb_rate: float) -> float:
        """Return the part of a wanted climb rate (m/s) that speed needs, at most all of it."""
        per_acceleration = GAIN * (self._airspeed or 0.0) / GRAVITY
        if climb_rate > LEAST_CLIMB and self._missing > LEAST_MISSING:
            return min(per_acceleration * (self._missing - LEAST_MISSING), climb_rate)
        if climb_rate < -LEAST_CLIMB and self._missing < -LEAST_MISSING:
            return max(per_acceleration * (self._missing + LEAST_MISSING), climb_rate)
        return 0.0


class LoiterHeight:
    """Height of one vehicle that is ordered to loiter: each has its own, since no companion steers there."""

    def __init__(self, plan: FlightPlan, adapter: AutopilotAdapter) -> None:
        self._plan = plan
        self._adapter = adapter
        self._number: int | None = None
        self._tries = 0
        self._altitude = math.nan

    def due(
        self, *, up: float, order: int | None, returned: bool, engaged: bool, altitude_amsl: float
    ) -> list[MAVLink_message]:
        """Return the command that answers the heartbeat just heard.

        Args:
            up: final height of the slot above the leader, m.
            order: number of the order to loiter; None while in the formation.
            returned: whether the heartbeat is recent and shows the loiter that this companion commanded.
            engaged: whether it shows a mode in which the companion steers.
            altitude_amsl: altitude of the vehicle, m.
        """
        if engaged:
            # Only then is the vehicle back in its slot; a second abort finds it at its loiter.
            self._altitude = math.nan
        if order is None or not returned:
            return []
        if order != self._number:
            self._number, self._tries = order, 0
        if not math.isfinite(self._altitude):
            self._altitude = self._own_altitude(altitude_amsl - up)
        if self._tries >= TRIES or not math.isfinite(self._altitude):
            return []
        self._tries += 1
        return self._adapter.loiter_at(self._altitude)

    def answered(self, report: CommandReport) -> None:
        """Take an answer of the autopilot; accepting the height ends the commands."""
        accepted = report.result == mavlink.MAV_RESULT_ACCEPTED
        if report.command == mavlink.MAV_CMD_DO_CHANGE_ALTITUDE and accepted:
            self._tries = TRIES

    def _own_altitude(self, leader: float) -> float:
        """Return the loiter altitude for a leader's altitude, m, such that all fit below the fence."""
        plan = self._plan
        level = plan.altitude_amsl - plan.up
        lowest = level + min(plan.lowest - plan.height, 0.0)
        highest = level + plan.loiter_room
        return min(max(leader, lowest), highest) + plan.loiter_up
