"""The parts that a vehicle can have in a formation, and that of one which names deputies.

With deputies a vehicle is leader, follower, or deputy in place of a leader that is lost. A deputy that
takes over leaves nobody's place. Every follower carries a silent leader on along its path by itself; the
deputy goes on with that, for as long as it takes, and tells the others, so that all carry on the same. It
stays a follower of what it carries on. The mission's leader, once it is back, is one too, in a slot at
its own place.
"""

import math
from collections import Counter
from collections.abc import Callable

from msgspec.structs import replace

from vfguide.companion.alerts import Alerts
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.follower_role import FollowerRole
from vfguide.companion.leader_role import LeaderRole
from vfguide.companion.own_vehicle import NavigatedState
from vfguide.companion.plan import FlightPlan, LeadPlan
from vfguide.companion.role import Lead, Role, RoleStep
from vfguide.companion.state_publisher import StatePublisher
from vfguide.companion.state_receiver import COPY_S, motion_of
from vfguide.companion.succession import Succession
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SharedClock
from vfguide.laws.leader import LeaderTask
from vfguide.link.codec import LeaderMessage, LinkDataError, encode, is_leaders
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import TrafficReport
from vfguide.state import HeardState, LeaderState

PASSED_S = 2.0 * COPY_S
"""The last words are said by so much later than the state before: others take them for a newer one."""


RoleMaker = Callable[[FlightPlan, SharedClock, Arrangements, Alerts], Role]
"""Makes a vehicle's part of its plan, the formation's clock, what was ordered of it, and its alerts."""


