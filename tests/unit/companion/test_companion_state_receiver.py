"""What a follower believes of a leader that flies north at 20 m/s, heard 20 times a second."""

from collections.abc import Callable

import pytest

from tests.kit.companion import leader_bytes
from tests.kit.states import FRAME
from vfguide.companion.alerts import Alerts
from vfguide.companion.state_receiver import StateReceiver
from vfguide.companion.timing import SAME_CLOCK, SharedClock


@pytest.fixture
def alerts() -> Alerts:
    return Alerts()


@pytest.fixture
def receiver(alerts: Alerts) -> StateReceiver:
    return StateReceiver(FRAME, SAME_CLOCK, alerts, whose="f2")


def ahead(now: float, off: float) -> bytes:
    """A state whose place is some metres ahead of the true one."""
    return leader_bytes(now, north=20.0 * now + off)


def taken(receiver: StateReceiver, off: Callable[[float], float]) -> list[float]:
    """When a state was not taken, of 20 s."""
    times = [step / 20 for step in range(400)]
    return [now for now in times if not receiver.take(ahead(now, off(now)), now)]


@pytest.mark.parametrize("back_s", [99.0, 13.0])
def test_a_leader_that_steps_40_m_ahead_is_silent_for_5_s_or_until_2_s_after_it_is_back(
    receiver, alerts, back_s
):
    refused = taken(receiver, lambda now: 40.0 if 10.0 <= now < back_s else 0.0)
    assert (refused[0], refused[-1]) == (10.0, pytest.approx(14.95))
    assert receiver.counters == {"impossible": 100}
    first, second = (one.text for one in alerts.heard(20.0))
    assert first.startswith("f2 reports what cannot be")
    assert second.startswith("f2 reports what can be again")
    assert alerts.heard(20.0) == []


def test_after_a_long_silence_a_leader_may_have_flown_far_and_one_that_restarts_is_heard(receiver):
    assert receiver.take(leader_bytes(0.0, sequence=5000), 0.0)
    assert receiver.take(ahead(20.0, -600.0), 20.0)
    assert receiver.take(leader_bytes(23.0, north=-140.0, sequence=1), 23.0)


def test_a_formation_whose_clock_starts_anew_is_heard_again():
    shift_s = [0.0]
    shifted = SharedClock(
        to_own=lambda time_s: time_s + shift_s[0], from_own=lambda own_s: own_s - shift_s[0]
    )
    receiver = StateReceiver(FRAME, shifted)
    for step in range(100):
        now = 630.0 + 0.05 * step
        assert receiver.take(leader_bytes(now), now)
    # The leader's computer has started anew: its clock is at 10 s, and it has flown on for 5 s.
    shift_s[0] = 630.0
    for step in range(100):
        own = 640.0 + 0.05 * step
        state = leader_bytes(own, time_s=own - 630.0)
        heard = receiver.take(state, own)
    assert heard


def test_states_that_go_back_in_time_are_not_judged():
    receiver = StateReceiver(FRAME, SAME_CLOCK)
    for step in range(200):
        now = 0.05 * step
        assert receiver.take(leader_bytes(now), now)
    for step in range(60):
        now = 10.0 + 0.05 * step
        assert not receiver.take(ahead(now, 60.0), now)
    before = receiver.counters["not newer"]
    for step in range(20):
        assert not receiver.take(leader_bytes(12.9 - 0.09 * step), 13.0)
    assert receiver.counters["not newer"] == before + 20
