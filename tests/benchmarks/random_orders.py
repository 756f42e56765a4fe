"""How near any two come in random orders, successions, losses and attacks, through MAVLink and link bytes.

Run with `.venv/bin/python -m tests.benchmarks.random_orders [--orders 1000] [--seed 1] [--first 0]`.
Each flight has 4 to 6 aircraft along a circle, a line or a route of waypoints in the article's wind, and a
dozen orders: shapes, spacings, swaps, slots, leave and join, hold and resume, another path, another leader.
In every eighth a companion dies, mostly the leader's, and comes back within 20 s. In every fourth somebody
attacks with a member's key for some seconds, in a form of `tests.benchmarks.insiders`. An order is worked out
by the operator's program from what it hears (`vfguide.lab.order_desk.OrderDesk`) and given where that accepts
it. Flight k of a seed is the same whatever is flown before it: --first begins with a later one. It fails if
anybody flies what nobody ordered.
"""

import argparse
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from random import Random

import numpy as np
from msgspec.structs import replace

from tests.benchmarks.insiders import Insider, drawn_attack, strays
from tests.benchmarks.orders import mission_of
from tests.benchmarks.results import append, row
from tests.kit.figures import tell
from tests.kit.missions import replaced
from tests.kit.orders import overhear
from tests.kit.signed_flight import SignedFlight
from vfguide.errors import VfguideError
from vfguide.formation.arrangement import SHAPES, Arrangement, Manoeuvre, Point
from vfguide.formation.orders import EPOCH_S, Formation, Order, new_number
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab.order_desk import OrderDesk
from vfguide.lab.ordering import DECIDED
from vfguide.lab.report.figures import pair_separations
from vfguide.link.codec import Kind
from vfguide.link.order_codec import Verdict, check_of, encode_order
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import resolve
from vfguide.mission.rehearsal import Loss
from vfguide.record.flight import FlightRecord

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
PER_FLIGHT = 12
KILLED, ATTACKED = 1.0 / 8.0, 1.0 / 4.0
"""Shares of orders in which a companion dies, and in which somebody attacks."""
SHAKEN_S = 45.0
"""So long after a companion has come back, or an attack, what happens is put down to that."""

CIRCLE = {"type": "circle", "centre": {"north_m": 300, "east_m": 0}, "radius_m": 300, "gain": 0.015}
LINE = {"type": "line", "point": {"north_m": 0, "east_m": 0}, "course_deg": 45, "gain": 0.03}
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
    verdict: Verdict | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Near:
    """The nearest two of a flight."""

    distance_m: float
    pair: str
    time_s: float
    order: str


@dataclass(slots=True)
class Tally:
    """What all flights came to."""

    carried_out: int = 0
    void: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    kinds: Counter[str] = field(default_factory=Counter)
    killed: int = 0
    attacks: Counter[str] = field(default_factory=Counter)
    strays: Counter[str] = field(default_factory=Counter)
    flights: int = 0
    flown_s: float = 0.0


def drawn_mission(random: Random) -> Mission:
    """A formation of 4 to 6 aircraft that may order another path and another leader."""
    name = random.choice(list(PATHS))
    formation = mission_of(random.randint(3, 5), "line")
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
) -> tuple[str, Order]:
    """(in words, as a whole) an order that may or may not be possible."""
    here = list(formation.slots)
    away = [name for name in formation.home if name not in here]
    shape, spacing = random.choice(SHAPES), float(random.randint(10, 30))
    kinds = ["shape"] * 6 + ["spacing"] * 2 + ["swap"] * 3 + ["slot", "path", "lead", "lead"]
    kinds += ["leave"] * 2 if len(here) > 2 else []
    kinds += ["join"] * 4 if away else []
    kinds += ["resume"] * 6 if formation.flown is Manoeuvre.HOLD else ["hold"]
    match random.choice(kinds):
        case "spacing":
            return f"spacing {spacing:g}", Order(spacing=spacing)
        case "swap" if len(here) > 1:
            first, second = random.sample(here, 2)
            return f"swap {first} {second}", Order(swap=(first, second))
        case "slot":
            one = random.choice(here)
            point = Point(float(random.randint(-60, 0)), float(random.randint(-50, 50)))
            text = f"slot {one}={point.forward:g},{point.right:g}"
            return text, Order(slots={one: point})
        case "path":
            path = random.choice([one for one in formation.paths if one != formation.path])
            return f"path {path}", Order(path=path)
        case "lead":
            lead = random.choice([one for one in formation.may_lead if one != formation.leads])
            return f"lead {lead}", Order(lead=lead)
        case "leave":
            one = random.choice(here)
            return f"leave {one}", Order(leave=(one,))
        case "join":
            one = random.choice(away)
            if random.random() < 0.5:
                return f"join {one}", Order(join=(one,))
            return f"join {one}, {shape} {spacing:g}", Order(
                join=(one,), shape=shape, spacing=spacing
            )
        case "hold":
            return "hold", Order(action="hold")
        case "resume":
            return "resume", Order(action="resume")
        case _:
            return f"{shape} {spacing:g}", Order(shape=shape, spacing=spacing)


