"""The height that is asked for: behind speed where energy is short, in a loiter, after a late order."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace

from tests.kit.companion import KINDS, new_flight
from tests.kit.missions import plan_of, replaced, shipped
from tests.kit.orders import abort, moves
from tests.kit.states import leader_at, vehicle_at
from tests.kit.wire import number_of, parsed
from vfguide.companion.height_keeper import TRIES, HeightKeeper, LoiterHeight, PlannedHeight
from vfguide.companion.mission_plan import adapter_of, flight_plan, loiter_step
from vfguide.companion.own_vehicle import GeodeticPlace, NavigatedState
from vfguide.formation.arrangement import Arrangement, Manoeuvre, Point
from vfguide.guidance.height import BesidePath, ClimbLimits, HeightTarget, held_height
from vfguide.guidance.path import Path
from vfguide.link.order_codec import encode_order
from vfguide.mavlink.reports import CommandReport
from vfguide.paths.line import Line
from vfguide.state import LeaderState, Setpoint

PERIOD_S = 0.05
CLIMB = HeightTarget(height=150.0, climb_rate=3.0, ahead=156.0)


def navigated(time_s: float, airspeed: float) -> NavigatedState:
    state = vehicle_at(time_s=time_s, ground_speed=airspeed, height=150.0)
    place = GeodeticPlace(latitude_deg=47.0, longitude_deg=8.0, altitude_amsl=638.0)
    times = {"period": PERIOD_S, "interval": PERIOD_S}
    return NavigatedState(state=state, place=place, altitude_amsl=638.0, **times)


def asked(
    keeper: HeightKeeper,
    seconds: float,
    target: HeightTarget = CLIMB,
    *,
    airspeed: Callable[[float], float] | float = 20.0,
    wanted: float = 22.0,
    steered: bool = True,
) -> float:
    """The height that is asked for in the end."""
    height, setpoint = 0.0, Setpoint(course=0.0, speed=wanted)
    for step in range(round(seconds / PERIOD_S)):
        now = step * PERIOD_S
        flown = airspeed if isinstance(airspeed, float) else airspeed(now)
        height = keeper.step(navigated(now, flown), target, setpoint, steered=steered)
    return height


@pytest.fixture
def keeper() -> HeightKeeper:
    return HeightKeeper(plan_of(vehicle="f1"))


@pytest.mark.parametrize(
    ("airspeed", "wanted", "target", "steered"),
    [
        # beta 0.8: the speed closes 2 m/s by exp(-0.8 t), as declared, and leaves energy.
        (lambda now: 22.0 - 2.0 * math.exp(-0.8 * now), 22.0, CLIMB, True),
        # Level flight gives nothing up, and nothing is learned while the pilot flies.
        (20.0, 25.0, held_height(150.0), True),
        (20.0, 25.0, CLIMB, False),
    ],
)
def test_a_height_that_leaves_energy_is_flown_as_wanted(keeper, airspeed, wanted, target, steered):
    height = asked(keeper, 20.0, target, airspeed=airspeed, wanted=wanted, steered=steered)
    assert height == target.ahead


def test_a_climb_gives_way_to_a_speed_that_does_not_come(keeper):
    assert 0.0 < asked(keeper, 20.0) < 156.0 - 10.0
    given = keeper.given_up
    assert given > 0.0
    asked(keeper, 1.0)
    # 3 m/s of climb, no descent.
    assert keeper.given_up - given <= 3.0 + 1e-9


def test_a_descent_gives_way_to_a_speed_that_does_not_fall(keeper):
    sink = replace(CLIMB, climb_rate=-3.0, ahead=144.0)
    assert asked(keeper, 20.0, sink, airspeed=24.0, wanted=20.0) > 144.0 + 10.0


def test_height_that_was_given_up_is_taken_back(keeper):
    asked(keeper, 10.0)
    assert keeper.given_up > 5.0
    assert asked(keeper, 90.0, held_height(200.0), airspeed=22.0) == pytest.approx(200.0)


def test_height_that_a_climb_gave_up_is_not_missing_in_the_descent_after_it(keeper):
    # 20 s of climb without the speed for it: from 96 m to 156 m, and nearly all of that is given up.
    begin = lowest = asked(keeper, 20.0)
    assert begin < 130.0
    setpoint: Setpoint = Setpoint(course=0.0, speed=20.0)
    for step in range(1200):
        now = step * PERIOD_S
        target = max(156.0 - 3.0 * now, 60.0)
        sink = HeightTarget(height=target, climb_rate=-3.0 if target > 60.0 else 0.0, ahead=target)
        height = keeper.step(navigated(now, 20.0), sink, setpoint, steered=True)
        # Never below both where the climb ended and where the path is.
        assert height >= min(begin, target) - 1e-6
        lowest = min(lowest, height)
    assert lowest == pytest.approx(60.0)


DO_CHANGE_ALTITUDE, ACCEPTED = 186, 0


def off_at(up: float = 0.0, *, number: int = 1, time_s: float = 20.0) -> Arrangement:
    """Everything is called off while f1 is this much above the leader."""
    here = {"f1": Point(-20.0, -20.0, up)}
    return abort(*moves(here, here), number=number, time_s=time_s)


@pytest.fixture
def height() -> LoiterHeight:
    """That of f1, the first behind the leader."""
    adapter = adapter_of(shipped("line-calm").vehicles["f1"])
    return LoiterHeight(plan_of(vehicle="f1"), adapter)


def altitudes(height: LoiterHeight, flown: Arrangement | None, **state: object) -> list[float]:
    """What a heartbeat is answered with, m above mean sea level."""
    aborts = flown is not None and flown.flown is Manoeuvre.ABORT
    known: dict[str, Any] = {"returned": True, "engaged": False, "altitude_amsl": 600.0}
    known["order"] = flown.number if flown is not None and aborts else None
    place = None if flown is None else flown.place_of("f1")
    known["up"] = 0.0 if place is None else place.end.up
    return [float(one.param1) for one in height.due(**(known | state))]


@pytest.mark.parametrize(
    ("up", "altitude_amsl", "told"),
    [
        (0.0, 600.0, 615.0),
        # A slot that is higher already climbs less: as in the stack of a hold, whose first is 15 m up.
        (15.0, 610.0, 610.0),
        # Nobody loiters lower than the path, which is at 588 m, and its rank.
        (0.0, 570.0, 603.0),
    ],
)
def test_the_first_follower_loiters_15_m_above_the_leader(height, up, altitude_amsl, told):
    assert altitudes(height, off_at(up), altitude_amsl=altitude_amsl) == [told]


def test_nothing_is_told_without_a_loiter_that_was_asked_for(height):
    assert altitudes(height, off_at(), returned=False) == []
    assert altitudes(height, None) == []
    assert altitudes(height, replace(off_at(), flown=Manoeuvre.FORMATION)) == []
    assert altitudes(height, off_at(number=2), altitude_amsl=math.nan) == []


def test_the_same_height_is_told_until_it_is_accepted_and_a_few_times_at_most(height):
    told = [altitudes(height, off_at(), altitude_amsl=600.0 + n) for n in range(10)]
    assert told == [[615.0]] * TRIES + [[]] * (10 - TRIES)
    # A further abort finds it in its loiter, and is told the same.
    assert altitudes(height, off_at(number=2), altitude_amsl=615.0) == [615.0]
    height.answered(CommandReport(command=DO_CHANGE_ALTITUDE, result=ACCEPTED))
    assert altitudes(height, off_at(number=2), altitude_amsl=615.0) == []
    # Engaged again, it flies at a height of its slot.
    assert altitudes(height, None, returned=False, engaged=True) == []
    assert altitudes(height, off_at(number=3), altitude_amsl=590.0) == [605.0]


def test_all_heights_stay_within_the_fence():
    one = shipped("line-calm")
    assert loiter_step(one) == 15.0
    fenced = replaced(one, fence={"max_height_m": one.height_above_origin_m + 12.0})
    assert loiter_step(fenced) == pytest.approx(12.0 / len(one.followers))


def test_on_a_climbing_path_all_stay_within_the_fence_and_apart():
    one = shipped("line-calm")
    level, n = one.height_above_origin_m, len(one.followers)
    fenced = replaced(one, fence={"max_height_m": level + 510.0})
    top = one.origin.altitude_amsl_m + level + 510.0
    told = []
    for name in ["leader", *one.followers_by_name]:
        own = LoiterHeight(flight_plan(fenced, name), adapter_of(one.vehicles[name]))
        told += altitudes(own, replace(off_at(), places=()), altitude_amsl=top - 10.0)
    assert told == pytest.approx([top - 15.0 * (n - rank) for rank in range(n + 1)])


@pytest.mark.parametrize("kind", KINDS)
def test_an_autopilot_that_was_handed_back_climbs_to_it_and_a_pilots_mode_is_left_alone(kind):
    flown = new_flight(kind=kind, until_s=20.0)
    before = flown.autopilot.truth().altitude_amsl_m
    data = encode_order(off_at(time_s=flown.now))
    flown.companion.receive_order(data, data, flown.now)
    flown.run(60.0)
    assert flown.autopilot.truth().altitude_amsl_m == pytest.approx(before + 15.0, abs=2.0)
    said = parsed(b"".join(sent for _, sent in flown.sent))
    told = [one for one in said if number_of(one) == DO_CHANGE_ALTITUDE]
    # PX4 is steered by the same command.
    assert len([one for one in told if one.param1 > before + 10.0]) == 1


LIMITS = ClimbLimits(climb=4.0, sink=3.0)
MAIN, OTHER = (Line(north=0.0, east=east, course=0.0) for east in (0.0, 10.0))
FLYING = 100.0


def leader(time_s: float, height: float, climb_rate: float) -> LeaderState:
    """A leader that flies north at 20 m/s."""
    return leader_at(time_s=time_s, north=20.0 * time_s, height=height, climb_rate=climb_rate)


def along(planned: PlannedHeight, path: Path, motion: LeaderState, *, late: bool) -> HeightTarget:
    """The height beside a path, with a setpoint that takes effect at once."""
    point = path.nearest_in_space(motion.north, motion.east, motion.course, 0.0)
    beside = BesidePath(path=path, point=point, motion=motion, flying=FLYING, ahead_s=0.0)
    return planned.along(beside, steered=True, late=late)


def test_who_saw_the_beginning_of_a_change_plans_on_and_who_did_not_goes_by_the_leader():
    # The leader is 3 m below the path at which it goes over to the other one.
    seen, late = PlannedHeight(LIMITS), PlannedHeight(LIMITS)
    for one in (seen, late):
        along(one, MAIN, leader(0.0, 97.0, 1.0), late=False)
    assert along(seen, OTHER, leader(0.0, 97.0, 1.0), late=False).height == 100.0
    assert not seen.began_anew
    found = along(late, OTHER, leader(0.0, 97.0, 1.0), late=True)
    assert (found.height, found.climb_rate) == (97.0, 1.0)
    assert late.began_anew
    along(late, OTHER, leader(0.1, 97.1, 1.0), late=True)
    assert not late.began_anew


def test_who_hears_of_a_hold_first_levels_off_with_the_leader():
    planned = PlannedHeight(LIMITS)
    # 2² / 0.8 + 0.3 m above where the leader climbs at 2 m/s.
    begin = planned.hold(leader(0.0, 120.0, 2.0), ahead_s=0.0, late=True)
    assert (begin.height, begin.climb_rate) == (120.0, 2.0)
    for step in range(1, 200):
        # What the leader does later does not count.
        found = planned.hold(leader(0.1 * step, 90.0, 0.0), ahead_s=0.0, late=True)
    assert found.height == pytest.approx(125.3125, abs=0.02)
    assert not planned.changes


def test_who_learns_of_a_hold_late_does_not_go_by_the_path_before():
    planned = PlannedHeight(LIMITS)
    along(planned, MAIN, leader(0.0, 130.0, 0.0), late=False)
    assert planned.hold(leader(0.1, 130.0, 0.0), ahead_s=0.0, late=True).height == 130.0


def test_a_leader_whose_height_is_not_known_is_planned_by_its_path():
    planned = PlannedHeight(LIMITS)
    assert along(planned, OTHER, leader(0.0, math.nan, 0.0), late=True).height == 100.0
    assert planned.hold(leader(0.1, math.nan, 0.0), ahead_s=0.0, late=True).height == 100.0
