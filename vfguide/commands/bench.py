"""`vfguide bench`: what this computer takes."""

import json

from vfguide.bench.latency import render, run_latency
from vfguide.commands.terminal import Terminal


def measure_latency(*, seconds: float, rate_hz: float, as_json: bool) -> None:
    """Measure, and print the table or the figures."""
    result = run_latency(seconds=seconds, rate_hz=rate_hz)
    Terminal().tell(json.dumps(result, indent=2) if as_json else render(result))