class Sortie:
    """One flight, and its operator."""

    def __init__(self, random: Random, tally: Tally) -> None:
        """Put everybody into the air."""
        self.random, self.tally = random, tally
        self.mission = drawn_mission(random)
        self.flight = SignedFlight(self.mission)
        self.names, self.aircraft = self.flight.names, self.flight.aircraft
        self.now = 0.0
        self.desk = OrderDesk(self.mission, clock=lambda: self.now)
        self.given: list[Given] = []
        self.losses: list[Loss] = []
        self.attacks: list[tuple[float, float, Insider]] = []
        self._ordered = set[tuple[int, int]]()
        self._next_s = FIRST_S
        self._said_s = -math.inf
        self._kill: tuple[float, float] | None = None

    def fly(self, count: int) -> None:
        """Fly until so many orders were given and have been carried out."""
        end_s = FIRST_S + LONGEST_S * count
        while self.now < end_s and not self.is_over(count):
            self.step()
            self.operate(count)
            self.kill()
            self.attack()

    def is_over(self, count: int) -> bool:
        """Whether so many orders were given, and all slots are at rest."""
        decided = len(self.given) == count and self.given[-1].verdict is not None
        return decided and self.now >= self._next_s + LEAD_S

    def step(self) -> None:
        """One turn of everybody."""
        order = self.given[-1] if self.given else None
        if order is not None and order.verdict is None and self.now >= self._said_s + REPEAT_S:
            self._said_s = self.now
            self.flight.operator.member.say(Kind.ORDER, order.data)
        heard = self.flight.step()
        self.now = self.flight.now
        for sender, data in heard:
            overhear(self.desk, sender, data)
        for name, text in strays(self.flight, self._ordered).items():
            self.tally.strays[f"{text}; {self.order_at(self.now)}"] += 1
            # Told once.
            self._ordered.add(self.aircraft[name].companion._arrangements.flight.order.identity)  # noqa: SLF001

    def operate(self, count: int) -> None:
        """See what becomes of the order that is given, and give the next one when its time has come."""
        if self.given and self.given[-1].verdict is None:
            self.judge(self.given[-1])
        elif self.now >= self._next_s and len(self.given) < count:
            self._next_s = self.now + AGAIN_S
            self.give()

    def give(self) -> None:
        """Draw an order, and give it where it is possible."""
        tally, random, mission = self.tally, self.random, self.mission
        time_s = self.now + LEAD_S
        kind = ""
        try:
            formation = self.desk.formation()
            name, order = drawn_order(formation, random)
            kind = kind_of(name)
            place = self.desk.leader_place(time_s)
            number = new_number(self.desk.newest_number, EPOCH_S + self.now, random)
            found, _ = resolve(
                mission, order, formation, number=number, time_s=time_s, leader=place
            )
        except VfguideError as refusal:
            where = kind if isinstance(refusal, RefusedOrderError) else "desk"
            tally.refused[f"{where}: {reason_of(str(refusal))}"] += 1
            return
        data = encode_order(found)
        awaited = frozenset(self.desk.awaited_from(formation, found))
        self.desk.given, self.desk.replies = (found.number, check_of(data)), {}
        self.desk.note_order(found)
        self._ordered.add(self.desk.given)
        self.given.append(Given(name, found, data, awaited))
        tally.kinds[kind] += 1
        if random.random() < KILLED and not self.is_shaken(self.now):
            at_s = time_s + random.uniform(-LEAD_S, found.duration_s + 10.0)
            self._kill = at_s, random.uniform(3.0, 20.0)
        if random.random() < ATTACKED:
            self.draw_attack(found)

    def draw_attack(self, order: Arrangement) -> None:
        """Have somebody attack about an order's time."""
        random, flight = self.random, self.flight
        part, name, form = drawn_attack(flight, random)
        begin_s = max(order.time_s + random.uniform(-LEAD_S, 4.0), self.now)
        insider = Insider(flight, name, form, random)
        if form in {"old order", "old abort"}:
            # Of this formation, and of about now by its clock: all but the flight is right.
            number, time_s = order.number + 2**16, begin_s + random.choice((-5.0, 3.0))
            insider.record_earlier(replace(order, number=number, time_s=time_s))
        self.attacks.append((begin_s, begin_s + random.uniform(3.0, 12.0), insider))
        self.tally.attacks[f"{part}: {form}"] += 1

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
        flown = self.desk.newest_number == found.number
        order.verdict = Verdict.FLOWN if flown else Verdict.VOID
        rest_s = max(found.time_s - self.now, 0.0)
        if flown:
            self.tally.carried_out += 1
            rest_s += found.duration_s
        else:
            texts = sorted(reply.text for reply in decided.values() if reply.text)
            order.reason = reason_of(texts[0] if texts else "no answer")
            self.tally.void[order.reason] += 1
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
        self.tally.killed += 1

    def is_shaken(self, time_s: float) -> bool:
        """Whether a companion is lost at a time, or was shortly before."""
        lost = [(loss.at_s, loss.at_s + (loss.for_s or 0.0)) for loss in self.losses]
        attacked = [(begin_s, end_s) for begin_s, end_s, _ in self.attacks]
        return any(begin_s <= time_s <= end_s + SHAKEN_S for begin_s, end_s in lost + attacked)

    def record(self) -> FlightRecord:
        """What was flown."""
        return self.flight.record()

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

    def nearest(self, record: FlightRecord, *, shaken: bool) -> Near:
        """The nearest two: in all of the flight, or only while no companion was lost."""
        counts = record.time_s >= FIRST_S
        if not shaken:
            counts &= ~np.array([self.is_shaken(time_s) for time_s in record.time_s])
        found = []
        for pair in pair_separations(record):
            distance = np.where(counts, pair.distance_m, np.inf)
            index = int(distance.argmin())
            time_s = float(record.time_s[index])
            text = f"{pair.first} and {pair.second}"
            found.append(Near(float(distance[index]), text, time_s, self.order_at(time_s)))
        return min(found, key=lambda one: one.distance_m)


