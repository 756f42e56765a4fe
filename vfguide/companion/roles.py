"""Who leads a formation, and the roles that a vehicle can have in it.

**Terms.** A term is a number that every state carries. The highest that was heard counts, as in Raft (Ongaro
and Ousterhout, "In Search of an Understandable Consensus Algorithm", USENIX ATC 2014, section 5). There is no
majority vote: a part of the formation that hears no others has to fly on, too. Instead each term belongs to
one vehicle from the outset. Those who may lead stand in an order of n: the mission's leader first, then its
deputies. Term 0 is the leader's. Of every n terms from there on each has one, the last in the order the
lowest. So no term has two leaders. After one succession in each of two parts, the part of the earlier deputy
has the higher term. Times come in; no clock is read.

**Roles.** With deputies a vehicle is leader, follower, or deputy in place of a lost leader. Every follower
predicts a silent leader along its path. The deputy goes on with that for as long as it takes and tells the
others, so that all predict the same. It remains a follower of that prediction, in its own slot. The mission's
leader, once it is back, is a follower, too, in a slot at its own place.
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
"""A deputy gives each who comes before it in the order so long to lead first: a message's way and some."""

UNSTEERED_S = 0.3
"""For so long a leader may say that its companion does not steer it."""

PATIENCE_S = 3.0
"""A leader that is not steered any more is carried on along its path for so long, since a deputy is about to
lead. If none can by then it is followed wherever it flies, as where there are no deputies."""

DEAF_S = 5.0
"""Who hears no vehicle at all is probably deaf itself. It flies on as predicted for so long, and then leads:
there may have been no other vehicle than the leader."""

WORKS_S = 0.6
"""The link works while another vehicle was heard this short a time ago."""

LATER_S = 0.3
"""Another that was heard by so much later than the leader shows that the link works without it."""

LISTEN_S = 1.5
"""A leader that has just started listens for so long: it may have been succeeded."""

VACANT_S = 3.0
"""A leader that hears for so long only that others obey a higher term, and not the vehicle that leads in it,
leads in a new one: that vehicle is gone, and who has heard it obeys no lower term any more."""

MOST_RENEWALS = 10
"""After so many it waits no longer each time: for some 50 minutes."""

GREATEST_TERM = 2**32 - 1

MOST_ROUNDS = 1_000
"""A state of any vehicle raises the terms that are known by at most so many rounds: a damaged or forged one
is not to use them all up, after which nobody could lead any more."""

LEADERS_ROUNDS = 1_000_000
"""The same of a leader's own. They are known where the leader was not heard for a long time, or never."""


def holder_of(term: int, order: tuple[str, ...]) -> str:
    """The vehicle whose a term is.

    Args:
        term: 0 or higher.
        order: who may lead, the mission's leader first.
    """
    if term == 0:
        return order[0]
    return order[-1 - (term - 1) % len(order)]


