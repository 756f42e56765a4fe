"""The autopilots' programs: a machine without them may do without these tests, CI may not."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pytest

from tests.autopilots.formation import Plan, load
from tests.autopilots.programs import FlightError, find_mosquitto
from tests.autopilots.simulators import PROGRAMS, Conditions, find_program

Found = TypeVar("Found")

MISSIONS = Path(__file__).parents[2] / "missions"


def found_or_skipped(find: Callable[[], Found]) -> Found:
    """What is found; without it the test is skipped, or fails where CI runs."""
    try:
        return find()
    except FlightError as error:
        if os.environ.get("CI"):
            pytest.fail(str(error))
        pytest.skip(str(error))


def program(kind: str) -> Path:
    """The autopilot's program that a variable names."""
    return found_or_skipped(lambda: find_program(kind, os.environ.get(kind.upper())))


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
        mosquitto=found_or_skipped(find_mosquitto),
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
