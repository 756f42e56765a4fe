"""Role of the leader: follow the path, publish its state, keep clear of stray vehicles."""

import cmath
import math
from collections import Counter
from functools import partial
from typing import Any

from msgspec.structs import replace

from vfguide.companion.alerts import Alerts
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.avoidance import Intent, KeepClear
from vfguide.companion.height_keeper import HeightKeeper, PlannedHeight
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan, course_settings
from vfguide.companion.role import Role, RoleStep, StatePublisher
from vfguide.companion.state_receiver import LeaderStories
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SharedClock
from vfguide.companion.traffic import Traffic
from vfguide.guidance.airframe import ground_speed_on_course
from vfguide.guidance.height import BesidePath, HeightTarget
from vfguide.guidance.path import PathPoint, desired_course
from vfguide.guidance.separation import HORIZON_S, WantedMotion
from vfguide.laws.leader import FIRST, LeaderGuidance, LeaderLaw, LeaderTask, leader_step
from vfguide.mavlink.reports import TrafficReport
from vfguide.state import LeaderFix, LeaderState, VehicleState

ASTRAY_S = 1.0
"""Weight of a velocity error in how far the leader is astray, m per m/s."""


class LeaderRole(Role):
    """Leader that follows the path and publishes its state."""

    def __init__(
        self,
        plan: FlightPlan,
        task: LeaderTask,
        clock: SharedClock,
        arrangements: Arrangements,
        report: StatePublisher | None = None,
        *,
        alerts: Alerts | None = None,
    ) -> None:
        """Begin with no follower heard; a `report` in use by another role may be shared."""
        self._plan = plan
        self._mission_task = self._task = task
        self._arrangements = arrangements
        self._report = report or StatePublisher(plan)
        self._law = leader_law(plan, task)
        self._memory: Any = FIRST
        self._traffic = Traffic(plan.others, plan.frame, clock, alerts)
        self._keep_clear = KeepClear(plan, self._traffic, alerts)
        self._stories = LeaderStories(alerts, leads=True)
        self._height = HeightKeeper(plan)
        self._planned = PlannedHeight(plan.climb_limits)

    def retune(self, plan: FlightPlan) -> None:
        """Use another response of the same vehicle."""
        self._plan = plan
        self._law = leader_law(plan, self._mission_task)
        self._keep_clear.retune(plan)

    @property
    def counters(self) -> Counter[str]:
        """States of followers that were not used, by reason."""
        return self._traffic.counters + self._keep_clear.aircraft.counters

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """Perform a step along the path, and publish the own state."""
        self._arrangements.joining_m = 0.0
        task = self._ordered_task(navigated.state.time_s)
        if navigated.moved or task.path is not self._task.path:
            self._memory = FIRST
        self._task = task
        self._traffic.satellite_m = navigated.satellite_m
        self._traffic.arrange(self._arrangements.flight.others(navigated.state.time_s))
        self._stories.most_m = self._arrangements.flight.most_m(navigated.state.time_s)
        guidance = self._guidance(navigated.state, self._law, navigated.period)
        setpoint = guidance.setpoint
        if navigated.delay_compensator is not None:
            setpoint = navigated.delay_compensator.course_setpoint(
                lambda ahead: self._guidance(ahead, self._law, navigated.period).setpoint
            )
        self._memory = guidance.memory
        self._arrangements.watch_route(task.path, guidance.point, steered=mode.steers)
        self._arrangements.leader = motion = self._report.note(navigated)
        state, altitude = navigated.state, navigated.place.altitude_amsl
        if self._report.term > 0:
            # This is the altitude as published: predicted while it is doubted.
            altitude = self._plan.frame.altitude_m + state.height
        place = LeaderFix(state.time_s, state.north, state.east, altitude)
        self._stories.hear_leader(place, self._report.term)
        distance = abs(guidance.cross_track_error)
        planned = partial(self._planned_height, guidance.point, motion, steered=mode.steers)
        target = planned(self._height.delay_s(navigated))
        self._arrangements.leader_height = lambda ahead_s: planned(ahead_s).ahead
        avoidance = self._keep_clear.step(
            navigated,
            motion.turn_rate,
            lambda: self._intent(navigated.state, distance, target),
            steered=mode.steers,
        )
        setpoint = avoidance.setpoint or setpoint
        return RoleStep(
            setpoint=setpoint,
            height=self._height.step(navigated, target, setpoint, steered=mode.steers),
            distance=distance,
            lyapunov=math.nan,
            publish=self._report.message(
                motion,
                navigated,
                navigated.state.time_s,
                steered=mode.steers,
                arrangement=self._arrangements.number,
                course_setpoint=setpoint.course,
                height_sense=self._keep_clear.height_sense,
            ),
            keeps_clear=avoidance.setpoint is not None,
            climb_m=avoidance.climb_m,
            cross_track=-guidance.cross_track_error,
            motion=motion,
        )

    def _planned_height(
        self, point: PathPoint[float], motion: LeaderState, ahead_s: float, *, steered: bool
    ) -> HeightTarget:
        """Return the height target `ahead_s` from now along the path, or that of a hold."""
        flight = self._arrangements.flight
        late = flight.is_late(motion.time_s)
        if flight.circle is not None:
            return self._planned.hold(motion, ahead_s=ahead_s, late=late)
        beside = BesidePath(
            path=self._task.path,
            point=point,
            motion=motion,
            flying=self._task.height,
            ahead_s=ahead_s,
        )
        return self._planned.along(beside, steered=steered, late=late)

    def _ordered_task(self, now: float) -> LeaderTask:
        """Return the mission's task with the ordered slots and path, or on the circle of a hold."""
        if self._arrangements.flight.flown is None:
            return self._mission_task
        task, circle, route = (
            self._mission_task,
            self._arrangements.flight.circle,
            self._arrangements.flight.route,
        )
        if route is not None:
            task = replace(
                task,
                path=route.path,
                path_gains=route.gains,
                least_radius=0.0 if circle is not None else route.least_radius,
            )
        slots = [self._arrangements.flight.slot(name, now) for name in self._plan.neighbours]
        return replace(
            task,
            path=task.path if circle is None else circle,
            followers=tuple(
                replace(one, slot=slot)
                for slot, one in zip(slots, task.followers, strict=True)
                if slot is not None
            ),
        )

    def _intent(self, state: VehicleState, distance: float, height: HeightTarget) -> Intent:
        """Return the intent to fly along the path; there the steered followers give way to the leader."""
        wanted = self._wanted(state)
        velocity = cmath.rect(state.ground_speed, state.course)
        return Intent(
            wanted=wanted,
            leader=None,
            astray=distance + ASTRAY_S * abs(velocity - wanted.velocity),
            height=height,
        )

    def _wanted(self, state: VehicleState) -> WantedMotion:
        """Return the motion along the vector field around the path, turning with the path."""
        point = self._task.path.nearest_in_space(
            state.north, state.east, state.course, state.height - self._task.height
        )
        gains = self._task.path_gains
        course = desired_course(point, gains.gain, gains.approach_angle)
        speed = ground_speed_on_course(
            self._task.airspeed, course, state.wind_north, state.wind_east
        )
        velocity = cmath.rect(speed, course)
        return WantedMotion(
            velocity=velocity,
            base_velocity=velocity,
            turn_rate=point.curvature * speed,
            settle_s=HORIZON_S,
        )

    def _guidance(self, state: VehicleState, law: LeaderLaw, period: float) -> LeaderGuidance:
        return leader_step(state, law, self._task, period=period, memory=self._memory)

    def receive(self, data: bytes, now: float) -> None:
        """Ignore a leader's state: the leader follows no vehicle."""
        del data, now

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Process a state of a follower."""
        state = self._traffic.receive(vehicle, data, now)
        self._arrangements.hear(vehicle, state, now)
        if state is not None:
            self._stories.hear_follower(vehicle, state, now)

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Process the own autopilot's report of an aircraft outside the formation."""
        self._keep_clear.aircraft.take(report, now)

    def lose_link(self, now: float) -> None:
        """Note that the link is down: vehicles silent since then may fly on as before."""
        self._traffic.lose_link(now)

    def to_leader(self, now: float) -> bytes:
        """Return no data: the leader follows no vehicle."""
        del now
        return b""

    def leader_age(self, now: float) -> float:
        """Return 0 s: the leader knows itself."""
        del now
        return 0.0


def leader_law(plan: FlightPlan, task: LeaderTask) -> LeaderLaw:
    """Return the law of a task within the limits of the vehicle."""
    law: type[LeaderLaw] = task.law
    return law(task.gains, course_settings(plan), plan.airframe)
