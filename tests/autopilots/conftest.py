"""The autopilots' programs, no part of the project: tests that miss one are skipped with the reason."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from tests.autopilots.formation import Plan, load
from tests.autopilots.programs import FlightError, find_mosquitto
from tests.autopilots.simulators import PROGRAMS, Conditions, find_program
from tests.kit.missions import MISSIONS


def broker_program() -> str:
    """Find mosquitto; without it the test fails in CI, and is skipped elsewhere."""
    try:
        return find_mosquitto()
    except FlightError as error:
        if os.environ.get("CI"):
            pytest.fail(str(error))
        pytest.skip(str(error))


def program(kind: str) -> Path:
    """Find the autopilot's program that a variable names; skip the test where there is none."""
    try:
        return find_program(kind)
    except FlightError as error:
        pytest.skip(str(error))


def formation_of(
    kind: str,
    mission: str,
    conditions: Conditions,
    directory: Path,
    *,
    engage: bool,
    deputies: Sequence[str] = (),
) -> Plan:
    """Four of an autopilot's programs on a mission of this project."""
    return Plan(
        mission=load(MISSIONS / f"{mission}.yaml", {"deputies": list(deputies)}),
        kind=PROGRAMS[kind],
        binary=program(kind),
        conditions=conditions,
        directory=directory,
        mosquitto=broker_program(),
        engage=engage,
        # By what a deputy leads is in what companions record.
        record=bool(deputies),
    )


@pytest.fixture
def arduplanes_in_gusts(tmp_path: Path) -> Plan:
    """Four ArduPlanes on the circle, in wind and turbulence, two of them deputies."""
    gusts = Conditions(wind_m_s=5.0, wind_from_deg=270.0, turbulence=1.0)
    return formation_of(
        "arduplane", "ardupilot-sitl", gusts, tmp_path, engage=True, deputies=("f1", "f2")
    )


@pytest.fixture
def px4s(tmp_path: Path) -> Plan:
    """Four PX4s on the circle, in calm air."""
    return formation_of("px4", "px4-sitl", Conditions(), tmp_path, engage=True)


@pytest.fixture
def arduplane_pair(tmp_path: Path) -> Plan:
    """A leader and one follower, whose companions record."""
    plan = formation_of(
        "arduplane", "ardupilot-sitl", Conditions(wind_m_s=5.0), tmp_path, engage=False
    )
    slot = {"vehicle": "f1", "slot": {"forward_m": -25, "right_m": -25}}
    changes = {"followers": [slot], "vehicles": {"f2": None, "f3": None}}
    return replace(plan, mission=load(MISSIONS / "ardupilot-sitl.yaml", changes), record=True)
