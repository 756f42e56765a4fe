"""What it costs that an autopilot's limits are tighter than the mission's, in words."""

import math
from collections.abc import Callable

import pytest

from tests.kit.missions import shipped
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.narrowed_limits import narrowed_limits
from vfguide.companion.plan import FlightPlan, flown_by
from vfguide.mavlink.parameters import AutopilotResponse


@pytest.fixture
def circling() -> Callable[[str], FlightPlan]:
    """A vehicle of circle-wind: clockwise, 150 m, 20 m/s: 0.1333 rad/s."""
    return lambda name: flight_plan(shipped("circle-wind"), name)


def told(declared: FlightPlan, autopilot: AutopilotResponse) -> str:
    return narrowed_limits(declared, flown_by(declared, autopilot)).sentence


def test_limits_that_are_no_tighter_cost_nothing(circling):
    wide = AutopilotResponse(
        airspeed_min=10.0,
        airspeed_max=40.0,
        max_bank=1.0,
        climb_max=20.0,
        sink_max=20.0,
    )
    assert told(circling("f1"), wide) == ""
    assert told(circling("f1"), AutopilotResponse()) == ""


@pytest.mark.parametrize(
    ("name", "autopilot", "words"),
    [
        # Outer slot, 20 m behind: (20 + 0.1333 * 20, 0.1333 * 20) = 22.82 m/s, whose bank is
        # atan(22.82 * 0.1333 / 9.80665) = 17.2 degrees; the leader's atan(20 * 0.1333 / 9.80665) = 15.2.
        (
            "f1",
            AutopilotResponse(max_bank=math.radians(30.0)),
            "30 degrees of bank, not 45 (its slot takes 17.2)",
        ),
        (
            "leader",
            AutopilotResponse(max_bank=math.radians(30.0)),
            "30 degrees of bank, not 45 (its path takes 15.2)",
        ),
        ("f1", AutopilotResponse(airspeed_max=24.0), "up to 24 m/s, not 32 (its slot takes 22.8)"),
        # Inner slot: (20 - 0.1333 * 20, 0.1333 * 20) = 17.54 m/s.
        (
            "f2",
            AutopilotResponse(airspeed_min=15.0),
            "down to 15 m/s, not 12 (its slot takes 17.5)",
        ),
        (
            "f1",
            AutopilotResponse(climb_max=3.0, sink_max=2.0),
            "climbs of 3 m/s, not 4, descents of 2 m/s, not 3",
        ),
    ],
)
def test_what_is_narrowed_is_told_with_what_the_flight_takes(circling, name, autopilot, words):
    sentence = told(circling(name), autopilot)
    assert words in sentence
    assert "less is left" in sentence
    assert not narrowed_limits(circling(name), flown_by(circling(name), autopilot)).too_tight


@pytest.mark.parametrize(
    "autopilot",
    [
        AutopilotResponse(max_bank=math.radians(17.0)),
        AutopilotResponse(airspeed_max=22.0),
    ],
)
def test_limits_that_the_slot_exceeds_are_called_too_tight(circling, autopilot):
    declared = circling("f1")
    found = narrowed_limits(declared, flown_by(declared, autopilot))
    assert found.too_tight
    assert "the slot cannot be held" in found.sentence


def test_a_path_that_climbs_is_held_against_the_climb():
    """climb-and-turn: 8.5 degrees at 20 m/s are 20 tan 8.5 = 2.99 m/s."""
    declared = flight_plan(shipped("climb-and-turn"), "leader")
    assert "climbs of 5 m/s, not 6 (its path takes 2.99)" in told(
        declared, AutopilotResponse(climb_max=5.0)
    )
    low = flown_by(declared, AutopilotResponse(climb_max=2.0))
    assert narrowed_limits(declared, low).too_tight


def test_behind_a_leader_without_a_path_the_tightest_circle_is_told():
    """V² / (g tan 20 degrees)."""
    declared = flight_plan(shipped("foreign-leader"), "f1")
    cruise = declared.airframe.cruise
    radius = cruise**2 / (9.80665 * math.tan(math.radians(20.0)))
    found = narrowed_limits(
        declared, flown_by(declared, AutopilotResponse(max_bank=math.radians(20.0)))
    )
    assert f"no turn tighter than {radius:.0f} m" in found.sentence
    assert not found.too_tight
