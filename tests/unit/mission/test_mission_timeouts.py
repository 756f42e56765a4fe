"""The section that says how long silences are borne."""

from pathlib import Path

import pytest

from vfguide.mission import MissionError, load_mission, parse_mission

MISSIONS = sorted((Path(__file__).parents[3] / "missions").glob("*.yaml"))

LEAST = """
name: alone
origin: {latitude_deg: 0, longitude_deg: 0, altitude_amsl_m: 0}
path: {type: line, course_deg: 90}
leader: {vehicle: one, airspeed_m_s: 20}
vehicles: {one: {system_id: 1}}
"""


def with_patience(section: str) -> bytes:
    return (LEAST + f"patience: {{{section}}}\n").encode()


def test_a_mission_that_says_nothing_has_the_usual_patience():
    patience = parse_mission(LEAST.encode(), file="m.yaml").mission.patience
    assert (patience.telemetry_s, patience.leader_s) == (1.0, 0.6)
    assert (patience.prediction_s, patience.breakaway_s) == (30.0, 25.0)


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_a_shipped_mission_outlasts_a_silence_of_twenty_seconds(file):
    assert load_mission(file).patience.prediction_s > 20.0


def test_what_is_given_counts_and_the_rest_is_as_usual():
    content = with_patience("prediction_s: 5, breakaway_s: 0")
    patience = parse_mission(content, file="m.yaml").mission.patience
    assert (patience.leader_s, patience.prediction_s, patience.breakaway_s) == (0.6, 5.0, 0.0)


@pytest.mark.parametrize(
    "section",
    [
        "telemetry_s: 0",
        "leader_s: 0",
        "leader_s: -1",
        "prediction_s: 0",
        "prediction_s: 3600.1",
        "prediction_s: .inf",
        "breakaway_s: -0.1",
        "breakaway_s: 3601",
        "breakaway_s: .nan",
        "breakaway_s: '5'",
        "patient: 3",
    ],
)
def test_a_patience_that_cannot_be_had_is_refused_by_name(section):
    field = section.split(":", maxsplit=1)[0]
    with pytest.raises(MissionError, match=rf"patience\.{field}"):
        parse_mission(with_patience(section), file="m.yaml")
