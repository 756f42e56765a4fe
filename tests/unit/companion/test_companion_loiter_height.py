"""Once everything was called off each loiters at a height of its own, where the autopilot can be told so."""

import math
from typing import Any

import pytest
from msgspec.structs import replace

from tests.kit.companion import KINDS, new_flight
from tests.kit.missions import plan_of, shipped
from tests.kit.orders import abort, moves
from tests.kit.wire import number_of, parsed
from vfguide.companion.height_keeper import TRIES, LoiterHeight
from vfguide.companion.mission_plan import adapter_of, flight_plan, loiter_step
from vfguide.formation.arrangement import Arrangement, Manoeuvre, Point
from vfguide.link.order_codec import encode_order
from vfguide.mavlink.reports import CommandReport
from vfguide.mission.place import Fence

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
    highest = one.height_above_origin_m + 12.0
    fenced = one.model_copy(update={"fence": Fence(max_height_m=highest)})
    assert loiter_step(fenced) == pytest.approx(12.0 / len(one.followers))


def test_on_a_climbing_path_all_stay_within_the_fence_and_apart():
    one = shipped("line-calm")
    level, n = one.height_above_origin_m, len(one.followers)
    fenced = one.model_copy(update={"fence": Fence(max_height_m=level + 510.0)})
    origin = one.origin.altitude_amsl_m
    told = []
    for name in ["leader", *one.followers_by_name]:
        own = LoiterHeight(flight_plan(fenced, name), adapter_of(one.vehicles[name]))
        altitude = origin + level + 500.0
        told += altitudes(own, replace(off_at(), places=()), altitude_amsl=altitude)
    top = origin + level + 510.0
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
