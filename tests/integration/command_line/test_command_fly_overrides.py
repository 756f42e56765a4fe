"""Options of `vfguide fly` in the place of what the mission file says."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Make = Callable[..., Any]

SLOW = "{system_id: 1, airspeed_range_m_s: [5, 32]}"


@pytest.fixture
def recorded(command: Make, pair_with: Make, tmp_path: Path, unplotted: None) -> Make:
    """Flies the pair with options: its summary, and the arrays of its record."""
    del unplotted

    def fly(name: str, *options: str | int) -> tuple[dict[str, Any], dict[str, Any]]:
        directory = tmp_path / name
        # a short flight is judged before it has settled, and may be refused
        options = ("--duration", 8, *options)
        outcome = command("fly", pair_with(), "--json", "--out", directory, *options)
        assert outcome.status in {0, 1}
        with np.load(directory / "flight.npz") as stored:
            arrays = {key: stored[key] for key in stored.files if key != "description"}
        return json.loads(outcome.out), arrays

    return fly


@pytest.mark.parametrize(
    ("options", "field", "value"),
    [
        (("--controller", "article"), "controller", "article"),
        (("--plant", "course-hold"), "plant", "course-hold"),
        (("--plant", "bank", "--speed-response", "tecs"), "plant", "bank"),
        (("--wind", "article"), "wind", "article"),
        (("--seed", 7), "seed", 7),
    ],
)
def test_an_option_is_in_the_summary_and_changes_the_flight(recorded, options, field, value):
    usual, as_usual = recorded("usual")
    other, otherwise = recorded("other", *options)
    assert other[field] == value
    assert usual[field] != value
    same = {"controller", "plant", "wind", "seed", "rate_hz", "duration_s"} - {field}
    assert {name: usual[name] for name in same} == {name: other[name] for name in same}
    assert not np.array_equal(as_usual["vehicle_1_north_m"], otherwise["vehicle_1_north_m"])


def test_calm_takes_the_wind_of_the_file_away(command, pair_with):
    windy = pair_with(
        ("rehearsal:", "wind: {type: steady, speed_m_s: 5, toward_deg: 90}\nrehearsal:")
    )
    for options, wind in [((), "steady"), (("--wind", "calm"), "calm")]:
        outcome = command("fly", windy, "--duration", 2, "--json", *options)
        assert json.loads(outcome.out)["wind"] == wind


def test_a_course_hold_is_sent_ground_speeds_and_a_heading_hold_airspeeds(recorded):
    for plant, sent, unsent in [
        ("course-hold", "ground_speed_setpoint_m_s", "airspeed_setpoint_m_s"),
        ("heading-hold", "airspeed_setpoint_m_s", "ground_speed_setpoint_m_s"),
    ]:
        _, arrays = recorded(plant, "--plant", plant)
        assert np.isfinite(arrays[f"vehicle_1_{sent}"][-1])
        assert np.isnan(arrays[f"vehicle_1_{unsent}"]).all()


@pytest.mark.parametrize(("duration", "rate"), [(5, 20), (5, 10), (3, 40)])
def test_duration_and_rate_set_the_number_of_samples(recorded, duration, rate):
    summary, arrays = recorded("short", "--duration", duration, "--rate", rate)
    assert (summary["duration_s"], summary["rate_hz"]) == (duration, rate)
    assert arrays["time_s"].size == duration * rate + 1
    assert np.allclose(np.diff(arrays["time_s"]), 1 / rate)


def test_the_same_seed_gives_the_same_flight_to_the_last_bit(recorded):
    _, first = recorded("first", "--seed", 3)
    _, second = recorded("second", "--seed", 3)
    assert first.keys() == second.keys()
    for name, array in first.items():
        assert np.array_equal(array, second[name], equal_nan=array.dtype.kind == "f"), name


def test_an_option_may_ask_for_what_the_mission_cannot_fly(command, pair_with):
    slow = pair_with(("airspeed_m_s: 20", "airspeed_m_s: 7"), ("{system_id: 1}", SLOW))
    outcome = command("fly", slow, "--duration", 2, "--wind", "article")
    assert outcome.status == 2
    assert "the declared wind reaches 8.0 m/s, the leader's airspeed is 7 m/s" in outcome.err


def test_what_an_option_asks_for_is_not_blamed_on_the_file(command, pair_with):
    (line,) = (
        line
        for line in command("fly", pair_with(), "--duration", 5).lines
        if "warning" in line and "settle_10m_s" in line
    )
    assert line.endswith("rehearsal of 5 s; lengthen --duration or ask for earlier settling")


def test_nothing_can_be_replaced_where_nothing_is_written(refusal, pair_with):
    line = refusal("fly", pair_with(), "--force")
    assert line == "--force: nothing is replaced without --out; add --out DIR, or leave it out"
