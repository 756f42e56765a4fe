"""How near any two come in random orders, successions, losses and attacks, through MAVLink and link bytes.

Each flight has 4 to 6 aircraft along a circle, a line or a route of waypoints in the article's wind, and a
dozen orders: shapes, spacings, swaps, slots, leave and join, hold and resume, another path, another leader.
In every eighth a companion dies, mostly the leader's, and comes back within 20 s. In every fourth somebody
attacks with a member's key for some seconds, in a form of `tests.benchmarks.insiders`. An order is worked out
by the operator's program from what it hears (`vfguide.lab.order_desk.OrderDesk`) and given where that accepts
it. It fails if anybody flies what nobody ordered.

`python -m tests.benchmarks.random_orders NUMBER ...` tells of single flights.
"""

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from random import Random

import numpy as np
from msgspec.structs import replace

from tests.benchmarks.insiders import Insider, drawn_attack, strays
from tests.benchmarks.orders import LINE, mission_of
from tests.benchmarks.results import Cases
from tests.kit.figures import tell
from tests.kit.missions import replaced
from tests.kit.orders import overhear
from tests.kit.signed_flight import SignedFlight
from vfguide.errors import VfguideError
from vfguide.formation.arrangement import SHAPES, Arrangement, Manoeuvre, Point
from vfguide.formation.orders import EPOCH_S, Formation, Order, new_number
from vfguide.lab.console.orders import order_in_words
from vfguide.lab.order_desk import OrderDesk
from vfguide.lab.ordering import DECIDED
from vfguide.lab.report.figures import pair_separations
from vfguide.link.codec import Kind
from vfguide.link.order_codec import check_of, encode_order
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import resolve
from vfguide.mission.rehearsal import Loss

RATE_HZ = 20.0
LEAD_S = 6.0
"""From when an order is given to its time, as `vfguide order` does."""
REPEAT_S = 0.5
ANSWERS_S = 6.0
"""Answers are awaited for so long after an order's time."""
FIRST_S = 15.0
"""Everybody is in its slot by then."""
AGAIN_S = 2.0
"""After an order that was refused the next one is drawn."""
LONGEST_S = 150.0
"""A flight takes no longer than this for each order."""
PER_FLIGHT, FLIGHTS = 12, 84
KILLED, ATTACKED = 1.0 / 8.0, 1.0 / 4.0
"""Shares of orders in which a companion dies, and in which somebody attacks."""
SHAKEN_S = 45.0
"""So long after a companion has come back, or an attack, what happens is put down to that."""

CIRCLE = {"type": "circle", "centre": {"north_m": 300, "east_m": 0}, "radius_m": 300, "gain": 0.015}
CORNERS = ((0, 0), (1500, 0), (1500, 1200), (0, 1200))
ROUTE = {
    "type": "waypoints",
    "end": "repeat",
    "waypoints": [{"north_m": north, "east_m": east} for north, east in CORNERS],
}
PATHS = {"circle": CIRCLE, "line": LINE, "waypoints": ROUTE}


@dataclass(slots=True)
class Given:
    """An order that was given, and what became of it."""

    name: str
    arrangement: Arrangement
    data: bytes
    awaited: frozenset[str]
    flown: bool | None = None
    """Whether it was carried out; None while that is not decided."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a flight came to."""

    number: int
    orders: int
    carried_out: int
    refused: int
    """Orders that were not given: the operator's program saw that they cannot be flown."""
    killed: int
    attacked: int
    nearest_m: float
    words: str
    """The nearest two, when, and what happened before."""
    strays: tuple[str, ...]
    """Who flew what nobody ordered."""


def drawn_mission(random: Random) -> Mission:
    """A formation of 4 to 6 aircraft that may order another path and another leader."""
    name = random.choice(list(PATHS))
    formation = mission_of(random.randint(3, 5), {})
    return replaced(
        formation,
        name=f"random-{name}",
        path=PATHS[name],
        paths={other: shape for other, shape in PATHS.items() if other != name},
        deputies=["f1", "f2"],
        rehearsal={"link_delay_s": 0.1, "rate_hz": RATE_HZ, "seed": random.randrange(10**6)},
    )


