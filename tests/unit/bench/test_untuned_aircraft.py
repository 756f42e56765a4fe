"""The matrix of untuned aircraft: what is declared changes nothing of what flies."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from tests.benchmarks.untuned import (
    AIRCRAFT,
    AIRS,
    DECLARED,
    Judged,
    UntunedFlight,
    figures_of,
    flights,
    lone_roll_rate,
    rolled,
)
from tests.kit.missions import content_of
from vfguide.lab.rehearsal.aircraft import checked_settings

GOOD = Judged(
    flight=UntunedFlight(aircraft="late", air="still", declared="right"),
    mean_error_m=0.4,
    max_error_m=1.0,
    settle_10m_s=30.0,
    min_separation_m=20.0,
    limited=0.1,
    roll_rate_rad_s=math.radians(4.0),
    lone_roll_rate_rad_s=0.0,
    restless="f1",
    handed_back=(),
)


def test_aircraft_of_all_plants_are_flown_once_in_each_air_by_all_kinds_of_declarations():
    plants = {one.emulator["plant"] for one in AIRCRAFT.values()}
    assert plants == {"heading-hold", "course-hold", "bank", "npfg", "six-dof"}
    found = flights()
    assert sorted((one.aircraft, one.air) for one in found) == sorted(product(AIRCRAFT, AIRS))
    assert {one.declared for one in found} == set(DECLARED)


@pytest.mark.parametrize("name", AIRCRAFT)
def test_what_is_declared_changes_nothing_of_the_aircraft_that_flies(name):
    missions = {
        how: UntunedFlight(aircraft=name, air="rough", declared=how).mission() for how in DECLARED
    }
    plants = {how: checked_settings(one, "f1").config().plant for how, one in missions.items()}
    assert len(set(plants.values())) == 1
    told = {one.vehicles["f1"].alpha_1_s for one in missions.values()}
    assert len(told) >= 3


def test_a_mission_has_places_speeds_and_slots_and_no_gains():
    mission = UntunedFlight(aircraft="arduplane", air="article", declared="unknown").mission()
    said = content_of(mission)
    assert said["controller"] == {"type": "slot"}
    assert "gain" not in said["path"]
    assert set(said["vehicles"]["f1"]) == {"system_id", "autopilot", "airspeed_range_m_s"}


def test_a_lone_aircraft_rolls_in_turbulence_alone():
    assert lone_roll_rate("arduplane", "still", 1) == pytest.approx(0.0, abs=1e-6)
    assert math.radians(1.0) < lone_roll_rate("arduplane", "rough", 1) < math.radians(10.0)


@pytest.mark.parametrize(("aircraft", "rolls"), [("late", False), ("arduplane", True)])
def test_banks_that_jump_with_setpoints_are_no_rolls_of_a_plant_that_has_none(aircraft, rolls):
    """0, 8, 0, 8, … degrees at 20 Hz are 160 deg/s; a lag of 0.4 s leaves 6 % of that."""
    time_s = np.arange(200) / 20.0
    found = math.degrees(rolled(aircraft, time_s, np.radians(np.where(np.arange(200) % 2, 8, 0))))
    assert found == pytest.approx(160.0 if rolls else 10.0, rel=0.1)


@pytest.mark.parametrize(
    ("change", "verdicts"),
    [
        ({}, (False, False, False)),
        ({"max_error_m": 60.0}, (True, False, False)),
        ({"max_error_m": math.nan}, (True, False, False)),
        ({"handed_back": ("f2",)}, (True, False, False)),
        ({"min_separation_m": 4.9}, (False, True, False)),
        ({"limited": 0.21}, (False, False, True)),
        ({"roll_rate_rad_s": math.radians(5.1)}, (False, False, True)),
        (
            {"roll_rate_rad_s": math.radians(19.0), "lone_roll_rate_rad_s": math.radians(10.0)},
            (False, False, False),
        ),
        (
            {"roll_rate_rad_s": math.radians(21.0), "lone_roll_rate_rad_s": math.radians(10.0)},
            (False, False, True),
        ),
    ],
)
def test_what_is_lost_near_or_thrashed_is_told_apart(change, verdicts):
    one = replace(GOOD, **change)  # type: ignore[arg-type]
    assert (one.lost, one.near, one.thrashed) == verdicts


def test_the_figures_count_what_must_not_be():
    bad = replace(GOOD, mean_error_m=7.0, limited=0.5)
    rough = replace(GOOD, flight=replace(GOOD.flight, air="rough"), mean_error_m=1.25)
    late = replace(GOOD, settle_10m_s=math.inf, mean_error_m=7.0)
    figures = figures_of([GOOD, bad, rough, late])
    counts = [figures[name] for name in ("flights", "lost", "near", "thrashed", "late")]
    assert counts == [4, 0, 0, 1, 1]
    assert (figures["smooth_m"], figures["rough_median_m"]) == (7.0, 1.25)
