"""A formation in containers without a broker, as a user flies it who wants a verdict."""

import json
from typing import Any

from tests.docker.flown import Flown
from tests.docker.formation import Formation
from tests.kit.missions import content_of, on_the_circle

FLIGHT_S = 48.0
"""They start in their slots, companions take over some seconds later: all are back for the second half."""


def plain(formation: Formation) -> Flown:
    """Fly and wait."""
    formation.begin_in_foreground()
    return formation.finish_in_foreground()


def docker_flights() -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    mission = content_of(on_the_circle(), "json")
    settings = {"COMPOSE_PROFILES": "direct", "DURATION": f"{FLIGHT_S:g}"}
    return {"direct": (plain, {"mission": mission, **settings})}


def test_a_formation_in_containers_keeps_the_missions_figures_and_leaves_a_report(flights, tell):
    flown = flights["direct"]
    tell(f"direct: {json.dumps(flown.summary['formation'])}")
    assert flown.summary["accepted"], flown.summary["rejections"]
    assert flown.status == 0
    assert flown.summary["mode"] == "live"
    assert flown.summary["duration_s"] >= FLIGHT_S
    assert flown.summary["latency"]
    names = {path.name for path in flown.directory.iterdir()}
    assert {"summary.json", "flight.npz", "report.html"} <= names
