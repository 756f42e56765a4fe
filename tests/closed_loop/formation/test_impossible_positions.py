"""Reports that cannot be true, through MAVLink bytes, measured on the emulators' true places.

Short flights at 10 Hz, leader and two followers, all in place at the start; one flight has several faults,
one after the other, far enough apart for each to be told.
"""

from math import cos, inf, radians, sin

import numpy as np
import pytest

from sitl_stub import Fault
from tests.benchmarks.impossible_reports import Flown, Stop, fly, on_course
from vfguide.mission import Mission

APART_S = 16.0
"""Between two faults: no text is repeated within 10 s."""

FIRST_S = 5.0

LEAST_M = 5.0

OWN_FAULTS = (
    ("latitude and longitude 0", Fault("zero", 0.0, 3.0), "m from where it can be", 1.0),
    ("5 km off", Fault("offset", 0.0, 3.0, 5000.0), "5000 m from where it can be", 1.0),
    ("50 m off", Fault("offset", 0.0, 3.0, 50.0), "50 m from where it can be", 1.0),
    ("frozen", Fault("frozen", 0.0, 3.0), "the position does not change in flight", 2.0),
    # Nothing to steer by for 5 s, and then for another 2 s: it flies on on its last course.
    ("velocity 327 m/s", Fault("velocity", 0.0, 3.0, 327.0), "a speed of 327 m/s", 10.0),
    ("airspeed 500 m/s", Fault("airspeed", 0.0, 3.0, 500.0), "an airspeed of 500 m/s", 1.0),
    # No boot time is newer than the one before for 5 s, 100 m of a turn: reports count as they arrive.
    ("clock stops for 5 s", Fault("clock", 0.0, 5.0, 5.0), "boot times stand still", 80.0),
)
"""What f1's autopilot reports, what its pilot is told, and how far (m) f1 may get off."""

LOST_S = (0.5, 1.0, 5.0)
"""What the leader's clock loses."""

OFF_M = (1.0, 8.0, 220.0)
"""How far that takes followers off. For the longest nothing steers the leader, and f1 stays beside it."""

STEERED = {"tracking", "joining"}

SLOWER_S = 20.0
"""Between two of these."""


def starts(number: int, apart_s: float = APART_S) -> float:
    """When a fault begins, s."""
    return FIRST_S + apart_s * number


def placed(fault: Fault, at_s: float) -> Fault:
    return Fault(fault.kind, at_s, fault.length_s, fault.north, fault.east)


def small(name: str) -> Mission:
    """A mission in place, at 10 Hz and with the two followers beside the leader."""
    content = on_course(name).model_dump(exclude_unset=True)
    content["followers"] = content["followers"][:2]
    content["rehearsal"]["rate_hz"] = 10
    content["patience"] = {"prediction_s": 6.0, "breakaway_s": 8.0}
    del content["vehicles"]["f3"], content["rehearsal"]["start"]["f3"]
    return Mission.model_validate(content)


@pytest.fixture(scope="module")
def circle() -> Mission:
    return small("circle-wind")


@pytest.fixture(scope="module")
def line() -> Mission:
    return small("line-wind")


@pytest.fixture(scope="module")
def undisturbed(circle: Mission) -> Flown:
    return fly(circle, {}, starts(len(OWN_FAULTS)))


@pytest.fixture(scope="module")
def one_after_another(circle: Mission) -> Flown:
    faults = [placed(fault, starts(number)) for number, (_, fault, *_) in enumerate(OWN_FAULTS)]
    return fly(circle, {"f1": faults}, starts(len(OWN_FAULTS)))


@pytest.mark.parametrize("number", range(len(OWN_FAULTS)), ids=[name for name, *_ in OWN_FAULTS])
def test_a_followers_impossible_reports_cost_metres_at_most_and_are_told(
    number, undisturbed, one_after_another
):
    begins = starts(number)
    ends = begins + APART_S
    _, _, sentence, most_m = OWN_FAULTS[number]
    assert one_after_another.off(undisturbed, "f1", begins, ends) < most_m
    assert one_after_another.nearest(begins, ends) > 20.0
    assert any(sentence in text for text in one_after_another.said("f1", begins, ends))
    assert one_after_another.mode_at("f1", ends) == "tracking"


@pytest.fixture(scope="module")
def leader_slips(circle: Mission) -> Flown:
    """The leader's clock loses time while the aircraft flies on."""
    faults = [
        Fault("clock", starts(number, SLOWER_S), lost_s, lost_s)
        for number, lost_s in enumerate(LOST_S)
    ]
    return fly(circle, {"leader": faults}, starts(len(LOST_S), SLOWER_S))


@pytest.fixture(scope="module")
def leader_stops(circle: Mission) -> Flown:
    """The leader's autopilot and its simulated aircraft stand still for a while."""
    stops = [Stop(starts(number, SLOWER_S), lost_s) for number, lost_s in enumerate(LOST_S)]
    return fly(circle, {}, starts(len(LOST_S), SLOWER_S), stops={"leader": stops})


@pytest.mark.parametrize("stopped", [False, True], ids=["its clock slips", "it stands still"])
@pytest.mark.parametrize("number", range(len(LOST_S)))
def test_followers_follow_again_3_s_after_the_leader_has_lost_time(
    number, stopped, undisturbed, leader_slips, leader_stops
):
    flown = leader_stops if stopped else leader_slips
    begins = starts(number, SLOWER_S)
    ends, over = begins + SLOWER_S, begins + LOST_S[number] + 3.0
    # A clock that stands still for longer than 1.5 s is not waited for.
    found = "clock has lost" if stopped or LOST_S[number] < 1.5 else "boot times stand still"
    assert any(found in text for text in flown.said("leader", begins, over))
    for name in ("f1", "f2"):
        assert stopped or flown.off(undisturbed, name, begins, ends) < OFF_M[number]
        assert flown.mode_at(name, over) in STEERED
        assert set(flown.mode_changes(name, over, ends)) <= STEERED
    assert flown.nearest(begins, ends) > LEAST_M


