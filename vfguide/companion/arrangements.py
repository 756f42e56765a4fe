"""The arrangement that a companion flies by: ordered, agreed on by all, flown by all from one moment on.

An order comes in two phases, as a transaction does (Gray, "Notes on data base operating systems", 1978). Each
companion looks at it by its own limits and says yes or why not, again and again. Once all have said yes, or
shortly before its time those whose slots move and most of the others, the leader's states carry its number:
from then on it is certain, and at its time all slots begin to move. Without these answers it is void, and
everybody says so. What an operator calls off is flown at once, without answers.

A companion that has missed an arrangement, because it was started anew, hears of it by the number that others
fly by. It steers by no slot until one of them has repeated the order, as the operator has signed it in this
flight. That order passes the limits of a fresh one.
"""

import math
from collections import Counter
from collections.abc import Callable

from msgspec.structs import replace

from vfguide.companion.alerts import Alerts
from vfguide.companion.order_limits import (
    age_objection,
    ceiling_objection,
    circle_objection,
    climb_objection,
    joining_objection,
    lead_objection,
    nearness_objection,
    path_objection,
    slot_objection,
    time_objection,
)
from vfguide.companion.ordered_flight import KnownOrder, OrderedFlight, leader_name
from vfguide.companion.plan import FlightPlan
from vfguide.companion.timing import SharedClock
from vfguide.formation.arrangement import (
    Arrangement,
    Manoeuvre,
    agreed_number,
    arrangement_in_words,
    missing_votes,
)
from vfguide.guidance.height import stopping_way
from vfguide.guidance.path import Path, PathPoint
from vfguide.link.codec import LinkDataError
from vfguide.link.order_codec import (
    Reply,
    Verdict,
    check_of,
    decode_order,
    decode_reply,
    encode_reply,
)
from vfguide.mavlink.announcements import INFO, WARNING
from vfguide.state import HeardState, LeaderState

REPLY_S = 0.25
"""Between two answers to an order that is not decided yet."""

SETTLE_S = 0.5
"""The leader decides this long before an order's time at the latest: two copies of its word may be lost."""

LATE_DECISION_S = 30.0
"""For so long after its time an order that this companion has agreed to may turn out to be flown."""

NO_TIME_S = 1e-3
"""Less than this is what numbers are rounded by."""

HEARD_S = 5.0
"""Who was heard by so much earlier flies by what it said then."""

ECHO_S = 2.0
"""So long after the leader has confirmed an order, states of others that do not carry its number tell that
nobody hears it."""

VOTE_S = 1.0
"""So long before an order's time a majority decides, however silent the others are."""

STARTED_S = 20.0
"""For so long after its start a companion waits for an order of which a single voice tells."""

REPEAT_S, REPEAT_RANK_S = 1.0, 0.3
"""Between two repetitions of an order, and how much longer each rank waits with the first."""

APPOINTED_S = 1.0
"""Who is to lead by an order, and is not steered by its companion for so long, does not."""

RATE_S = 0.1
"""Over this long the climb rate of the leader's height is looked at, with which a hold begins."""

PATIENCE_S = 3.0
"""An order that is known to be flown and was not repeated for so long is worth a text."""

ROUTE_ENDED = "the route is at its end: its flight is over"
"""Why nothing is steered any more."""

CALLED_OFF = "everything was called off: no order brings the formation back, restart all companions"
"""Why no order but another abort is taken up any more."""


