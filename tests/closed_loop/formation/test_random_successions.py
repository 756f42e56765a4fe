"""Companions and links that come and go at random, through companion cores and emulated autopilots in memory.

Whatever happens there are never two leaders of one term, no two aircraft come within 5 m of each other, and a
part of the formation that stays as it is has one leader in time.
"""

import math
from itertools import combinations

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from tests.kit.formation import GUIDED, LOITER, SET_MODE
from tests.kit.missions import mission_with, replaced
from tests.kit.orders import overhear
from tests.kit.wire import command_long, packed
from vfguide.companion.roles import DEAF_S
from vfguide.errors import VfguideError
from vfguide.formation.orders import Order
from vfguide.lab.order_desk import OrderDesk
from vfguide.lab.rehearsal.aircraft import OPERATOR, Aircraft
from vfguide.link.memory import LinkQuality, Mail
from vfguide.link.order_codec import encode_order
from vfguide.mission import Mission
from vfguide.mission.order_plan import resolve
from vfguide.mission.rehearsal import Loss

LEAST_M = 5.0
RATE_HZ = 10.0
SETTLED_S = DEAF_S + 5.0
"""A part that stays as it is has one leader after this; alone, a deputy takes itself for deaf at first."""

DEPUTIES = ("f1", "f2")

LEAD_S = 6.0
"""From when an order is given to its time, as `vfguide order` does."""

DECIDED_S = 1.0
"""So long after its time it is known whether an order is flown, where everybody is heard."""

ORDERS = (
    Order(shape="vee", spacing=28.0),
    Order(shape="trail", spacing=20.0),
    Order(shape="line-abreast", spacing=25.0),
    Order(spacing=25.0),
    Order(swap=("f1", "f2")),
    Order(swap=("f2", "f3")),
    Order(leave=("f3",)),
    Order(join=("f3",)),
    Order(action="hold"),
    Order(action="resume"),
)


def mission(name: str) -> Mission:
    """A mission of the article, everyone in place."""
    return replaced(
        mission_with(name, rehearsal={"start": {}, "rate_hz": RATE_HZ}), deputies=list(DEPUTIES)
    )


class Flight(RuleBasedStateMachine):
    """Four aircraft along a line in calm air, of which three may lead."""

    flown = "line-calm"

    @initialize()
    def launch(self) -> None:
        self.mission = mission(self.flown)
        self.names = [self.mission.leader.vehicle, *self.mission.followers_by_name]
        # An operator's mail comes with everybody else's.
        self.aircraft = {
            name: Aircraft(self.mission, name, orders=[(math.inf, b"")]) for name in self.names
        }
        self.group = dict.fromkeys(self.names, 0)
        self.down: set[str] = set()
        self.mail: list[Mail] = []
        self.steps = 0
        self.nearest_m = math.inf
        self.two_leaders = ""
        self.changed_s = 0.0
        self.fly(6.0)

    @property
    def now(self) -> float:
        return self.steps / RATE_HZ

    def leaders(self) -> dict[str, int]:
        """Terms of those who lead and steer, by name."""
        found = {name: one.companion.snapshot.lead for name, one in self.aircraft.items()}
        return {n: lead.term for n, lead in found.items() if lead and n not in self.down}

    @rule(seconds=st.floats(0.5, 6.0))
    def fly(self, seconds: float) -> None:
        for _ in range(round(seconds * RATE_HZ)):
            self.step()

    @rule()
    def fly_until_settled(self) -> None:
        self.fly(SETTLED_S + 0.5)

    def step(self) -> None:
        mail, self.mail = [*self.mail, *self.operators_mail()], []
        for name, one in self.aircraft.items():
            heard = [sent for sent in mail if self.group.get(sent[0], 0) == self.group[name]]
            self.mail += one.step(self.now, heard)
        self.steps += 1
        truths = [one.emulator.truth() for one in self.aircraft.values()]
        frame = self.aircraft["f1"].companion._vehicle.plan.frame  # noqa: SLF001
        spots = [
            (*frame.to_local(t.latitude_deg, t.longitude_deg), t.altitude_amsl_m) for t in truths
        ]
        nearest = min(math.dist(a, b) for a, b in combinations(spots, 2))
        self.nearest_m = min(self.nearest_m, nearest)
        terms = list(self.leaders().values())
        if len(terms) != len(set(terms)):
            self.two_leaders = f"{self.leaders()} at {self.now:.2f} s"

    def operators_mail(self) -> list[Mail]:
        """What an operator says now, who is in the first part of the formation."""
        return []

    @precondition(lambda self: not self.down)
    @rule(data=st.data())
    def kill(self, data: st.DataObject) -> None:
        """End a companion without a word: its aircraft flies on by its last setpoint."""
        name = data.draw(st.sampled_from(self.names))
        self.down.add(name)
        self.lose(name, for_s=None)

    @precondition(lambda self: self.down)
    @rule()
    def restart(self) -> None:
        name = self.down.pop()
        self.aircraft[name]._losses = ()  # noqa: SLF001
        self.changed_s = self.now

    def lose(self, name: str, for_s: float | None) -> None:
        loss = Loss(vehicle=name, at_s=self.now, for_s=for_s)
        self.aircraft[name]._losses, self.aircraft[name]._lost = (loss,), False  # noqa: SLF001
        self.changed_s = self.now

    @rule(data=st.data())
    def split(self, data: st.DataObject) -> None:
        self.group = {name: data.draw(st.integers(0, 1)) for name in self.names}
        self.changed_s = self.now

    @rule()
    def join(self) -> None:
        self.group = dict.fromkeys(self.names, 0)
        self.changed_s = self.now

    @rule(delay_s=st.floats(0.0, 0.25), loss=st.floats(0.0, 0.3))
    def disturb(self, delay_s: float, loss: float) -> None:
        quality = LinkQuality(delay_s=delay_s, jitter_s=0.5 * delay_s, loss=loss)
        for one in self.aircraft.values():
            one._link.quality = quality  # noqa: SLF001
        self.changed_s = self.now

    @invariant()
    def never_two_leaders_of_one_term(self) -> None:
        assert not getattr(self, "two_leaders", "")

    @invariant()
    def nobody_comes_near(self) -> None:
        assert getattr(self, "nearest_m", math.inf) >= LEAST_M

    @invariant()
    def one_leader_in_each_part_in_time(self) -> None:
        if not hasattr(self, "names") or self.now - self.changed_s < SETTLED_S:
            return
        for group in set(self.group.values()):
            part = {n for n in self.names if self.group[n] == group and n not in self.down}
            leaders = [name for name in self.leaders() if name in part]
            assert len(leaders) <= 1
            able = [
                name
                for name in part
                if name in (self.names[0], *DEPUTIES)
                and self.aircraft[name].companion.snapshot.mode.steers
            ]
            if able:
                assert len(leaders) == 1


