import io
import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from tests.kit.flight import fly
from tests.kit.missions import shipped
from vfguide.commands.fly_live import LiveRow, find_slowness, line_of, live_table, rows_of
from vfguide.commands.terminal import Terminal
from vfguide.lab.report.figures import seen_from_leader
from vfguide.link.presence import Presence
from vfguide.record.flight import FlightRecord
from vfguide.record.latency import latency_of
from vfguide.record.vehicle import SLOT_SERIES

NAMES = ("leader", "f1", "f2", "f3")

ROW = LiveRow(
    vehicle="f1", mode="tracking", error_m=0.123, ground_speed_m_s=19.96, leader_age_s=0.0512
)


SECOND = replace(ROW, vehicle="f2")


def flown() -> FlightRecord:
    return fly("circle-calm", 1.0).record


def presence(**figures: float) -> Presence:
    return Presence(status="online", mode="joining", time_s=1.0, version="1", figures=figures)


def test_before_anything_is_known_every_vehicle_has_a_row_of_dashes():
    rows = rows_of(NAMES, None, {})
    assert [row.vehicle for row in rows] == list(NAMES)
    assert line_of(rows[:1]) == "leader - - m off"


def test_a_row_tells_true_distance_and_speed_and_what_the_companion_says():
    said = {"leader": presence(leader_age_ms_last=0.0), "f1": presence(leader_age_ms_last=51.2)}
    leader, f1, f2, _ = rows_of(NAMES, flown(), said)
    assert (leader.mode, f1.mode, f2.mode) == ("joining", "joining", "")
    assert (leader.leader_age_s, f1.leader_age_s, f2.leader_age_s) == (None, 0.0512, None)
    # Everyone starts out of place, at about the leader's airspeed.
    assert f1.error_m > 10.0
    assert 15.0 < f1.ground_speed_m_s < 25.0


def test_errors_are_from_the_slot_that_was_ordered_and_of_nobody_who_has_left():
    record = flown()
    leader, f1, f2, f3 = record.vehicles
    ordered = {
        name: np.full_like(f1.north_m, value)
        for name, value in zip(SLOT_SERIES, (0.0, 30.0, 0.0), strict=True)
    }
    left = {name: np.full_like(f2.north_m, np.nan) for name in SLOT_SERIES}
    changed = replace(record, vehicles=(leader, replace(f1, **ordered), replace(f2, **left), f3))
    _, first, second, _ = rows_of(NAMES, changed, {})
    forward, right = seen_from_leader(leader, f1)
    assert first.error_m == pytest.approx(math.hypot(forward[-1], right[-1] - 30.0))
    assert second.error_m is None
    assert line_of([second]) == "f2 - - m off"


def test_a_companion_that_is_gone_is_offline_whatever_it_did_last():
    gone = msgspec.structs.replace(presence(), status="offline")
    assert rows_of(("f1",), None, {"f1": gone})[0].mode == "offline"


def printed(*times_s: float) -> str:
    console = Terminal()
    console.file = io.StringIO()
    with live_table(console, "flying", 100.0) as show:
        for time_s in times_s:
            show(time_s, [ROW, SECOND])
    return console.file.getvalue()


def test_away_from_a_terminal_there_is_a_line_for_each_fifth_of_the_flight(monkeypatch):
    monkeypatch.setenv("TERM", "dumb")
    lines = printed(0.0, 1.0, 20.0, 21.0, 39.9, 40.0).splitlines()
    assert lines == [
        "flying: 20 of 100 s: f1 tracking 0.12 m off, f2 tracking 0.12 m off",
        "flying: 40 of 100 s: f1 tracking 0.12 m off, f2 tracking 0.12 m off",
    ]


def test_on_a_terminal_the_table_is_drawn_in_place(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    text = printed(1.0, 2.0)
    assert "flying: 2 of 100 s" in text
    for cell in ("f1", "f2", "tracking", "0.12", "20.0", "0.051"):
        assert cell in text
    # Up, to where the table before began.
    assert "\x1b[1A" in text


def test_a_computer_that_is_too_slow_for_the_flight_is_named_with_the_remedy():
    mission = shipped("circle-calm")
    assert mission.patience.leader_s == 0.6
    ages = {"leader_age_ms_p50": 300.0, "leader_age_ms_p99": 2800.0, "leader_age_ms_max": 1e4}

    def found(speedup: float, **more: float) -> str | None:
        return find_slowness(mission, latency_of({"f1": ages | more}, leader="leader"), speedup)

    assert found(2.0, leader_age_ms_p99=599.0) is None
    assert "2.8 s old" in str(found(2.0))
    assert "--speedup 1," in str(found(2.0))
    assert "--speedup" not in str(found(1.0))
    assert "end what else runs here" in str(found(1.0))
