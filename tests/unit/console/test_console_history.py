import numpy as np
import pytest

from vfguide.lab.console.alarms import FINE_S, History


def filled(seconds: float, *, room: int) -> History:
    """Ten samples a second, each with its own time as its value."""
    history = History(2, 1, room=room)
    for time_s in np.arange(0.0, seconds, 0.1):
        history.add(float(time_s), np.full((2, 1), time_s))
    return history


def test_everything_is_kept_while_there_is_room_but_what_is_not_later():
    history = filled(20.0, room=1000)
    assert history.time_s.size == 200
    np.testing.assert_allclose(history.series(1, 0), history.time_s, atol=1e-4)
    for time_s in (19.9, 19.9, 0.5, 21.0):
        history.add(time_s, np.zeros((2, 1)))
    assert list(history.time_s[199:]) == [pytest.approx(19.9), 21.0]


@pytest.mark.parametrize("room", [800, 1500])
def test_a_long_flight_keeps_its_room_its_beginning_and_its_newest_minute(room):
    history = filled(1800.0, room=room)
    time_s = history.time_s
    assert time_s.size <= room
    assert time_s[0] == 0.0
    assert time_s[-1] == pytest.approx(1799.9)
    newest = min(FINE_S, 0.1 * room / 2) - 1.0
    assert (time_s > 1799.9 - newest).sum() >= 10.0 * newest - 1.0
    np.testing.assert_allclose(history.series(0, 0), time_s, atol=1e-3)


def test_older_samples_stay_evenly_spread():
    """1800 s in at most 0.75 * 1500 samples, 600 of which are the newest minute: 1740 s in 525 at most."""
    time_s = filled(1800.0, room=1500).time_s
    steps = np.diff(time_s[time_s < 1500.0])
    assert steps.max() <= 6.5
    assert steps.max() / steps.min() <= 2.0 + 1e-6