class Arrangements:
    """What one companion knows of the orders of its formation."""

    leader_height: Callable[[float], float] | None
    """Height of the leader in so many seconds, m above the origin; None while it is not known."""

    def __init__(self, plan: FlightPlan, clock: SharedClock, alerts: Alerts | None = None) -> None:
        """Begin with the slots of the mission.

        Args:
            plan: of this vehicle.
            clock: that the formation shares: orders are timed by it.
            alerts: takes what people should know.
        """
        self._plan = plan
        self._clock = clock
        self._names = {plan.name, *(one.name for one in plan.others)}
        self._leader = leader_name(plan)
        self.flight = OrderedFlight(plan, clock)
        """By what is ordered."""
        self.coordinator = plan.timekeeper if plan.foreign_leader is not None else self._leader
        """Who decides whether an order is flown: the leader, or the deputy in its place.

        Behind a leader without a companion it is the first follower, whose clock counts.
        """
        self.joining_m = 0.0
        """How far this vehicle is from the slot that it is to come to, m; 0 in it, and flown by its pilot."""
        self.leader_height = None
        self.leader: LeaderState | None = None
        """How the leader moves, times on the own clock; None while it is not known."""
        self._next: KnownOrder | None = None
        self._appointed, self._appointed_s = "", -math.inf
        self._returned = self._moving = False
        self._last_up: float | None = None
        self._refused: tuple[KnownOrder, str] | None = None
        self._answers: dict[str, Reply] = {}
        self._numbers: dict[str, tuple[int, bool, float]] = {}
        self._heard_number = self._missed = 0
        self._places: dict[str, tuple[float, float]] = {}
        self._older: dict[str, float] = {}
        self._replied_s = self._repeated_s = -math.inf
        self._waits_since = math.inf
        self._started_s = math.nan
        self._complained = False
        self._replies: list[bytes] = []
        self._repeats: list[bytes] = []
        self._alerts = alerts or Alerts()
        self.counters: Counter[str] = Counter()
        """Orders and answers that were not used, by reason."""

    @property
    def number(self) -> int:
        """Of what is flown or is certain to be: what the own states carry.

        While an earlier one is missed it is that of what is flown: the others repeat the missed one then.
        """
        if self._next is not None and self._next.confirmed and self.flight.number >= self._missed:
            return self._next.arrangement.number
        return self.flight.number

    def awaits(self, number: int) -> bool:
        """Whether an order was agreed to here, and has not begun."""
        return self._next is not None and self._next.arrangement.number == number

    def leads_by_order(self, now: float) -> bool:
        """Whether this vehicle is to lead by an order that has just begun."""
        return self._appointed == self._plan.name and now <= self._appointed_s + APPOINTED_S

    def waits(self, now: float) -> bool:
        """Whether others fly by an arrangement that this companion does not know."""
        self._note_missed(now)
        if self.flight.number >= self._missed:
            self._waits_since, self._complained = math.inf, False
            return False
        self._waits_since = min(self._waits_since, now)
        if now - self._waits_since > PATIENCE_S and not self._complained:
            self._complained = True
            self._say(
                f"the others fly by order {self._missed}, which this companion has not heard:"
                " it does not steer; give the order again",
                warning=True,
            )
        return True

    def _note_missed(self, now: float) -> None:
        """Note which order others go by, and which one of them is missed here; 0 where none is.

        An order that was missed stays so while a later one is expected, until that is flown.
        """
        newest, order = self.flight.number, self._next
        if self._heard_number > newest:
            newest = self._newest(now, lone=now < self._started_s + STARTED_S)
        later = order is not None and order.arrangement.number >= newest
        if order is not None and later and self._is_expected(order, now):
            missed = min(self._missed, newest)
            self._missed = 0 if missed == order.arrangement.number else missed
        else:
            self._missed = newest

    def _is_expected(self, order: KnownOrder, now: float) -> bool:
        """Whether an order that was agreed to is certain, or its time has not come."""
        return bool(order.confirmed) or self.flight.time_of(order, now) < order.arrangement.time_s

    def _newest(self, now: float, *, lone: bool = True) -> int:
        """Number of the newest order that the others fly by, or are about to.

        Args:
            now: s.
            lone: whether the only other vehicle of a formation of two is believed.
        """
        heard = {
            vehicle: number
            for vehicle, (number, _, time_s) in self._numbers.items()
            if vehicle != self._plan.name and now - time_s <= HEARD_S
        }
        return agreed_number(heard, self.coordinator, lone=lone and len(self._names) == 2)

    def _newest_flown(self, now: float) -> int:
        """Number of the newest order that counts as flown once it is heard as its operator signed it.

        Also the one that the mission's leader alone carries while a deputy leads: flown in another part.
        A number without an order stops nobody, see `_newest`.
        """
        said, _, heard_s = self._numbers.get(self._leader, (0, False, -math.inf))
        return max(self._newest(now), said if now - heard_s <= HEARD_S else 0)

    def obstacle(self, now: float) -> str | None:
        """What of the orders keeps this companion from steering, in words; None where nothing does."""
        if self.flight.is_over:
            return ROUTE_ENDED
        if self.flight.called_off is not None:
            return "everything was called off"
        if self.flight.has_left:
            return "ordered out of the formation"
        if self.waits(now):
            return "the others fly by an order that is not known to it: see that all are heard"
        return None

    def own_up(self, now: float) -> float:
        """Height of the own slot above the leader, m; once it is ordered to loiter the one it had then."""
        if self._last_up is not None:
            return self._last_up
        if self._plan.leads or self.coordinator == self._plan.name != self._plan.timekeeper:
            return 0.0
        height = self.flight.height(self._plan.name, now)
        return self._plan.up if height is None else height[0]

    def adopt(self, plan: FlightPlan) -> None:
        """Go by another plan of the same vehicle from now on."""
        self._plan = plan
        self.flight.adopt(plan)

    def watch_route(self, path: Path, point: PathPoint[float], *, steered: bool) -> None:
        """At the end of the route everybody goes back to the autopilot, for good; see `OrderedFlight`."""
        if self.flight.watch_route(path, point, steered=steered):
            self._moving = False
            self._say("the route is at its end: everybody back to the autopilot", warning=True)

    def returns_to_formation(self) -> bool:
        """Whether an order has just brought this vehicle back; asked once."""
        returned, self._returned = self._returned, False
        return returned

    def receive_order(
        self, data: bytes, signed: bytes, now: float, *, repeated: bool = False
    ) -> None:
        """Take an order that an operator has given.

        Args:
            data: the order.
            signed: how others can be told of it: as the operator has signed it.
            now: s, on one's own clock.
            repeated: whether another vehicle says it again. When it was given is not proven then, be it an
                order of an earlier flight: it counts only where it is what the others fly by.
        """
        try:
            order = decode_order(data)
        except LinkDataError:
            self.counters["order: malformed"] += 1
            return
        # What the others fly counts, whatever this companion has thought of it before.
        given = KnownOrder(order, signed, check_of(data))
        if self._is_missed(given, now):
            calls_off = order.flown is Manoeuvre.ABORT
            objection = None if calls_off else self._missed_objection(order)
            if objection is not None:
                if not self._is_known(given):
                    self._refuse(given, objection)
                return
            late_s = self.flight.shared_time(now) - order.time_s
            expected = self._next
            in_time = 0.0 <= late_s <= APPOINTED_S
            if expected is not None and expected.identity == given.identity and in_time:
                # Another copy of what begins at this very moment: nothing was missed, nor who is to lead.
                given = expected
            if late_s < 0.0:
                given.offset_s = math.inf
            self._begin(given, now)
        elif repeated:
            self.counters["order: repeated, and not what the others fly by"] += 1
        elif not self._is_known(given):
            self._consider(given, now)

    def _consider(self, given: KnownOrder, now: float) -> None:
        """Agree to an order, or refuse it; fly it at once where it calls everything off."""
        order = given.arrangement
        calls_off = order.flown is Manoeuvre.ABORT
        if order.number <= self.number and not calls_off:
            self.counters["order: not newer"] += 1
            return
        if order.number <= self.number and self.flight.has_aborted:
            self._reply(given, Verdict.FLOWN)
            return
        objection = (
            age_objection(order, self._clock.from_own(now))
            if calls_off
            else self._objection(order, now)
        )
        if objection is not None:
            self._refuse(given, objection)
            return
        if calls_off:
            self._call_off(given, now)
            return
        self._say(f"order {order.number} is understood: {arrangement_in_words(order)}")
        self._next, self._replied_s = given, -math.inf
        self._answers.clear()

    def _call_off(self, given: KnownOrder, now: float) -> None:
        """Fly an abort, whatever its number: of two operators one may not have heard of the other's order."""
        number = self.number
        self._begin(given, now)
        if number > given.arrangement.number:
            # By the greater number nobody repeats what was flown before; signed, the abort has another one.
            given.arrangement = replace(given.arrangement, number=number)
            given.signed = b""

    def receive_reply(self, vehicle: str, data: bytes, now: float) -> None:
        """Take another vehicle's answer to an order, or an operator's question for the one that is flown."""
        try:
            reply = decode_reply(data)
        except LinkDataError:
            self.counters["answer: malformed"] += 1
            return
        if reply.verdict is Verdict.UNKNOWN:
            self._note_older(vehicle, reply.number, now)
        elif self._next is None or reply.number != self._next.arrangement.number:
            return
        elif reply.check == self._next.check:
            self._answers[vehicle] = reply
        elif vehicle == self.coordinator and reply.verdict is not Verdict.REFUSED:
            # States carry the number alone: by it this one would seem to be confirmed.
            self._void(self._next, "the leader was given another order of this number")

    def hear(self, vehicle: str, state: HeardState | None, now: float) -> None:
        """Take the number that another vehicle flies by."""
        if state is None or vehicle not in self._names:
            return
        if math.isnan(self._started_s):
            self._started_s = now
        number = state.arrangement
        self._numbers[vehicle] = (number, state.steered, now)
        self._heard_number = max(self._heard_number, number)
        self._places[vehicle] = (state.north, state.east)
        order = self._next
        # Of a leader that is lost since it has decided two others tell: one alone may make that up.
        if order is not None and not order.confirmed:
            newest = self._newest(now, lone=False)
            order.confirmed = self.coordinator if newest == order.arrangement.number else ""
        self._note_older(vehicle, number, now)

    def step(self, now: float) -> None:
        """What is due by time alone."""
        self._note_missed(now)
        self._tell_of_rest(now)
        self._tell_of_lead(now)
        order = self._next
        if order is None:
            return
        time_s = self.flight.time_of(order, now)
        due_s = order.arrangement.time_s
        leads = self.coordinator == self._plan.name
        if leads and not order.confirmed:
            self._decide(order, time_s, now)
        if order.confirmed:
            self._carry_out(order, time_s, now)
        elif leads:
            if time_s >= due_s - SETTLE_S:
                self._void(order, self._missing(order, now, closing=True))
        elif time_s >= due_s + SETTLE_S and self._leader_is_heard(now):
            self._void(order, "the leader has not confirmed it")
        elif time_s >= due_s + LATE_DECISION_S:
            self._void(order, "the leader was not heard")
        if self._next is order and not order.confirmed and now - self._replied_s >= REPLY_S:
            self._replied_s = now
            self._reply(order, Verdict.READY)

    def _tell_of_rest(self, now: float) -> None:
        """Say once that what was ordered is carried out."""
        if self._moving and self.flight.order is not None and self.flight.left(now) <= 0.0:
            self._moving = False
            self._say(
                f"order {self.flight.order.arrangement.number} is carried out: all slots are at rest"
            )

    def _tell_of_lead(self, now: float) -> None:
        """Say once who leads where that is not who was to lead by an order: its pilot may have taken it."""
        if not self._appointed or now <= self._appointed_s + APPOINTED_S + SETTLE_S:
            return
        if self.coordinator != self._appointed:
            self._say(f"{self._appointed} does not lead: {self.coordinator} leads", warning=True)
        self._appointed = ""

    def to_say(self) -> tuple[list[bytes], list[bytes]]:
        """(answers, orders to be repeated as they were signed) since this was asked last."""
        said = self._replies, self._repeats
        self._replies, self._repeats = [], []
        return said

    def _is_known(self, given: KnownOrder) -> bool:
        """Whether an order of this number was taken already; it is answered again where that is not to come.

        Another order of the same number is refused: whoever flies by the number would not fly the same.
        """
        refused = None if self._refused is None else self._refused[0]
        for known in (self._next, self.flight.order, refused):
            if known is None or known.arrangement.number != given.arrangement.number:
                continue
            if known.check != given.check and given.arrangement.flown is Manoeuvre.ABORT:
                continue
            if known.check != given.check:
                self._reply(given, Verdict.REFUSED, "another order has this number: give it again")
            elif known is self.flight.order:
                self._reply(given, Verdict.FLOWN)
            elif self._refused is not None and known is refused:
                self._reply(given, Verdict.REFUSED, self._refused[1])
            return True
        return False

    def _is_missed(self, given: KnownOrder, now: float) -> bool:
        """Whether an order is one that others fly by already."""
        order = given.arrangement
        if self.flight.called_off is not None and order.flown is not Manoeuvre.ABORT:
            return False
        flying = order.number in (self._newest_flown(now), self._missed)
        due = order.flown is Manoeuvre.ABORT or given.begins(self.flight.shared_time(now))
        newer = self.flight.order is None or order.number > self.flight.order.arrangement.number
        return flying and due and newer

    def _begin(self, order: KnownOrder, now: float) -> None:
        """Fly by it from now on."""
        # Of an order that was missed it is not known who has led since.
        self._appointed = order.arrangement.lead if order is self._next else ""
        self._appointed_s = now
        had_left, last_up = self.flight.has_left, self.own_up(now)
        self.flight.begin(order)
        # Who loiters by it has no slot any more: an abort tells the mission's, not knowing the present ones.
        self._last_up = last_up if self.flight.has_left else None
        number, what = order.arrangement.number, order.arrangement.flown
        later = self._next is not None and self._next.arrangement.number > number
        if what is Manoeuvre.ABORT or not later:
            self._next = None
        self._returned, self._moving = had_left and not self.flight.has_left, False
        self._older.clear()
        self._reply(order, Verdict.FLOWN)
        if what is Manoeuvre.ABORT:
            self._say(f"order {number}: everybody back to the autopilot", warning=True)
        elif self.flight.has_left:
            self._say(f"order {number}: out of the formation, back to the autopilot", warning=True)
        else:
            self._say(
                f"order {number} is flown from now on: {arrangement_in_words(order.arrangement)}"
            )
            self._moving = self.flight.left(now) > 0.0

    def _void(self, order: KnownOrder, reason: str) -> None:
        self._next, self._refused = None, (order, reason)
        self._reply(order, Verdict.VOID, reason)
        self._say(
            f"order {order.arrangement.number} is void: {reason}; all fly on as before",
            warning=True,
        )

    def _refuse(self, order: KnownOrder, reason: str) -> None:
        self._refused = order, reason
        self._reply(order, Verdict.REFUSED, reason)
        text = f"order {order.arrangement.number} is refused: {reason}"
        self._alerts.say("refused order", WARNING, text, about="order")

    def _decide(self, order: KnownOrder, time_s: float, now: float) -> None:
        """As the leader: once enough have agreed in time, it is certain."""
        left_s = order.arrangement.time_s - time_s
        if left_s > SETTLE_S and not self._missing(order, now, closing=left_s <= VOTE_S):
            order.confirmed, order.confirmed_s = self.coordinator, now
            silent = self._missing(order, now, closing=False)
            agreed = f"most have agreed; {silent}" if silent else "all have agreed"
            self._say(f"order {order.arrangement.number}: {agreed}")

    def _missing(self, order: KnownOrder, now: float, *, closing: bool) -> str:
        """Whose consent an order lacks, in words; empty if it may be flown."""
        agreed = {name for name, one in self._answers.items() if one.verdict is Verdict.READY}
        steered = {name for name in self._numbers if self._steered(name, now)}
        lacking = missing_votes(
            order.arrangement, self._plan.name, agreed, steered, closing=closing
        )
        return ", ".join(self._said_no(vehicle) for vehicle in lacking)

    def _said_no(self, vehicle: str) -> str:
        """Why a vehicle has not agreed, in words."""
        reply = self._answers.get(vehicle)
        return f"{vehicle} does not answer" if reply is None else f"{vehicle}: {reply.text or 'no'}"

    def _carry_out(self, order: KnownOrder, time_s: float, now: float) -> None:
        """Begin a confirmed order at its time, unless others evidently do not fly by it."""
        numbers, leads = self._numbers, self.coordinator == self._plan.name
        told = {
            vehicle
            for vehicle, (number, _, heard_s) in numbers.items()
            if number >= order.arrangement.number and now - heard_s <= HEARD_S
        }
        asked = order.arrangement.vehicles | {order.arrangement.lead}
        unheard = leads and any(
            vehicle in asked and heard_s > order.confirmed_s + ECHO_S
            for vehicle, (_, _, heard_s) in numbers.items()
        )
        vouched_for = self.coordinator in told or bool(told - {order.confirmed})
        if not told and unheard:
            self._void(order, "nobody has heard that it is confirmed")
        elif time_s < order.arrangement.time_s:
            return
        elif self._leader_is_heard(now) and not vouched_for:
            # A leader that is lost since has told this vehicle alone, and not who leads now.
            self._void(order, "who leads now has not confirmed it")
        else:
            self._begin(order, now)

    def _leader_is_heard(self, now: float) -> bool:
        heard = self._numbers.get(self.coordinator)
        return heard is not None and now - heard[2] < SETTLE_S

    def _note_older(self, vehicle: str, number: int, now: float) -> None:
        """Repeat the order that is flown for a vehicle that does not know it, not all companions at once."""
        flown = self.flight.order
        if flown is None or number >= flown.arrangement.number:
            self._older.pop(vehicle, None)
            return
        since = self._older.setdefault(vehicle, now)
        patient = now - since >= REPEAT_RANK_S * (1 + self._plan.rank)
        if patient and now - self._repeated_s >= REPEAT_S and flown.signed:
            self._repeated_s = now
            self._repeats.append(flown.signed)

    def _objection(self, order: Arrangement, now: float) -> str | None:
        """Why this companion cannot carry out an order, in words; None if it can."""
        if self.flight.called_off is not None:
            return ROUTE_ENDED if self.flight.is_over else CALLED_OFF
        time_s = self._clock.from_own(now)
        if not math.isfinite(time_s):
            return "the formation's time is not known to this companion yet"
        if (objection := time_objection(order, time_s)) is not None:
            return objection
        if (objection := self._stranger_objection(order)) is not None:
            return objection
        if self._next is not None:
            return f"order {self._next.arrangement.number} is not decided yet"
        return (
            path_objection(order, self._plan)
            or lead_objection(order, self._plan, self._leader, self._steered(order.lead, now))
            or self._motion_objection(order, now)
        )

    def _stranger_objection(self, order: Arrangement) -> str | None:
        """Who is no follower of this formation, in words."""
        strangers = order.vehicles - self._names | order.vehicles & {self._leader}
        return (
            f"{', '.join(sorted(strangers))} is no follower of this formation"
            if strangers
            else None
        )

    def _place_objection(self, order: Arrangement) -> str | None:
        """Why slots or circle of an order cannot be flown, whenever it began."""
        if (objection := nearness_objection(order, self._leader)) is not None:
            return objection
        circle = self.flight.circle_of(order)
        if circle is None:
            return None
        places = self._places.values() if self._places else [(0.0, 0.0)]
        return circle_objection(circle, self._plan.airframe, places)

    def _missed_objection(self, order: Arrangement) -> str | None:
        """Why an order that others fly already cannot be flown, in words; None if it can."""
        place = order.place_of(self._plan.name)
        height = self._plan.height - self._plan.up
        if self.leader_height is not None and math.isfinite(told := self.leader_height(0.0)):
            height = told
        objection = (
            self._stranger_objection(order)
            or path_objection(order, self._plan)
            or self._place_objection(order)
            or ceiling_objection(order, place, self._plan, height, self.flight.ceiling)
        )
        if objection is not None or place is None:
            return objection
        return slot_objection(order, place, self._plan, None, height)

    def _motion_objection(self, order: Arrangement, now: float) -> str | None:
        """The same about how slots move."""
        left_s = self.flight.left(now) - (order.time_s - self._clock.from_own(now))
        if left_s > NO_TIME_S:
            return f"order {self.number} is still being carried out {left_s:.0f} s too long for it"
        if (objection := self._place_objection(order)) is not None:
            return objection
        circle = self.flight.circle_of(order)
        place = order.place_of(self._plan.name)
        ahead_s = order.time_s - self._clock.from_own(now)
        height = self._plan.height - self._plan.up
        if self.leader_height is not None:
            height = self.leader_height(ahead_s)
            if circle is not None:
                rate = (self.leader_height(ahead_s + RATE_S) - height) / RATE_S
                height += stopping_way(rate)
        objection = ceiling_objection(
            order, place, self._plan, height, self.flight.ceiling
        ) or climb_objection(order, self._plan, height, self.flight.chosen_path)
        if objection is not None or place is None:
            return objection
        objection = joining_objection(order, place, self.joining_m, self._leader)
        if objection is not None:
            return objection
        # Slots may still be on their way now, and at rest at its time.
        begin = self.flight.own_slot(now + ahead_s)
        return slot_objection(order, place, self._plan, begin, height)

    def _steered(self, vehicle: str, now: float) -> bool | None:
        """Whether a vehicle's companion steers it, by what it said last; None where it is not heard."""
        _, steered, time_s = self._numbers.get(vehicle, (0, False, -math.inf))
        return steered if now - time_s <= HEARD_S else None

    def _reply(self, order: KnownOrder, verdict: Verdict, text: str = "") -> None:
        number = order.arrangement.number
        reply = Reply(number=number, verdict=verdict, check=order.check, text=text)
        self._replies.append(encode_reply(reply))

    def _say(self, text: str, *, warning: bool = False) -> None:
        self._alerts.say("order", WARNING if warning else INFO, text, about="order")
