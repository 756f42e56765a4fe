from collections.abc import Callable
from typing import Any

import pytest

from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.detected import DetectedAutopilot
from vfguide.mavlink.px4 import Px4

Make = Callable[..., Any]

ARDUPILOT, PX4, PAPARAZZI = 3, 12, 9
GUIDED, OFFBOARD = 15, 6 << 16


def test_an_autopilot_that_was_not_heard_is_told_nothing(address: Make) -> None:
    adapter = DetectedAutopilot(address())
    assert adapter.engage() == adapter.hand_back() == adapter.hold_altitude(500.0) == []
    assert adapter.fly(1.0, 20.0) == adapter.stay_ready(1.0, 20.0) == []
    assert not adapter.is_engaged(GUIDED)
    assert not adapter.is_handed_back(12)


@pytest.mark.parametrize(("number", "kind"), [(ARDUPILOT, ArduPlane), (PX4, Px4)])
def test_the_heartbeat_tells_how_to_speak(address: Make, number: int, kind: Make) -> None:
    adapter, known = DetectedAutopilot(address()), kind(address())
    assert adapter.recognise(number) is None
    for act in ("engage", "hand_back"):
        found, expected = getattr(adapter, act)(), getattr(known, act)()
        assert [str(one) for one in found] == [str(one) for one in expected]
    assert [str(one) for one in adapter.fly(1.0, 20.0)] == [
        str(one) for one in known.fly(1.0, 20.0)
    ]
    for mode in (GUIDED, OFFBOARD):
        assert adapter.is_engaged(mode) is known.is_engaged(mode)
    assert adapter.parameters == known.parameters
    assert adapter.streams_before_engaging is known.streams_before_engaging
    assert adapter.keep_alive_s == known.keep_alive_s


def test_it_stays_with_the_first_autopilot(address: Make) -> None:
    adapter = DetectedAutopilot(address())
    adapter.recognise(ARDUPILOT)
    assert "the mission says ArduPilot and the vehicle is PX4" in str(adapter.recognise(PX4))
    assert adapter.is_engaged(GUIDED)


def test_an_autopilot_that_is_not_spoken_here_is_told_so(address: Make) -> None:
    complaint = DetectedAutopilot(address()).recognise(PAPARAZZI)
    assert complaint == ("the vehicle is autopilot number 9, which is not spoken here: not steered")


@pytest.mark.parametrize(("kind", "other"), [(ArduPlane, PX4), (Px4, ARDUPILOT)])
def test_another_autopilot_than_the_missions_is_told_in_words(
    address: Make, kind: Make, other: int
) -> None:
    complaint = str(kind(address()).recognise(other))
    assert "ArduPilot" in complaint
    assert "PX4" in complaint
    assert "not steered" in complaint