class Ordered(Flight):
    """The same, with an operator in one part of it, and pilots who take over in the midst of anything."""

    @initialize()
    def launch(self) -> None:
        self.given_until, self.said = -math.inf, b""
        self.pilots: dict[str, float] = {}
        self.desk = None
        super().launch()
        self.desk = OrderDesk(self.mission, clock=lambda: self.now)
        self.fly(2.0)

    def operators_mail(self) -> list[Mail]:
        if self.desk is None:
            return []
        for sender, data in self.mail:
            if self.group[sender] == 0:
                overhear(self.desk, sender, data)
        if self.now > self.given_until or self.steps % 10 != 0:
            return []
        return [(OPERATOR, self.said)]

    @rule(order=st.sampled_from(ORDERS), later_s=st.floats(0.0, 12.0))
    def order(self, order: Order, later_s: float) -> None:
        """Give an order where it is possible, and fly on into it."""
        if self.now < self.given_until + DECIDED_S:
            return
        time_s = self.now + LEAD_S
        try:
            found, _ = resolve(
                self.mission,
                order,
                self.desk.formation(),
                number=self.desk.newest_number + 8,
                time_s=time_s,
                leader=self.desk.leader_place(time_s),
            )
        except VfguideError:
            return
        self.given_until, self.said = time_s, encode_order(found)
        self.desk.note_order(found)
        self.changed_s = self.now
        self.fly(LEAD_S + later_s)

    @precondition(lambda self: not self.pilots)
    @rule(data=st.data(), for_s=st.floats(1.0, 10.0))
    def take_over(self, data: st.DataObject, for_s: float) -> None:
        """A pilot selects the autopilot's loiter."""
        name = data.draw(st.sampled_from(self.names))
        self.select(name, LOITER)
        self.pilots[name] = self.now
        self.fly(for_s)

    @precondition(lambda self: self.pilots)
    @rule()
    def give_back(self) -> None:
        name, _ = self.pilots.popitem()
        self.select(name, GUIDED)

    def select(self, name: str, mode: int) -> None:
        system = self.mission.vehicles[name].system_id
        order = packed(command_long(SET_MODE, 1, mode, system_id=system))
        self.aircraft[name].emulator.receive(order)
        self.changed_s = self.now

    @invariant()
    def a_pilot_who_has_taken_over_has_the_vehicle(self) -> None:
        for name in getattr(self, "pilots", ()):
            assert self.aircraft[name].emulator.truth().mode == "LOITER"

    @invariant()
    def those_who_hear_each_other_fly_by_one_order_in_time(self) -> None:
        if not hasattr(self, "names") or self.now - self.changed_s < SETTLED_S + DECIDED_S:
            return
        for group in set(self.group.values()):
            flown = {
                one.arrangement.number if one.arrangement else 0
                for name, one in ((n, self.aircraft[n].companion) for n in self.names)
                if self.group[name] == group and name not in self.down and one.snapshot.mode.steers
            }
            assert len(flown) <= 1


class Circling(Flight):
    """The same on a circle in the article's wind, where two parts measure it differently."""

    flown = "circle-wind"


Flight.TestCase.settings = settings(
    max_examples=3, stateful_step_count=8, deadline=None, suppress_health_check=list(HealthCheck)
)
Ordered.TestCase.settings = settings(
    Flight.TestCase.settings, max_examples=6, stateful_step_count=10
)
Circling.TestCase.settings = settings(Flight.TestCase.settings, max_examples=2)
TestFlight = Flight.TestCase
TestOrdered = Ordered.TestCase
TestCircling = Circling.TestCase
