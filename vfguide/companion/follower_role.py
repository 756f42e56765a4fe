"""Follower role: hold the slot, keep clear of the others, and publish the own state for them."""

import cmath
import math
from collections import Counter
from functools import partial

from vfguide.companion.alerts import Alerts
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.avoidance import Intent, KeepClear
from vfguide.companion.delay_compensator import Law
from vfguide.companion.followed_leader import FollowedLeader
from vfguide.companion.height_keeper import HeightKeeper
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan, FollowerTask, bandwidth_for, follower_law, late_laws
from vfguide.companion.role import Role, RoleStep, StatePublisher
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SharedClock
from vfguide.companion.traffic import Traffic
from vfguide.elementwise import wrap_angle
from vfguide.guidance.formation import (
    Slot,
    breakaway_course,
    extrapolate_by_rates,
    formation_error,
    slot_motion,
)
from vfguide.guidance.height import HeightTarget, held_height
from vfguide.guidance.separation import HORIZON_S, WantedMotion
from vfguide.guidance.sliding_laws import cruise_setpoint, sliding_course_rate
from vfguide.laws.base import SlotKeeper
from vfguide.mavlink.reports import TrafficReport
from vfguide.state import HeardState, LeaderState, Setpoint, VehicleState

PUBLISH_S = 0.2
"""Interval of states for the other followers, s: they move little relative to each other in that time."""

PUBLISH_IN_SLOT_S = 0.4
"""Interval of states from a slot in straight flight, s: an autopilot alone would fly straight on, too."""

STRAIGHT_RAD_S = 0.05
"""Own turn rate that still counts as straight flight, rad/s: 2 m in 2 s at 20 m/s."""

PUBLISH_FREE_S = 0.1
"""Interval of states while not under guidance, s: avoiding the vehicle is up to the others alone."""

LEAST_SETTLE_S = 1.0
GREATEST_SETTLE_S = 60.0
"""Bounds of the assumed time constant of reaching the slot, s."""

IN_SLOT_M = 2.0
"""Distance from the slot within which a follower is in it, m."""


