"""Reinforcement-learning environments: a formation in virtual time with followers as agents.

Companions, gates, link and emulators are those of every flight in virtual time. An agent replaces a
follower's law: it observes what the law would, and its commands pass the same limits.

Each piloted follower runs its instant in a greenlet, a call that can be suspended and resumed. The greenlet
is suspended where the companion calls its law, and resumed with the pilot's answer. Aircraft, companions and
the flight are therefore the same as in `fly_lockstep`.
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
from vfguide.lab.rehearsal.lockstep import FormationShare, LockstepFlight, leading_first, windows
from vfguide.laws.base import DesiredMotion, Law, View
from vfguide.laws.vectors import HIGH, LOW, ActionKind, motion_of, observed
from vfguide.link.codec import is_leaders
from vfguide.link.memory import Mail
from vfguide.mission.model import Mission


class PilotedAircraft(Aircraft):
    """Follower flown by a pilot's law, or by the mission's where the pilot gives no answer."""

    def __init__(self, mission: Mission, name: str) -> None:
        super().__init__(mission, name)
        plan = flight_plan(mission, name)
        asked = replace(plan, law=asking(plan.law, self))
        vehicle = mission.vehicles[name]
        self._make = lambda: Companion(
            asked, adapter_of(vehicle), engage=True, consent=self._consent
        )
        self.companion = self._make()
        self.view: View | None = None
        """Pilot's view in this instant; None where the companion does not ask its law."""
        self._turn: greenlet | None = None
        self._asked = False
        self._wanted: DesiredMotion | None = None
        self._led: list[Mail] = []

    def step(self, now: float, mail: Sequence[Mail]) -> list[Mail]:
        """Fly on to this time, up to the pilot's decision.

        Returns:
            Messages that others hear now: all of them if the pilot is not asked; otherwise those that this
            vehicle sent as leading deputy in the previous instant.
        """
        said, self._led = self._led, []
        self._asked, turn = False, greenlet(super().step)
        found = turn.switch(now, mail)
        if turn.dead:
            return [*said, *found]
        self._turn, self.view = turn, found
        return said

    def resume(self, wanted: DesiredMotion | None) -> list[Mail]:
        """Fly the rest of the instant, and return the messages sent as a follower.

        With `wanted` None the mission's law flies.
        """
        turn, self._turn, self.view = self._turn, None, None
        if turn is None:
            return []
        said: list[Mail] = turn.switch(wanted)
        self._led = [one for one in said if is_leaders(one[1])]
        return [one for one in said if not is_leaders(one[1])]

    def ask(self, view: View) -> DesiredMotion | None:
        """Suspend the instant for the pilot's answer, once: a late vehicle's law is called three times."""
        if not self._asked:
            outside = getcurrent().parent
            # Outside a step there is no pilot to answer.
            if outside is None:
                return None
            self._wanted = outside.switch(view)
            self._asked = True
        return self._wanted


def asking(law: type[Law], aircraft: PilotedAircraft) -> type[Law]:
    """Return a subclass of the law that asks the aircraft's pilot first."""

    class Asking(law):  # type: ignore[misc, valid-type] # of whatever law a mission names
        """Law that asks a pilot first."""

        def step(self, view: View, memory: Any) -> tuple[DesiredMotion, Any]:  # noqa: ANN401
            """Return the pilot's motion, or else the law's own."""
            wanted = aircraft.ask(view)
            if wanted is not None:
                return wanted, PILOTED
            known = self.start(view) if memory is PILOTED else memory
            own: tuple[DesiredMotion, Any] = super().step(view, known)
            return own

        def learn(self, view: View, memory: Any, *, limited: bool) -> Any:  # noqa: ANN401
            """Learn from steps that the law itself has flown."""
            return memory if memory is PILOTED else super().learn(view, memory, limited=limited)

    return Asking


PILOTED = object()
"""Memory of a law after a step flown by its pilot."""


class SteppedFlight(FormationShare):
    """Flight that advances by one instant per step."""

    def __init__(self, mission: Mission, piloted: Sequence[str]) -> None:
        """Place all aircraft, and fly the first instant up to the decisions of the `piloted` followers.

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
        """Views of the pilots to ask now, by name; a companion with nothing to steer by asks none."""
        return {name: one.view for name, one in self._piloted.items() if one.view is not None}

    @property
    def is_over(self) -> bool:
        """Whether this is the last instant of the mission."""
        return self.left == 0

    def step(self, wanted: Mapping[str, DesiredMotion]) -> None:
        """Fly on to the next instant, up to the pilots' decisions.

        Args:
            wanted: motions by name; the mission's law flies vehicles without one.
        """
        self._finish(wanted)
        self._advance()

    def brought_home(self) -> LockstepFlight:
        """End the flight, and return what was flown; no step may follow."""
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
"""Modes in which a companion flies by its law."""

ENGAGED_S = 20.0
"""Time by which every agent's companion must steer; otherwise the mission is unfit for learning, s."""

