"""A follower's knowledge of its leader: as heard, as it intends to fly, and as predicted."""

import math

from msgspec.structs import replace

from vfguide.companion.alerts import Alerts
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.height_keeper import PlannedHeight
from vfguide.companion.leader_telemetry import LeaderTelemetry
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan, FollowerTask, ForeignLeader
from vfguide.companion.state_receiver import LeaderStories, StateReceiver, motion_of, place_said
from vfguide.companion.timing import SharedClock
from vfguide.companion.witnesses import MOVING_M_S, HeightWitnesses
from vfguide.elementwise import low_pass
from vfguide.guidance.formation import extrapolate_by_rates
from vfguide.guidance.height import (
    PLANNED_S,
    UNPLANNED_S,
    BesidePath,
    HeightDeviation,
    HeightTarget,
    followed_height,
    height_deviation,
    held_height,
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
from vfguide.guidance.navigation import memory_of
from vfguide.guidance.path import Path, PathPoint
from vfguide.state import GAP_S, HeardState, LeaderFix, LeaderState

CARRY_S = 0.25
"""Longest step of the prediction of a silent leader, s."""

MOST_STEPS = 240
"""Limit on prediction steps, a minute's worth; after a longer gap in telemetry steps are longer."""

HANDED_BACK_S = 5.0
"""Time for handing an autopilot back after the formation has broken up, with a margin, s."""

WIND_S = 5.0
"""Time constant of the mean wind, s."""

GUST_SHARE = 10.0
"""Drift speed of a vehicle that nobody corrects over the speed at which gusts move its leader aside. The
latter is the rms course jitter times ground speed. Chosen by 30 lost leaders in docs/succession.md."""

GUSTS_S = 12.0
"""Memory of gusts, s: as long as a silent vehicle is looked for."""


class FollowedLeader:
    """Leader that a follower flies by: the mission's own, or the one that a deputy predicts."""

    def __init__(
        self,
        plan: FlightPlan,
        task: FollowerTask,
        clock: SharedClock,
        arrangements: Arrangements,
        alerts: Alerts | None = None,
    ) -> None:
        self._plan = plan
        self._task = task
        self._clock = clock
        self._arrangements = arrangements
        # A leader that stays elsewhere may be at either place until all have been handed back.
        self._moved_s = plan.timeouts.prediction_s + plan.timeouts.breakaway_s + HANDED_BACK_S
        self.receiver: StateReceiver | LeaderTelemetry = (
            LeaderTelemetry(
                task.leader,
                plan.frame,
                alerts,
                moved_s=self._moved_s,
                system_id=plan.system_id,
                beside=self._beside,
            )
            if isinstance(task.leader, ForeignLeader)
            else StateReceiver(
                plan.frame,
                clock,
                alerts,
                whose="the leader",
                moved_s=self._moved_s,
                beside=self._beside,
            )
        )
        """Receiver of the mission's leader."""
        self._followed = self.receiver
        self.stories = LeaderStories(alerts)
        """Comparison of the leader's place with what the other followers were told."""
        self._deputy: str | None = None
        self._lead_said: HeardState | None = None
        self.stands_in = False
        """Whether this vehicle stands in for a lost leader and predicts it for all."""
        self._steered = False
        self.name = next((one.name for one in plan.others if one.leads), "")
        """Name of the mission's leader; empty if it has no companion."""
        self._carried: LeaderState | None = None
        self._intended: IntendedMotion | None = None
        self._intended_path: Path | None = None
        self._deviation: HeightDeviation | None = None
        self._planned = PlannedHeight(plan.climb_limits)
        self._wind = (0.0, 0.0)
        self._own_altitude = math.nan
        self.gusts = 0.0
        """Drift speed of a vehicle in gusts that nobody corrects, m/s, estimated from the leader's course.

        It fades within GUSTS_S once the course is calm: a deputy predicts a smooth leader in the same gusts.
        """

    def _beside(self, heard: HeardState) -> HeightWitnesses:
        """Return witnesses of the leader's altitude: the planned one and the own one."""
        known = self._known_leader()
        climbed = 0.0 if isinstance(known, ForeignLeader) else known.point_beside(heard).height
        return HeightWitnesses(
            planned=self._plan.frame.altitude_m + known.height + climbed,
            own=self._own_altitude,
            above=known.height,
        )

    @property
    def place(self) -> LeaderFix | None:
        """Newest place of the leader; None where this vehicle predicts it, as the others know it."""
        return None if self.stands_in else self.stories.newest

    @property
    def motion(self) -> LeaderState | None:
        """Newest leader state to which slots refer, times on the own clock."""
        if isinstance(self._task.leader, ForeignLeader):
            return self.receiver.newest
        return None if self._intended is None else self._intended.motion

    @property
    def is_left(self) -> bool:
        """Whether the formation flies on without its leader: a deputy leads, or is about to."""
        newest = self.receiver.newest
        leaves = self._steered and newest is not None and not newest.steered
        return self.stands_in or self._deputy is not None or leaves

    @property
    def foreign(self) -> HeardState | None:
        """Last state of a leader without a companion, on the own clock; None for any other leader."""
        return self.receiver.newest if isinstance(self.receiver, LeaderTelemetry) else None

    @property
    def carried(self) -> LeaderState | None:
        """Predicted state of a leader that is not heard; None while it is heard."""
        return self._carried

    def note_leader(self, data: bytes, now: float) -> bool:
        """Process a state of the mission's leader; return whether it is sound, newer, and may be followed."""
        newer = self.receiver.take(data, now)
        if isinstance(self.receiver, LeaderTelemetry):
            # A leader without a companion knows no order, and each follower has its own receiver for it.
            return newer
        if newer:
            self._arrangements.hear(self.name, self.receiver.newest, now)
            said = motion_of(data, self._plan.frame)
            # A leader that obeys another one reports only its own place.
            if said.term == 0:
                self.stories.hear_leader(place_said(said), 0)
        return newer and self.stories.may_be_followed(now)

    def note_lead(self, vehicle: str, data: bytes, now: float) -> bool:
        """Process a deputy's state of the leader; return whether it is sound, newer, and may be followed."""
        if vehicle != self._deputy:
            self._deputy = vehicle
            self._carried_on = StateReceiver(self._plan.frame, self._clock, moved_s=self._moved_s)
        newer = self._carried_on.take(data, now)
        if newer:
            self._lead_said = motion_of(data, self._plan.frame)
        return newer and self.stories.may_be_followed(now)

    def follow_leader(self) -> None:
        """Fly by the mission's leader, as last heard."""
        self._deputy = None
        self._follow(self.receiver)

    def follow_lead(self) -> None:
        """Fly by the leader that a deputy predicts, as last heard."""
        if self._lead_said is not None:
            self.stories.hear_leader(place_said(self._lead_said), self._lead_said.term)
        self._follow(self._carried_on)

    def _follow(self, receiver: StateReceiver | LeaderTelemetry) -> None:
        self.stands_in, self._followed = False, receiver
        self._carried = None
        self._intend()

    def take_lead(self) -> None:
        """Predict the leader along its path for all from now on."""
        self.stands_in, self._deputy = True, None

    def age(self, now: float) -> float:
        """Return the age of the newest leader state, s; 0 for a leading deputy, infinite before the first."""
        return 0.0 if self.stands_in else self._heard_age(now)

    def _heard_age(self, now: float) -> float:
        return math.inf if self.motion is None else now - self.motion.time_s

    def to_say(self, now: float) -> bytes:
        """Return heartbeats and time requests for a leader without a companion."""
        return self.receiver.say(now) if isinstance(self.receiver, LeaderTelemetry) else b""

    def _known_leader(self) -> KnownLeader | ForeignLeader:
        """Return what is known of the leader, on its path or on the circle of a hold."""
        known, circle = self._routed_leader(), self._arrangements.flight.circle
        if circle is None or isinstance(known, ForeignLeader):
            return known
        return replace(known, path=circle, least_radius=self._arrangements.flight.turn_radius)

    def _routed_leader(self) -> KnownLeader | ForeignLeader:
        """Return what is known of the leader, whether it is in a hold or not."""
        known, route = self._task.leader, self._arrangements.flight.route
        radius = self._arrangements.flight.turn_radius
        if isinstance(known, ForeignLeader) or (route is None and radius == 0.0):
            return known
        if route is None:
            return replace(known, least_radius=radius)
        return replace(
            known, path=route.path, path_gains=route.gains, least_radius=route.least_radius
        )

    def _intend(self) -> None:
        """Estimate the leader's intended motion from its newest state."""
        heard, before, known = self._followed.newest, self._intended, self._known_leader()
        if heard is None:
            return
        self._steered = heard.steered
        if isinstance(known, ForeignLeader):
            self._note_height(heard, held_height(known.height), UNPLANNED_S)
            return
        measured, heard = heard, self._with_height(heard)
        planned = planned_motion(heard, known, self._wind)
        at_once = self._planned_height(heard, planned.point, 0.0, steered=heard.steered)
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
        jitter = max(math.sqrt(self._intended.jitter) - CALM_RAD, 0.0)
        faded = self.gusts * memory_of(max(passed_s, 0.0), GUSTS_S)
        self.gusts = max(GUST_SHARE * jitter * self._intended.motion.ground_speed, faded)

    def _with_height(self, heard: HeardState) -> HeardState:
        """Return a leader's state, with the last known height where its altitude is doubted.

        A climbing path is searched by height, and a leading deputy reports a height.
        """
        if math.isfinite(heard.height):
            return heard
        planned = self._task.leader.height if self._planned.height is None else self._planned.height
        off = 0.0 if self._deviation is None else self._deviation.height
        return replace(heard, height=planned + off)

    def _note_height(self, heard: LeaderState, planned: HeightTarget, memory_s: float) -> None:
        """Update the leader's deviation from its planned height."""
        if self._task.follows_height:
            self._deviation = height_deviation(self._deviation, heard, planned, memory_s=memory_s)

    def _planned_height(
        self, leader: LeaderState, point: PathPoint[float], ahead_s: float, *, steered: bool
    ) -> HeightTarget:
        """Return the leader's planned height, or that of a hold."""
        known = self._routed_leader()
        if isinstance(known, ForeignLeader):
            return held_height(known.height)
        flight = self._arrangements.flight
        late = flight.is_late(leader.time_s)
        if flight.circle is not None:
            found = self._planned.hold(leader, ahead_s=ahead_s, late=late)
        else:
            beside = BesidePath(
                path=known.path, point=point, motion=leader, flying=known.height, ahead_s=ahead_s
            )
            found = self._planned.along(beside, steered=steered, late=late)
        if self._planned.began_anew:
            self._deviation = None
        return found

    def height(self, leader: LeaderState, now: float, ahead_s: float) -> HeightTarget:
        """Return the leader's height now and `ahead_s` later, when a setpoint takes effect."""
        known = self._known_leader()
        planned = held_height(known.height)
        if not isinstance(known, ForeignLeader):
            heard, intended = self._followed.newest, self._intended
            # A deviation from another path, before an order, says nothing about this one.
            on_path = self._carried is None and self._intended_path is known.path
            if heard is None or intended is None or not on_path:
                motion, point = leader, known.point_beside(leader)
            else:
                # The state is as heard, gusts included: the leader looks ahead by it, too.
                motion, point = heard, intended.planned.point
            steered = self._carried is not None or heard is None or heard.steered
            planned = self._planned_height(
                motion, point, now - motion.time_s + ahead_s, steered=steered
            )
        deviation = self._deviation or HeightDeviation(time_s=now)
        if now - deviation.time_s > self._plan.timeouts.leader_s:
            # The present climb rate beside the plan is not known.
            deviation = replace(deviation, climb_rate=0.0)
        return followed_height(planned, deviation, flying=known.height, now_s=now, ahead_s=ahead_s)

    def at(self, navigated: NavigatedState) -> LeaderState | None:
        """Return the leader as last heard, or as predicted along its path or arc after a silence."""
        heard, known = self.motion, self._known_leader()
        now = navigated.state.time_s
        if isinstance(known, ForeignLeader):
            return None if heard is None else carried_on(heard, now - heard.time_s, GAP_S)
        fresh = self._heard_age(now) <= self._plan.timeouts.leader_s and not self.stands_in
        if heard is None or fresh:
            return heard
        carried = self._carried
        if carried is None:
            carried = extrapolate_by_rates(heard, min(now, heard.time_s + GAP_S))
        before = carried
        # A gap in telemetry takes many steps.
        count = min(math.ceil((now - carried.time_s) / CARRY_S), MOST_STEPS)
        for left in range(count, 0, -1):
            time_s = carried.time_s + (now - carried.time_s) / left
            carried = extrapolate_along_path(
                carried, replace(navigated.state, time_s=time_s), known
            )
        self._carried = self._on_its_way(before, carried, known)
        return self._carried

    def _on_its_way(
        self, before: LeaderState, carried: LeaderState, known: KnownLeader
    ) -> LeaderState:
        """Return a predicted leader that climbs with its planned height while that changes."""
        if not self._planned.changes:
            return carried
        begin, end = (
            self._planned_height(one, known.point_beside(one), 0.0, steered=True)
            for one in (before, carried)
        )
        return replace(
            carried, height=before.height + end.height - begin.height, climb_rate=end.climb_rate
        )

    def watch_route(self, leader: LeaderState) -> None:
        """Check whether the leader, as heard or predicted, is at the end of its path."""
        known, heard = self._known_leader(), self._followed.newest
        if heard is None or isinstance(known, ForeignLeader) or known.path.last_circle is None:
            return
        point = known.point_beside(leader)
        self._arrangements.watch_route(known.path, point, steered=heard.steered)

    def note_own(self, navigated: NavigatedState) -> None:
        """Note the own altitude and mean wind; the leader's planned speed depends on the latter."""
        state, (north, east) = navigated.state, self._wind
        flies = state.ground_speed > MOVING_M_S
        self._own_altitude = navigated.altitude_amsl if flies else math.nan
        if not math.isfinite(navigated.interval):
            self._wind = state.wind_north, state.wind_east
            return
        self._wind = (
            low_pass(north, state.wind_north, navigated.interval, WIND_S),
            low_pass(east, state.wind_east, navigated.interval, WIND_S),
        )
