"""`vfguide check`: all that can be known before take-off."""

import json
from collections.abc import Sequence
from typing import Annotated

import typer

from vfguide.commands.options import AsJson, Controller, MissionFile, Settings
from vfguide.commands.terminal import Terminal, stopped_by_signals
from vfguide.errors import VfguideError
from vfguide.mission import MissionError, read_mission
from vfguide.mission.feasibility import check_mission
from vfguide.mission.finding import Finding, MissionSource, worst_first
from vfguide.mission.model import Mission
from vfguide.mission.overrides import Overrides, parse_settings

PASSED, WARNED, WRONG = 0, 1, 2


def check(
    mission: MissionFile,
    *,
    controller: Controller = None,
    settings: Settings = None,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 on warnings.")] = False,
    as_json: AsJson = False,
) -> None:
    """Find out what can be known before take-off.

    One line for each finding; what formation error to expect is flown in virtual time: a minute as the
    mission declares it, and 40 s each by aircraft that answer half and twice as fast. Exit status: 0 ready
    to fly, 1 with warnings under --strict, 2 the mission cannot be flown, 3 the rehearsal broke or was
    stopped.
    """
    overrides = Overrides(controller=controller, settings=parse_settings(settings or ()))
    try:
        loaded = read_mission(mission, overrides)
    except MissionError as error:
        if not as_json:
            raise
        status = report_findings(error.faults, name=None, strict=strict, as_json=True)
        raise typer.Exit(status) from error
    read = loaded.mission
    findings = with_expectation(check_mission(read, loaded.source), read, loaded.source)
    raise typer.Exit(report_findings(findings, name=read.name, strict=strict, as_json=as_json))


def lowered_in(mission: Mission) -> list[Finding]:
    """Return notes on the gains that are lowered because some aircraft do not bear the declared ones."""
    # Imported here, since a wrong mission needs no plan.
    from vfguide.companion.guided_vehicle import LoweredGain, lowered_gains
    from vfguide.companion.mission_plan import flight_plan

    lowered: dict[LoweredGain, list[str]] = {}
    for name in mission.companions:
        for one in lowered_gains(flight_plan(mission, name)):
            lowered.setdefault(one, []).append(name)
    return [
        Finding(
            "note",
            ("path", "gain") if one.name == "path.gain" else ("controller", one.name),
            one.sentence(f"{names[0]} bears" if len(names) == 1 else f"{', '.join(names)} bear"),
        )
        for one, names in lowered.items()
    ]


def with_expectation(
    findings: Sequence[Finding], mission: Mission, source: MissionSource
) -> Sequence[Finding]:
    """Add a rehearsal's results to the findings of a formation that can fly; the worst come first.

    Raises:
        VfguideError: the rehearsal was stopped.
    """
    if not mission.followers or any(one.severity == "error" for one in findings):
        return findings
    # Imported here, since a mission that is not flown needs no emulator.
    from vfguide.lab.studies.prediction import expected_precision

    with stopped_by_signals() as stop:
        expected = expected_precision(mission, stop)
    if expected is None:
        raise VfguideError("stopped before the rehearsal had ended")
    found = [*lowered_in(mission), *expected]
    return worst_first([*findings, *(one.placed(source) for one in found)])


def report_findings(
    findings: Sequence[Finding], *, name: str | None, strict: bool, as_json: bool
) -> int:
    """Print findings, one line each, and return the exit status."""
    output = Terminal()
    kinds = {finding.severity for finding in findings}
    status = WRONG if "error" in kinds else WARNED if strict and "warning" in kinds else PASSED
    if as_json:
        content = {"mission": name, "findings": [finding.as_json() for finding in findings]}
        output.tell(json.dumps(content, indent=2))
        return status
    for finding in findings:
        output.tell(str(finding))
    if status == PASSED:
        output.tell(f"{name}: ready to fly")
    return status
