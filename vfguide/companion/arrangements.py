"""Agreement of the formation on orders: votes, decision, and the start at one common time.

An order has two phases like a transaction (Gray, "Notes on data base operating systems", 1978). Each
companion checks it against its own limits and repeatedly replies ready or refused. Once all have agreed, the
leader confirms the order by carrying its number in its states. Shortly before the order's time, the vehicles
whose slots move and a majority of the others suffice. All slots begin to move at the order's time. Without
these votes it is void, and all say so. An abort is flown at once, without votes.

A restarted companion learns of a missed order from the number in others' states. It steers to no slot until
one of them repeats the order, as the operator signed it in this flight. That order must pass the limits of a
new one.
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
"""Interval between replies to an order that is not yet decided, s."""

SETTLE_S = 0.5
"""Time before an order by which the leader decides at the latest, s: two of its states may be lost."""

LATE_DECISION_S = 30.0
"""Time after an order until which a companion that has agreed to it waits for the confirmation, s."""

NO_TIME_S = 1e-3
"""Rounding error of times, s."""

HEARD_S = 5.0
"""Time for which the last state of a vehicle counts, s."""

ECHO_S = 2.0
"""Time after the confirmation, s, from which states without its number show that nobody has heard it."""

VOTE_S = 1.0
"""Time before an order from which a majority decides, however silent the others are, s."""

STARTED_S = 20.0
"""Time after the first state heard in which an order known from a single other vehicle is waited for, s."""

REPEAT_S, REPEAT_RANK_S = 1.0, 0.3
"""Interval between repetitions of an order, and the delay of the first one per rank, s."""

APPOINTED_S = 1.0
"""Time in which the vehicle that an order appoints must take the lead, s."""

RATE_S = 0.1
"""Interval over which the leader's climb rate at the start of a hold is computed, s."""

PATIENCE_S = 3.0
"""Time without a repetition of a missed order after which the pilot is warned, s."""

ROUTE_ENDED = "the route is at its end: its flight is over"
"""Reason why the vehicle is no longer steered."""

CALLED_OFF = "everything was called off: no order brings the formation back, restart all companions"
"""Reason why only another abort is accepted."""


