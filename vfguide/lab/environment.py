"""Environments for reinforcement learning: a formation in virtual time, whose followers are agents.

Companions, gates, link and emulators are those of every flight in virtual time. An agent takes the place of
a follower's law: it is shown what the law would see, and what it asks for goes through the same limits.

Each follower with a pilot flies its instant in a greenlet of its own, which is a call that can be left and
taken up again: it is left where its law is asked, deep in its companion, and taken up with the answer. So
nothing of an aircraft or a companion is otherwise than in `fly_lockstep`, and neither is the flight.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any, ClassVar

import gymnasium
import msgspec
import numpy as np
from greenlet import getcurrent, greenlet
from gymnasium.spaces import Box, Space
from msgspec.structs import replace
from numpy.typing import ArrayLike, NDArray
from pettingzoo import ParallelEnv

from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan, local_frame
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.errors import InputError, VfguideError
from vfguide.formation.arrangement import Point
from vfguide.guidance.airframe import compose
from vfguide.lab.rehearsal.aircraft import Aircraft, EmulatedForeignLeader, aircraft_of
from vfguide.lab.rehearsal.lockstep import (
    FormationShare,
    LockstepFlight,
    leading_first,
    windows,
)
from vfguide.laws.base import DesiredMotion, Law, View
from vfguide.laws.vectors import HIGH, LOW, ActionKind, motion_of, observed
from vfguide.link.codec import is_leaders
from vfguide.link.memory import Mail
from vfguide.mission.model import Mission


class PilotedAircraft(Aircraft):
    """A follower whose law is a pilot's, or the mission's where the pilot leaves it to that."""

    def __init__(self, mission: Mission, name: str) -> None:
        """Put the aircraft of this name at its start."""
        super().__init__(mission, name)
        plan = flight_plan(mission, name)
        asked = replace(plan, law=asking(plan.law, self))
        vehicle = mission.vehicles[name]
        self._make = lambda: Companion(
            asked, adapter_of(vehicle), engage=True, consent=self._consent
        )
        self.companion = self._make()
        self.view: View | None = None
        """What the pilot is asked about in this instant; None where the companion does not ask."""
        self._turn: greenlet | None = None
        self._asked = False
        self._wanted: DesiredMotion | None = None
        self._led: list[Mail] = []

    def step(self, now: float, mail: Sequence[Mail]) -> list[Mail]:
        """Fly on to this time, as far as the pilot is asked.

        Returns:
            what others hear now: all of it where nobody was asked; else what a deputy that leads said in
            the instant before.
        """
        said, self._led = self._led, []
        self._asked, turn = False, greenlet(super().step)
        found = turn.switch(now, mail)
        if turn.dead:
            return [*said, *found]
        self._turn, self.view = turn, found
        return said

    def resume(self, wanted: DesiredMotion | None) -> list[Mail]:
        """Fly the rest of the instant.

        Args:
            wanted: by the pilot; None to leave it to the mission's law.

        Returns:
            what it says as a follower.
        """
        turn, self._turn, self.view = self._turn, None, None
        if turn is None:
            return []
        said: list[Mail] = turn.switch(wanted)
        self._led = [one for one in said if is_leaders(one[1])]
        return [one for one in said if not is_leaders(one[1])]

    def ask(self, view: View) -> DesiredMotion | None:
        """Leave the instant until the pilot has answered, once: the law of a late vehicle is asked thrice."""
        if not self._asked:
            outside = getcurrent().parent
            # Asked from elsewhere than a step, there is nobody to answer.
            if outside is None:
                return None
            self._wanted = outside.switch(view)
            self._asked = True
        return self._wanted


def asking(law: type[Law], aircraft: PilotedAircraft) -> type[Law]:
    """Return a law like another, which asks an aircraft's pilot first."""

    class Asking(law):  # type: ignore[misc, valid-type] # of whatever law a mission names
        """That law."""

        def step(self, view: View, memory: Any) -> tuple[DesiredMotion, Any]:  # noqa: ANN401
            """Return what the pilot wants, or what the law does."""
            wanted = aircraft.ask(view)
            if wanted is not None:
                return wanted, PILOTED
            known = self.start(view) if memory is PILOTED else memory
            own: tuple[DesiredMotion, Any] = super().step(view, known)
            return own

        def learn(self, view: View, memory: Any, *, limited: bool) -> Any:  # noqa: ANN401
            """Learn of what the law itself has asked for."""
            return memory if memory is PILOTED else super().learn(view, memory, limited=limited)

    return Asking


