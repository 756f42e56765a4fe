"""Scenarios, and what became of each."""

from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tests.docker.flown import Flown
from tests.docker.formation import Formation

Scenario = Callable[[Formation], Flown]

Settings = dict[str, Any]


class Removals:
    """Containers that are removed while the next flight flies."""

    def __init__(self, pool: Executor) -> None:
        self._pool = pool
        self._under_way: dict[str, Future[None]] = {}

    def begin(self, name: str, remove: Callable[[], None]) -> None:
        """Remove those of a scenario."""
        self._under_way[name] = self._pool.submit(remove)

    def finish(self, name: str) -> None:
        """Wait until those of a scenario are gone: its next flight needs their ports."""
        if name in self._under_way:
            self._under_way.pop(name).result()

    def finish_all(self) -> None:
        """Wait until nothing of any flight stays."""
        for name in list(self._under_way):
            self.finish(name)


def fly(
    compose: tuple[str, ...],
    name: str,
    directory: Path,
    flight: tuple[Scenario, Settings],
    removals: Removals,
    attempt: int,
) -> Flown:
    """One scenario, with a mission and containers of its own; nothing of it stays, however it ends.

    It flies at twice real time, if its settings say nothing of it: the containers take half a core. Flown
    again it flies in real time, as the computer may have been too slow. The next flight of another scenario
    does not wait until its containers are removed.
    """
    removals.finish(name)
    scenario, settings = flight
    mission = directory / "mission.yaml"
    mission.write_text(yaml.safe_dump(settings["mission"], sort_keys=False))
    mission.chmod(0o644)
    given = {"SPEEDUP": "2" if attempt == 1 else "1", **settings, "MISSION": str(mission)}
    given.pop("mission")
    formation = Formation(compose, name, directory, given)
    try:
        return scenario(formation)
    finally:
        removals.begin(name, formation.remove)


class AllFlights:
    """Every scenario that tests look at, each flown when it is first asked for.

    One formation at a time: ten containers take half a core on a fast machine, more than one on a slow one,
    and while they start all there is. Two beside each other would test the machine.
    """

    def __init__(self, fly: Callable[[str, int], Flown]) -> None:
        self._fly = fly
        self._flights: dict[str, list[Future[Flown]]] = {}

    def result(self, name: str, attempt: int) -> Flown:
        """What became of the latest flight of a scenario.

        Args:
            name: of the scenario.
            attempt: 1 for a test's first; the second one gets a second flight.

        Raises:
            Exception: the flight has failed; all tests that look at it get the same exception.
        """
        flights = self._flights.setdefault(name, [])
        if len(flights) < attempt:
            with ThreadPoolExecutor(max_workers=1) as pool:
                flights.append(pool.submit(self._fly, name, attempt))
        return flights[-1].result()


@dataclass(frozen=True, slots=True)
class Flights:
    """What became of each scenario, by name, as one test sees it."""

    flights: AllFlights
    attempt: int

    def __getitem__(self, name: str) -> Flown:
        return self.flights.result(name, self.attempt)
