"""The two parts a vehicle can have in a formation: each turns a navigated state into a guidance step."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from vfguide.angles import wrap_angle
from vfguide.companion.own_vehicle import Fix, Place
from vfguide.companion.plan import FlightPlan, FollowerTask
from vfguide.companion.supervisor import Mode
from vfguide.frames import LocalFrame
from vfguide.guidance.breakaway import breakaway_course
from vfguide.guidance.course_law import sliding_course_rate
from vfguide.guidance.follower import follower_step
from vfguide.guidance.formation import predict_leader
from vfguide.guidance.leader import LeaderTask, leader_step
from vfguide.guidance.leader_motion import estimate_leader, leader_at_rest
from vfguide.guidance.setpoint import cruise_setpoint
from vfguide.guidance.virtual_leader import carry_along_path
from vfguide.link.codec import LeaderMessage, LinkDataError, decode, encode
from vfguide.state import LeaderState, Setpoint

FUTURE_S = 0.25
"""A leader state from farther in the future than this is not believed."""

PAST_S = 60.0
"""A leader state that is older than this when it arrives is not believed either."""

GAP_S = 1.0
"""After a silence longer than this the leader's rates start anew, or mean nothing any more."""

CARRY_S = 0.25
"""Longest step in which a silent leader is carried on."""

MOST_STEPS = 240
"""A minute of them: after a longer gap in telemetry they are longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoleStep:
    """What a part makes of one state."""

    setpoint: Setpoint[float] | None
    """None where there is nothing to steer by."""
    distance: float
    """m from path or slot; infinite while not known."""
    lyapunov: float
    """W, m²; NaN for the leader."""
    publish: bytes | None
    """Leader state for the link."""


class Role(Protocol):
    """A part in the formation."""

    counters: Counter[str]
    """What came over the link and was not used, by reason."""

    def step(self, fix: Fix, mode: Mode) -> RoleStep:
        """Guidance for a navigated report, in the supervisor's present mode."""

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes from the link."""

    def leader_age(self, now: float) -> float:
        """Seconds since the newest leader state was true."""


class LeaderRole:
    """Follows the path and tells the others."""

    def __init__(self, plan: FlightPlan, task: LeaderTask) -> None:
        self._plan = plan
        self._task = task
        self._motion: LeaderState[float] | None = None
        self._speed_estimate: float | None = None
        self._sequence = 0
        self.counters: Counter[str] = Counter()
        """Nothing: the leader listens to nobody."""

    def step(self, fix: Fix, mode: Mode) -> RoleStep:
        """One step along the path; the leader's own state goes out with it."""
        del mode
        plan, state, before = self._plan, fix.state, self._motion
        if before is None or not 0.0 < state.time_s - before.time_s <= GAP_S:
            self._motion = leader_at_rest(state)
        else:
            time_constant = plan.settings.rate_filter_s
            self._motion = estimate_leader(before, state, plan.airframe, time_constant)
        guidance = leader_step(
            state,
            self._task,
            plan.settings,
            plan.airframe,
            period=fix.period,
            speed_estimate=self._speed_estimate,
        )
        self._speed_estimate = guidance.speed_estimate
        return RoleStep(
            setpoint=guidance.setpoint,
            distance=abs(guidance.cross_track_error),
            lyapunov=math.nan,
            publish=self._message(self._motion, fix.place),
        )

    def receive(self, data: bytes, now: float) -> None:
        """The leader listens to nobody."""
        del data, now

    def leader_age(self, now: float) -> float:
        """The leader knows itself."""
        del now
        return 0.0

    def _message(self, motion: LeaderState[float], place: Place) -> bytes:
        self._sequence = (self._sequence + 1) % 2**32
        return encode(
            LeaderMessage(
                sequence=self._sequence,
                time_s=motion.time_s,
                latitude_deg=place.latitude_deg,
                longitude_deg=place.longitude_deg,
                altitude_amsl=place.altitude_amsl,
                course=motion.course,
                ground_speed=motion.ground_speed,
                acceleration=motion.acceleration,
                turn_rate=motion.turn_rate,
                turn_acceleration=motion.turn_acceleration,
            )
        )


class FollowerRole:
    """Holds a slot."""

    def __init__(
        self, plan: FlightPlan, task: FollowerTask, to_own_time: Callable[[float], float]
    ) -> None:
        """Make a follower that has heard nothing yet.

        Args:
            plan: its part of the mission.
            task: its slot.
            to_own_time: from the leader's clock to the follower's, s.
        """
        self._plan = plan
        self._task = task
        self._to_own_time = to_own_time
        self.counters: Counter[str] = Counter()
        """Leader states that were not used, by reason."""
        self.leader: LeaderState[float] | None = None
        """Newest leader state, times on the follower's clock."""
        self._carried: LeaderState[float] | None = None
        self._breakaway_course: float | None = None

    def receive(self, data: bytes, now: float) -> None:
        """Take a leader state if it is sound and newer than the one before."""
        try:
            message = decode(data)
        except LinkDataError:
            self.counters["malformed"] += 1
            return
        time_s = self._to_own_time(message.time_s)
        if time_s > now + FUTURE_S:
            self.counters["from the future"] += 1
        elif not time_s >= now - PAST_S:
            self.counters["too old"] += 1
        elif self.leader is not None and time_s <= self.leader.time_s:
            self.counters["not newer"] += 1
        else:
            self.leader = leader_state(message, time_s, self._plan.frame)
            self._carried = self._breakaway_course = None

    def leader_age(self, now: float) -> float:
        """Age of the newest leader state, s; infinite before the first."""
        return math.inf if self.leader is None else now - self.leader.time_s

    def step(self, fix: Fix, mode: Mode) -> RoleStep:
        """One step toward the slot, or away from the others once the formation breaks up."""
        leader = self._leader_at(fix)
        if leader is None:
            return RoleStep(setpoint=None, distance=math.inf, lyapunov=math.nan, publish=None)
        plan = self._plan
        guidance = follower_step(
            fix.state, leader, self._task.slot, plan.settings, plan.airframe, period=fix.period
        )
        error = guidance.error
        breaks_away = mode is Mode.BREAKAWAY
        return RoleStep(
            setpoint=self._away(fix, leader) if breaks_away else guidance.setpoint,
            distance=math.hypot(error.along_track, error.cross_track),
            lyapunov=guidance.lyapunov,
            publish=None,
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


def leader_state(message: LeaderMessage, time_s: float, frame: LocalFrame) -> LeaderState[float]:
    """A leader state from the link, in the local frame and at the follower's own time."""
    north, east = frame.to_local(message.latitude_deg, message.longitude_deg)
    return LeaderState(
        time_s=time_s,
        north=north,
        east=east,
        course=message.course,
        ground_speed=message.ground_speed,
        acceleration=message.acceleration,
        turn_rate=message.turn_rate,
        turn_acceleration=message.turn_acceleration,
    )


def role_of(plan: FlightPlan, to_own_time: Callable[[float], float]) -> LeaderRole | FollowerRole:
    """The part that a plan asks for; times of the leader's clock by way of `to_own_time`."""
    task = plan.task
    if isinstance(task, LeaderTask):
        return LeaderRole(plan, task)
    return FollowerRole(plan, task, to_own_time)
