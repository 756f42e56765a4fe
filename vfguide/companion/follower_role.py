"""A follower's part: hold the slot, keep clear of the others, and publish the own state for them."""

import cmath
import math
from collections import Counter
from dataclasses import replace

from vfguide.companion.arrangements import Arrangements
from vfguide.companion.avoidance import Intent, KeepClear
from vfguide.companion.delay_compensator import Law
from vfguide.companion.height_keeper import HeightKeeper
from vfguide.companion.leader_telemetry import LeaderTelemetry
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import (
    FlightPlan,
    FollowerTask,
    ForeignLeader,
    follower_law,
    late_laws,
)
from vfguide.companion.role import Role, RoleStep
from vfguide.companion.state_publisher import GAP_S, StatePublisher
from vfguide.companion.state_receiver import StateReceiver
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SharedClock
from vfguide.companion.traffic import Traffic
from vfguide.elementwise import low_pass, wrap_angle
from vfguide.guidance.formation import (
    Slot,
    breakaway_course,
    extrapolate_by_rates,
    formation_error,
    slot_motion,
)
from vfguide.guidance.height import (
    PLANNED_S,
    UNPLANNED_S,
    HeightDeviation,
    HeightTarget,
    followed_height,
    height_deviation,
    held_height,
    path_height,
)
from vfguide.guidance.intended_motion import (
    CALM_RAD,
    IntendedMotion,
    KnownLeader,
    extrapolate_along_path,
    intended_at_first,
    intended_motion,
    planned_motion,
)
from vfguide.guidance.leader_motion import carried_on
from vfguide.guidance.path import Path, PathPoint
from vfguide.guidance.predicted_tracks import HORIZON_S, WantedMotion
from vfguide.guidance.sliding_laws import cruise_setpoint, sliding_course_rate
from vfguide.laws.keeper import SlotKeeper
from vfguide.mavlink.reports import TrafficReport
from vfguide.state import HeardState, LeaderState, Setpoint, VehicleState

CARRY_S = 0.25
"""Longest step in which a silent leader is carried on."""

MOST_STEPS = 240
"""A minute of them: after a longer gap in telemetry they are longer."""

PUBLISH_S = 0.2
"""Between states for the other followers: they move little relative to each other in that time."""

PUBLISH_IN_SLOT_S = 0.4
"""The same from a slot of a formation that flies straight on: so would its autopilot without a companion."""

STRAIGHT_RAD_S = 0.05
"""Slower turns of the own course count as flying straight on: 2 m in 2 s at 20 m/s."""

PUBLISH_FREE_S = 0.1
"""The same of a vehicle that is not under guidance: the others have to look out for it alone."""

LEAST_SETTLE_S = 1.0
GREATEST_SETTLE_S = 60.0
"""Bounds of the time constant with which a follower is thought to reach its slot."""

HANDED_BACK_S = 5.0
"""Longer than it takes an autopilot to be handed back after the formation has broken up."""

WIND_S = 5.0
"""Memory of the mean wind."""

GUST_SHARE = 10.0
"""So much faster than the leader's course jitters aside, gusts carry one away whose companion has died."""

IN_SLOT_M = 2.0
"""From the slot: nearer a follower is in it."""


