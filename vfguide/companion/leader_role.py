"""The leader's part: follow the path, and tell the others."""

import math
from collections import Counter

from vfguide.companion.motion_report import MotionReport
from vfguide.companion.own_vehicle import Fix
from vfguide.companion.plan import FlightPlan, course_settings
from vfguide.companion.role import RoleStep
from vfguide.companion.supervisor import Mode
from vfguide.guidance.leader import LeaderGuidance, LeaderTask, leader_step
from vfguide.guidance.settings import GuidanceSettings
from vfguide.state import VehicleState


class LeaderRole:
    """Follows the path and tells the others."""

    def __init__(self, plan: FlightPlan, task: LeaderTask) -> None:
        self._plan = plan
        self._task = task
        self._report = MotionReport(plan)
        self._speed_estimate: float | None = None
        self.counters: Counter[str] = Counter()
        """Nothing: the leader listens to nobody."""

    def step(self, fix: Fix, mode: Mode) -> RoleStep:
        """One step along the path; the leader's own state goes out with it."""
        del mode
        guidance = self._guidance(fix.state, self._plan.settings, fix.period)
        setpoint = guidance.setpoint
        if fix.foresight is not None:
            settings = course_settings(self._plan)
            setpoint = fix.foresight.course_setpoint(
                lambda ahead: self._guidance(ahead, settings, fix.period).setpoint
            )
        self._speed_estimate = guidance.speed_estimate
        motion = self._report.note(fix)
        return RoleStep(
            setpoint=setpoint,
            distance=abs(guidance.cross_track_error),
            lyapunov=math.nan,
            publish=self._report.message(motion, fix, fix.state.time_s),
        )

    def _guidance(
        self, state: VehicleState[float], settings: GuidanceSettings, period: float
    ) -> LeaderGuidance[float]:
        """One step of the law, from a state now or ahead."""
        return leader_step(
            state,
            self._task,
            settings,
            self._plan.airframe,
            period=period,
            speed_estimate=self._speed_estimate,
        )

    def receive(self, data: bytes, now: float) -> None:
        """The leader listens to nobody."""
        del data, now

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """The leader has the right of way: the others keep clear of it."""
        del vehicle, data, now

    def leader_age(self, now: float) -> float:
        """The leader knows itself."""
        del now
        return 0.0