class FollowerRole(Role):
    """Role of a vehicle that holds a slot."""

    def __init__(
        self,
        plan: FlightPlan,
        task: FollowerTask,
        clock: SharedClock,
        arrangements: Arrangements,
        report: StatePublisher | None = None,
        *,
        alerts: Alerts | None = None,
    ) -> None:
        self._arrangements = arrangements
        self._plan = plan
        self._task = task
        self._clock = clock
        self.followed = FollowedLeader(plan, task, clock, arrangements, alerts)
        """Knowledge of its leader."""
        self._traffic = Traffic(plan.others, plan.frame, clock, alerts)
        self._keep_clear = KeepClear(plan, self._traffic, alerts)
        self._report = report or StatePublisher(plan)
        self._published_time = -math.inf
        self._distance = math.inf
        self._avoiding = False
        self._law = follower_law(plan)
        self._keeper = SlotKeeper(self._law, task.slot, slot_at=self.slot_at)
        # One each for the delays of course and speed, if the autopilot has delays.
        self._late_keepers = tuple(
            SlotKeeper(law, task.slot, slot_at=self.slot_at) for law in late_laws(plan)
        )
        self._height = HeightKeeper(plan)
        self._height_wanted = held_height(plan.height)
        self._asked_height = plan.height
        self._breakaway_course: float | None = None

    def retune(self, plan: FlightPlan) -> None:
        """Go on with another response of the same vehicle; the laws keep their memory."""
        self._plan = plan
        self._law = follower_law(plan)
        self._keeper.retune(self._law)
        late = late_laws(plan)
        if len(late) == len(self._late_keepers):
            for keeper, law in zip(self._late_keepers, late, strict=True):
                keeper.retune(law)
        else:
            self._late_keepers = tuple(
                SlotKeeper(law, self._task.slot, slot_at=self.slot_at) for law in late
            )
        self._keep_clear.retune(plan)

    @property
    def counters(self) -> Counter[str]:
        """States that were not used, counted by reason."""
        aircraft = self._keep_clear.aircraft
        return self.followed.receiver.counters + self._traffic.counters + aircraft.counters

    @property
    def foreign_leader(self) -> HeardState | None:
        """Newest state of a leader without a companion, on the own clock; None for any other leader."""
        return self.followed.foreign

    def _height_target(self, navigated: NavigatedState, leader: LeaderState) -> HeightTarget:
        """Return the height of the slot, now and when a setpoint takes effect."""
        now, ahead_s = navigated.state.time_s, self._height.delay_s(navigated)
        target = self.followed.height(leader, now, ahead_s)
        (up, rate), (up_ahead, _) = self._slot_height(now), self._slot_height(now + ahead_s)
        shown_more = self._traffic.shown_more(self.followed.name)
        return HeightTarget(
            height=target.height + up + shown_more,
            climb_rate=target.climb_rate + rate,
            ahead=target.ahead + up_ahead + shown_more,
        )

    def _leader_height(self, leader: LeaderState, now: float, ahead_s: float) -> float:
        """Return the leader's height `ahead_s` seconds from now, m above the origin."""
        return self.followed.height(leader, now, ahead_s).ahead

    def _slot_height(self, time_s: float) -> tuple[float, float]:
        """Return (slot height above the leader in m, its rate in m/s) at a time of the own clock, s."""
        return self._arrangements.flight.height(self._plan.name, time_s) or (self._plan.up, 0.0)

    def receive(self, data: bytes, now: float) -> None:
        """Follow the leader by a sound and newer state, or datagram of a leader without a companion."""
        if self.note_leader(data, now):
            self.follow_leader()

    def follow_leader(self) -> None:
        """Fly by the newest state of the mission's leader."""
        self._breakaway_course = None
        self.followed.follow_leader()

    def note_leader(self, data: bytes, now: float) -> bool:
        """Take a state of the mission's leader like any vehicle's; return whether it is sound and newer."""
        newer = self.followed.note_leader(data, now)
        receiver = self.followed.receiver
        heard = receiver.newest
        elsewhere = None
        if heard is not None and not self.followed.is_left:
            elsewhere = self.followed.stories.elsewhere(heard, now)
        self._traffic.note(self.followed.name, receiver, elsewhere)
        return newer

    def receive_lead(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a leader state by which a deputy leads, and fly by it if it is sound and newer."""
        if self.followed.note_lead(vehicle, data, now):
            self.follow_lead()

    def follow_lead(self) -> None:
        """Fly by the newest leader state of a leading deputy."""
        self._breakaway_course = None
        self.followed.follow_lead()

    def take_lead(self) -> None:
        """Carry the leader on along its path from now on, for as long as it takes."""
        self._breakaway_course = None
        self.followed.take_lead()

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of another follower."""
        state = self._traffic.receive(vehicle, data, now)
        self._arrangements.hear(vehicle, state, now)
        if state is not None:
            self.followed.stories.hear_follower(vehicle, state, now)

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Take the own autopilot's report of an aircraft outside the formation."""
        self._keep_clear.aircraft.take(report, now)

    def unheard(self) -> list[str]:
        """Return the names of other followers never heard."""
        return self._traffic.unheard()

    def lose_link(self, now: float) -> None:
        """Note that nobody can be heard now: silent vehicles may fly on as before."""
        self._traffic.lose_link(now)

    def to_leader(self, now: float) -> bytes:
        """Return heartbeats and time requests for a leader without a companion."""
        return self.followed.to_say(now)

    def leader_age(self, now: float) -> float:
        """Return the age of the newest leader state, s; 0 for a leading deputy, infinite before the first."""
        return self.followed.age(now)

    def slot_at(self, time_s: float) -> Slot:
        """Return the ordered slot, or else the mission's, at a time of the own clock, s."""
        return self._arrangements.flight.slot(self._plan.name, time_s) or self._task.slot

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """Steer toward the slot, or away from the others once the formation breaks up."""
        motion = self._report.note(navigated)
        self.followed.note_own(navigated)
        self._traffic.satellite_m = navigated.satellite_m
        self._traffic.arrange(self._arrangements.flight.others(navigated.state.time_s))
        self.followed.stories.most_m = self._arrangements.flight.most_m(navigated.state.time_s)
        leader = self.followed.at(navigated)
        if leader is None:
            return RoleStep(
                setpoint=None,
                height=self._asked_height,
                distance=math.inf,
                lyapunov=math.nan,
                publish=self._own_state(navigated, motion, mode, math.nan),
            )
        self.followed.watch_route(leader)
        self._arrangements.leader = leader
        self._arrangements.leader_height = partial(
            self._leader_height, leader, navigated.state.time_s
        )
        breaks_away = mode is Mode.BREAKAWAY
        if navigated.moved or not mode.steers or breaks_away:
            for keeper in (self._keeper, *self._late_keepers):
                keeper.reset()
        guidance = self._keeper.step(
            navigated.state, leader, period=navigated.period, held=self._avoiding
        )
        setpoint = guidance.setpoint
        if navigated.delay_compensator is not None:
            course_law, speed_law = (
                self._late_law(keeper, navigated, leader) for keeper in self._late_keepers
            )
            setpoint = navigated.delay_compensator.setpoint(course_law, speed_law)
        error = guidance.error
        self._distance = math.hypot(error.along_track, error.cross_track)
        comes = mode in {Mode.WAITING, Mode.JOINING}
        self._arrangements.joining_m = self._distance if comes else 0.0
        if breaks_away:
            setpoint = self._away(navigated, leader)
        away = setpoint if breaks_away else None
        self._height_wanted = (
            held_height(self._asked_height)
            if breaks_away
            else self._height_target(navigated, leader)
        )
        avoidance = self._keep_clear.step(
            navigated,
            motion.turn_rate,
            lambda: self._intent(
                navigated, extrapolate_by_rates(leader, navigated.state.time_s), away
            ),
            steered=mode.steers,
        )
        self._avoiding = mode.steers and avoidance.setpoint is not None
        setpoint = avoidance.setpoint or setpoint
        if not breaks_away:
            self._asked_height = self._height.step(
                navigated, self._height_wanted, setpoint, steered=mode.steers
            )
        return RoleStep(
            setpoint=setpoint,
            height=self._asked_height,
            distance=self._distance,
            lyapunov=guidance.lyapunov,
            publish=self._own_state(navigated, motion, mode, setpoint.course),
            keeps_clear=avoidance.setpoint is not None,
            climb_m=avoidance.climb_m,
            along_track=error.along_track,
            cross_track=error.cross_track,
            up=math.nan if breaks_away else self._up(navigated),
            slot=self._arrangements.flight.point(self._plan.name, navigated.state.time_s),
        )

    def _up(self, navigated: NavigatedState) -> float:
        """Return the height of the slot above the vehicle, m."""
        return self._height_wanted.height - (navigated.altitude_amsl - self._plan.frame.altitude_m)

    def _late_law(self, keeper: SlotKeeper, navigated: NavigatedState, leader: LeaderState) -> Law:
        """Return a law to be applied to the vehicle's predicted state."""

        def law(ahead: VehicleState) -> Setpoint:
            return keeper.step(ahead, leader, period=navigated.period, held=self._avoiding).setpoint

        return law

    def _intent(
        self, navigated: NavigatedState, leader: LeaderState, away: Setpoint | None
    ) -> Intent:
        """Return the motion of this vehicle if it were alone with its leader."""
        return Intent(
            wanted=self._wanted(navigated, leader, away),
            leader=leader,
            astray=self._distance,
            height=self._height_wanted,
            gusts=self.followed.gusts,
            leaderless=self.followed.is_left,
        )

    def _wanted(
        self, navigated: NavigatedState, leader: LeaderState, away: Setpoint | None
    ) -> WantedMotion:
        """Return the motion that guidance wants: onto the slot, or straight away in a breakaway."""
        state = navigated.state
        if away is not None and self._breakaway_course is not None:
            velocity = cmath.rect(state.ground_speed, self._breakaway_course)
            return WantedMotion(
                velocity=velocity, base_velocity=velocity, turn_rate=0.0, settle_s=HORIZON_S
            )
        slot = slot_motion(leader, self.slot_at(state.time_s))
        error = formation_error(slot, state)
        course, speed = self._law.expected_motion(slot, error)
        velocity = cmath.rect(speed, course)
        base = cmath.rect(slot.speed, slot.course)
        settle_s = self._distance / max(abs(velocity - base), 1e-3)
        return WantedMotion(
            velocity=velocity,
            base_velocity=base,
            turn_rate=slot.turn_rate,
            settle_s=min(max(settle_s, LEAST_SETTLE_S), GREATEST_SETTLE_S),
        )

    def _own_state(
        self, navigated: NavigatedState, motion: LeaderState, mode: Mode, course_setpoint: float
    ) -> bytes | None:
        """Return the own state for the others at intervals, shortest while not steered; else None."""
        now = navigated.state.time_s
        time_s = self._clock.from_own(now)
        in_slot = self._distance < IN_SLOT_M and not self._avoiding
        straight = abs(motion.turn_rate) < STRAIGHT_RAD_S
        interval = PUBLISH_IN_SLOT_S if in_slot and straight else PUBLISH_S
        if not mode.steers:
            interval = PUBLISH_FREE_S
        # Within half a period of the due time, now is closer to it than the next report.
        due = now - self._published_time >= interval - 0.5 * navigated.period
        if not (due and math.isfinite(time_s)):
            return None
        self._published_time = now
        return self._report.message(
            motion,
            navigated,
            time_s,
            steered=mode.steers,
            arrangement=self._arrangements.number,
            course_setpoint=course_setpoint,
            height_sense=self._keep_clear.height_sense,
            leader=self.followed.place,
        )

    def _away(self, navigated: NavigatedState, leader: LeaderState) -> Setpoint:
        """Return the setpoint of the breakaway: a fixed course to the side of the slot."""
        if self._breakaway_course is None:
            self._breakaway_course = breakaway_course(
                leader.course, self.slot_at(navigated.state.time_s)
            )
        plan = self._plan
        sliding = plan.settings.sliding
        course_rate = sliding_course_rate(
            wrap_angle(navigated.state.course - self._breakaway_course),
            0.0,
            sliding.kappa,
            sliding.layer(navigated.period, bandwidth_for(plan).course),
        )
        return cruise_setpoint(
            navigated.state,
            self._task.airspeed,
            course_rate,
            plan.airframe,
            wind_feedforward=plan.settings.wind_feedforward,
        )
