"""Companions and links that come and go at random, through companion cores and emulated autopilots in memory.

Whatever happens there are never two leaders of one term, no two aircraft come within 5 m of each other, and a
part of the formation that stays as it is has one leader in time.
"""

import math
from itertools import combinations
from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from vfguide.companion.succession import DEAF_S
from vfguide.lab.rehearsal.aircraft import Aircraft, Mail
from vfguide.link.memory import LinkQuality
from vfguide.mission import Mission, load_mission
from vfguide.mission.rehearsal import Loss

MISSIONS = Path(__file__).parents[3] / "missions"

LEAST_M = 5.0
RATE_HZ = 20.0
SETTLED_S = DEAF_S + 5.0
"""A part that stays as it is has one leader after this; alone, a deputy takes itself for deaf at first."""

DEPUTIES = ("f1", "f2")


def mission(name: str) -> Mission:
    """A mission of the article, everyone in place."""
    content = load_mission(MISSIONS / f"{name}.yaml").model_dump(exclude_unset=True)
    content["deputies"] = list(DEPUTIES)
    content["rehearsal"]["start"] = {}
    return Mission.model_validate(content)


class Flight(RuleBasedStateMachine):
    """Four aircraft along a line in calm air, of which three may lead."""

    flown = "line-calm"

    @initialize()
    def launch(self) -> None:
        self.mission = mission(self.flown)
        self.names = [self.mission.leader.vehicle, *self.mission.followers_by_name]
        self.aircraft = {name: Aircraft(self.mission, name) for name in self.names}
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
        mail, self.mail = self.mail, []
        for name, one in self.aircraft.items():
            heard = [sent for sent in mail if self.group[sent[0]] == self.group[name]]
            self.mail += one.step(self.now, heard)
        self.steps += 1
        truths = [one._emulator.truth() for one in self.aircraft.values()]  # noqa: SLF001
        frame = self.aircraft["f1"].companion._vehicle.plan.frame  # noqa: SLF001
        spots = [
            (*frame.to_local(t.latitude_deg, t.longitude_deg), t.altitude_amsl_m) for t in truths
        ]
        nearest = min(math.dist(a, b) for a, b in combinations(spots, 2))
        self.nearest_m = min(self.nearest_m, nearest)
        terms = list(self.leaders().values())
        if len(terms) != len(set(terms)):
            self.two_leaders = f"{self.leaders()} at {self.now:.2f} s"

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


class Circling(Flight):
    """The same on a circle in the article's wind, where two parts measure it differently."""

    flown = "circle-wind"


Flight.TestCase.settings = settings(
    max_examples=3,
    stateful_step_count=8,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
Circling.TestCase.settings = settings(Flight.TestCase.settings, max_examples=2)
TestFlight = Flight.TestCase
TestCircling = Circling.TestCase