COLLISION_M = 5.0
"""Two aircraft closer than this have collided."""

NEAR_M = 10.0
"""Distance from the slot that costs half of the greatest penalty."""

EFFORT = 0.01
"""Penalty per mean square of an action."""


class FlownStep(msgspec.Struct, frozen=True, kw_only=True):
    """Outcome of a step for one agent, from the true states after it."""

    view: View
    """View of the agent's law after the step; the newest one where the companion no longer asks."""
    action: FloatArray
    """Action of the agent, shape (2,)."""
    distance_m: float
    """Horizontal distance from the slot, m."""
    nearest_m: float
    """Distance to the nearest other aircraft, m."""
    lost: bool
    """Whether the agent has ended before the mission."""
    left: int
    """Steps left in the mission."""


Reward = Callable[[FlownStep], float]


def usual_reward(step: FlownStep) -> float:
    """Return the reward -d²/(d² + 10²), less the effort, for the distance d from the slot in m.

    The reward is about -(d / 10 m)² near the slot and -1 far away. A lost agent gets a further -1 for each
    step that is left, so that it never pays to be lost.
    """
    square = step.distance_m**2
    worth = -square / (square + NEAR_M**2) - EFFORT * float(np.mean(step.action**2))
    return worth - step.left if step.lost else worth


# pettingzoo has no type annotations.
class FormationEnvironment(ParallelEnv):  # type: ignore[misc]
    """A PettingZoo parallel environment: every follower is an agent, named after its vehicle.

    A step is a guidance step of the mission. An agent ends (`terminated`) when its companion no longer flies
    its actions, or when it comes within 5 m of another aircraft; the aircraft flies on by the mission's law.
    All agents end (`truncated`) with the mission. Infos hold `distance_m` from the slot, `nearest_m` to the
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
        """Make an environment, which `reset` must start.

        Args:
            change: returns the mission with other values of some fields; raises InputError.
            agents: followers that are agents; all if empty.
            actions: meaning of an action.
            reward: reward of a step.
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
        self.agents: list[str] = []
        """Agents that still fly."""
        self.observation_spaces: dict[str, Space[Any]] = {
            name: Box(LOW, HIGH, dtype=np.float32) for name in self.possible_agents
        }
        """Observation space of each agent: see `vfguide.laws.OBSERVATION`."""
        self.action_spaces: dict[str, Space[Any]] = {
            name: Box(-1.0, 1.0, (2,), dtype=np.float32) for name in self.possible_agents
        }
        """Action space of each agent: see `vfguide.laws.motion_of`."""

    def observation_space(self, agent: str) -> Space[Vector]:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Vector]:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Begin a flight, and fly by the mission's law until every agent's companion steers.

        Args:
            seed: seed of everything random, 0 or more. If absent, the first flight takes the mission's; later
                flights take seeds that follow from the last one given.
            options: `settings`: values of mission fields for this flight alone, as in `vfguide.fly`.

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
            actions: two numbers per agent; an agent without any is flown by the mission's law in this step.

        Returns:
            Observations, rewards, terminations, truncations and infos by agent.

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
        """End the flight, and return it for `vfguide.Flight(flown=...)` and its report.

        Raises:
            InputError: the environment was not reset.
        """
        flight = self._flying()
        self._flight, self.agents = None, []
        return flight.brought_home()

    def render(self) -> None:
        """Draw nothing: `brought_home` returns a flight with a report and a replay."""

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
        """Return (info, whether the agent is lost) for each agent."""
        flight = self._flying()
        truths = {name: one.emulator.truth() for name, one in flight.aircraft.items()}
        places = {
            name: (
                *self._frame.to_local(true.latitude_deg, true.longitude_deg),
                true.altitude_amsl_m,
            )
            for name, true in truths.items()
        }
        # Slots refer to the mission's leader, whoever leads.
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
    """Check whether an aircraft flies its law's commands."""
    return isinstance(aircraft, Aircraft) and aircraft.companion.snapshot.mode in HELD_BY


class FollowerEnvironment(gymnasium.Env[Vector, Any]):
    """A Gymnasium environment: one follower, in a formation whose others fly by the mission's law."""

    metadata = {"render_modes": []}  # noqa: RUF012 - as the base class declares it

    def __init__(self, formation: FormationEnvironment) -> None:
        """Wrap an environment with one agent."""
        self.formation = formation
        (self._name,) = formation.possible_agents
        self.observation_space = formation.observation_space(self._name)
        self.action_space = formation.action_space(self._name)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Begin a flight, as in `FormationEnvironment`."""
        super().reset(seed=seed)
        observations, infos = self.formation.reset(seed, options)
        return observations[self._name], infos[self._name]

    def step(self, action: ArrayLike) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Fly a guidance step, as in `FormationEnvironment`.

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
