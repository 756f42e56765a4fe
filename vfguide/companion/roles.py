"""Succession of the leader, and the roles that a vehicle can have in a formation.

**Terms.** Every state carries a term, and the highest one heard counts, as in Raft (Ongaro and Ousterhout,
"In Search of an Understandable Consensus Algorithm", USENIX ATC 2014, section 5). There is no majority vote,
as a part of the formation that hears no others has to fly on, too. Instead each term belongs to one vehicle
from the outset. The n candidates have an order: the mission's leader first, then its deputies. Term 0 is the
leader's. Of every n later terms each candidate has one, the last in the order the lowest. So no term has two
leaders. After one succession in each of two parts, the part of the earlier deputy has the higher term. Times
are passed in; no clock is read.

**Roles.** With deputies a vehicle is leader, follower, or deputy in place of a lost leader. Every follower
predicts a silent leader along its path. The deputy continues that prediction and sends it to the others, so
that all predict the same. It remains a follower in its own slot. The mission's leader, once it is back, also
follows the prediction, in a slot at its own place.
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
from vfguide.companion.role import Lead, Role, RoleStep, StatePublisher
from vfguide.companion.state_receiver import SAME_S, motion_of
from vfguide.companion.supervisor import Mode
from vfguide.companion.timing import SharedClock
from vfguide.laws.leader import LeaderTask
from vfguide.link.codec import LeaderMessage, LinkDataError, encode, is_leaders
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import TrafficReport
from vfguide.state import HeardState, LeaderState

STAGGER_S = 0.3
"""Time that a deputy grants to each candidate before it, s: a little more than a message's latency."""

UNSTEERED_S = 0.3
"""Time for which a leader may report that its companion does not steer, s."""

PATIENCE_S = 3.0
"""Time for which a leader that is no longer steered is predicted along its path, s: a deputy is about to
lead. If none can by then, the leader is followed wherever it flies, as without deputies."""

DEAF_S = 5.0
"""Time for which a vehicle that hears no other flies on as predicted, s: it is probably deaf. Then it leads,
as there may have been no other vehicle than the leader."""

WORKS_S = 0.6
"""Time since another vehicle was heard within which the link works, s."""

LATER_S = 0.3
"""Delay of another vehicle's state after the leader's that shows that the link works without it, s."""

LISTEN_S = 1.5
"""Time for which a restarted leader listens, s: it may have been succeeded."""

VACANT_S = 3.0
"""Time after which a leader leads in a new term, s, if others obey a higher one whose leader is not heard.
That leader is gone, and vehicles that have heard it obey no lower term."""

MOST_RENEWALS = 10
"""Limit on doublings of that time, reached after some 50 minutes."""

GREATEST_TERM = 2**32 - 1

MOST_ROUNDS = 1_000
"""Limit on rounds by which any vehicle's state raises the known terms: a damaged or forged one must not use
up all terms, after which nobody could lead."""

LEADERS_ROUNDS = 1_000_000
"""The same limit for states of a term's own leader, which may not have been heard for long, or ever."""


def holder_of(term: int, order: tuple[str, ...]) -> str:
    """Return the vehicle that owns a term; `order` lists the candidates, the mission's leader first."""
    if term == 0:
        return order[0]
    return order[-1 - (term - 1) % len(order)]