def term_above(highest: int, name: str, order: tuple[str, ...]) -> int:
    """The lowest term of a vehicle in the next round of terms.

    Args:
        highest: of all terms that it has heard of.
        name: of a vehicle in the order.
        order: who may lead, the mission's leader first.
    """
    rounds = -(-highest // len(order))
    return rounds * len(order) + len(order) - order.index(name)


class Succession:
    """One vehicle's view of who leads."""

    def __init__(self, name: str, order: tuple[str, ...], *, silence_s: float) -> None:
        """Know of the mission's leader only.

        Args:
            name: of the vehicle.
            order: who may lead, the mission's leader first; the vehicle need not be among them.
            silence_s: how long nothing may be heard of a leader (`timeouts.leader_s`).
        """
        self._name = name
        self._order = order
        self._silence_s = silence_s
        self.term = 0
        """Highest term of which a leader was heard, or one's own."""
        self.highest = 0
        """Highest term that any state has carried."""
        self.listens = name == order[0]
        """Whether this is the mission's leader, just started, and may have been succeeded."""
        self._began_s = self._unsteered_s = self._outranked_s = math.inf
        self._heard_s = self._others_s = self._works_since = -math.inf
        self._steered = False
        self._renewals = 0

    @property
    def holder(self) -> str:
        """The vehicle that leads, as far as is known."""
        return holder_of(self.term, self._order)

    @property
    def leads(self) -> bool:
        """Whether this vehicle leads."""
        return self.holder == self._name and not self.listens

    @property
    def was_heard(self) -> bool:
        """Whether a leader was heard: only it can be succeeded."""
        return math.isfinite(self._heard_s)

    def is_leaving(self, now: float) -> bool:
        """Whether the leader was steered by its companion, and is not any more since a short while."""
        return self._steered and 0.0 <= now - self._unsteered_s < PATIENCE_S

    def may_obey(self, vehicle: str, term: int) -> bool:
        """Whether a vehicle that says that it leads in a term is the one to be obeyed."""
        in_reach = self.term <= term <= self._reach(LEADERS_ROUNDS)
        return in_reach and self._holds(vehicle, term)

    def _holds(self, vehicle: str, term: int) -> bool:
        """Whether a term is that of another vehicle."""
        return vehicle != self._name and vehicle == holder_of(term, self._order)

    def _reach(self, rounds: int) -> int:
        """The highest term within so many rounds of terms from the one that is obeyed."""
        return self.term + rounds * len(self._order)

    def hear_leader(self, vehicle: str, term: int, now: float, *, steered: bool) -> bool:
        """Take notice of a leader's state.

        Args:
            vehicle: whose message it is.
            term: that it says it leads in.
            now: s.
            steered: whether its own companion steers it.

        Returns:
            Whether it is the one to be obeyed.
        """
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
        """Take notice of a state of any other vehicle, which obeys a leader of this term."""
        # Who has just started knows of no term, and learns it from others.
        rounds = LEADERS_ROUNDS // 2 if self.listens else MOST_ROUNDS
        self._hear(term if term <= self._reach(rounds) else 0, now)

    def _hear(self, term: int, now: float) -> None:
        if now - self._others_s > WORKS_S:
            self._works_since = now
        self._others_s, self.highest = now, max(self.highest, term)

    def step(self, now: float, *, eligible: bool, ordered: bool = False) -> bool:
        """Let time pass.

        Args:
            now: s.
            eligible: whether the own companion steers this vehicle.
            ordered: whether this vehicle is to lead now, whoever leads.

        Returns:
            Whether this vehicle leads from now on, and did not before.
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
        """Whether a leader that has just started leads now."""
        self._began_s = min(self._began_s, now)
        if self.highest == 0 and now - self._began_s >= LISTEN_S:
            self.listens = False
            return True
        return now - self._began_s >= VACANT_S and self._take_lead()

    def _renew_term(self, now: float) -> None:
        """Lead on in a new term, if others obey a higher one and nobody is heard to lead in it.

        Each time twice as late: two leaders that do not hear each other, and whom others hear, are not to
        take turns.
        """
        self._outranked_s = min(self._outranked_s, now) if self.highest > self.term else math.inf
        if now - self._outranked_s >= VACANT_S * 2.0**self._renewals and self._take_lead():
            self._renewals = min(self._renewals + 1, MOST_RENEWALS)

    def _is_gone(self, now: float) -> bool:
        """Whether the leader has been silent, or not steered, for too long for this vehicle's turn."""
        absent_s = now - self._heard_s
        before = self._order[: self._order.index(self._name)]
        wait_s = STAGGER_S * sum(1 for one in before if one != self.holder)
        silence_s = self._silence_s + wait_s
        # While no other vehicle is heard either, silence says nothing of the leader.
        works = now - self._others_s <= WORKS_S and self._others_s > self._heard_s + LATER_S
        silent_s = min(absent_s, now - self._works_since) if works else 0.0
        silent = silent_s >= silence_s or absent_s >= DEAF_S + silence_s
        left = self._steered and now - self._unsteered_s >= UNSTEERED_S + wait_s
        return left or (silent and self.was_heard)

    def _take_lead(self) -> bool:
        """Lead in a term of one's own above all that were heard of; not where there is none left."""
        term = term_above(self.highest, self._name, self._order)
        if term > GREATEST_TERM:
            return False
        self.term = self.highest = term
        self.listens = False
        self._unsteered_s = self._outranked_s = math.inf
        return True


PASSED_S = 2.0 * SAME_S
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
    """The part that a plan asks for, in a formation that shares this clock and these arrangements."""
    task = plan.task
    arrangements = arrangements or Arrangements(plan, clock)
    if plan.lead is not None:
        return SuccessionRole(plan, plan.lead, clock, arrangements, alerts)
    if isinstance(task, LeaderTask):
        return LeaderRole(plan, task, clock, arrangements, alerts=alerts)
    return FollowerRole(plan, task, clock, arrangements, alerts=alerts)
