"""Scenarios, and what became of each."""

from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tests.docker.flown import Flown
from tests.docker.formation import Formation

Scenario = Callable[[Formation], Flown]

Settings = dict[str, Any]


def fly(
    compose: tuple[str, ...], name: str, directory: Path, flight: tuple[Scenario, Settings]
) -> Flown:
    """One scenario, with a mission and containers of its own; nothing of it stays, however it ends."""
    scenario, settings = flight
    mission = directory / "mission.yaml"
    mission.write_text(yaml.safe_dump(settings["mission"], sort_keys=False))
    mission.chmod(0o644)
    environment = {key: value for key, value in settings.items() if key != "mission"}
    formation = Formation(compose, name, directory, {**environment, "MISSION": str(mission)})
    try:
        return scenario(formation)
    finally:
        formation.remove()


class AllFlights:
    """Every scenario that tests look at, in the order given."""

    def __init__(self, scenarios: Iterable[str], fly: Callable[[str], Future[Flown]]) -> None:
        self._fly = fly
        self._flights = {name: [fly(name)] for name in scenarios}

    def result(self, name: str, attempt: int) -> Flown:
        """What became of the latest flight of a scenario; whoever asks too early waits.

        Args:
            name: of the scenario.
            attempt: 1 for a test's first; who asks for a second one gets a second flight.
        """
        flights = self._flights[name]
        if len(flights) < attempt:
            flights.append(self._fly(name))
        return flights[-1].result()


@dataclass(frozen=True, slots=True)
class Flights:
    """What became of each scenario, by name, as one test sees it."""

    flights: AllFlights
    attempt: int

    def __getitem__(self, name: str) -> Flown:
        return self.flights.result(name, self.attempt)
