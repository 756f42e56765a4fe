"""Four companions' knowledge of orders, on a link in memory that loses what a test says."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tests.kit.missions import plan_of
from vfguide.companion.alerts import Alerts
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.plan import FlightPlan
from vfguide.companion.timing import SAME_CLOCK
from vfguide.formation.arrangement import Arrangement, HoldCircle, Manoeuvre, Point, SlotMove
from vfguide.formation.transition import MotionLimits
from vfguide.lab.order_desk import OrderDesk
from vfguide.link.codec import is_leaders
from vfguide.link.order_codec import ORDER_MAGIC, REPLY_MAGIC, Reply, decode_reply, encode_order
from vfguide.state import HeardState

NAMES = ("leader", "f1", "f2", "f3")


STEP_S = 0.05


Lost = Callable[[str, str, str, float], bool]
"""Whether something of a kind is lost from a sender to a receiver at a time."""


def nothing(kind: str, sender: str, receiver: str, now: float) -> bool:
    """A link that loses nothing."""
    del kind, sender, receiver, now
    return False


@dataclass
class Formation:
    """Four companions' knowledge of orders, on a link in memory."""

    plan: Callable[..., FlightPlan] = plan_of
    lost: Lost = nothing
    now: float = 0.0
    members: dict[str, Arrangements] = field(default_factory=dict)
    said: list[tuple[str, Reply]] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    silent: set[str] = field(default_factory=set)
    alerts: Alerts = field(default_factory=Alerts)

    def __post_init__(self) -> None:
        for name in NAMES:
            self.start(name)

    def start(self, name: str) -> None:
        """A companion that knows nothing yet."""
        self.members[name] = Arrangements(self.plan(vehicle=name), SAME_CLOCK, self.alerts)

    def give(self, order: Arrangement, *, until_s: float | None = None) -> None:
        """An operator's order, on its way to everybody; then go on until a time, if one is given."""
        data = encode_order(order)
        for name, member in self.members.items():
            if not self.lost("order", "operator", name, self.now):
                member.receive_order(data, data, self.now)
        if until_s is not None:
            self.run(until_s)

    def run(self, until_s: float) -> None:
        """Go on until then: states 20 times a second of the leader, 4 times of the others."""
        while self.now < until_s:
            self.now = round(self.now + STEP_S, 3)
            all_due = round(self.now / STEP_S) % 5 == 0
            for name, member in self.members.items():
                member.step(self.now)
                self.words += [one.text for one in self.alerts.heard(self.now)]
                replies, repeats = member.to_say()
                self.said += [(name, decode_reply(data)) for data in replies]
                due = all_due or name == "leader"
                if name not in self.silent and (due or replies or repeats):
                    state = heard(self.now, member.number) if due else None
                    self._carry(name, replies, repeats, state)

    def _carry(
        self, name: str, replies: list[bytes], repeats: list[bytes], state: HeardState | None
    ) -> None:
        """What a member says reaches those from whom it is not lost."""
        for other, receiver in self.members.items():
            if other == name:
                continue
            for data in replies:
                if not self.lost("reply", name, other, self.now):
                    receiver.receive_reply(name, data, self.now)
            for data in repeats:
                if not self.lost("repeat", name, other, self.now):
                    receiver.receive_order(data, data, self.now, repeated=True)
            if state is not None and not self.lost("state", name, other, self.now):
                receiver.hear(name, state, self.now)

    @property
    def flown(self) -> dict[str, int]:
        """Number of what each flies."""
        return {
            name: 0 if member.flight.flown is None else member.flight.flown.number
            for name, member in self.members.items()
        }


def overhear(desk: OrderDesk, sender: str, data: bytes) -> None:
    """Let an operator's program hear what somebody says."""
    if data.startswith(ORDER_MAGIC):
        desk.heard_order(data, data, repeated=True)
    elif data.startswith(REPLY_MAGIC):
        desk.heard_reply(sender, data)
    elif is_leaders(data):
        desk.heard_lead(sender, data)
    else:
        desk.heard_state(sender, data)


def heard(time_s: float, number: int) -> HeardState:
    """A state that carries this number; nothing else of it counts here."""
    return HeardState(
        time_s=time_s,
        north=0.0,
        east=0.0,
        course=0.0,
        ground_speed=20.0,
        acceleration=0.0,
        turn_rate=0.0,
        turn_acceleration=0.0,
        altitude_amsl=588.0,
        steered=True,
        arrangement=number,
    )


def slot_of(name: str) -> Point:
    """That of a follower in the mission, m."""
    slot = plan_of(vehicle=name).task.slot  # type: ignore[union-attr]
    return Point(slot.forward, slot.right)


SLOTS = {name: slot_of(name) for name in NAMES[1:]}
"""The mission's slots of its three followers."""


def begun(until_s: float = 5.0, **parts: Any) -> Formation:
    """Make a formation that has flown for a while; `parts` as of Formation."""
    formation = Formation(**parts)
    formation.run(until_s)
    return formation


def ordered(order: Arrangement, *, until_s: float, **parts: Any) -> Formation:
    """Make a formation that is given an order at 5 s, and has gone on until a time."""
    formation = begun(**parts)
    formation.give(order, until_s=until_s)
    return formation


def member_of(vehicle: str = "f1") -> Arrangements:
    """Make one companion's knowledge of orders, with nobody around it."""
    return Arrangements(plan_of(vehicle=vehicle), SAME_CLOCK)


def moves(ends: dict[str, Point], begins: dict[str, Point] | None = None) -> tuple[SlotMove, ...]:
    """Move vehicles from slots, the mission's if nothing is said, to others."""
    begins = SLOTS if begins is None else begins
    return tuple(SlotMove(vehicle=name, begin=begins[name], end=end) for name, end in ends.items())


def order_of(*places: SlotMove, **changes: Any) -> Arrangement:
    """Make order 1: from 10 s on, within 10 s, but for what is given."""
    fields: dict[str, Any] = {"number": 1, "time_s": 10.0, "across_s": 10.0, "places": places}
    return Arrangement(**(fields | changes))


def answered(member: Arrangements) -> list[Reply]:
    """Take what a companion answers."""
    return [decode_reply(data) for data in member.to_say()[0]]


def further(slots: dict[str, Point], *, number: int = 1, time_s: float = 10.0) -> Arrangement:
    """Everybody half as far again from the leader, within 10 s."""
    ends = {name: Point(1.5 * slot.forward, 1.5 * slot.right) for name, slot in slots.items()}
    return order_of(*moves(ends, slots), number=number, time_s=time_s)


def abort(*places: SlotMove, number: int = 4, time_s: float = 5.0) -> Arrangement:
    """Make an order that calls everything off."""
    return order_of(*places, number=number, time_s=time_s, flown=Manoeuvre.ABORT, across_s=0.0)


def called_off(*, number: int, time_s: float) -> bytes:
    """An order that calls everything off, in bytes."""
    return encode_order(abort(number=number, time_s=time_s))


VEE = {"f1": Point(-20.0, 20.0), "f2": Point(-20.0, -20.0), "f3": Point(-40.0, 40.0, 5.0)}
"""Slots of a mission: the second place of its vee on the left is nobody's."""

MOTION = MotionLimits(forward=5.0, back=4.0, aside=6.0, acceleration=1.0)
CIRCLE = HoldCircle(latitude_deg=47.0, longitude_deg=8.0, radius_m=200.0)
"""Where a hold is flown."""