class Arrangements:
    """Orders of the formation as one companion knows them, timed by the formation's clock."""

    leader_height: Callable[[float], float] | None
    """Function from seconds ahead to the leader's height, m above the origin; None while not known."""

    def __init__(self, plan: FlightPlan, clock: SharedClock, alerts: Alerts | None = None) -> None:
        self._plan = plan
        self._clock = clock
        self._names = {plan.name, *(one.name for one in plan.others)}
        self._leader = leader_name(plan)
        self.flight = OrderedFlight(plan, clock)
        """Flight as orders have shaped it."""
        self.coordinator = plan.timekeeper if plan.foreign_leader is not None else self._leader
        """Name of the vehicle that decides on orders: the leader, or the deputy in its place.

        Behind a leader without a companion it is the first follower, which keeps the time.
        """
        self.joining_m = 0.0
        """Distance to the slot that is to be joined, m; 0 in the slot and under the pilot's control."""
        self.leader_height = None
        self.leader: LeaderState | None = None
        """Motion of the leader, times on the own clock; None while not known."""
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
        """Orders and replies that were not used, by reason."""

    @property
    def number(self) -> int:
        """Number in the own states: of a confirmed order, else of the one being flown.

        While an earlier order is missed it is the latter, so that others repeat the missed one.
        """
        if self._next is not None and self._next.confirmed and self.flight.number >= self._missed:
            return self._next.arrangement.number
        return self.flight.number

    def awaits(self, number: int) -> bool:
        """Check whether an order of this number was accepted here and has not begun."""
        return self._next is not None and self._next.arrangement.number == number

    def leads_by_order(self, now: float) -> bool:
        """Check whether this vehicle must take the lead by an order that has just begun."""
        return self._appointed == self._plan.name and now <= self._appointed_s + APPOINTED_S

    def waits(self, now: float) -> bool:
        """Check whether others fly by an order that this companion does not know."""
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
        """Note the newest order that others fly by and this companion has missed; 0 for none.

        A missed order stays missed until a later one that is expected is flown.
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
        """Check whether an accepted order is confirmed, or its time has not come."""
        return bool(order.confirmed) or self.flight.time_of(order, now) < order.arrangement.time_s

    def _newest(self, now: float, *, lone: bool = True) -> int:
        """Return the newest order number heard; `lone` believes the only other vehicle of a pair."""
        heard = {
            vehicle: number
            for vehicle, (number, _, time_s) in self._numbers.items()
            if vehicle != self._plan.name and now - time_s <= HEARD_S
        }
        return agreed_number(heard, self.coordinator, lone=lone and len(self._names) == 2)

    def _newest_flown(self, now: float) -> int:
        """Return the number of the newest order that may be flown once its signed copy is heard.

        While a deputy leads, a number that only the mission's leader carries counts too: another part flies
        by it. Without the order itself such a number stops nobody, see `_newest`.
        """
        said, _, heard_s = self._numbers.get(self._leader, (0, False, -math.inf))
        return max(self._newest(now), said if now - heard_s <= HEARD_S else 0)

    def obstacle(self, now: float) -> str | None:
        """Return the reason in the orders why this companion must not steer, or None."""
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
        """Return the height of the own slot above the leader, m; once ordered to loiter, its last value."""
        if self._last_up is not None:
            return self._last_up
        if self._plan.leads or self.coordinator == self._plan.name != self._plan.timekeeper:
            return 0.0
        height = self.flight.height(self._plan.name, now)
        return self._plan.up if height is None else height[0]

    def adopt(self, plan: FlightPlan) -> None:
        """Use another plan of the same vehicle from now on."""
        self._plan = plan
        self.flight.adopt(plan)

    def watch_route(self, path: Path, point: PathPoint[float], *, steered: bool) -> None:
        """Hand everybody back to the autopilot for good at the end of the route; see `OrderedFlight`."""
        if self.flight.watch_route(path, point, steered=steered):
            self._moving = False
            self._say("the route is at its end: everybody back to the autopilot", warning=True)

    def returns_to_formation(self) -> bool:
        """Check once whether an order has just brought this vehicle back."""
        returned, self._returned = self._returned, False
        return returned

    def receive_order(
        self, data: bytes, signed: bytes, now: float, *, repeated: bool = False
    ) -> None:
        """Process an encoded order; `signed` is the operator's signed copy, for repetition to others.

        An order `repeated` by another vehicle may be of an earlier flight: it counts only if the others fly
        by it.
        """
        try:
            order = decode_order(data)
        except LinkDataError:
            self.counters["order: malformed"] += 1
            return
        # An order that others already fly is accepted even if this companion has refused it before.
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
                # This copy arrives just as the order begins: nothing was missed, and the appointed leader is
                # known.
                given = expected
            if late_s < 0.0:
                given.offset_s = math.inf
            self._begin(given, now)
        elif repeated:
            self.counters["order: repeated, and not what the others fly by"] += 1
        elif not self._is_known(given):
            self._consider(given, now)

    def _consider(self, given: KnownOrder, now: float) -> None:
        """Accept or refuse an order; fly an abort at once."""
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
        """Fly an abort, whatever its number: one of two operators may not have heard of the other's order."""
        number = self.number
        self._begin(given, now)
        if number > given.arrangement.number:
            # The greater number keeps others from repeating the earlier order; the signed abort has another
            # number.
            given.arrangement = replace(given.arrangement, number=number)
            given.signed = b""

    def receive_reply(self, vehicle: str, data: bytes, now: float) -> None:
        """Process another vehicle's reply to an order, or an operator's query for the order being flown."""
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
            # States carry the number alone: the other order's number would seem to confirm this one.
            self._void(self._next, "the leader was given another order of this number")

    def hear(self, vehicle: str, state: HeardState | None, now: float) -> None:
        """Process a state of another vehicle for the number of the order that it flies by."""
        if state is None or vehicle not in self._names:
            return
        if math.isnan(self._started_s):
            self._started_s = now
        number = state.arrangement
        self._numbers[vehicle] = (number, state.steered, now)
        self._heard_number = max(self._heard_number, number)
        self._places[vehicle] = (state.north, state.east)
        order = self._next
        # Two others can vouch for a leader that was lost after its decision; one alone may make that up.
        if order is not None and not order.confirmed:
            newest = self._newest(now, lone=False)
            order.confirmed = self.coordinator if newest == order.arrangement.number else ""
        self._note_older(vehicle, number, now)

    def step(self, now: float) -> None:
        """Perform all actions that are due by time."""
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
        """Announce once that the order is carried out."""
        if self._moving and self.flight.order is not None and self.flight.left(now) <= 0.0:
            self._moving = False
            self._say(
                f"order {self.flight.order.arrangement.number} is carried out: all slots are at rest"
            )

    def _tell_of_lead(self, now: float) -> None:
        """Warn once if the appointed vehicle does not lead: its pilot may have taken control."""
        if not self._appointed or now <= self._appointed_s + APPOINTED_S + SETTLE_S:
            return
        if self.coordinator != self._appointed:
            self._say(f"{self._appointed} does not lead: {self.coordinator} leads", warning=True)
        self._appointed = ""

    def to_say(self) -> tuple[list[bytes], list[bytes]]:
        """Return the (replies, signed orders to repeat) that were queued since the last call."""
        said = self._replies, self._repeats
        self._replies, self._repeats = [], []
        return said

    def _is_known(self, given: KnownOrder) -> bool:
        """Check whether an order of this number is known; repeat its reply unless it is still undecided.

        Another order of the same number is refused: those who fly by the number would not fly the same.
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
        """Check whether others already fly by an order that this companion has missed."""
        order = given.arrangement
        if self.flight.called_off is not None and order.flown is not Manoeuvre.ABORT:
            return False
        flying = order.number in (self._newest_flown(now), self._missed)
        due = order.flown is Manoeuvre.ABORT or given.begins(self.flight.shared_time(now))
        newer = self.flight.order is None or order.number > self.flight.order.arrangement.number
        return flying and due and newer

    def _begin(self, order: KnownOrder, now: float) -> None:
        # After a missed order it is not known who has led since.
        self._appointed = order.arrangement.lead if order is self._next else ""
        self._appointed_s = now
        had_left, last_up = self.flight.has_left, self.own_up(now)
        self.flight.begin(order)
        # A loitering vehicle keeps the height that it had: an abort names the mission's slots, not the last
        # ones.
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
        """Confirm an order, as the leader, once enough vehicles have agreed in time."""
        left_s = order.arrangement.time_s - time_s
        if left_s > SETTLE_S and not self._missing(order, now, closing=left_s <= VOTE_S):
            order.confirmed, order.confirmed_s = self.coordinator, now
            silent = self._missing(order, now, closing=False)
            agreed = f"most have agreed; {silent}" if silent else "all have agreed"
            self._say(f"order {order.arrangement.number}: {agreed}")

    def _missing(self, order: KnownOrder, now: float, *, closing: bool) -> str:
        """Return text naming the vehicles whose consent an order lacks; empty if it may be flown."""
        agreed = {name for name, one in self._answers.items() if one.verdict is Verdict.READY}
        steered = {name for name in self._numbers if self._steered(name, now)}
        lacking = missing_votes(
            order.arrangement, self._plan.name, agreed, steered, closing=closing
        )
        return ", ".join(self._said_no(vehicle) for vehicle in lacking)

    def _said_no(self, vehicle: str) -> str:
        """Return text on why a vehicle has not agreed."""
        reply = self._answers.get(vehicle)
        return f"{vehicle} does not answer" if reply is None else f"{vehicle}: {reply.text or 'no'}"

    def _carry_out(self, order: KnownOrder, time_s: float, now: float) -> None:
        """Begin a confirmed order at its time, unless the others evidently do not fly by it."""
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
            # The lost leader has confirmed it to this vehicle alone, and the present leader does not know of
            # it.
            self._void(order, "who leads now has not confirmed it")
        else:
            self._begin(order, now)

    def _leader_is_heard(self, now: float) -> bool:
        heard = self._numbers.get(self.coordinator)
        return heard is not None and now - heard[2] < SETTLE_S

    def _note_older(self, vehicle: str, number: int, now: float) -> None:
        """Repeat the order being flown for a vehicle that does not know it, after a delay by rank."""
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
        """Return the reason why this companion cannot carry out an order, or None."""
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
        """Return text naming the vehicles of an order that are no followers of this formation, or None."""
        strangers = order.vehicles - self._names | order.vehicles & {self._leader}
        return (
            f"{', '.join(sorted(strangers))} is no follower of this formation"
            if strangers
            else None
        )

    def _place_objection(self, order: Arrangement) -> str | None:
        """Return why the slots or the circle of an order cannot be flown, whenever it begins, or None."""
        if (objection := nearness_objection(order, self._leader)) is not None:
            return objection
        circle = self.flight.circle_of(order)
        if circle is None:
            return None
        places = self._places.values() if self._places else [(0.0, 0.0)]
        return circle_objection(circle, self._plan.airframe, places)

    def _missed_objection(self, order: Arrangement) -> str | None:
        """Return the reason why an order that others already fly cannot be flown here, or None."""
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
        """Return the reason why the slot motions of an order cannot be flown, or None."""
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
        # Slots may still be moving now, and at rest at the order's time.
        begin = self.flight.own_slot(now + ahead_s)
        return slot_objection(order, place, self._plan, begin, height)

    def _steered(self, vehicle: str, now: float) -> bool | None:
        """Return whether a vehicle's companion last said that it steers; None if not heard."""
        _, steered, time_s = self._numbers.get(vehicle, (0, False, -math.inf))
        return steered if now - time_s <= HEARD_S else None

    def _reply(self, order: KnownOrder, verdict: Verdict, text: str = "") -> None:
        number = order.arrangement.number
        reply = Reply(number=number, verdict=verdict, check=order.check, text=text)
        self._replies.append(encode_reply(reply))

    def _say(self, text: str, *, warning: bool = False) -> None:
        self._alerts.say("order", WARNING if warning else INFO, text, about="order")