def term_above(highest: int, name: str, order: tuple[str, ...]) -> int:
    """Return the lowest term of the candidate `name` in the round of terms after the highest one heard."""
    rounds = -(-highest // len(order))
    return rounds * len(order) + len(order) - order.index(name)


class Succession:
    """Leadership as one vehicle knows it."""

    def __init__(self, name: str, order: tuple[str, ...], *, silence_s: float) -> None:
        """Begin in term 0; `order` lists the candidates, the mission's leader first, maybe without `name`.

        A leader is lost after `silence_s` without states (`timeouts.leader_s`).
        """
        self._name = name
        self._order = order
        self._silence_s = silence_s
        self.term = 0
        """Highest term in which a leader was heard, or the own one."""
        self.highest = 0
        """Highest term in any state heard."""
        self.listens = name == order[0]
        """Whether this is the mission's leader, just started, which may have been succeeded."""
        self._began_s = self._unsteered_s = self._outranked_s = math.inf
        self._heard_s = self._others_s = self._works_since = -math.inf
        self._steered = False
        self._renewals = 0

    @property
    def holder(self) -> str:
        """Name of the vehicle that leads, as far as known."""
        return holder_of(self.term, self._order)

    @property
    def leads(self) -> bool:
        """Whether this vehicle leads."""
        return self.holder == self._name and not self.listens

    @property
    def was_heard(self) -> bool:
        """Whether a leader was ever heard; otherwise none can be succeeded."""
        return math.isfinite(self._heard_s)

    def is_leaving(self, now: float) -> bool:
        """Check whether the leader's companion has stopped steering it a short while ago."""
        return self._steered and 0.0 <= now - self._unsteered_s < PATIENCE_S

    def may_obey(self, vehicle: str, term: int) -> bool:
        """Check whether a vehicle that claims to lead in a term is to be obeyed."""
        in_reach = self.term <= term <= self._reach(LEADERS_ROUNDS)
        return in_reach and self._holds(vehicle, term)

    def _holds(self, vehicle: str, term: int) -> bool:
        """Check whether a term belongs to this other vehicle."""
        return vehicle != self._name and vehicle == holder_of(term, self._order)

    def _reach(self, rounds: int) -> int:
        """Return the highest term within this many rounds from the own one."""
        return self.term + rounds * len(self._order)

    def hear_leader(self, vehicle: str, term: int, now: float, *, steered: bool) -> bool:
        """Process the state of a vehicle that claims to lead in a term; return whether to obey it."""
        if not self._holds(vehicle, term):
            return False
        if not self.may_obey(vehicle, term):
            self.hear_other(term, now)
            return False
        self._hear(term, now)
        if term > self.term:
            self.term, self._steered, self._unsteered_s = term, False, math.inf
        self.listens = False
        self._renewals = 0
        self._heard_s = now
        self._steered |= steered
        self._unsteered_s = math.inf if steered else min(self._unsteered_s, now)
        return True

    def hear_other(self, term: int, now: float) -> None:
        """Process a state of another vehicle, which obeys the leader of a term."""
        # A restarted leader knows no term and learns it from the others.
        rounds = LEADERS_ROUNDS // 2 if self.listens else MOST_ROUNDS
        self._hear(term if term <= self._reach(rounds) else 0, now)

    def _hear(self, term: int, now: float) -> None:
        if now - self._others_s > WORKS_S:
            self._works_since = now
        self._others_s, self.highest = now, max(self.highest, term)

    def step(self, now: float, *, eligible: bool, ordered: bool = False) -> bool:
        """Process the passage of time and return whether this vehicle begins to lead.

        It must be steered (`eligible`). By order (`ordered`) it takes the lead, whoever leads.
        """
        if self.listens:
            return self._listen(now)
        if self.leads:
            self._renew_term(now)
            return False
        if self._name not in self._order:
            return False
        if not (eligible and (ordered or self._is_gone(now))):
            return False
        return self._take_lead()

    def _listen(self, now: float) -> bool:
        """Check whether a restarted leader begins to lead now."""
        self._began_s = min(self._began_s, now)
        if self.highest == 0 and now - self._began_s >= LISTEN_S:
            self.listens = False
            return True
        return now - self._began_s >= VACANT_S and self._take_lead()

    def _renew_term(self, now: float) -> None:
        """Start a new term if others obey a higher one and nobody is heard to lead in it.

        The wait doubles each time. Otherwise two leaders that the others hear, but not each other, would take
        turns.
        """
        self._outranked_s = min(self._outranked_s, now) if self.highest > self.term else math.inf
        if now - self._outranked_s >= VACANT_S * 2.0**self._renewals and self._take_lead():
            self._renewals = min(self._renewals + 1, MOST_RENEWALS)

    def _is_gone(self, now: float) -> bool:
        """Check whether the leader has been silent or unsteered for too long, with this deputy's stagger."""
        absent_s = now - self._heard_s
        before = self._order[: self._order.index(self._name)]
        wait_s = STAGGER_S * sum(1 for one in before if one != self.holder)
        silence_s = self._silence_s + wait_s
        # While no other vehicle is heard either, silence says nothing about the leader.
        works = now - self._others_s <= WORKS_S and self._others_s > self._heard_s + LATER_S
        silent_s = min(absent_s, now - self._works_since) if works else 0.0
        silent = silent_s >= silence_s or absent_s >= DEAF_S + silence_s
        left = self._steered and now - self._unsteered_s >= UNSTEERED_S + wait_s
        return left or (silent and self.was_heard)

    def _take_lead(self) -> bool:
        """Lead in the next own term; return False if there is none left."""
        term = term_above(self.highest, self._name, self._order)
        if term > GREATEST_TERM:
            return False
        self.term = self.highest = term
        self.listens = False
        self._unsteered_s = self._outranked_s = math.inf
        return True


PASSED_S = 2.0 * SAME_S
"""Time added to the last state at shutdown, s, so that others take it for a newer one."""


RoleMaker = Callable[[FlightPlan, SharedClock, Arrangements, Alerts], Role]
"""Factory of a vehicle's role."""


class SuccessionRole(Role):
    """Role of a vehicle in a formation with deputies: leader, follower, or deputy in the lead."""

    def __init__(
        self,
        plan: FlightPlan,
        lead: LeadPlan,
        clock: SharedClock,
        arrangements: Arrangements,
        alerts: Alerts | None = None,
    ) -> None:
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
        """Use another response of the same vehicle in both parts."""
        if self._leader_role is not None:
            self._leader_role.retune(plan)
        self._follower_role.retune(replace(plan, task=self._plan.task))

    @property
    def leadership(self) -> tuple[str, int]:
        """Name of the vehicle that leads, as far as known, and its term."""
        return self._succession.holder, self._succession.term

    @property
    def lead(self) -> Lead | None:
        """Term and motion by which this vehicle leads; None if it does not."""
        if not self._succession.leads or self._last is None:
            return None
        return Lead(term=self._succession.term, motion=self._last[0])

    @property
    def counters(self) -> Counter[str]:
        """States that were not used, by reason."""
        return self._counters + self._role.counters

    @property
    def _flies_path(self) -> bool:
        """Whether this vehicle is the leader that the slots refer to."""
        return self._leader_role is not None and (
            self._succession.listens
            or (self._succession.leads and not self._follower_role.followed.stands_in)
        )

    @property
    def _role(self) -> LeaderRole | FollowerRole:
        leads = self._leader_role if self._flies_path else None
        return leads or self._follower_role

    def step(self, navigated: NavigatedState, mode: Mode) -> RoleStep:
        """Perform a step of the part in force, and publish the lead while leading in a later term."""
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
        """Return an encoded state of the leader as this vehicle predicts it; None while not known."""
        if self._last is None:
            return None
        motion, _ = self._last
        time_s = self._clock.from_own(motion.time_s)
        if not math.isfinite(time_s):
            return None
        latitude, longitude = self._frame.to_geodetic(motion.north, motion.east)
        # The height is NaN if the leader's last altitude was doubted.
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
        """Return last states that report this vehicle as unsteered, so that no deputy has to wait."""
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
        """Process a state of the mission's leader, which leads in term 0.

        A leader counts as heard only if its states are flown by: one with impossible states counts as silent.
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
        """Process a state by which another vehicle leads."""
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
        """Check whether the time of a state is known; before that, it only shows that a leader exists."""
        return math.isfinite(self._clock.to_own(state.time_s))

    def _read(self, data: bytes, *, leads: bool) -> HeardState | None:
        """Return a decoded state; None if it is malformed or of another kind than sent as."""
        if is_leaders(data) is leads:
            try:
                return motion_of(data, self._frame)
            except LinkDataError:
                pass
        self._counters["malformed"] += 1
        return None

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Process a state of another follower."""
        state = self._read(data, leads=False)
        if state is not None:
            self._succession.hear_other(state.term, now)
        for role in (self._leader_role, self._follower_role):
            if role is not None:
                role.receive_neighbour(vehicle, data, now)

    def receive_traffic(self, report: TrafficReport, now: float) -> None:
        """Process the own autopilot's report of an aircraft outside the formation."""
        for role in (self._leader_role, self._follower_role):
            if role is not None:
                role.receive_traffic(report, now)

    def unheard(self) -> list[str]:
        """Return the names of other followers that were never heard; empty for the leader."""
        return [] if self._flies_path else self._follower_role.unheard()

    def lose_link(self, now: float) -> None:
        """Note that the link is down."""
        for role in (self._leader_role, self._follower_role):
            if role is not None:
                role.lose_link(now)

    def to_leader(self, now: float) -> bytes:
        """Return no data: every leader here has a companion."""
        del now
        return b""

    def leader_age(self, now: float) -> float:
        """Return the age of the newest leader state, s; infinite while the leader is unknown."""
        if self._succession.listens:
            return math.inf
        return self._role.leader_age(now)

    def _tell(self) -> None:
        """Announce a change of leader."""
        succession = self._succession
        if succession.term == self._told:
            return
        self._told = succession.term
        whose = succession.holder
        if not succession.leads:
            text = f"{whose} leads the formation now: nothing to do"
        elif whose == self._leader_name:
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
    """Return the role that a plan asks for."""
    task = plan.task
    arrangements = arrangements or Arrangements(plan, clock)
    if plan.lead is not None:
        return SuccessionRole(plan, plan.lead, clock, arrangements, alerts)
    if isinstance(task, LeaderTask):
        return LeaderRole(plan, task, clock, arrangements, alerts=alerts)
    return FollowerRole(plan, task, clock, arrangements, alerts=alerts)
