"""`vfguide bench latency`: response time of companions, compared with other programs.

The benchmark is meant for four companions, their emulators and the broker on two cores at 50 Hz. On a busy
machine or at another rate, compare its figures only with those of the plain loops.
"""

import asyncio
import math
import os
import platform
import site
import socket
import tempfile
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import yaml

import sitl_stub
from sitl_stub.server import precise_event_loop
from vfguide.companion.consent import begin_flight
from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.aircraft import emulator_of
from vfguide.lab.rehearsal.processes import (
    Account,
    Process,
    account_of,
    broker,
    free_port,
    load,
    python_module,
    running,
)
from vfguide.lab.studies.flown import Row, article_mission, markdown
from vfguide.lab.studies.peers import PYMAVLINK_ENVIRONMENT, TimedVehicle, installed_mavsdk
from vfguide.link.keys import key_places, make_keys
from vfguide.mavlink.adapter import Vehicle, telemetry_at
from vfguide.mavlink.codec import Codec
from vfguide.mission import Mission
from vfguide.mission.load import with_overrides
from vfguide.mission.overrides import DEFAULTS, Overrides

WARM_S = 2.0
"""Time of answers before measurement begins."""

PATIENCE_S = 45.0
"""Time that clients get to start, to find their autopilot and to answer for `WARM_S`."""

PROGRAM_LOOK_S = 0.1
"""Interval of the check whether clients answer."""

PACE_STEP = 0.004
"""Difference between the paces of neighbouring aircraft: at 50 Hz two of them meet every 5 s."""

PEER_LEADER = "leader"
"""Vehicle whose start the peers' aircraft take; each flies alone."""


def formation(rate_hz: float, autopilot: Literal["ardupilot", "px4"] = "ardupilot") -> Mission:
    """Return the article's circle in wind at a guidance rate, with this autopilot in all vehicles."""
    settings = ((("vehicles", DEFAULTS, "autopilot"), autopilot),)
    return with_overrides(
        article_mission("circle-wind"), Overrides(rate_hz=rate_hz, settings=settings)
    )


def write_mission(mission: Mission, directory: Path) -> Path:
    """Write the mission file of the companions."""
    path = directory / "mission.yaml"
    content = mission.model_dump(mode="json", exclude_unset=True)
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


@dataclass(slots=True, kw_only=True)
class Client:
    """Program under test, with the aircraft it communicates with."""

    process: Process
    vehicle: TimedVehicle
    is_companion: bool = False
    """Whether the program is a companion of this project."""

    @property
    def name(self) -> str:
        """Name of the program in results."""
        return self.process.name

    def account(self) -> Account | None:
        """Return the resources used so far; None if the program does not run."""
        return None if self.process.pid is None else account_of(self.process.pid)


async def measure_responses(
    link: str, *, seconds: float, rate_hz: float, directory: Path
) -> dict[str, Any]:
    """Run every client at once, and time them for `seconds` after warming up.

    Returns:
        Each client's response times, share of a core and memory; the companions together; MAVSDK's version.

    Raises:
        VfguideError: a companion does not answer.
    """
    clients = companions(link, rate_hz=rate_hz, directory=directory)
    clients += peers(rate_hz=rate_hz, directory=directory)
    async with AsyncExitStack() as stack:
        for client in clients:
            await stack.enter_async_context(running(client.process))
        await stack.enter_async_context(in_the_air(clients, rate_hz))
        await warm_up(clients, rate_hz)
        for client in clients:
            client.vehicle.begin()
        before = [client.account() for client in clients]
        await asyncio.sleep(seconds)
        after = [client.account() for client in clients]
    results = {
        client.name: {
            **figures_of(client.vehicle.responses),
            "unanswered": client.vehicle.unanswered,
            **usage_between(earlier, later),
        }
        for client, earlier, later in zip(clients, before, after, strict=True)
    }
    together = [
        one for client in clients if client.is_companion for one in client.vehicle.responses
    ]
    version = installed_mavsdk()
    return {
        "clients": results,
        "companions": {
            "names": [client.name for client in clients if client.is_companion],
            **figures_of(together),
        },
        "mavsdk": "not installed" if version is None else version,
    }


def usage_between(earlier: Account | None, later: Account | None) -> dict[str, float]:
    """Return share of a core and memory; empty for a process that has ended."""
    if earlier is None or later is None:
        return {}
    return {
        "cpu_percent": round(100.0 * later.since(earlier).cpu_share, 2),
        "memory_mb": round(later.rss_mb, 1),
    }


def companions(link: str, *, rate_hz: float, directory: Path) -> list[Client]:
    """Return the companions of a formation, as `vfguide companion` runs them."""
    mission = formation(rate_hz)
    path = write_mission(mission, directory)
    names = [mission.leader.vehicle, *mission.followers_by_name]
    make_keys(key_places(path), mission.name, names)
    clients = []
    for name in names:
        port = free_port(socket.SOCK_DGRAM)
        options = [f"--mission={path}", f"--mavlink=udpin://127.0.0.1:{port}", f"--link={link}"]
        # A separate consent: that of an earlier measurement belongs to another flight.
        begin_flight(directory / "state", name)
        options.append(f"--state={directory / 'state'}")
        clients.append(
            Client(
                process=Process(
                    name,
                    python_module("vfguide", "companion", name, *options, "--engage"),
                    directory / f"{name}.log",
                ),
                vehicle=TimedVehicle(emulator_of(mission, name), port=port, rate_hz=rate_hz),
                is_companion=True,
            )
        )
    return clients


