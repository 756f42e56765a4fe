"""Guidance that asks for what the vehicle cannot fly, for a moment and for longer."""

from types import SimpleNamespace

import pytest

import vfguide.companion.steering
from tests.kit.companion import HEADING, SET_MODE, new_flight
from vfguide.companion.supervisor import Mode

REASON = "setpoint not flyable"


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Stands for guidance that goes wrong: what it closes to counts as impossible to fly."""
    made = SimpleNamespace(is_open=True)
    judge = vfguide.companion.steering.is_flyable
    monkeypatch.setattr(
        vfguide.companion.steering, "is_flyable", lambda *wanted: made.is_open and judge(*wanted)
    )
    return made


def complaints(events: list[tuple[float, str]]) -> list[tuple[float, str]]:
    return [one for one in events if "cannot be flown" in one[1]]


def test_setpoints_that_cannot_be_flown_are_counted_and_told_once(gate):
    flown = new_flight(until_s=10.0)
    assert flown.companion.counters[REASON] == 0
    gate.is_open = False
    flown.run(15.0)
    assert flown.companion.counters[REASON] == 50
    assert [time for time, _ in complaints(flown.events)] == [pytest.approx(10.1)]
    assert flown.later(HEADING, 10.0) == []


def test_the_complaint_is_a_warning(gate):
    flown = new_flight(until_s=10.0)
    gate.is_open = False
    telemetry = flown.waiting + flown.autopilot.advance(10.1)
    out = flown.companion.receive_mavlink(telemetry, 10.1)
    assert [event.warning for event in out.events] == [True]
    assert not out.steered


def test_after_more_than_a_second_of_them_the_vehicle_is_handed_back(gate):
    flown = new_flight(until_s=10.0)
    gate.is_open = False
    # Looked at once a second: 0.9 s after the first of them is too early.
    flown.run(11.5)
    assert flown.later(SET_MODE, 10.0) == []
    assert flown.autopilot_mode == "GUIDED"
    flown.run(15.0)
    assert flown.later(SET_MODE, 10.0) == [12.0]
    assert flown.autopilot_mode == "LOITER"
    assert len(complaints(flown.events)) == 1


def test_a_moment_without_them_passes_by_itself(gate):
    flown = new_flight(until_s=10.0)
    gate.is_open = False
    flown.run(10.5)
    gate.is_open = True
    flown.run(40.0)
    assert flown.later(HEADING, 10.0)[0] == pytest.approx(10.6)
    assert flown.later(SET_MODE, 10.0) == []
    assert flown.mode_at(40.0) is Mode.TRACKING
    # The next time is told again.
    gate.is_open = False
    flown.run(41.0)
    assert [time for time, _ in complaints(flown.events)] == [
        pytest.approx(10.1),
        pytest.approx(40.1),
    ]


def test_a_vehicle_that_was_handed_back_is_steered_again_once_its_pilot_says_so(gate):
    flown = new_flight(until_s=10.0)
    gate.is_open = False
    flown.run(15.0)
    gate.is_open = True
    flown.run(20.0)
    assert flown.autopilot_mode == "LOITER"
    flown.pilot("GUIDED", until_s=85.0)
    assert flown.later(HEADING, 10.0)[0] == pytest.approx(20.1)
    assert flown.autopilot_mode == "GUIDED"
    assert flown.mode_at(85.0) is Mode.TRACKING


def test_autopilots_that_need_a_stream_are_not_engaged_without_one(gate):
    gate.is_open = False
    flown = new_flight(kind="px4", version=(1, 16), until_s=5.0)
    assert flown.times(SET_MODE) == []
    gate.is_open = True
    flown.run(10.0)
    assert flown.autopilot_mode == "OFFBOARD"
