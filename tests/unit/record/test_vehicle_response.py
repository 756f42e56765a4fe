"""How a vehicle was finally flown, in a companion's file and in a flight's record."""

import json

import numpy as np
import pytest

from tests.kit.records import still_flight, still_leader
from vfguide.lab.report.metrics import summarise, summary_json
from vfguide.lab.report.page import write_report
from vfguide.lab.report.wording import response_words, verdict_text
from vfguide.record.flight import FlightRecord
from vfguide.record.response import (
    RESPONSE_HEADER,
    VehicleResponse,
    compose_response,
    encode_response,
    read_response,
)

TIME = np.arange(0.0, 4.0)

LEARNED = VehicleResponse(
    alpha_1_s=0.4,
    course_dead_time_s=0.2,
    course_lag_s=0.1,
    course_spread=1.25,
    beta_1_s=0.32,
    speed_dead_time_s=0.5,
    speed_lag_s=0.0,
    speed_spread=2.0,
    slips=True,
    turn_efficiency=0.81,
    max_bank_deg=22.0,
)

DECLARED = VehicleResponse(
    alpha_1_s=1.0, course_dead_time_s=0.0, course_lag_s=0.0, slips=False, max_bank_deg=45.0
)

SENTENCE = (
    "alpha 0.40 (0.32 to 0.50) 0.3 s late, declared 1.00; beta 0.32 (0.16 to 0.64) 0.5 s late,"
    " not declared; turns 0.81 of what its bank says: slips; banks to 22°, declared 45°"
)


def flight(**given):
    return still_flight(TIME, still_leader(TIME, **given))


def test_the_last_response_that_was_flown_by_is_read(tmp_path):
    file = tmp_path / "f1.response.csv"
    first = VehicleResponse(alpha_1_s=1.2, slips=True)
    file.write_bytes(
        RESPONSE_HEADER + encode_response(0.1, first) + encode_response(9.0, LEARNED) + b"12.0,0"
    )
    assert read_response(file) == LEARNED
    assert read_response(tmp_path / "none.csv") is None


def test_a_record_keeps_how_it_was_flown_and_what_was_declared(tmp_path):
    flight(response=LEARNED, declared=DECLARED).save(tmp_path / "flight.npz")
    leader = FlightRecord.load(tmp_path / "flight.npz").leader
    assert (leader.response, leader.declared) == (LEARNED, DECLARED)


@pytest.mark.parametrize("entry", [[1], {"alpha_1_s": "x"}, {"alpha_1_s": float("nan")}])
def test_a_damaged_response_is_refused(entry):
    with pytest.raises(ValueError, match="a response is"):
        compose_response(entry)


def test_a_report_says_the_learned_response_beside_the_declared(tmp_path):
    record = flight(response=LEARNED, declared=DECLARED)
    summary = summarise(record)
    assert response_words(summary.vehicles["leader"]) == SENTENCE
    assert f"leader: {SENTENCE}" in verdict_text(summary).plain
    assert SENTENCE in write_report(record, tmp_path).read_text(encoding="utf-8")
    plain = json.loads(json.dumps(summary_json(summary)))["vehicles"]["leader"]
    assert plain["response"]["alpha_1_s"] == 0.4
    assert plain["declared"]["alpha_1_s"] == 1.0


def test_a_response_that_was_right_is_one_word_and_of_a_log_nothing_is_said():
    right = VehicleResponse(
        alpha_1_s=1.0, course_dead_time_s=0.0, course_lag_s=0.0, course_spread=1.1, slips=False
    )
    told = summarise(flight(response=right, declared=DECLARED)).vehicles["leader"]
    assert response_words(told) == "alpha 1.00 as declared; beta not told"
    assert response_words(summarise(flight(declared=DECLARED)).vehicles["leader"]) is None
