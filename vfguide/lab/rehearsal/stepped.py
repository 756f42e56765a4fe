"""A flight in lockstep that waits in each instant for what its pilots want.

Each follower with a pilot flies its instant in a greenlet of its own, which is a call that can be left and
taken up again: it is left where its law is asked, deep in its companion, and taken up with the answer. So
nothing of an aircraft or a companion is otherwise than in `fly_lockstep`, and neither is the flight.
"""

import time
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

from greenlet import getcurrent, greenlet
from msgspec.structs import replace

from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.errors import InputError
from vfguide.lab.rehearsal.aircraft import (
    Aircraft,
    Candidates,
    EmulatedForeignLeader,
    aircraft_of,
    fly_window,
)
from vfguide.lab.rehearsal.lockstep import (
    LockstepFlight,
    MailExchange,
    flight_of,
    outcome_of,
    windows,
)
from vfguide.laws.base import DesiredMotion, Law, View
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


class SteppedFlight:
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
        self._mission = mission
        self._piloted = {name: PilotedAircraft(mission, name) for name in piloted}
        first = [mission.leader.vehicle, *mission.deputies]
        names = [*first, *(name for name in mission.followers_by_name if name not in first)]
        self.aircraft: dict[str, Aircraft | EmulatedForeignLeader] = {
            name: self._piloted.get(name) or aircraft_of(mission, name) for name in names
        }
        """Everyone who flies, by name, the mission's leader first."""
        stepped = [*self.aircraft.values()]
        self._candidates = Candidates(stepped[: len(first)])
        self._followers = stepped[len(first) :]
        self._exchange = MailExchange()
        self._times: list[float] = []
        self._instants = chain.from_iterable(
            ((window, number == 0, now) for number, now in enumerate(due))
            for window, due in enumerate(windows(mission))
        )
        self._window = 0
        self._advance()

    @property
    def now(self) -> float:
        """Virtual time, s."""
        return self._times[-1]

    @property
    def views(self) -> Mapping[str, View]:
        """What pilots are asked now, by name. A companion with nothing to steer by asks nothing."""
        return {name: one.view for name, one in self._piloted.items() if one.view is not None}

    @property
    def left(self) -> int:
        """Steps that are left of the mission."""
        rehearsal = self._mission.rehearsal
        return round(rehearsal.duration_s * rehearsal.rate_hz) + 1 - len(self._times)

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
        order = [self._mission.leader.vehicle, *self._mission.followers_by_name]
        return flight_of(
            self._mission,
            self._times,
            [outcome_of(self.aircraft[name]) for name in order],
            wall_s=time.perf_counter() - self._began,
            interrupted=not self.is_over,
        )

    def _finish(self, wanted: Mapping[str, DesiredMotion]) -> None:
        said = [one.resume(wanted.get(name)) for name, one in self._piloted.items()]
        self._exchange.post(self._window, [*chain.from_iterable(said)])

    def _advance(self) -> None:
        self._window, begins, now = next(self._instants)
        mail = self._exchange.collect(self._window) if begins else []
        at_once, later = self._candidates.step(now, mail)
        published = fly_window(self._followers, [(now, [*mail, *at_once])])
        self._exchange.post(self._window, [*later, *published])
        self._times.append(now)
