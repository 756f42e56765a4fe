"""Scenarios, and what became of each."""

from collections.abc import Callable
from concurrent.futures import Future
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
    mission.write_text(yaml.safe_dump(settings.pop("mission"), sort_keys=False))
    mission.chmod(0o644)
    formation = Formation(compose, name, directory, {"MISSION": str(mission), **settings})
    try:
        return scenario(formation)
    finally:
        formation.remove()


class Flights:
    """What became of each scenario, by name; whoever asks too early waits."""

    def __init__(self, flights: dict[str, Future[Flown]]) -> None:
        self._flights = flights

    def __getitem__(self, name: str) -> Flown:
        return self._flights[name].result()
