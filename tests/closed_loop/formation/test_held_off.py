"""Aircraft that begin on the wrong sides of each other: each comes past the others to its slot.

Their autopilots slip, answer slowly and are not declared. Two that approach gently are kept apart by turns,
and these bring neither nearer to its slot.
"""

import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.flight import Flight, fly
from tests.kit.missions import content_of
from vfguide.mission import Mission
from vfguide.registry import laws
from vfguide.suite import with_law

BACK_S = 52.0
"""By then everybody is in the slot: responses are learned first, and that takes half of it."""

TAKEN_BACK_S = 80.0

OFF_M, LEAST_M = 5.0, 5.0

Places = list[tuple[float, float]]
WIND = {"type": "steady", "speed_m_s": 5.5, "toward_deg": 150.0}
CALM = {"type": "calm"}

CROSSED: dict[str, tuple[Places, Places, dict[str, object]]] = {
    "side by side": ([(-30, -10), (-30, 10)], [(-30, 6), (-30, -6)], CALM),
    "side by side, in wind": ([(-30, -14), (-30, 14)], [(-30, 6), (-30, -6)], WIND),
    "one a little ahead": ([(-42, -24), (-34, -51)], [(-40, -42), (-35, -31)], WIND),
    "in column": ([(-20, 0), (-44, 0)], [(-38, 0), (-26, 0)], CALM),
    "three in a ring": ([(-30, 0), (-50, -14), (-50, 14)], [(-48, -7), (-48, 7), (-36, 0)], WIND),
    "three abreast": ([(-30, -20), (-30, 0), (-30, 20)], [(-30, 12), (-30, 0), (-30, -12)], CALM),
}
"""Slots, where each begins, and the wind: (forward, right) of the leader, m."""


def flight_of(
    slots: Places, begins: Places, wind: dict[str, object], **rehearsal: object
) -> Flight:
    content = content_of(with_law(86, "slot"))
    names = [f"f{number}" for number in range(1, len(slots) + 1)]
    content["name"], content["wind"] = "held-off", wind
    content["path"] = {"type": "line", "point": {"north_m": 0, "east_m": 0}, "course_deg": 0}
    content["followers"] = [
        {"vehicle": name, "slot": {"forward_m": forward, "right_m": right}}
        for name, (forward, right) in zip(names, slots, strict=True)
    ]
    content["vehicles"] = {
        name: vehicle
        for name, vehicle in content["vehicles"].items()
        if name in {"defaults", "leader", *names}
    }
    del content["rehearsal"]["losses"]
    start = {
        name: {"forward_m": at[0] - slot[0], "right_m": at[1] - slot[1]}
        for name, slot, at in zip(names, slots, begins, strict=True)
    }
    content["rehearsal"] |= {"start": start, "duration_s": BACK_S + 3.0, **rehearsal}
    return fly(Mission.model_validate(content))


@pytest.mark.parametrize("case", CROSSED)
def test_everybody_comes_past_the_others_to_the_slot(case):
    flight = flight_of(*CROSSED[case])
    assert flight.errors(BACK_S).max() < OFF_M
    assert flight.nearest() >= LEAST_M


@pytest.mark.parametrize(("number", "until_s"), [(28, 19.0), (49, 20.0)])
def test_two_that_meet_while_they_join_do_not_leave_their_heights_to_the_same_side(number, until_s):
    """One climbs from below toward one that sinks; by heights, ranks or climb rates alone both climb."""
    content = content_of(with_law(number, "slot"))
    content["rehearsal"]["duration_s"] = until_s
    content["rehearsal"].pop("losses", None)
    assert fly(Mission.model_validate(content)).nearest() >= LEAST_M


@pytest.fixture
def pursuit() -> Iterator[str]:
    """Make the law of the example known for one test: it takes everybody to the slot the shortest way."""
    runpy.run_path(str(Path(__file__).parents[3] / "examples" / "own_law.py"))
    yield "pursuit"
    del laws._known["pursuit"]  # noqa: SLF001


@pytest.mark.parametrize(("number", "until_s"), [(51, 10.0), (79, 8.0)])
def test_two_that_cross_do_not_turn_toward_each_other_to_pass_behind(number, until_s, pursuit):
    """By distances alone both do, or one turns round again and again: 3 m were left."""
    content = content_of(with_law(number, pursuit))
    content["rehearsal"]["duration_s"] = until_s
    content["rehearsal"].pop("losses", None)
    assert fly(Mission.model_validate(content)).nearest() >= LEAST_M


def test_one_that_its_pilot_hands_back_comes_past_the_others_to_the_slot():
    # 300 m behind by then, and no more than 8 m/s faster.
    slots = [(-20.0, 0.0), (-44.0, 0.0)]
    taken = {"vehicle": "f2", "at_s": 25.0, "for_s": 6.0, "what": "guidance"}
    flight = flight_of(slots, slots, WIND, losses=[taken], duration_s=TAKEN_BACK_S + 3.0)
    assert flight.errors(TAKEN_BACK_S).max() < OFF_M
    assert flight.nearest() >= LEAST_M
