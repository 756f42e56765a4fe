import pytest

from tests.kit.autopilot import address, asked
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.detected import DetectedAutopilot
from vfguide.mavlink.px4 import Px4
from vfguide.mavlink.reports import VersionReport

ARDUPILOT, PX4, PAPARAZZI = 3, 12, 9
GUIDED, OFFBOARD = 15, 6 << 16


def test_an_autopilot_that_was_not_heard_is_told_nothing():
    adapter = DetectedAutopilot(address())
    assert not adapter.is_ready
    assert adapter.questions() == []
    assert adapter.engage() == adapter.hand_back() == adapter.hold_altitude(500.0) == []
    assert adapter.fly(asked(1.0, 20.0)) == adapter.stay_ready(asked(1.0, 20.0)) == []
    assert not adapter.is_engaged(GUIDED)
    assert not adapter.is_handed_back(12)


@pytest.mark.parametrize(("number", "kind"), [(ARDUPILOT, ArduPlane), (PX4, Px4)])
def test_the_heartbeat_tells_how_to_speak(number, kind):
    adapter, known = DetectedAutopilot(address()), kind(address())
    assert adapter.recognise(number) is None
    for act, *given in (("engage",), ("hand_back",), ("fly", asked(1.0, 20.0))):
        found, expected = getattr(adapter, act)(*given), getattr(known, act)(*given)
        assert [str(one) for one in found] == [str(one) for one in expected]
    for mode in (GUIDED, OFFBOARD):
        assert adapter.is_engaged(mode) is known.is_engaged(mode)
    assert adapter.is_ready
    same = ("counts_ground_stations", "is_ready", "keep_alive_s", "parameters")
    for name in (*same, "streams_before_engaging"):
        assert getattr(adapter, name) == getattr(known, name)


def test_it_hears_the_version_of_what_was_found():
    adapter = DetectedAutopilot(address(px4_steering="auto"))
    adapter.recognise(PX4)
    assert not adapter.is_ready
    assert len(adapter.questions()) == 1
    assert "Guided Course" in str(adapter.hear(VersionReport(major=1, minor=18)))
    assert adapter.is_ready
    assert adapter.counts_ground_stations


def test_it_stays_with_the_first_autopilot():
    adapter = DetectedAutopilot(address())
    adapter.recognise(ARDUPILOT)
    assert "the mission says ArduPilot and the vehicle is PX4" in str(adapter.recognise(PX4))
    assert adapter.is_engaged(GUIDED)


def test_an_autopilot_that_is_not_spoken_here_is_told_so():
    complaint = DetectedAutopilot(address()).recognise(PAPARAZZI)
    assert complaint == ("the vehicle is autopilot number 9, which is not spoken here: not steered")


@pytest.mark.parametrize(("kind", "other"), [(ArduPlane, PX4), (Px4, ARDUPILOT)])
def test_another_autopilot_than_the_missions_is_told_in_words(kind, other):
    complaint = str(kind(address()).recognise(other))
    assert "ArduPilot" in complaint
    assert "PX4" in complaint
    assert "not steered" in complaint