PILOTED = object()
"""What a law remembers of steps that its pilot flew."""


class SteppedFlight(FormationShare):
    """A flight that goes on by an instant with each step."""

    def __init__(self, mission: Mission, piloted: Sequence[str]) -> None:
        """Put everyone at the start, and fly the first instant as far as the pilots are asked.

        Args:
            mission: the mission.
            piloted: names of the followers that have a pilot.

        Raises:
            InputError: the mission is flown by radio.
        """
        if mission.rehearsal.radio is not None:
            raise InputError(
                "rehearsal.radio: no environment flies by radio; leave it out (`rehearsal.radio: null`)"
            )
        self._began = time.perf_counter()
        self._piloted = {name: PilotedAircraft(mission, name) for name in piloted}
        aircraft: dict[str, Aircraft | EmulatedForeignLeader] = {
            name: self._piloted.get(name) or aircraft_of(mission, name)
            for name in leading_first(mission)
        }
        super().__init__(mission, aircraft)
        self._instants = ((at, now) for at, due in enumerate(windows(mission)) for now in due)
        self._advance()

    @property
    def now(self) -> float:
        """Virtual time, s."""
        return self.times[-1]

    @property
    def views(self) -> Mapping[str, View]:
        """What pilots are asked now, by name. A companion with nothing to steer by asks nothing."""
        return {name: one.view for name, one in self._piloted.items() if one.view is not None}

    @property
    def is_over(self) -> bool:
        """Whether this is the last instant of the mission."""
        return self.left == 0

    def step(self, wanted: Mapping[str, DesiredMotion]) -> None:
        """Fly on to the next instant, as far as the pilots are asked.

        Args:
            wanted: motions by name; the mission's law flies who has none.
        """
        self._finish(wanted)
        self._advance()

    def brought_home(self) -> LockstepFlight:
        """End the flight here, and return what was flown: no step may follow."""
        self._finish({})
        return self.land(self._began)

    def _finish(self, wanted: Mapping[str, DesiredMotion]) -> None:
        said = [one.resume(wanted.get(name)) for name, one in self._piloted.items()]
        self.post(self._window, chain.from_iterable(said))

    def _advance(self) -> None:
        self._window, now = next(self._instants)
        self.fly(self._window, [now])


Vector = NDArray[np.float32]

HELD_BY = frozenset({Mode.JOINING, Mode.TRACKING, Mode.PREDICTING})
"""Modes in which a companion flies by what its law asks for."""

ENGAGED_S = 20.0
"""Every agent's companion steers by then, or the mission is no place to learn in."""

COLLISION_M = 5.0
"""Two that come nearer to each other have collided."""

NEAR_M = 10.0
"""Distance from the slot at which the reward has lost half of what it can lose."""

EFFORT = 0.01
"""What the mean square of an action costs."""


class FlownStep(msgspec.Struct, frozen=True, kw_only=True):
    """What a step came to for one agent, by the true states after it."""

    view: View
    """What its law sees after it; the newest where the companion does not ask any more."""
    action: FloatArray
    """What the agent asked for, shape (2,)."""
    distance_m: float
    """From its slot, seen from above, m."""
    nearest_m: float
    """To the nearest other aircraft, m."""
    lost: bool
    """Whether this was the agent's last step, though the mission goes on."""
    left: int
    """Steps that are left of the mission."""


Reward = Callable[[FlownStep], float]
"""What a step is worth."""


def usual_reward(step: FlownStep) -> float:
    """Return what a step is worth: -d²/(d² + 10²) for the distance d from the slot in m, less the effort.

    Near the slot that is the negative square of d / 10 m; far away it is -1. Who is lost gets -1 for each
    step that is left: to be lost is never worth while.
    """
    square = step.distance_m**2
    worth = -square / (square + NEAR_M**2) - EFFORT * float(np.mean(step.action**2))
    return worth - step.left if step.lost else worth