class FollowerRole(Role):
    """Holds a slot."""

    def __init__(
        self,
        plan: FlightPlan,
        task: FollowerTask,
        clock: SharedClock,
        arrangements: Arrangements,
        report: StatePublisher | None = None,
    ) -> None:
        """Make a follower that has heard nothing yet.

        Args:
            plan: its part of the mission.
            task: its slot.
            clock: that the formation shares.
            arrangements: what was ordered of the formation.
            report: says how the vehicle moves; a new one if absent.
        """
        self._arrangements = arrangements
        self._plan = plan
        self._task = task
        self._clock = clock
        # A leader that stays elsewhere may be at either place until all vehicles have been handed back.
        self._moved_s = plan.timeouts.prediction_s + plan.timeouts.breakaway_s + HANDED_BACK_S
        self._leader: StateReceiver | LeaderTelemetry = (
            LeaderTelemetry(
                task.leader, plan.frame, moved_s=self._moved_s, system_id=plan.system_id
            )
            if isinstance(task.leader, ForeignLeader)
            else StateReceiver(plan.frame, clock, moved_s=self._moved_s)
        )
        self._followed = self._leader
        self._deputy: str | None = None
        self.leads = False
        """Whether this vehicle stands in for a leader that is lost, and carries its motion on for all."""
        self._traffic = Traffic(plan.others, plan.frame, clock)
        self._keep_clear = KeepClear(plan, self._traffic)
        self._leader_name = next((one.name for one in plan.others if one.leads), "")
        self._report = report or StatePublisher(plan)
        self._published_time = -math.inf
        self._distance = math.inf
        self._avoiding = False
        self._law = follower_law(plan)
        self._keeper = SlotKeeper(self._law, task.slot, slot_at=self.slot_at)
        # One for each of the two delays with which an autopilot answers, if it does.
        self._late_keepers = tuple(
            SlotKeeper(law, task.slot, slot_at=self.slot_at) for law in late_laws(plan)
        )
        self._carried: LeaderState[float] | None = None
        self._intended: IntendedMotion | None = None
        self._intended_path: Path | None = None
        self._deviation: HeightDeviation | None = None
        self._height = HeightKeeper(plan)
        self._height_wanted = held_height(plan.height)
        self._asked_height = plan.height
        self._leader_height: float | None = None
        self._wind = (0.0, 0.0)
        self._breakaway_course: float | None = None

    @property
    def counters(self) -> Counter[str]:
        """States that were not used, by reason."""
        aircraft = self._keep_clear.aircraft
        return self._leader.counters + self._traffic.counters + aircraft.counters

    @property
    def foreign_leader(self) -> HeardState | None:
        """How a leader without a companion was heard to move last, on the own clock; None of any other."""
        return self._leader.newest if isinstance(self._leader, LeaderTelemetry) else None

    @property
    def leader(self) -> LeaderState[float] | None:
        """Newest leader state as slots are fixed to it, times on the follower's clock."""
        if isinstance(self._task.leader, ForeignLeader):
            return self._leader.newest
        return None if self._intended is None else self._intended.motion

    def _intend(self) -> None:
        """Find out how the leader means to fly, by what it was just heard to do."""
        heard, before, known = self._followed.newest, self._intended, self._known_leader()
        if heard is None:
            return
        if isinstance(known, ForeignLeader):
            self._note_height(heard, held_height(known.height), UNPLANNED_S)
            return
        measured, heard = heard, self._with_height(heard)
        planned = planned_motion(heard, known, self._wind)
        at_once = self._planned_height(heard, planned.point, 0.0)
        self._note_height(measured, at_once, PLANNED_S if heard.steered else UNPLANNED_S)
        passed_s = math.inf if before is None else heard.time_s - before.motion.time_s
        slot_frame = self._plan.settings.slot_frame
        follows_path = (
            slot_frame != "leader" and heard.steered and known.path is self._intended_path
        )
        self._intended_path = known.path
        if before is None or not follows_path or not 0.0 < passed_s <= GAP_S:
            self._intended = intended_at_first(heard, planned)
        else:
            as_planned = slot_frame == "plan"
            self._intended = intended_motion(before, heard, planned, as_planned=as_planned)

    def _with_height(self, heard: HeardState) -> HeardState:
        """A state of the leader; one whose altitude is doubted with the height that was known last.

        A path that climbs is searched by height, and a deputy that leads on says a height.
        """
        if math.isfinite(heard.height):
            return heard
        planned = self._task.leader.height if self._leader_height is None else self._leader_height
        off = 0.0 if self._deviation is None else self._deviation.height
        return replace(heard, height=planned + off)

    def _note_height(
        self, heard: LeaderState[float], planned: HeightTarget, memory_s: float
    ) -> None:
        """Find out by how much the leader flies above what is planned for it."""
        if self._task.follows_height:
            self._deviation = height_deviation(self._deviation, heard, planned, memory_s=memory_s)

    def _planned_height(
        self, leader: LeaderState[float], point: PathPoint[float], ahead_s: float
    ) -> HeightTarget:
        """What the mission says of the leader's height; on the circle of a hold, the one where it began."""
        known = self._routed_leader()
        if isinstance(known, ForeignLeader):
            return held_height(known.height)
        if self._arrangements.flight.circle is not None and self._leader_height is not None:
            return held_height(self._leader_height)
        found = path_height(known.path, point, leader, flying=known.height, ahead_s=ahead_s)
        self._leader_height = found.height
        return found

    def _height_target(self, navigated: NavigatedState, leader: LeaderState[float]) -> HeightTarget:
        """How high the slot is: now, and when a setpoint takes effect."""
        known, now = self._known_leader(), navigated.state.time_s
        ahead_s = self._height.delay_s(navigated)
        planned = held_height(known.height)
        if not isinstance(known, ForeignLeader):
            intended = None if self._carried is not None else self._intended
            point = known.point_beside(leader) if intended is None else intended.planned.point
            # As it was heard, gusts included: the leader looks ahead by that, too.
            motion = leader if intended is None else self._followed.newest or leader
            planned = self._planned_height(motion, point, now - motion.time_s + ahead_s)
        deviation = self._deviation or HeightDeviation(time_s=now)
        if now - deviation.time_s > self._plan.timeouts.leader_s:
            # Nothing is heard of how it goes on beside its plan.
            deviation = replace(deviation, climb_rate=0.0)
        target = followed_height(
            planned, deviation, flying=known.height, now_s=now, ahead_s=ahead_s
        )
        (up, rate), (up_ahead, _) = self._slot_height(now), self._slot_height(now + ahead_s)
        return HeightTarget(
            height=target.height + up,
            climb_rate=target.climb_rate + rate,
            ahead=target.ahead + up_ahead,
        )

    def _slot_height(self, time_s: float) -> tuple[float, float]:
        """(height of the slot above the leader in m, its rate in m/s) at a time of the own clock, s."""
        return self._arrangements.flight.height(self._plan.name, time_s) or (self._plan.up, 0.0)

    def receive(self, data: bytes, now: float) -> None:
        """Take a leader state, or a datagram of one without a companion, if it is sound and newer."""
        if self.note_leader(data, now):
            self.follow_leader()

    def follow_leader(self) -> None:
        """Fly by the mission's leader, as it was heard last."""
        self._follow(self._leader)

    def note_leader(self, data: bytes, now: float) -> bool:
        """Take a state of the mission's leader as one of any other vehicle; whether it is sound and newer."""
        newer = self._leader.take(data, now)
        if newer and not isinstance(self._leader, LeaderTelemetry):
            # One without a companion knows of no order.
            self._arrangements.hear(self._leader_name, self._leader.newest, now)
        self._traffic.note(self._leader_name, self._leader)
        return newer

    def receive_lead(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of the leader by which a deputy leads, and fly by it if it is sound and newer."""
        if self.note_lead(vehicle, data, now):
            self.follow_lead()

    def note_lead(self, vehicle: str, data: bytes, now: float) -> bool:
        """Take a state of the leader by which a deputy leads; whether it is sound and newer."""
        if vehicle != self._deputy:
            self._deputy = vehicle
            self._carried_on = StateReceiver(self._plan.frame, self._clock, moved_s=self._moved_s)
        return self._carried_on.take(data, now)

    def follow_lead(self) -> None:
        """Fly by the leader by which a deputy leads, as it was heard last."""
        self._follow(self._carried_on)

    def _follow(self, receiver: StateReceiver | LeaderTelemetry) -> None:
        """Fly by the newest state of a receiver."""
        self.leads, self._followed = False, receiver
        if receiver is self._leader:
            self._deputy = None
        self._carried = self._breakaway_course = None
        self._intend()

    def take_lead(self) -> None:
        """Carry the leader on along its path from now on, for as long as it takes."""
        self.leads, self._deputy, self._breakaway_course = True, None, None

    @property
    def carried(self) -> LeaderState[float] | None:
        """The leader as it is carried on while it is not heard; None while it is."""
        return self._carried

    def note_wind(self, navigated: NavigatedState) -> None:
        """Get to know the wind while another part is flown."""
        self._note_wind(navigated)

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of another follower."""
        state = self._traffic.receive(vehicle, data, now)
        self._arrangements.hear(vehicle, state, now)

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Take what the own autopilot reports of an aircraft that is not of the formation."""
        self._keep_clear.aircraft.take(report, now)

    def unheard(self) -> list[str]:
        """Names of other followers that were never heard."""
        return self._traffic.unheard()

    def lose_link(self, now: float) -> None:
        """Note that nobody can be heard now: who has been silent since then may fly on as before."""
        self._traffic.lose_link(now)

    def to_leader(self, now: float) -> bytes:
        """Heartbeats and questions for the time, where the leader has no companion."""
        return self._leader.say(now) if isinstance(self._leader, LeaderTelemetry) else b""

    def words(self) -> list[str]:
        """What the pilot should know of the states of leader and neighbours, and of keeping clear of them."""
        heard = [f"the leader {words}" for words in self._leader.words()] + self._traffic.words()
        return heard + self._keep_clear.words()

    def leader_age(self, now: float) -> float:
        """Age of the newest leader state, s; 0 for a deputy that leads, infinite before the first."""
        return 0.0 if self.leads else self._heard_age(now)

    def _heard_age(self, now: float) -> float:
        return math.inf if self.leader is None else now - self.leader.time_s

    def slot_at(self, time_s: float) -> Slot[float]:
        """The slot at a time of the own clock (s): the one that was ordered, or the mission's."""
        return self._arrangements.flight.slot(self._plan.name, time_s) or self._task.slot

    def _known_leader(self) -> KnownLeader | ForeignLeader:
        """What is known of the leader: on a path of the mission, or on the circle of a hold."""
        known, circle = self._routed_leader(), self._arrangements.flight.circle
        if circle is None or isinstance(known, ForeignLeader):
            return known
        return replace(known, path=circle, least_radius=self._arrangements.flight.turn_radius)

    def _routed_leader(self) -> KnownLeader | ForeignLeader:
        """What is known of the leader, whether it holds now or not."""
        known, route = self._task.leader, self._arrangements.flight.route
        radius = self._arrangements.flight.turn_radius
        if isinstance(known, ForeignLeader) or (route is None and radius == 0.0):
            return known
        if route is None:
            return replace(known, least_radius=radius)
        return replace(
            known, path=route.path, path_gains=route.gains, least_radius=route.least_radius
        )

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """One step toward the slot, or away from the others once the formation breaks up."""
        motion = self._report.note(navigated)
        self._note_wind(navigated)
        self._traffic.arrange(self._arrangements.flight.others(navigated.state.time_s))
        leader = self._leader_at(navigated)
        if leader is None:
            return RoleStep(
                setpoint=None,
                height=self._asked_height,
                distance=math.inf,
                lyapunov=math.nan,
                publish=self._own_state(navigated, motion, mode, math.nan),
            )
        self._watch_route(leader)
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
            climb_m=avoidance.climb_m,
            along_track=error.along_track,
            cross_track=error.cross_track,
            up=math.nan if breaks_away else self._up(navigated),
            slot=self._arrangements.flight.point(self._plan.name, navigated.state.time_s),
        )

    def _up(self, navigated: NavigatedState) -> float:
        """How far above the vehicle its slot is, m."""
        return self._height_wanted.height - (navigated.altitude_amsl - self._plan.frame.altitude_m)

    def _watch_route(self, leader: LeaderState[float]) -> None:
        """See whether the leader, as it is heard or carried on, is at the end of its path."""
        known, heard = self._known_leader(), self._followed.newest
        if heard is None or isinstance(known, ForeignLeader) or known.path.last_circle is None:
            return
        point = known.point_beside(leader)
        self._arrangements.watch_route(known.path, point, steered=heard.steered)

    def _note_wind(self, navigated: NavigatedState) -> None:
        """The mean wind, in which the leader's speed is planned."""
        state, (north, east) = navigated.state, self._wind
        if not math.isfinite(navigated.interval):
            self._wind = state.wind_north, state.wind_east
            return
        self._wind = (
            low_pass(north, state.wind_north, navigated.interval, WIND_S),
            low_pass(east, state.wind_east, navigated.interval, WIND_S),
        )

    def _late_law(
        self, keeper: SlotKeeper[float], navigated: NavigatedState, leader: LeaderState[float]
    ) -> Law:
        """What a law asks for of the vehicle as it will be."""

        def law(ahead: VehicleState[float]) -> Setpoint[float]:
            return keeper.step(ahead, leader, period=navigated.period, held=self._avoiding).setpoint

        return law

    def _intent(
        self, navigated: NavigatedState, leader: LeaderState[float], away: Setpoint[float] | None
    ) -> Intent:
        """What it would fly if it were alone with its leader."""
        return Intent(
            wanted=self._wanted(navigated, leader, away),
            leader=leader,
            astray=self._distance,
            height=self._height_wanted,
            gusts=self._gusts(),
        )

    def _gusts(self) -> float:
        """How fast gusts carry a vehicle that nobody corrects, m/s, as the leader's course tells."""
        if self._intended is None:
            return 0.0
        jitter = max(math.sqrt(self._intended.jitter) - CALM_RAD, 0.0)
        return GUST_SHARE * jitter * self._intended.motion.ground_speed

    def _wanted(
        self, navigated: NavigatedState, leader: LeaderState[float], away: Setpoint[float] | None
    ) -> WantedMotion:
        """Where guidance goes: onto the slot as its law does, or straight away from the others."""
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
        self,
        navigated: NavigatedState,
        motion: LeaderState[float],
        mode: Mode,
        course_setpoint: float,
    ) -> bytes | None:
        """The own state for the other vehicles, now and then; most often of a vehicle that is not steered."""
        now = navigated.state.time_s
        time_s = self._clock.from_own(now)
        in_slot = self._distance < IN_SLOT_M and not self._avoiding
        straight = abs(motion.turn_rate) < STRAIGHT_RAD_S
        interval = PUBLISH_IN_SLOT_S if in_slot and straight else PUBLISH_S
        if not mode.steers:
            interval = PUBLISH_FREE_S
        # Half a period early is nearer to the time than half a period late.
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
        )

    def _leader_at(self, navigated: NavigatedState) -> LeaderState[float] | None:
        """The leader as last heard; after a silence, as it would have flown on along its path or arc."""
        heard, known = self.leader, self._known_leader()
        now = navigated.state.time_s
        if isinstance(known, ForeignLeader):
            return None if heard is None else carried_on(heard, now - heard.time_s, GAP_S)
        fresh = self._heard_age(now) <= self._plan.timeouts.leader_s and not self.leads
        if heard is None or fresh:
            return heard
        carried = self._carried
        if carried is None:
            carried = extrapolate_by_rates(heard, min(now, heard.time_s + GAP_S))
        # One step, or many after a gap in telemetry.
        count = min(math.ceil((now - carried.time_s) / CARRY_S), MOST_STEPS)
        for left in range(count, 0, -1):
            time_s = carried.time_s + (now - carried.time_s) / left
            carried = extrapolate_along_path(
                carried, replace(navigated.state, time_s=time_s), known
            )
        self._carried = carried
        return carried

    def _away(self, navigated: NavigatedState, leader: LeaderState[float]) -> Setpoint[float]:
        """Setpoint of the breakaway: a fixed course to the side of the slot."""
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
            sliding.layer(navigated.period),
        )
        return cruise_setpoint(
            navigated.state,
            self._task.airspeed,
            course_rate,
            plan.airframe,
            wind_feedforward=plan.settings.wind_feedforward,
        )
