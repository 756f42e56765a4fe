"""`vfguide bench latency`: how fast a companion answers.

What latency is required to be, for a reader to hold the measured figures against.

With four companions, their emulators and the broker on two cores at 50 Hz; on a machine that is busy with
something else, or at another rate, the comparison says little.
"""

import asyncio
import os
import platform
import tempfile
from pathlib import Path
from typing import Any

from sitl_stub.server import precise_event_loop
from vfguide.lab.rehearsal.processes import broker, load
from vfguide.lab.studies.comparison import markdown
from vfguide.lab.studies.response import measure_responses

LOADS = ("load_before", "load_after")

TIMES = ("p50_ms", "p99_ms", "max_ms")

HEADINGS = ("p50 ms", "p99 ms", "max ms")


def comparison(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Each required figure with the measured one; a figure that could not be measured is None.

    Times are ratios to what loops of the same run take that do nothing but hear and answer: how fast the
    machine is, and what else it does, cancels out.
    """
    clients, companions = result["response"]["clients"], result["response"]["companions"]
    ours = [clients[name] for name in companions["names"]]
    p50, core = companions.get("p50_ms"), greatest(ours, "cpu_percent")
    rows = [
        ("p50 over that of the MAVSDK loop", "", 1.0, ratio(p50, clients.get("mavsdk"), "p50_ms")),
        (
            "p50 over that of the pymavlink loop",
            "",
            1.8,
            ratio(p50, clients["pymavlink"], "p50_ms"),
        ),
        (
            "core, busiest companion over the pymavlink loop",
            "",
            2.5,
            ratio(core, clients["pymavlink"], "cpu_percent"),
        ),
        ("memory, largest companion", "MB", 80.0, greatest(ours, "memory_mb")),
    ]
    return [
        {
            "figure": figure,
            "unit": unit,
            "at_most": at_most,
            "measured": measured,
            "met": measured is not None and measured <= at_most,
        }
        for figure, unit, at_most, measured in rows
    ]


def ratio(figure: float | None, entry: dict[str, Any] | None, key: str) -> float | None:
    """A figure over that of another client; None where one of them is missing."""
    other = None if entry is None else entry.get(key)
    return None if figure is None or not other else figure / float(other)


def greatest(entries: list[dict[str, Any]], key: str) -> float | None:
    """The greatest of the figures that there are."""
    return max((float(entry[key]) for entry in entries if key in entry), default=None)


def run_latency(*, seconds: float, rate_hz: float) -> dict[str, Any]:
    """Measure everything; takes the seconds and some more for starting.

    Args:
        seconds: length of the measurement.
        rate_hz: telemetry and leader states per second.

    Returns:
        Figures in milliseconds, percent of one core and 10^6 bytes, ready for JSON.

    Raises:
        VfguideError: the broker or one of the programs does not do its part.
    """
    with (
        tempfile.TemporaryDirectory() as scratch,
        asyncio.Runner(loop_factory=precise_event_loop) as runner,
    ):
        return runner.run(_measure(Path(scratch), seconds=seconds, rate_hz=rate_hz))


async def _measure(directory: Path, *, seconds: float, rate_hz: float) -> dict[str, Any]:
    before = load()
    async with broker(directory) as port:
        link = f"mqtt://127.0.0.1:{port}"
        response = await measure_responses(
            link, seconds=seconds, rate_hz=rate_hz, directory=directory
        )
    result: dict[str, Any] = {
        "rate_hz": rate_hz,
        "seconds": seconds,
        "machine": {
            "cores": len(os.sched_getaffinity(0)),
            "python": platform.python_version(),
            "load_before": before,
            "load_after": load(),
        },
        "response": response,
    }
    return {**result, "required": comparison(result)}


def render(result: dict[str, Any]) -> str:
    """The result in words and tables."""
    machine, response = result["machine"], result["response"]
    before, after = (" ".join(f"{one:.2f}" for one in machine[key]) for key in LOADS)
    title = (
        f"{result['rate_hz']:g} Hz, {result['seconds']:g} s each; {machine['cores']} cores, "
        f"Python {machine['python']}"
    )
    return "\n\n".join(
        [
            f"{title}\nload before {before}, after {after}",
            response_table(response),
            required_table(result["required"]),
        ]
    )


def response_table(response: dict[str, Any]) -> str:
    """One line for each client."""
    head = ["telemetry in to setpoint out", *HEADINGS, "core %", "MB", "count", "unanswered"]
    entries = {**response["clients"], "companions together": response["companions"]}
    keys = (*TIMES, "cpu_percent", "memory_mb", "count", "unanswered")
    rows = [[name, *(shown(one.get(key)) for key in keys)] for name, one in entries.items()]
    if "mavsdk" not in response["clients"]:
        rows.append(["mavsdk", response["mavsdk"], *[""] * (len(keys) - 1)])
    return markdown(head, rows)


def required_table(required: list[dict[str, Any]]) -> str:
    """One line for each required figure."""
    rows = [
        [
            one["figure"],
            shown(one["measured"]),
            shown(one["at_most"]),
            one["unit"],
            "met" if one["met"] else "NOT MET",
        ]
        for one in required
    ]
    return markdown(["for information", "measured", "at most", "", ""], rows)


def shown(value: float | None) -> str:
    """A figure for reading; a dash for one that is not there."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.2f}"