def drawn_order(  # noqa: C901, PLR0911 - one case for each kind
    formation: Formation, random: Random
) -> Order:
    """Draw an order that may or may not be possible."""
    here = list(formation.slots)
    away = [name for name in formation.home if name not in here]
    shape, spacing = random.choice(SHAPES), float(random.randint(10, 30))
    kinds = ["shape"] * 6 + ["spacing"] * 2 + ["swap"] * 3 + ["slot", "path", "lead", "lead"]
    kinds += ["leave"] * 2 if len(here) > 2 else []
    kinds += ["join"] * 4 if away else []
    kinds += ["resume"] * 6 if formation.flown is Manoeuvre.HOLD else ["hold"]
    match random.choice(kinds):
        case "spacing":
            return Order(spacing=spacing)
        case "swap" if len(here) > 1:
            first, second = random.sample(here, 2)
            return Order(swap=(first, second))
        case "slot":
            one = random.choice(here)
            point = Point(float(random.randint(-60, 0)), float(random.randint(-50, 50)))
            return Order(slots={one: point})
        case "path":
            return Order(
                path=random.choice([one for one in formation.paths if one != formation.path])
            )
        case "lead":
            return Order(
                lead=random.choice([one for one in formation.may_lead if one != formation.leads])
            )
        case "leave":
            return Order(leave=(random.choice(here),))
        case "join":
            join = (random.choice(away),)
            if random.random() < 0.5:
                return Order(join=join)
            return Order(join=join, shape=shape, spacing=spacing)
        case "hold":
            return Order(action="hold")
        case "resume":
            return Order(action="resume")
        case _:
            return Order(shape=shape, spacing=spacing)