class SuccessionRole(Role):
    """Leads, follows, or leads on."""

    def __init__(
        self,
        plan: FlightPlan,
        lead: LeadPlan,
        clock: SharedClock,
        arrangements: Arrangements,
        alerts: Alerts | None = None,
    ) -> None:
        """Make one that has heard nothing yet.

        Args:
            plan: its part of the mission.
            lead: who may lead.
            clock: that the formation shares.
            arrangements: what was ordered of the formation.
            alerts: takes what a pilot should know.
        """
        self._arrangements = arrangements
        self._plan = lead
        self._leader_name = lead.order[0]
        self._frame = plan.frame
        self._clock = clock
        self._succession = Succession(plan.name, lead.order, silence_s=plan.timeouts.leader_s)
        self._report = StatePublisher(plan)
        self._alerts = alerts = alerts or Alerts()
        self._leader_role = (
            LeaderRole(
                plan,
                plan.task,
                clock,
                arrangements,
                self._report,
                alerts=alerts.only_while(lambda: self._flies_path),
            )
            if isinstance(plan.task, LeaderTask)
            else None
        )
        self._follower_role = FollowerRole(
            replace(plan, task=lead.task),
            lead.task,
            clock,
            arrangements,
            self._report,
            alerts=alerts.only_while(lambda: not self._flies_path),
        )
        self._sequence = 0
        self._told = 0
        self._last: tuple[LeaderState, NavigatedState] | None = None
        self._counters: Counter[str] = Counter()

    def retune(self, plan: FlightPlan) -> None:
        """Go on with another response of the same vehicle, in either part."""
        if self._leader_role is not None:
            self._leader_role.retune(plan)
        self._follower_role.retune(replace(plan, task=self._plan.task))

    @property
    def leadership(self) -> tuple[str, int]:
        """Who leads as far as is known, and its term."""
        return self._succession.holder, self._succession.term

    @property
    def lead(self) -> Lead | None:
        """By what this vehicle leads."""
        if not self._succession.leads or self._last is None:
            return None
        return Lead(term=self._succession.term, motion=self._last[0])

    @property
    def counters(self) -> Counter[str]:
        """States that were not used, by reason."""
        return self._counters + self._role.counters

    @property
    def _flies_path(self) -> bool:
        """Whether this vehicle is the leader that the formation is fixed to."""
        return self._leader_role is not None and (
            self._succession.listens
            or (self._succession.leads and not self._follower_role.followed.stands_in)
        )

    @property
    def _role(self) -> LeaderRole | FollowerRole:
        leads = self._leader_role if self._flies_path else None
        return leads or self._follower_role

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """One step of the part that is due."""
        now = navigated.state.time_s
        carries = not self._flies_path
        ordered = self._arrangements.leads_by_order(now)
        eligible = carries and mode.steers
        if self._succession.step(now, eligible=eligible, ordered=ordered) and carries:
            self._follower_role.take_lead()
        self._tell()
        self._report.term = self._succession.term
        self._arrangements.coordinator = self._succession.holder
        if self._flies_path:
            self._follower_role.followed.note_own(navigated)
        step = self._role.step(navigated, mode)
        motion = step.motion or self._follower_role.followed.carried
        self._last = None if motion is None else (motion, navigated)
        if self._succession.leads and self._succession.term > 0:
            return replace(step, lead=self._state_to_lead_by(steered=mode.steers))
        return step

    def _state_to_lead_by(self, *, steered: bool) -> bytes | None:
        """The leader by which this vehicle leads, for the others."""
        if self._last is None:
            return None
        motion, _ = self._last
        time_s = self._clock.from_own(motion.time_s)
        if not math.isfinite(time_s):
            return None
        latitude, longitude = self._frame.to_geodetic(motion.north, motion.east)
        # Of a leader whose altitude was doubted last none is known.
        altitude = self._frame.altitude_m + motion.height
        if math.isnan(altitude):
            altitude = self._plan.altitude_amsl
        self._sequence = (self._sequence + 1) % 2**32
        return encode(
            LeaderMessage(
                sequence=self._sequence,
                time_s=time_s,
                latitude_deg=latitude,
                longitude_deg=longitude,
                altitude_amsl=altitude,
                course=math.remainder(motion.course, math.tau),
                ground_speed=motion.ground_speed,
                acceleration=motion.acceleration,
                turn_rate=motion.turn_rate,
                turn_acceleration=motion.turn_acceleration,
                climb_rate=motion.climb_rate,
                term=self._succession.term,
                arrangement=self._arrangements.number,
                steered=steered,
                leads=True,
            )
        )

    def leave(self) -> RoleStep | None:
        """States that say that nothing is steered here any more: a deputy need not wait to find that out."""
        if self._last is None:
            return None
        motion, navigated = self._last
        own = self._report.note(navigated)
        time_s = self._clock.from_own(own.time_s) + PASSED_S
        if not math.isfinite(time_s):
            return None
        self._last = replace(motion, time_s=motion.time_s + PASSED_S), navigated
        leads = self._succession.leads and self._succession.term > 0
        return RoleStep(
            setpoint=None,
            height=math.nan,
            distance=math.inf,
            lyapunov=math.nan,
            publish=self._report.message(
                own, navigated, time_s, steered=False, arrangement=self._arrangements.number
            ),
            lead=self._state_to_lead_by(steered=False) if leads else None,
        )

    def receive(self, data: bytes, now: float) -> None:
        """Take a state of the mission's leader, which leads in term 0.

        A leader is heard where its states are flown by: one who says what cannot be is silent.
        """
        state = self._read(data, leads=False)
        if state is None:
            return
        follower, succession = self._follower_role, self._succession
        taken = follower.note_leader(data, now)
        if state.term > 0:
            succession.hear_other(state.term, now)
        elif taken or not self._knows_time(state):
            obeys = succession.hear_leader(self._leader_name, 0, now, steered=state.steered)
            if taken and obeys and not succession.is_leaving(now):
                follower.follow_leader()

    def receive_lead(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of the leader by which another vehicle leads."""
        state = self._read(data, leads=True)
        if state is None or state.term == 0:
            return
        follower, succession = self._follower_role, self._succession
        taken = False
        if succession.may_obey(vehicle, state.term):
            taken = follower.followed.note_lead(vehicle, data, now)
            if not taken and self._knows_time(state):
                return
        if not succession.hear_leader(vehicle, state.term, now, steered=state.steered):
            self._counters["not of the leader"] += 1
            return
        follower.followed.stands_in = False
        if taken and not succession.is_leaving(now):
            follower.follow_lead()

    def _knows_time(self, state: HeardState) -> bool:
        """Whether it is known when a state was true: else none is taken yet, and still there is a leader."""
        return math.isfinite(self._clock.to_own(state.time_s))

    def _read(self, data: bytes, *, leads: bool) -> HeardState | None:
        """A state, where it is sound and is what it was sent as."""
        if is_leaders(data) is leads:
            try:
                return motion_of(data, self._frame)
            except LinkDataError:
                pass
        self._counters["malformed"] += 1
        return None

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of another follower."""
        state = self._read(data, leads=False)
        if state is not None:
            self._succession.hear_other(state.term, now)
        for role in (self._leader_role, self._follower_role):
            if role is not None:
                role.receive_neighbour(vehicle, data, now)

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Take what the own autopilot reports of an aircraft that is not of the formation."""
        for role in (self._leader_role, self._follower_role):
            if role is not None:
                role.receive_traffic(report, now)

    def unheard(self) -> list[str]:
        """Names of other followers that were never heard, where it is a follower."""
        return [] if self._flies_path else self._follower_role.unheard()

    def lose_link(self, now: float) -> None:
        """Note that nobody can be heard now."""
        for role in (self._leader_role, self._follower_role):
            if role is not None:
                role.lose_link(now)

    def to_leader(self, now: float) -> bytes:
        """Every leader here has a companion."""
        del now
        return b""

    def leader_age(self, now: float) -> float:
        """Seconds since the newest leader state was true; infinite while it is not known who leads."""
        if self._succession.listens:
            return math.inf
        return self._role.leader_age(now)

    def _tell(self) -> None:
        """Say who leads, when that has changed."""
        succession = self._succession
        if succession.term == self._told:
            return
        self._told = succession.term
        whose = succession.holder
        if not succession.leads:
            text = f"{whose} leads the formation now: nothing to do"
        elif self._flies_path:
            text = "leads the formation again: nothing to do"
        else:
            text = f"leads the formation in place of {self._leader_name}: nothing to do"
        self._alerts.say("lead", WARNING, text, about="lead")


def role_of(
    plan: FlightPlan,
    clock: SharedClock,
    arrangements: Arrangements | None = None,
    alerts: Alerts | None = None,
) -> Role:
    """The part that a plan asks for, in a formation that shares this clock and these arrangements."""
    task = plan.task
    arrangements = arrangements or Arrangements(plan, clock)
    if plan.lead is not None:
        return SuccessionRole(plan, plan.lead, clock, arrangements, alerts)
    if isinstance(task, LeaderTask):
        return LeaderRole(plan, task, clock, arrangements, alerts=alerts)
    return FollowerRole(plan, task, clock, arrangements, alerts=alerts)
