"""`vfguide identify`: fly steps with one vehicle, and find how its autopilot answers."""

import asyncio
import sys
import time
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Annotated

import typer
from msgspec.structs import replace

from vfguide.commands.companion import read_key
from vfguide.commands.credentials import check_by_mavsdk, check_flies
from vfguide.commands.options import (
    AutopilotUrl,
    MissionOption,
    SigningKeyFile,
    StateDirectory,
    VehicleName,
    in_directory,
)
from vfguide.commands.terminal import stop_event
from vfguide.companion.alerts import Event
from vfguide.companion.clock import Clock
from vfguide.companion.consent import FileStore, default_directory
from vfguide.companion.daemon import POLL_S, take_leave
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import Outgoing
from vfguide.errors import InputError, VfguideError
from vfguide.identification.core import Identification
from vfguide.identification.flown import profile_text
from vfguide.identification.recording import described, shortcoming
from vfguide.mavlink.address import Address, parse_address
from vfguide.mavlink.connection import Connection, open_connection
from vfguide.mavlink.framing import ConnectionSigning, Introduction
from vfguide.mission import read_mission

PATIENCE_S = 5.0
"""Time for positions to arrive at the start, before the operator is warned."""

UNSURE = 1
"""Exit status when the flight was not informative enough."""


def identify(
    vehicle: VehicleName,
    *,
    mission: MissionOption,
    mavlink: AutopilotUrl,
    engage: Annotated[
        bool,
        typer.Option("--engage", help="Put the autopilot into its guided mode without the pilot."),
    ] = False,
    repeats: Annotated[
        int, typer.Option(min=1, max=10, help="How often each group of steps is flown.")
    ] = 1,
    speedup: Annotated[
        float, typer.Option(metavar="X", help="Simulated seconds of the emulator per real second.")
    ] = 1.0,
    out: Annotated[Path | None, in_directory("Keep profile and picture there.")] = None,
    state: StateDirectory = None,
    signing_key_file: SigningKeyFile = None,
) -> None:
    """Fly small steps of course and speed, and find how the autopilot answers.

    Prints alpha, beta, dead times, lags and slip with their intervals, as lines for the mission file, from a
    flight of two minutes. Exit status: 0 they are known well, 1 they are not or the flight ended early, and
    the last line says what was not learned; 2 the input is wrong, 3 broken.
    """
    # Imported here, since an aircraft's computer lacks the plotting library.
    from vfguide.identification.plot import draw_findings

    flown = read_mission(mission).mission
    check_flies(flown, vehicle)
    check_by_mavsdk(flown, vehicle, signing_key_file=signing_key_file)
    if not speedup > 0.0:
        raise InputError(f"--speedup: {speedup:g} is not above 0")
    address = parse_address(mavlink)
    plan = unled(flight_plan(flown, vehicle))
    for line in described(plan.airframe, repeats):
        say(line)
    say("engaging by itself" if engage else "waiting until the pilot selects the guided mode")
    key = None if signing_key_file is None else read_key(signing_key_file)
    signing = None if key is None else ConnectionSigning(key, time.time)
    identification = Identification(
        plan,
        adapter_of(flown.vehicles[vehicle]),
        engage=engage,
        repeats=repeats,
        signing=signing,
        consent=FileStore(state or default_directory(), vehicle),
    )
    by_mavsdk = flown.vehicles[vehicle].by_mavsdk
    introduction = Introduction(plan.system_id, plan.component_id, signing=signing)
    asyncio.run(
        fly_steps(identification, address, Clock(rate=speedup), introduction, by_mavsdk=by_mavsdk)
    )
    findings = identification.recording.findings()
    if findings.course is None and findings.speed is None:
        why = identification.ended or "too few reports of its steps"
        raise VfguideError(
            f"the flight ended before anything could be learned ({why}): fly it again, to its end"
        )
    text = profile_text(vehicle, findings)
    sys.stdout.write(text)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        profile, picture = out / f"{vehicle}.yaml", out / f"{vehicle}.png"
        profile.write_text(text, encoding="utf-8")
        draw_findings(findings, picture, f"{vehicle}: how its autopilot answers")
        say(f"written to {profile} and {picture}")
    lacking = shortcoming(findings, plan.airframe, identification.ended)
    if lacking is None:
        raise typer.Exit(0)
    say(lacking)
    raise typer.Exit(UNSURE)


def unled(plan: FlightPlan) -> FlightPlan:
    """Return the plan without dead times and lags, which are to be identified and not compensated."""
    airframe = replace(
        plan.airframe, course_dead_time=0.0, course_lag=0.0, speed_dead_time=0.0, speed_lag=0.0
    )
    return replace(plan, airframe=airframe)


async def fly_steps(
    identification: Identification,
    address: Address,
    clock: Clock,
    introduction: Introduction,
    *,
    by_mavsdk: bool,
) -> None:
    """Fly until all steps are done, or SIGINT or SIGTERM; then hand back control."""
    stop = stop_event()
    connection: Connection | None = None

    def dispatch(answer: Outgoing) -> None:
        if answer.to_autopilot and connection is not None:
            connection.send(answer.to_autopilot)
        for event in answer.events:
            tell(event)

    def take(datagram: bytes) -> None:
        dispatch(identification.receive(datagram, clock.now()))

    async with open_connection(
        address, take, random=Random(), by_mavsdk=by_mavsdk, introduction=introduction
    ) as opened:
        connection = opened
        patient_until, complaint = clock.now() + PATIENCE_S, None
        while not (stop.is_set() or identification.stage.is_over):
            dispatch(identification.poll(clock.now()))
            obstacle = identification.obstacle(clock.now())
            if clock.now() > patient_until and obstacle not in {None, complaint}:
                complaint = obstacle
                say(f"warning: {obstacle}")
            with suppress(TimeoutError):
                async with asyncio.timeout(clock.real_seconds(POLL_S)):
                    await stop.wait()
        await take_leave(identification, dispatch, clock)


def tell(event: Event) -> None:
    """Print an event on standard error."""
    say(f"{'warning: ' if event.warning else ''}{event.text}")


def say(text: str) -> None:
    """Print a line on standard error, since standard output is for the profile."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