# pettingzoo says nothing of its types.
class FormationEnvironment(ParallelEnv):  # type: ignore[misc]
    """A PettingZoo parallel environment: every follower is an agent, by the name of its vehicle.

    A step is a guidance step of the mission. An agent ends (`terminated`) when its companion does not fly by
    it any more, or when it comes within 5 m of another aircraft; its aircraft flies on by the mission's law.
    All end (`truncated`) with the mission. Infos have `distance_m` from the slot, `nearest_m` to the
    nearest other aircraft, and the companion's `mode`.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "vfguide_v0", "render_modes": []}

    def __init__(
        self,
        change: Callable[[Mapping[str, object]], Mission],
        *,
        agents: tuple[str, ...] = (),
        actions: ActionKind = "rates",
        reward: Reward = usual_reward,
    ) -> None:
        """Make an environment that is to be reset.

        Args:
            change: makes the mission with other values of some fields; raises InputError.
            agents: followers that are agents; all if there are none.
            actions: what an action says.
            reward: what a step is worth.
        """
        self._change = change
        self._mission = change({})
        self._kind: ActionKind = actions
        self._reward = reward
        self._random: np.random.Generator | None = None
        self._flight: SteppedFlight | None = None
        self._frame = local_frame(self._mission)
        self._slots = slots_of(self._mission)
        self._views: dict[str, View] = {}
        self.possible_agents = [*(agents or self._mission.followers_by_name)]
        """All agents."""
        self.agents: list[str] = []
        """Those that still fly."""
        self.observation_spaces: dict[str, Space[Any]] = {
            name: Box(LOW, HIGH, dtype=np.float32) for name in self.possible_agents
        }
        """Of each agent: see `vfguide.laws.OBSERVATION`."""
        self.action_spaces: dict[str, Space[Any]] = {
            name: Box(-1.0, 1.0, (2,), dtype=np.float32) for name in self.possible_agents
        }
        """Of each agent: see `vfguide.laws.motion_of`."""

    def observation_space(self, agent: str) -> Space[Vector]:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Vector]:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Begin a flight, and fly until the companion of every agent steers, by the mission's law.

        Args:
            seed: of everything random, 0 or more. The first flight has the mission's if absent, later
                ones have seeds that follow from the last that was given.
            options: `settings`: values of fields of the mission for this flight alone, as of `vfguide.fly`.

        Raises:
            InputError: a setting is wrong.
            VfguideError: a companion does not steer.
        """
        settings = (options or {}).get("settings")
        mission = self._change(settings) if settings else self._mission
        if seed is None and self._random is not None:
            seed = int(self._random.integers(2**32))
        else:
            seed = mission.rehearsal.seed if seed is None else seed % 2**32
            self._random = np.random.default_rng(seed)
        rehearsal = mission.rehearsal.model_copy(update={"seed": seed})
        flown = mission.model_copy(update={"rehearsal": rehearsal})
        flight = SteppedFlight(flown, self.possible_agents)
        while not set(self.possible_agents) <= self._steered(flight):
            if flight.is_over or flight.now > ENGAGED_S:
                waiting = sorted(set(self.possible_agents) - self._steered(flight))
                raise VfguideError(
                    f"{', '.join(waiting)}: not steered within {flight.now:.0f} s;"
                    " see what `vfguide fly` says of this mission"
                )
            flight.step({})
        self._flight, self._slots = flight, slots_of(flown)
        self._frame = local_frame(flown)
        self.agents = [*self.possible_agents]
        self._views = {**flight.views}
        return self._observations(), {name: info for name, (info, _) in self._told().items()}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[
        dict[str, Vector],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Fly a guidance step by the agents' actions.

        Args:
            actions: two numbers of each agent. Of one that is not there the mission's law flies this step.

        Returns:
            observations, rewards, terminations, truncations and infos by agent.

        Raises:
            InputError: the environment was not reset.
        """
        flight = self._flying()
        if not self.agents:
            return {}, {}, {}, {}, {}
        given = {
            name: np.asarray(actions[name], dtype=np.float64).reshape(2)
            for name in self.agents
            if name in actions
        }
        asked = flight.views
        flight.step(
            {
                name: motion_of(asked[name], action, self._kind)
                for name, action in given.items()
                if name in asked
            }
        )
        self._views |= flight.views
        told, over = self._told(), flight.is_over
        observations, still = self._observations(), np.zeros(2)
        rewards = {
            name: self._reward(
                FlownStep(
                    view=self._views[name],
                    action=given.get(name, still),
                    distance_m=info["distance_m"],
                    nearest_m=info["nearest_m"],
                    lost=lost,
                    left=flight.left,
                )
            )
            for name, (info, lost) in told.items()
        }
        terminations = {name: lost for name, (_, lost) in told.items()}
        infos = {name: info for name, (info, _) in told.items()}
        self.agents = [] if over else [name for name, lost in terminations.items() if not lost]
        return observations, rewards, terminations, dict.fromkeys(told, over), infos

    def brought_home(self) -> LockstepFlight:
        """End the flight, and return what was flown, for `vfguide.Flight(flown=...)` and its report.

        Raises:
            InputError: the environment was not reset.
        """
        flight = self._flying()
        self._flight, self.agents = None, []
        return flight.brought_home()

    def render(self) -> None:
        """Draw nothing: `brought_home` gives a flight with a report and a replay."""

    def close(self) -> None:
        """Forget the flight."""
        self._flight, self.agents = None, []

    def _flying(self) -> SteppedFlight:
        if self._flight is None:
            raise InputError("no flight has begun; call reset() before")
        return self._flight

    def _steered(self, flight: SteppedFlight) -> set[str]:
        return {name for name in flight.views if is_steered(flight.aircraft[name])}

    def _observations(self) -> dict[str, Vector]:
        return {name: observed(self._views[name]) for name in self.agents}

    def _told(self) -> dict[str, tuple[dict[str, Any], bool]]:
        """(info, whether it is lost) of each agent."""
        flight = self._flying()
        truths = {name: one.emulator.truth() for name, one in flight.aircraft.items()}
        places = {
            name: (
                *self._frame.to_local(true.latitude_deg, true.longitude_deg),
                true.altitude_amsl_m,
            )
            for name, true in truths.items()
        }
        # Slots count from the mission's leader, whoever leads.
        leader, course = next(iter(places.values())), next(iter(truths.values())).course_rad
        told = {}
        for name in self.agents:
            aircraft = flight.aircraft[name]
            snapshot = aircraft.companion.snapshot if isinstance(aircraft, Aircraft) else None
            ordered = None if snapshot is None else snapshot.slot
            slot = ordered or self._slots[name]
            north, east = compose(slot.forward, slot.right, course)
            own = places[name]
            distance = math.hypot(leader[0] + north - own[0], leader[1] + east - own[1])
            nearest = min(math.dist(own, there) for other, there in places.items() if other != name)
            info = {
                "distance_m": distance,
                "nearest_m": nearest,
                "mode": "" if snapshot is None else snapshot.mode.value,
            }
            told[name] = info, nearest < COLLISION_M or not is_steered(aircraft)
        return told


def slots_of(mission: Mission) -> dict[str, Point]:
    """Return the slots of a mission by follower."""
    return {name: one.slot.point for name, one in mission.followers_by_name.items()}


def is_steered(aircraft: Aircraft | EmulatedForeignLeader) -> bool:
    """Return whether an aircraft is flown by what its law asks for."""
    return isinstance(aircraft, Aircraft) and aircraft.companion.snapshot.mode in HELD_BY


class FollowerEnvironment(gymnasium.Env[Vector, Any]):
    """A Gymnasium environment: one follower of a formation, whose others fly by the mission's law."""

    metadata = {"render_modes": []}  # noqa: RUF012 - as the base class declares it

    def __init__(self, formation: FormationEnvironment) -> None:
        """Make it of an environment with one agent."""
        self.formation = formation
        """The environment of the formation."""
        (self._name,) = formation.possible_agents
        self.observation_space = formation.observation_space(self._name)
        self.action_space = formation.action_space(self._name)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Begin a flight; as of `FormationEnvironment`."""
        super().reset(seed=seed)
        observations, infos = self.formation.reset(seed, options)
        return observations[self._name], infos[self._name]

    def step(self, action: ArrayLike) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Fly a guidance step; as of `FormationEnvironment`.

        Raises:
            InputError: no flight has begun, or it is over.
        """
        if not self.formation.agents:
            raise InputError("no flight is under way; call reset() before")
        name = self._name
        seen, rewards, terminated, truncated, infos = self.formation.step({name: action})
        return seen[name], rewards[name], terminated[name], truncated[name], infos[name]

    def close(self) -> None:
        """Forget the flight."""
        self.formation.close()
