"""A follower's part: hold the slot, keep clear of the others, and tell them where one is."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from vfguide.angles import wrap_angle
from vfguide.companion.foresight import Law
from vfguide.companion.hearing import Hearing
from vfguide.companion.lookout import standpoint_of
from vfguide.companion.motion_report import GAP_S, MotionReport
from vfguide.companion.own_vehicle import Fix
from vfguide.companion.plan import FlightPlan, FollowerTask, course_settings, speed_settings
from vfguide.companion.role import RoleStep
from vfguide.companion.shared_clock import SharedClock
from vfguide.companion.supervisor import Mode
from vfguide.companion.traffic import Traffic, kept_distance, obstacle_of
from vfguide.guidance.breakaway import breakaway_course
from vfguide.guidance.controller import FormationController, formation_controller
from vfguide.guidance.course_law import sliding_course_rate
from vfguide.guidance.formation import predict_leader, slot_motion
from vfguide.guidance.separation import Obstacle, carried_on
from vfguide.guidance.setpoint import cruise_setpoint
from vfguide.guidance.virtual_leader import carry_along_path
from vfguide.state import LeaderState, Setpoint, VehicleState

CARRY_S = 0.25
"""Longest step in which a silent leader is carried on."""

MOST_STEPS = 240
"""A minute of them: after a longer gap in telemetry they are longer."""

TELL_S = 0.2
"""Between states for the other followers: they move little relative to each other in that time."""

TELL_IN_SLOT_S = 0.4
"""The same from a slot, where everybody knows how one flies on. One state may get lost before the others
take the silence for that of somebody without a companion."""

IN_SLOT_M = 2.0
"""From the slot: nearer a follower is in it."""


class FollowerRole:
    """Holds a slot."""

    def __init__(self, plan: FlightPlan, task: FollowerTask, clock: SharedClock) -> None:
        """Make a follower that has heard nothing yet.

        Args:
            plan: its part of the mission.
            task: its slot.
            clock: that the formation shares.
        """
        self._plan = plan
        self._task = task
        self._clock = clock
        self._leader = Hearing(plan.frame, clock)
        self._traffic = Traffic(task.spacing, plan.frame, clock, plan.settings.field)
        self._report = MotionReport(plan)
        self._told_time = -math.inf
        self._distance = math.inf
        self._avoiding = False
        self._controller = formation_controller(plan.settings, task.slot, plan.airframe)
        # One for each of the two delays with which an autopilot answers, if it does.
        self._late_controllers = tuple(
            formation_controller(settings, task.slot, plan.airframe)
            for settings in (course_settings(plan), speed_settings(plan))
            if plan.airframe.lags
        )
        self._carried: LeaderState[float] | None = None
        self._breakaway_course: float | None = None

    @property
    def counters(self) -> Counter[str]:
        """States that were not used, by reason."""
        return self._leader.counters + self._traffic.counters

    @property
    def leader(self) -> LeaderState[float] | None:
        """Newest leader state, times on the follower's clock."""
        return self._leader.newest

    def receive(self, data: bytes, now: float) -> None:
        """Take a leader state if it is sound and newer than the one before."""
        if self._leader.take(data, now):
            self._carried = self._breakaway_course = None

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of another follower."""
        self._traffic.receive(vehicle, data, now)

    def leader_age(self, now: float) -> float:
        """Age of the newest leader state, s; infinite before the first."""
        return math.inf if self.leader is None else now - self.leader.time_s

    def step(self, fix: Fix, mode: Mode) -> RoleStep:
        """One step toward the slot, or away from the others once the formation breaks up."""
        told = self._tell(fix)
        leader = self._leader_at(fix)
        if leader is None:
            return RoleStep(setpoint=None, distance=math.inf, lyapunov=math.nan, publish=told)
        if not mode.steers or mode is Mode.BREAKAWAY:
            for controller in (self._controller, *self._late_controllers):
                controller.reset()
        obstacles = self._obstacles(fix, leader)
        guidance = self._controller.step(fix.state, leader, period=fix.period, obstacles=obstacles)
        setpoint = guidance.setpoint
        if fix.foresight is not None:
            course_law, speed_law = (
                self._law(controller, fix, leader, obstacles)
                for controller in self._late_controllers
            )
            setpoint = fix.foresight.setpoint(course_law, speed_law)
        error = guidance.error
        self._distance = math.hypot(error.along_track, error.cross_track)
        self._avoiding = bool(guidance.avoiding)
        breaks_away = mode is Mode.BREAKAWAY
        return RoleStep(
            setpoint=self._away(fix, leader) if breaks_away else setpoint,
            distance=self._distance,
            lyapunov=guidance.lyapunov,
            publish=told,
        )

    def _law(
        self,
        controller: FormationController,
        fix: Fix,
        leader: LeaderState[float],
        obstacles: Sequence[Obstacle[float]],
    ) -> Law:
        """What a controller asks for of the vehicle as it will be, among the others as they will be."""

        def law(ahead: VehicleState[float]) -> Setpoint[float]:
            after_s = ahead.time_s - fix.state.time_s
            moved = [carried_on(obstacle, after_s) for obstacle in obstacles]
            return controller.step(ahead, leader, period=fix.period, obstacles=moved).setpoint

        return law

    def _tell(self, fix: Fix) -> bytes | None:
        """The own state for the other followers, now and then."""
        motion = self._report.note(fix)
        now = fix.state.time_s
        time_s = self._clock.from_own(now)
        in_slot = self._distance < IN_SLOT_M and not self._avoiding
        interval = TELL_IN_SLOT_S if in_slot else TELL_S
        # Half a period early is nearer to the time than half a period late.
        due = now - self._told_time >= interval - 0.5 * fix.period
        if not (due and self._task.spacing and math.isfinite(time_s)):
            return None
        self._told_time = now
        return self._report.message(motion, fix, time_s)

    def _obstacles(self, fix: Fix, leader: LeaderState[float]) -> list[Obstacle[float]]:
        """Whoever may be in the way, now."""
        now = fix.state.time_s
        linked = self.leader_age(now) <= self._plan.patience.leader_s
        slot = self._task.slot
        keep = kept_distance(math.hypot(slot.forward, slot.right), self._distance)
        leading = predict_leader(leader, now)
        here = standpoint_of(
            fix.state,
            slot_motion(leading, slot),
            self._distance,
            aims_off=max(one.aims_off for one in (self._controller, *self._late_controllers)),
            avoiding=self._avoiding,
        )
        airframe = self._plan.airframe
        return self._traffic.obstacles(
            here,
            linked=linked,
            leading=[obstacle_of(leading, keep)],
            lead_s=max(
                airframe.course_dead_time + airframe.course_lag,
                airframe.speed_dead_time + airframe.speed_lag,
            ),
        )

    def _leader_at(self, fix: Fix) -> LeaderState[float] | None:
        """The leader as last heard; after a silence, as it would have flown on along its path."""
        heard = self.leader
        if heard is None or self.leader_age(fix.state.time_s) <= self._plan.patience.leader_s:
            return heard
        now = fix.state.time_s
        carried = self._carried
        if carried is None:
            carried = predict_leader(heard, min(now, heard.time_s + GAP_S))
        # One step, or many after a gap in telemetry.
        count = min(math.ceil((now - carried.time_s) / CARRY_S), MOST_STEPS)
        for left in range(count, 0, -1):
            time_s = carried.time_s + (now - carried.time_s) / left
            carried = carry_along_path(
                carried, replace(fix.state, time_s=time_s), self._task.leader
            )
        self._carried = carried
        return carried

    def _away(self, fix: Fix, leader: LeaderState[float]) -> Setpoint[float]:
        """Setpoint of the breakaway: a fixed course to the side of the slot."""
        if self._breakaway_course is None:
            self._breakaway_course = breakaway_course(leader.course, self._task.slot)
        plan = self._plan
        sliding = plan.settings.sliding
        course_rate = sliding_course_rate(
            wrap_angle(fix.state.course - self._breakaway_course),
            0.0,
            sliding.kappa,
            sliding.layer(fix.period),
        )
        return cruise_setpoint(
            fix.state,
            self._task.airspeed,
            course_rate,
            plan.airframe,
            wind_feedforward=plan.settings.wind_feedforward,
        )
