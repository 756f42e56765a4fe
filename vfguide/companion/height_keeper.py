"""What height to ask of one vehicle's autopilot: as planned, in guided flight, and once it is handed back.

**Planned** is how high the leader flies: along its path, in a hold, and from one path's height to another's.
The leader and each of its followers work this out by themselves, from the leader's place; so they climb
together. A change begins when the leader goes over to another path, or from a hold back to its path, with
the height and the climb rate that were planned until then; from the leader's own where that is elsewhere,
and for a companion that learns of the order late, as one that was started anew. It is over once the planned
height has come to the path's and the leader is beside the path: on its way there the point of the path that
is nearest to it may jump from one leg to another. While the leader is not steered a change waits at the
leader's own height. A hold ends a climb evenly, and is as high as that leads.

**In guided flight** what is asked for is the wanted one, as far as speed leaves energy for it. Throttle
and height share one energy. An aircraft at full throttle that climbs cannot fly faster as well, and one
that glides down at idle cannot fly slower. Speed keeps the slot and with it the distances, so height
gives way: by the climb rate V a / g that sets the missing acceleration a free.

**Handed back**, each loiters at a height of its own, since the circles may cross. An autopilot loiters at the
height in which it begins to. Once its heartbeat shows that it was handed back by an order that calls
everything off, or at the end of the route, it is told another one: above the leader by so much for each
rank. That is asked of it a few times and no more. Nothing depends on it; who is in any other mode, by its
pilot's hand or its own, is told nothing.
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
"""A leader that is further away from its path is still on its way to it."""

ELSEWHERE_M = 5.0
"""A leader that is so much higher or lower than it is planned to be changes its height from there."""

LONGEST_S, LONGEST_BACK_S = 60.0, 2.0
"""After a longer silence, or by another clock, a change goes on from where it was."""


class PlannedHeight:
    """Of one leader, as one companion works it out."""

    def __init__(self, limits: ClimbLimits) -> None:
        """Make one for a leader whose path is not known yet.

        Args:
            limits: of the formation.
        """
        self._limits = limits
        self._beside: BesidePath | None = None
        self._held: float | None = None
        """Height of the hold that is flown, m above the origin."""
        self._last: HeightMotion | None = None
        self._changes = False
        self._as_planned = False
        """Whether it was steered, so that it flies what was planned last."""
        self.began_anew = False
        """Whether what was asked for last began a change at the leader's own height: whatever it flew beside
        the plan before is in the plan now."""

    @property
    def height(self) -> float | None:
        """As it was planned last, m above the origin; None before the first time."""
        return None if self._last is None else self._last.height

    @property
    def changes(self) -> bool:
        """Whether it goes over to another height, or waits to."""
        return self._changes

    def hold(self, motion: LeaderState, *, ahead_s: float, late: bool) -> HeightTarget:
        """The height planned on the circle of a hold: where the climb before has come to rest.

        Args:
            motion: of the leader, whose height counts for who does not know where the hold began.
            ahead_s: from the motion's time to when a setpoint takes effect, s.
            late: whether the order to hold is learned of later than it began.
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
        """The height planned for a leader beside a point of its path.

        Args:
            leader: where it is, and how far ahead is looked.
            steered: whether the leader's companion steers it.
            late: whether the order by which it flies along this path is learned of later than it began.
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
            # It flies as its pilot wants, and goes on from there.
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
        """Change the height from the leader's own on."""
        self._last, self._changes, self.began_anew = own_height(motion), True, True

    def _follow(self, target: HeightTarget, time_s: float) -> None:
        """Plan on to a time (s) on the way to a target; a change ends where it has come there."""
        last = self._last
        if last is None:
            return
        if not -LONGEST_BACK_S <= time_s - last.time_s <= LONGEST_S:
            last = replace(last, time_s=time_s)
        self._last = changed_height(last, target, time_s, self._limits)
        self._changes = not self._last.is_at(target)

    def _on_the_way(self, target: HeightTarget, ahead_s: float) -> HeightTarget:
        """What is to be flown now and so many seconds (s) ahead."""
        if self._last is None:
            return target
        return target_on_the_way(self._last, target, ahead_s, self._limits)


def own_height(motion: LeaderState) -> HeightMotion:
    """As a leader flies."""
    return HeightMotion(time_s=motion.time_s, height=motion.height, climb_rate=motion.climb_rate)


def carried_on(motion: HeightMotion, ahead_s: float) -> HeightTarget:
    """A height that changes on as it does, now and so many seconds (s) ahead."""
    ahead = motion.height + motion.climb_rate * ahead_s
    return HeightTarget(height=motion.height, climb_rate=motion.climb_rate, ahead=ahead)


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

TRIES = 4
"""Heartbeats that are answered with the height, as long as it is not accepted."""


class HeightKeeper:
    """Gives up height of one vehicle for its speed, where it has not the energy for both."""

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
        setpoint: Setpoint | None,
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


class LoiterHeight:
    """Of one vehicle that is ordered to loiter: each at a height of its own, as nobody steers them there."""

    def __init__(self, plan: FlightPlan, adapter: AutopilotAdapter) -> None:
        """Make one that has told nothing yet."""
        self._plan = plan
        self._adapter = adapter
        self._number: int | None = None
        self._tries = 0
        self._altitude = math.nan

    def due(
        self,
        *,
        up: float,
        order: int | None,
        returned: bool,
        engaged: bool,
        altitude_amsl: float,
    ) -> list[MAVLink_message]:
        """What a heartbeat that has just been heard is answered with.

        Args:
            up: height of its slot above the leader at the end, m.
            order: number of the order by which it loiters; None while it is in the formation.
            returned: whether the heartbeat is young, and shows the loiter that this companion has asked for.
            engaged: whether it shows a mode in which the companion steers.
            altitude_amsl: of the vehicle, m.
        """
        if engaged:
            # Only then is the vehicle back in its slot: a further abort finds it where it loiters.
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
        """Take an answer of the autopilot."""
        accepted = report.result == mavlink.MAV_RESULT_ACCEPTED
        if report.command == mavlink.MAV_CMD_DO_CHANGE_ALTITUDE and accepted:
            self._tries = TRIES

    def _own_altitude(self, leader: float) -> float:
        """Where to loiter once the leader flies at an altitude, m: all of the formation within the fence."""
        plan = self._plan
        level = plan.altitude_amsl - plan.up
        lowest = level + min(plan.lowest - plan.height, 0.0)
        highest = level + plan.loiter_room
        return min(max(leader, lowest), highest) + plan.loiter_up
