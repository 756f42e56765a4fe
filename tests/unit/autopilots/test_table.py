"""The table of real autopilots: of several flights the worst counts, of those whose simulators kept time."""

import shlex
from dataclasses import replace

import pytest

from tests.autopilots.fly_sitl import arguments, changes_of
from tests.autopilots.formation import load
from tests.autopilots.table import ROWS, Flight, append, read, table
from vfguide.lab.report.figures import Spread

FLIGHT = Flight(
    row="circle",
    options="missions/ardupilot-sitl.yaml",
    began="2026-11-25T02:00:00Z",
    duration_s=240.0,
    intended=Spread(mean=0.21, p95=0.52, max=0.81),
    as_it_is=Spread(mean=0.24, p95=0.6, max=0.9),
    roll=1.1,
    roll_deg_s=2.5,
    limited=0.02,
    lost_s=0.03,
    load=4.0,
)


def test_the_worst_of_several_flights_stands_in_the_table():
    better = replace(FLIGHT, intended=Spread(mean=0.19, p95=0.55, max=0.7), roll=1.2)
    last = table([FLIGHT, better]).splitlines()[-1]
    assert last == "| circle | 2 | 0.21 | 0.55 | 0.81 | 0.24 | 2.5 | 1.20 | 2.0% | 0.21, 0.19 |"


def test_a_flight_whose_simulators_lost_time_does_not_count():
    late = replace(FLIGHT, intended=Spread(mean=2.0, p95=3.0, max=4.0), lost_s=0.31)
    last = table([FLIGHT, late]).splitlines()[-1]
    assert last.startswith("| circle | 1 of 2 | 0.21 | 0.52 | 0.81 |")


def test_a_flight_that_was_kept_is_read_again(tmp_path):
    file = tmp_path / "flights.jsonl"
    append(file, FLIGHT)
    append(file, replace(FLIGHT, row="line"))
    assert read(file) == [FLIGHT, replace(FLIGHT, row="line")]


@pytest.mark.parametrize("row", ROWS)
def test_every_row_is_a_mission_that_can_be_flown(row):
    options = arguments().parse_args(shlex.split(ROWS[row]))
    mission = load(options.mission, changes_of(options.changes))
    assert len(mission.followers) == 3


def test_what_is_set_for_all_vehicles_reaches_each_of_them():
    options = arguments().parse_args(shlex.split(ROWS["arduplane-auto"]))
    mission = load(options.mission, changes_of(options.changes))
    assert {(one.slips, one.alpha_1_s) for one in mission.vehicles.values()} == {("auto", 1.2)}
