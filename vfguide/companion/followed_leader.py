"""What a follower knows of its leader: as it was heard, as it means to fly, as it is carried on."""

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
"""Longest step in which a silent leader is carried on."""

MOST_STEPS = 240
"""A minute of them: after a longer gap in telemetry they are longer."""

HANDED_BACK_S = 5.0
"""Longer than it takes an autopilot to be handed back after the formation has broken up."""

WIND_S = 5.0
"""Memory of the mean wind."""

GUST_SHARE = 10.0
"""Drift of a vehicle that nobody corrects, in parts of the speed at which gusts move its leader aside: the
rms of its course's jitter times its ground speed. Chosen by 30 lost leaders in docs/succession.md."""

GUSTS_S = 12.0
"""How long gusts are remembered: as long as a silent vehicle is looked for."""


class FollowedLeader:
    """The leader that one follower flies by: the mission's, or the one by which a deputy leads."""

    def __init__(
        self,
        plan: FlightPlan,
        task: FollowerTask,
        clock: SharedClock,
        arrangements: Arrangements,
        alerts: Alerts | None = None,
    ) -> None:
        """Begin with nothing heard.

        Args:
            plan: of the follower.
            task: its slot, and what the mission tells of the leader.
            clock: that the formation shares.
            arrangements: what was ordered of the formation.
            alerts: takes what a pilot should know of the leader's states.
        """
        self._plan = plan
        self._task = task
        self._clock = clock
        self._arrangements = arrangements
        # A leader that stays elsewhere may be at either place until all vehicles have been handed back.
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
        """Hears the mission's leader."""
        self._followed = self.receiver
        self.stories = LeaderStories(plan.most_m, alerts)
        """What the other followers say of their leader, against what this one was told."""
        self._deputy: str | None = None
        self._lead_said: HeardState | None = None
        self.stands_in = False
        """Whether the follower stands in for a leader that is lost, and carries its motion on for all."""
        self._steered = False
        self.name = next((one.name for one in plan.others if one.leads), "")
        """Of the mission's leader."""
        self._carried: LeaderState | None = None
        self._intended: IntendedMotion | None = None
        self._intended_path: Path | None = None
        self._deviation: HeightDeviation | None = None
        self._planned = PlannedHeight(plan.climb_limits)
        self._wind = (0.0, 0.0)
        self._own_altitude = math.nan
        self.gusts = 0.0
        """How fast gusts carry a vehicle that nobody corrects, m/s, as the leader's course tells.

        It fades within GUSTS_S once that is calm: a deputy leads smoothly in the gusts that its leader was
        lost in.
        """

    def _beside(self, heard: HeardState) -> HeightWitnesses:
        """What there is beside the leader's altitude: the mission's where it is, and one's own."""
        known = self._known_leader()
        climbed = 0.0 if isinstance(known, ForeignLeader) else known.point_beside(heard).height
        return HeightWitnesses(
            planned=self._plan.frame.altitude_m + known.height + climbed,
            own=self._own_altitude,
            above=known.height,
        )

    @property
    def place(self) -> LeaderFix | None:
        """Where the leader was, by the newest state of it; None where the others know it by themselves."""
        return None if self.stands_in else self.stories.newest

    @property
    def motion(self) -> LeaderState | None:
        """Newest leader state as slots are fixed to it, times on the follower's clock."""
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
        """How a leader without a companion was heard to move last, on the own clock; None of any other."""
        return self.receiver.newest if isinstance(self.receiver, LeaderTelemetry) else None

    @property
    def carried(self) -> LeaderState | None:
        """The leader as it is carried on while it is not heard; None while it is."""
        return self._carried

    def note_leader(self, data: bytes, now: float) -> bool:
        """Take a state of the mission's leader as one of any other vehicle; whether it is sound and newer."""
        newer = self.receiver.take(data, now)
        if isinstance(self.receiver, LeaderTelemetry):
            # One without a companion knows of no order, and each hears it by its own receiver.
            return newer
        if newer:
            self._arrangements.hear(self.name, self.receiver.newest, now)
            said = motion_of(data, self._plan.frame)
            # A leader that obeys another one says where it is itself.
            if said.term == 0:
                self.stories.hear_leader(place_said(said), 0)
        return newer and self.stories.may_be_followed(now)

    def note_lead(self, vehicle: str, data: bytes, now: float) -> bool:
        """Take a state of the leader by which a deputy leads; whether it is sound and newer."""
        if vehicle != self._deputy:
            self._deputy = vehicle
            self._carried_on = StateReceiver(self._plan.frame, self._clock, moved_s=self._moved_s)
        newer = self._carried_on.take(data, now)
        if newer:
            self._lead_said = motion_of(data, self._plan.frame)
        return newer and self.stories.may_be_followed(now)

    def follow_leader(self) -> None:
        """Fly by the mission's leader, as it was heard last."""
        self._deputy = None
        self._follow(self.receiver)

    def follow_lead(self) -> None:
        """Fly by the leader by which a deputy leads, as it was heard last."""
        if self._lead_said is not None:
            self.stories.hear_leader(place_said(self._lead_said), self._lead_said.term)
        self._follow(self._carried_on)

    def _follow(self, receiver: StateReceiver | LeaderTelemetry) -> None:
        """Fly by the newest state of a receiver."""
        self.stands_in, self._followed = False, receiver
        self._carried = None
        self._intend()

    def take_lead(self) -> None:
        """Carry the leader on along its path from now on, for as long as it takes."""
        self.stands_in, self._deputy = True, None

    def age(self, now: float) -> float:
        """Age of the newest leader state, s; 0 for a deputy that leads, infinite before the first."""
        return 0.0 if self.stands_in else self._heard_age(now)

    def _heard_age(self, now: float) -> float:
        return math.inf if self.motion is None else now - self.motion.time_s

    def to_say(self, now: float) -> bytes:
        """Heartbeats and questions for the time, where the leader has no companion."""
        return self.receiver.say(now) if isinstance(self.receiver, LeaderTelemetry) else b""

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

    def _intend(self) -> None:
        """Find out how the leader means to fly, by what it was just heard to do."""
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
        """A state of the leader; one whose altitude is doubted with the height that was known last.

        A path that climbs is searched by height, and a deputy that leads on says a height.
        """
        if math.isfinite(heard.height):
            return heard
        planned = self._task.leader.height if self._planned.height is None else self._planned.height
        off = 0.0 if self._deviation is None else self._deviation.height
        return replace(heard, height=planned + off)

    def _note_height(self, heard: LeaderState, planned: HeightTarget, memory_s: float) -> None:
        """Find out by how much the leader flies above what is planned for it."""
        if self._task.follows_height:
            self._deviation = height_deviation(self._deviation, heard, planned, memory_s=memory_s)

    def _planned_height(
        self,
        leader: LeaderState,
        point: PathPoint[float],
        ahead_s: float,
        *,
        steered: bool,
    ) -> HeightTarget:
        """What the mission says of the leader's height; on the circle of a hold, that of the hold."""
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
        """How high it flies: now, and in so many seconds, when a setpoint takes effect."""
        known = self._known_leader()
        planned = held_height(known.height)
        if not isinstance(known, ForeignLeader):
            heard, intended = self._followed.newest, self._intended
            # What was found along another path, before an order, says nothing of this one.
            on_path = self._carried is None and self._intended_path is known.path
            if heard is None or intended is None or not on_path:
                motion, point = leader, known.point_beside(leader)
            else:
                # As it was heard, gusts included: the leader looks ahead by that, too.
                motion, point = heard, intended.planned.point
            steered = self._carried is not None or heard is None or heard.steered
            planned = self._planned_height(
                motion, point, now - motion.time_s + ahead_s, steered=steered
            )
        deviation = self._deviation or HeightDeviation(time_s=now)
        if now - deviation.time_s > self._plan.timeouts.leader_s:
            # Nothing is heard of how it goes on beside its plan.
            deviation = replace(deviation, climb_rate=0.0)
        return followed_height(planned, deviation, flying=known.height, now_s=now, ahead_s=ahead_s)

    def at(self, navigated: NavigatedState) -> LeaderState | None:
        """The leader as last heard; after a silence, as it would have flown on along its path or arc."""
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
        # One step, or many after a gap in telemetry.
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
        """A leader that is carried on, which climbs with its planned height while that changes."""
        if not self._planned.changes:
            return carried
        begin, end = (
            self._planned_height(one, known.point_beside(one), 0.0, steered=True)
            for one in (before, carried)
        )
        return replace(
            carried,
            height=before.height + end.height - begin.height,
            climb_rate=end.climb_rate,
        )

    def watch_route(self, leader: LeaderState) -> None:
        """See whether the leader, as it is heard or carried on, is at the end of its path."""
        known, heard = self._known_leader(), self._followed.newest
        if heard is None or isinstance(known, ForeignLeader) or known.path.last_circle is None:
            return
        point = known.point_beside(leader)
        self._arrangements.watch_route(known.path, point, steered=heard.steered)

    def note_own(self, navigated: NavigatedState) -> None:
        """Take the own state: the mean wind, in which the leader's speed is planned, and the altitude."""
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