def kind_of(name: str) -> str:
    """The kind of an order in words."""
    word = name.split(maxsplit=1)[0].rstrip(",")
    return "shape" if word in SHAPES else word


def reason_of(text: str) -> str:
    """A reason without its figures and names, to be counted."""
    words = [
        "X" if any(letter.isdigit() for letter in word) or word.strip(":,") == "leader" else word
        for word in text.split(";", maxsplit=1)[0].split()
    ]
    return " ".join(words)[:110]


def flights(count: int, seed: int, first: int, tally: Tally) -> Iterator[Sortie]:
    """Flights with so many orders in all."""
    number, given = first, 0
    while given < count:
        sortie = Sortie(Random(f"{seed} {number}"), tally)
        sortie.fly(PER_FLIGHT)
        given += len(sortie.given)
        number += 1
        yield sortie


def main(words: Sequence[str] | None = None) -> None:
    """Fly what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--orders", type=int, default=1000, help="to be given, at least")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first flight")
    parser.add_argument("--append", action="store_true", help="a row to docs/results")
    options = parser.parse_args(words)
    tally, nearest, calm = Tally(), None, None
    everything = flights(options.orders, options.seed, options.first, tally)
    for number, sortie in enumerate(everything, options.first):
        record = sortie.record()
        near, near_calm = (sortie.nearest(record, shaken=shaken) for shaken in (True, False))
        nearest = min(nearest or near, near, key=lambda one: one.distance_m)
        calm = min(calm or near_calm, near_calm, key=lambda one: one.distance_m)
        tally.flights += 1
        tally.flown_s += sortie.now
        tell(
            f"flight {number}: {len(sortie.names)} aircraft, {sortie.mission.name}, {sortie.now:.0f} s,"
            f" {len(sortie.given)} orders, {len(sortie.losses)} losses, {len(sortie.attacks)} attacks;"
            f" nearest {near.distance_m:.1f} m: {near.pair} at {near.time_s:.1f} s, {near.order}"
        )
    summarise(tally, nearest, calm)
    if tally.strays:
        raise SystemExit("something was flown that nobody had ordered")
    if options.append and nearest is not None:
        given = sum(tally.kinds.values())
        figures = {
            "flights": tally.flights,
            "killed": tally.killed,
            "attacked": tally.attacks.total(),
            "carried_out": tally.carried_out,
            "void": sum(tally.void.values()),
            "refused": sum(tally.refused.values()),
            "nearest_m": nearest.distance_m,
        }
        command = f"python -m tests.benchmarks.random_orders --orders {options.orders} --append"
        append("random-orders", [row(f"seed {options.seed}, {given} orders", figures, command)])


def summarise(tally: Tally, nearest: Near | None, calm: Near | None) -> None:
    """Print what all flights came to."""
    if nearest is None or calm is None:
        return
    given = sum(tally.kinds.values())
    tell(
        f"{given} orders given in {tally.flights} flights of {tally.flown_s / 3600.0:.1f} h:"
        f" {tally.carried_out} carried out, {sum(tally.void.values())} void;"
        f" {sum(tally.refused.values())} refused before they were given; {tally.killed} companions lost,"
        f" {tally.attacks.total()} attacks"
    )
    for title, near in (("nearest two", nearest), ("without losses", calm)):
        tell(f"{title}: {near.distance_m:.1f} m, {near.pair}, {near.order}")
    tell("given: " + ", ".join(f"{kind} {count}" for kind, count in tally.kinds.most_common()))
    for title, reasons in (
        ("void", tally.void),
        ("refused", tally.refused),
        ("attack", tally.attacks),
        ("not ordered:", tally.strays),
    ):
        for reason, count in reasons.most_common():
            tell(f"{title} {count}: {reason}")


if __name__ == "__main__":
    main()
