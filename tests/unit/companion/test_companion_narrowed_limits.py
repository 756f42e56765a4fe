"""What it costs that an autopilot's limits are tighter than the mission's, in words."""

import math

import pytest

from tests.kit.missions import plan_of
from vfguide.companion.narrowed_limits import NarrowedLimits, narrowed_limits
from vfguide.companion.plan import FlightPlan, flown_by
from vfguide.mavlink.parameters import AutopilotResponse

BANK_30 = math.radians(30.0)
CLIMBS = {"climb_max": 3.0, "sink_max": 2.0}


def circling(name: str) -> FlightPlan:
    """A vehicle of circle-wind: clockwise, 150 m, 20 m/s: 0.1333 rad/s."""
    return plan_of("circle-wind", name)


def narrowed(declared: FlightPlan, **autopilot: float) -> NarrowedLimits:
    return narrowed_limits(declared, flown_by(declared, AutopilotResponse(**autopilot)))


WIDE = {"airspeed_min": 10.0, "airspeed_max": 40.0, "max_bank": 1.0}


@pytest.mark.parametrize("autopilot", [{}, WIDE | {"climb_max": 20.0, "sink_max": 20.0}])
def test_limits_that_are_no_tighter_cost_nothing(autopilot):
    assert narrowed(circling("f1"), **autopilot).sentence == ""


@pytest.mark.parametrize(
    ("name", "autopilot", "words"),
    [
        # Outer slot, 20 m behind: (20 + 0.1333 * 20, 0.1333 * 20) = 22.82 m/s, whose bank is
        # atan(22.82 * 0.1333 / 9.80665) = 17.2 degrees; the leader's atan(20 * 0.1333 / 9.80665) = 15.2.
        ("f1", {"max_bank": BANK_30}, "30 degrees of bank, not 45 (its slot takes 17.2)"),
        ("leader", {"max_bank": BANK_30}, "30 degrees of bank, not 45 (its path takes 15.2)"),
        ("f1", {"airspeed_max": 24.0}, "up to 24 m/s, not 32 (its slot takes 22.8)"),
        # Inner slot: (20 - 0.1333 * 20, 0.1333 * 20) = 17.54 m/s.
        ("f2", {"airspeed_min": 15.0}, "down to 15 m/s, not 12 (its slot takes 17.5)"),
        ("f1", CLIMBS, "climbs of 3 m/s, not 4, descents of 2 m/s, not 3"),
    ],
)
def test_what_is_narrowed_is_told_with_what_the_flight_takes(name, autopilot, words):
    found = narrowed(circling(name), **autopilot)
    assert words in found.sentence
    assert "less is left" in found.sentence
    assert not found.too_tight


@pytest.mark.parametrize("autopilot", [{"max_bank": math.radians(17.0)}, {"airspeed_max": 22.0}])
def test_limits_that_the_slot_exceeds_are_called_too_tight(autopilot):
    found = narrowed(circling("f1"), **autopilot)
    assert found.too_tight
    assert "the slot cannot be held" in found.sentence


def test_a_path_that_climbs_is_held_against_the_climb():
    """climb-and-turn: 8.5 degrees at 20 m/s are 20 tan 8.5 = 2.99 m/s."""
    declared = plan_of("climb-and-turn", "leader")
    words = "climbs of 5 m/s, not 6 (its path takes 2.99)"
    assert words in narrowed(declared, climb_max=5.0).sentence
    assert narrowed(declared, climb_max=2.0).too_tight


def test_behind_a_leader_without_a_path_the_tightest_circle_is_told():
    """V² / (g tan 20 degrees)."""
    declared = plan_of("foreign-leader")
    radius = declared.airframe.cruise**2 / (9.80665 * math.tan(math.radians(20.0)))
    found = narrowed(declared, max_bank=math.radians(20.0))
    assert f"no turn tighter than {radius:.0f} m" in found.sentence
    assert not found.too_tight