class Sortie:
    """One flight, and its operator."""

    def __init__(self, random: Random) -> None:
        """Put everybody into the air."""
        self.random, self.refused = random, 0
        self.mission = drawn_mission(random)
        self.flight = SignedFlight(self.mission)
        self.names, self.aircraft = self.flight.names, self.flight.aircraft
        self.now = 0.0
        self.desk = OrderDesk(self.mission, clock=lambda: self.now)
        self.given: list[Given] = []
        self.losses: list[Loss] = []
        self.attacks: list[tuple[float, float, Insider]] = []
        self.strays: list[str] = []
        self._ordered = set[tuple[int, int]]()
        self._next_s = FIRST_S
        self._said_s = -math.inf
        self._kill: tuple[float, float] | None = None

    def fly(self) -> None:
        """Fly until all orders were given and have been carried out."""
        end_s = FIRST_S + LONGEST_S * PER_FLIGHT
        while self.now < end_s and not self.is_over:
            self.step()
            self.operate()
            self.kill()
            self.attack()

    @property
    def is_over(self) -> bool:
        """Whether all orders were given, and all slots are at rest."""
        decided = len(self.given) == PER_FLIGHT and self.given[-1].flown is not None
        return decided and self.now >= self._next_s + LEAD_S

    def step(self) -> None:
        """One turn of everybody."""
        order = self.given[-1] if self.given else None
        if order is not None and order.flown is None and self.now >= self._said_s + REPEAT_S:
            self._said_s = self.now
            self.flight.operator.member.say(Kind.ORDER, order.data)
        heard = self.flight.step()
        self.now = self.flight.now
        for sender, data in heard:
            overhear(self.desk, sender, data)
        for name, text in strays(self.flight, self._ordered).items():
            self.strays.append(f"{text}; {self.order_at(self.now)}")
            # Told once.
            self._ordered.add(self.aircraft[name].companion._arrangements.flight.order.identity)  # noqa: SLF001

    def operate(self) -> None:
        """See what becomes of the order that is given, and give the next one when its time has come."""
        if self.given and self.given[-1].flown is None:
            self.judge(self.given[-1])
        elif self.now >= self._next_s and len(self.given) < PER_FLIGHT:
            self._next_s = self.now + AGAIN_S
            self.give()

    def give(self) -> None:
        """Draw an order, and give it where it is possible."""
        random, mission = self.random, self.mission
        time_s = self.now + LEAD_S
        try:
            formation = self.desk.formation()
            order = drawn_order(formation, random)
            place = self.desk.leader_place(time_s)
            number = new_number(self.desk.newest_number, EPOCH_S + self.now, random)
            found, _ = resolve(
                mission, order, formation, number=number, time_s=time_s, leader=place
            )
        except VfguideError:
            self.refused += 1
            return
        data = encode_order(found)
        awaited = frozenset(self.desk.awaited_from(formation, found))
        self.desk.given, self.desk.replies = (found.number, check_of(data)), {}
        self.desk.note_order(found)
        self._ordered.add(self.desk.given)
        self.given.append(Given(order_in_words(order), found, data, awaited))
        if random.random() < KILLED and not self.is_shaken(self.now):
            at_s = time_s + random.uniform(-LEAD_S, found.duration_s + 10.0)
            self._kill = at_s, random.uniform(3.0, 20.0)
        if random.random() < ATTACKED:
            self.draw_attack(found)

    def draw_attack(self, order: Arrangement) -> None:
        """Have somebody attack about an order's time."""
        random, flight = self.random, self.flight
        name, form = drawn_attack(flight, random)
        begin_s = max(order.time_s + random.uniform(-LEAD_S, 4.0), self.now)
        insider = Insider(flight, name, form, random)
        if form in {"old order", "old abort"}:
            # Of this formation, and of about now by its clock: all but the flight is right.
            number, time_s = order.number + 2**16, begin_s + random.choice((-5.0, 3.0))
            insider.record_earlier(replace(order, number=number, time_s=time_s))
        self.attacks.append((begin_s, begin_s + random.uniform(3.0, 12.0), insider))

    def attack(self) -> None:
        """Let insiders say what they say."""
        for begin_s, end_s, insider in self.attacks:
            if self.now >= end_s:
                insider.end()
            elif self.now >= begin_s:
                insider.begin()
                insider.step()

    def judge(self, order: Given) -> None:
        """Whether an order is decided, by all whose answers are awaited, or by the clock."""
        replies = self.desk.replies
        decided = {name: one for name, one in replies.items() if one.verdict in DECIDED}
        found = order.arrangement
        late = self.now > found.time_s + ANSWERS_S
        if not (late or order.awaited <= decided.keys()):
            return
        order.flown = self.desk.newest_number == found.number
        rest_s = max(found.time_s - self.now, 0.0) + (found.duration_s if order.flown else 0.0)
        self._next_s = self.now + rest_s + self.random.uniform(-LEAD_S, 20.0)

    def kill(self) -> None:
        """End a companion without a word when that is due, most often the one that leads."""
        if self._kill is None or self.now < self._kill[0]:
            return
        for_s = self._kill[1]
        self._kill = None
        leads = self.desk.leads
        name = leads if self.random.random() < 0.7 else self.random.choice(self.names)
        loss = Loss(vehicle=name, at_s=self.now, for_s=for_s)
        one = self.aircraft[name]
        one._losses, one._lost = (loss,), False  # noqa: SLF001
        self.losses.append(loss)

    def is_shaken(self, time_s: float) -> bool:
        """Whether a companion is lost at a time, or was shortly before."""
        lost = [(loss.at_s, loss.at_s + (loss.for_s or 0.0)) for loss in self.losses]
        attacked = [(begin_s, end_s) for begin_s, end_s, _ in self.attacks]
        return any(begin_s <= time_s <= end_s + SHAKEN_S for begin_s, end_s in lost + attacked)

    def order_at(self, time_s: float) -> str:
        """The order that was given last at a time, in words."""
        last = [one for one in self.given if one.arrangement.time_s <= time_s]
        if not last:
            return "before the first order"
        since_s = time_s - last[-1].arrangement.time_s
        lost = [
            f", {loss.vehicle}'s companion lost {time_s - loss.at_s:.0f} s before for {loss.for_s:.0f} s"
            for loss in self.losses
            if 0.0 <= time_s - loss.at_s <= (loss.for_s or 0.0) + SHAKEN_S
        ]
        lost += [
            f", {one.name}'s key: {one.form} {time_s - begin_s:.0f} s before"
            for begin_s, end_s, one in self.attacks
            if begin_s <= time_s <= end_s + SHAKEN_S
        ]
        return f"{since_s:.1f} s after `{last[-1].name}`{''.join(lost)}"

    def outcome(self, number: int) -> Outcome:
        """Judge what was flown."""
        record = self.flight.record()
        counts = record.time_s >= FIRST_S
        pairs = [
            (np.where(counts, one.distance_m, np.inf), one) for one in pair_separations(record)
        ]
        distance, pair = min(pairs, key=lambda one: one[0].min())
        time_s = float(record.time_s[distance.argmin()])
        return Outcome(
            number=number,
            orders=len(self.given),
            carried_out=sum(one.flown is True for one in self.given),
            refused=self.refused,
            killed=len(self.losses),
            attacked=len(self.attacks),
            nearest_m=float(distance.min()),
            words=f"{pair.first} and {pair.second} at {time_s:.1f} s, {self.order_at(time_s)}",
            strays=tuple(self.strays),
        )


def fly(number: int) -> Outcome:
    """Fly one, the same whenever it is flown."""
    sortie = Sortie(Random(f"1 {number}"))
    sortie.fly()
    return sortie.outcome(number)


def cases() -> Cases:
    """Fly them all, on all processors."""
    with ProcessPoolExecutor() as pool:
        outcomes = list(pool.map(fly, range(FLIGHTS)))
    for one in outcomes:
        if one.strays:
            raise SystemExit(f"flight {one.number}: nobody had ordered what {one.strays[0]}")
    sums = {
        name: sum(getattr(one, name) for one in outcomes)
        for name in ("orders", "carried_out", "refused", "killed", "attacked")
    }
    figures = {
        "flights": FLIGHTS,
        "void": sums["orders"] - sums["carried_out"],
        "nearest_m": min(one.nearest_m for one in outcomes),
    }
    yield f"seed 1, {sums['orders']} orders", sums | figures


def main() -> None:
    """Fly some by their numbers, and say what became of each."""
    for number in map(int, sys.argv[1:]):
        tell(fly(number))


if __name__ == "__main__":
    main()