def peers(*, rate_hz: float, directory: Path) -> list[Client]:
    """Return the other installed clients, each with a PX4 of its own."""
    kinds = ["bare", "pymavlink"] if installed_mavsdk() is None else ["bare", "pymavlink", "mavsdk"]
    mission = formation(rate_hz, "px4")
    clients = []
    for kind in kinds:
        port = free_port(socket.SOCK_DGRAM)
        autopilot = streaming(mission, rate_hz)
        clients.append(
            Client(
                process=Process(
                    kind,
                    python_module("vfguide.lab.studies.peers", kind, str(port)),
                    directory / f"{kind}.log",
                    {**PYMAVLINK_ENVIRONMENT, **home_in(directory)},
                ),
                vehicle=TimedVehicle(autopilot, port=port, rate_hz=rate_hz),
            )
        )
    return clients


def home_in(directory: Path) -> dict[str, str]:
    """Return variables that keep MAVSDK's files in the study's directory; packages are found as before."""
    places = dict.fromkeys(("HOME", "TMPDIR"), str(directory))
    return {**places, "PYTHONUSERBASE": site.getuserbase()}


def streaming(mission: Mission, rate_hz: float) -> sitl_stub.Autopilot:
    """Return an autopilot that already streams position and airspeed at the rate."""
    autopilot = emulator_of(mission, PEER_LEADER)
    address = Vehicle(
        system_id=autopilot.system_id,
        component_id=1,
        hold="heading-hold",
        lateral_acceleration=math.inf,
    )
    codec = Codec(autopilot.system_id, address.component_id)
    autopilot.receive(codec.encode(telemetry_at(address, rate_hz)))
    return autopilot


@asynccontextmanager
async def in_the_air(clients: Sequence[Client], rate_hz: float) -> AsyncIterator[None]:
    """Fly every aircraft for as long as the context lasts.

    Telemetry starts evenly spread over the interval and then drifts, since each clock has a pace of its own.
    So every client meets the moments at which all others are busy, but none meets them every time.
    """
    first_s = asyncio.get_running_loop().time()
    tasks = [
        asyncio.create_task(
            client.vehicle.fly(
                first_s + number / (rate_hz * len(clients)),
                pace=1.0 + PACE_STEP * (number - 0.5 * (len(clients) - 1)),
            )
        )
        for number, client in enumerate(clients)
    ]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        results = await asyncio.gather(*tasks, return_exceptions=True)
    for result in results:
        if isinstance(result, Exception):
            raise result


async def warm_up(clients: Sequence[Client], rate_hz: float) -> None:
    """Wait until every client answers; a peer that does not appears as such in the result.

    Raises:
        VfguideError: a companion does not answer.
    """
    enough = rate_hz * WARM_S
    with suppress(TimeoutError):
        async with asyncio.timeout(PATIENCE_S):
            while any(len(client.vehicle.responses) < enough for client in clients):
                await asyncio.sleep(PROGRAM_LOOK_S)
    for client in clients:
        if client.is_companion and len(client.vehicle.responses) < enough:
            raise VfguideError(f"{client.name} does not answer: {client.process.last_words()}")


def quantile(ordered: Sequence[float], share: float) -> float:
    """Return the quantile of a sorted series by the nearest rank."""
    return ordered[max(math.ceil(share * len(ordered)) - 1, 0)]


def figures_of(seconds: Sequence[float]) -> dict[str, Any]:
    """Return count, median, 99th percentile and maximum in milliseconds; of no times only the count."""
    ordered = sorted(seconds)
    if not ordered:
        return {"count": 0}
    return {
        "count": len(ordered),
        "p50_ms": round(quantile(ordered, 0.5) * 1e3, 3),
        "p99_ms": round(quantile(ordered, 0.99) * 1e3, 3),
        "max_ms": round(ordered[-1] * 1e3, 3),
    }


LATENCY_COLUMNS = {
    "telemetry in to setpoint out": "{case}",
    "p50 ms": "{p50_ms:.2f}",
    "p99 ms": "{p99_ms:.2f}",
    "max ms": "{max_ms:.2f}",
    "core %": "{cpu_percent:.2f}",
    "MB": "{memory_mb:.2f}",
    "count": "{count:g}",
    "unanswered": "{unanswered:g}",
}


def run_latency(*, seconds: float, rate_hz: float) -> dict[str, Any]:
    """Run the whole benchmark, which takes these seconds and some more for starting.

    Returns:
        Figures in milliseconds, percent of one core and 10^6 bytes, ready for JSON.

    Raises:
        VfguideError: the broker or a program fails.
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
    return {
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


def rows_of(result: dict[str, Any]) -> Iterator[Row]:
    """Yield a row per client, one for all companions, and one for a MAVSDK that is absent."""
    response = result["response"]
    yield from response["clients"].items()
    together = response["companions"]
    yield "companions together", {key: together[key] for key in together if key != "names"}
    if "mavsdk" not in response["clients"]:
        yield "mavsdk", {"p50_ms": response["mavsdk"]}


def render(result: dict[str, Any]) -> str:
    """Return the result as text with a table."""
    machine = result["machine"]
    before, after = (
        " ".join(f"{one:.2f}" for one in machine[f"load_{when}"]) for when in ("before", "after")
    )
    return (
        f"{result['rate_hz']:g} Hz, {result['seconds']:g} s each; {machine['cores']} cores, "
        f"Python {machine['python']}\nload before {before}, after {after}\n\n"
        f"{markdown(LATENCY_COLUMNS, rows_of(result))}"
    )