def ahead(metres: float, start_s: float, length_s: float) -> Fault:
    """The place steps along the line's course."""
    course = radians(45.0)
    return Fault("offset", start_s, length_s, metres * cos(course), metres * sin(course))


@pytest.fixture(scope="module")
def leader_ahead(line: Mission) -> Flown:
    """The leader's positions step 40 m ahead for 3 s, and 15 s later for ever."""
    faults = [ahead(40.0, 5.0, 3.0), ahead(40.0, 20.0, inf)]
    return fly(line, {"leader": faults}, 75.0)


def test_a_leader_whose_position_is_40_m_ahead_for_3_s_misleads_no_follower(leader_ahead):
    assert leader_ahead.nearest(0.0, 20.0) > 25.0
    assert [leader_ahead.mode_changes(name, 5.0, 20.0) for name in ("f1", "f2")] == [[], []]
    assert "40 m from where it can be" in leader_ahead.said("leader", 5.0, 20.0)[0]


def test_a_leader_whose_position_stays_40_m_ahead_is_handed_back_and_the_formation_comes_apart(
    leader_ahead,
):
    assert leader_ahead.nearest(20.0) > LEAST_M
    said = leader_ahead.said("leader", 20.0, 75.0)
    assert any("from where it can be: not steered" in text for text in said)
    assert "autopilot: Mode LOITER" in leader_ahead.said("leader", 20.0, 48.0)
    for name in ("f1", "f2"):
        changes = leader_ahead.mode_changes(name, 50.0, 65.0)
        assert changes[-3:] == ["predicting", "breakaway", "lost"]
        assert "autopilot: Mode LOITER" in leader_ahead.said(name, 63.0, 70.0)
        told = leader_ahead.said(name, 50.0, 51.0)
        assert any("the leader reports what cannot be" in one for one in told)


@pytest.mark.parametrize("vehicle", ["leader", "f1", "f2"])
@pytest.mark.parametrize(("north", "east"), [(0.0, 0.0), (14.0, -14.0)])
def test_a_velocity_that_stays_false_is_not_flown_by_and_the_vehicle_is_handed_back(
    line, vehicle, north, east
):
    # The line leads north-east: it stands still, or flies across.
    flown = fly(line, {vehicle: [Fault("velocity", 10.0, inf, north, east)]}, 35.0)
    assert flown.nearest() > LEAST_M
    said = flown.said(vehicle, 9.9, 35.0)
    assert "the velocity steps by" in said[0]
    assert "autopilot: Mode LOITER" in said


def test_a_step_of_the_place_that_a_gap_in_the_telemetry_hides_is_not_flown_to(line):
    # f1's slot is 20 m behind and 20 m left of the leader: after the gap it seems to be 28 m west of there.
    gap = Stop(10.0, 2.5)
    flown = fly(line, {"f1": [Fault("offset", 11.0, inf, 0.0, -28.0)]}, 30.0, stops={"f1": [gap]})
    assert flown.nearest() > LEAST_M
    assert any("from where it can be" in text for text in flown.said("f1", 12.0, 20.0))


@pytest.mark.parametrize("length_s", [2.0, 3.0, 5.0])
def test_place_and_velocity_that_are_repeated_while_stamps_go_on_are_not_flown_by(circle, length_s):
    kinds = ("frozen", "held")
    flown = fly(circle, {"f1": [Fault(kind, 10.0, length_s) for kind in kinds]}, 22.0)
    assert flown.nearest(9.0) > LEAST_M
    told = "do not change in flight: flown on by heading and airspeed"
    assert told in flown.said("f1", 9.9, 12.0)[0]
    # Right again with the first report that differs.
    back_s = 10.0 + length_s + 0.5
    assert any("are right again" in text for text in flown.said("f1", 11.0, back_s))
    assert flown.mode_at("f1", 22.0) == "tracking"


def test_a_velocity_that_stands_still_in_a_turn_is_outweighed_by_positions_and_airspeed(
    circle, undisturbed
):
    flown = fly(circle, {"f1": [Fault("held", 10.0, 5.0)]}, 25.0)
    assert flown.nearest(9.0) > LEAST_M
    assert flown.off(undisturbed, "f1", 9.0, 25.0) < 2.0
    assert "the velocity does not change in a turn" in flown.said("f1", 9.9, 11.0)[0]
    assert flown.mode_changes("f1", 9.0, 25.0) == []


@pytest.mark.parametrize("rate", [1.5, 4.0])
def test_a_place_that_drifts_is_not_followed_into_another(circle, rate):
    flown = fly(circle, {"f1": [Fault("drift", 10.0, 15.0, rate)]}, 35.0)
    assert flown.nearest(9.0) > LEAST_M
    assert any("contradict each other" in text for text in flown.said("f1", 10.0, 17.0))


@pytest.mark.parametrize("off_m", [-588.0, 47.0])
def test_a_leaders_altitude_that_cannot_be_is_not_followed(line, off_m):
    flown = fly(line, {"leader": [Fault("altitude", 0.0, inf, off_m)]}, 15.0)
    for name in ("f1", "f2"):
        assert np.abs(flown.vehicle(name).altitude_amsl_m - 588.0).max() < 2.0
        assert any("the mission's: own height kept" in text for text in flown.said(name, 0.0, 4.0))
