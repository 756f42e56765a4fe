"""`vfguide bench`: what this computer takes."""

import json
from collections.abc import Sequence

from vfguide.commands.terminal import Terminal
from vfguide.lab.studies.latency import render, run_latency
from vfguide.lab.studies.trust_cost import AIRCRAFT, render_trust_cost, run_trust_cost


def measure_trust(*, seconds: float, aircraft: Sequence[int] | None, as_json: bool) -> None:
    """Measure what signing costs, and print it.

    Raises:
        VfguideError: one of the programs does not do its part.
    """
    result = run_trust_cost(seconds=seconds, aircraft=aircraft or AIRCRAFT)
    Terminal().tell(json.dumps(result, indent=2) if as_json else render_trust_cost(result))


def measure_latency(*, seconds: float, rate_hz: float, as_json: bool) -> None:
    """Measure, and print the table or the figures."""
    result = run_latency(seconds=seconds, rate_hz=rate_hz)
    Terminal().tell(json.dumps(result, indent=2) if as_json else render(result))
