"""Slots move straight, together and smoothly, and keep apart: in layers, or not at all."""

import math
from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from tests.kit.orders import MOTION
from vfguide.formation.arrangement import (
    PEAK,
    SHAPES,
    Arrangement,
    Point,
    SlotMove,
    progress,
    shape_slots,
    time_of,
)
from vfguide.formation.orders import assigned, least_assignment
from vfguide.formation.transition import (
    LAYER_M,
    LEAST_M,
    RefusedOrderError,
    Transition,
    approach_of,
    approaches,
    transition,
)

Offset = tuple[float, float]


def points(places: Sequence[Offset]) -> dict[str, Point]:
    """Slots of f1, f2, ... in the plane."""
    return {f"f{number}": Point(*place) for number, place in enumerate(places, 1)}


def matrices(size: int) -> st.SearchStrategy[list[list[float]]]:
    row = st.lists(st.integers(0, 9).map(float) | st.floats(0, 1e6), min_size=size, max_size=size)
    return st.lists(row, min_size=size, max_size=size)


@settings(derandomize=True, deadline=None)
@given(st.integers(1, 6).flatmap(matrices))
def test_the_assignment_is_the_best_of_all(costs):
    found = least_assignment(costs)
    rows = range(len(costs))
    assert sorted(found) == [*rows]
    least = min(sum(costs[row][way[row]] for row in rows) for way in permutations(rows))
    assert sum(costs[row][found[row]] for row in rows) <= least * (1.0 + 1e-12)


def test_the_assignment_of_a_hundred_is_as_good_as_one_of_another_program():
    costs = np.random.default_rng(1).uniform(0.0, 1e4, (100, 100))
    rows, columns = linear_sum_assignment(costs)
    found = least_assignment(costs.tolist())
    assert costs[range(100), found].sum() == pytest.approx(costs[rows, columns].sum())


def flown_distances(found: Transition, steps: int = 400) -> np.ndarray:
    """Distance of each two, the leader among them, at many times of a transition."""
    times = {"time_s": 0.0, "climb_s": found.climb_s, "across_s": found.across_s}
    order = Arrangement(number=1, places=found.places, **times)
    tracks = [np.zeros((steps + 1, 3))]
    times = np.linspace(0.0, order.duration_s, steps + 1)
    for place in found.places:
        slots = [order.slot(place.vehicle, time_s) for time_s in times]
        heights = [order.height(place.vehicle, time_s)[0] for time_s in times]
        places = zip(slots, heights, strict=True)
        tracks.append(np.array([(slot.forward, slot.right, up) for slot, up in places]))
    return np.array([np.linalg.norm(one - other, axis=1) for one, other in combinations(tracks, 2)])


def test_a_motion_begins_and_ends_at_rest_and_passes_its_middle_at_half_time():
    assert progress(0.0, 20.0) == (0.0, 0.0, 0.0)
    assert progress(20.0, 20.0) == (1.0, 0.0, 0.0)
    # Speed rises over 6 s: (20 s - 6 s) at the greatest speed are the whole way.
    assert progress(10.0, 20.0) == pytest.approx((0.5, 1.0 / 14.0, 0.0))
    # Half of the ramp's time: half of the greatest speed.
    assert progress(3.0, 20.0)[1] == pytest.approx(0.5 / 14.0)


@given(st.floats(0.0, 30.0))
def test_rate_and_acceleration_of_a_motion_are_the_derivatives_of_its_share(time_s):
    step = 1e-4
    before, after = progress(time_s - step, 30.0), progress(time_s + step, 30.0)
    _, rate, acceleration = progress(time_s, 30.0)
    assert (after[0] - before[0]) / (2 * step) == pytest.approx(rate, abs=1e-5)
    assert (after[1] - before[1]) / (2 * step) == pytest.approx(acceleration, abs=1e-5)


@given(st.floats(0.0, 1.0))
def test_the_time_of_a_share_is_when_it_is_reached(share):
    assert progress(time_of(share, 12.0), 12.0)[0] == pytest.approx(share, abs=1e-9)


def test_how_near_two_slots_come_is_exact():
    # Head on, 10 m aside of each other: nearest in the middle of the way, at half time.
    one = SlotMove(vehicle="f1", begin=Point(-20.0, 0.0), end=Point(-60.0, 0.0))
    other = SlotMove(vehicle="f2", begin=Point(-60.0, 10.0), end=Point(-20.0, 10.0))
    found = approach_of(one, other, 0.0, 20.0)
    assert found.distance == pytest.approx(10.0)
    assert found.time_s == pytest.approx(10.0)


def test_a_transition_takes_as_long_as_the_slowest_way():
    # 40 m ahead at 5 m/s at most, which is 1/0.7 of the mean: 11.4 s.
    found = transition({"f1": Point(-60.0, 0.0)}, {"f1": Point(-20.0, 0.0)}, MOTION)
    assert found.across_s == pytest.approx(max(40.0 / 5.0 * PEAK, math.sqrt(40 * 8.929)), rel=1e-3)
    order = Arrangement(number=1, time_s=0.0, across_s=found.across_s, places=found.places)
    rates = [order.slot("f1", time_s).forward_rate for time_s in np.linspace(0, 20, 500)]
    assert max(rates) <= MOTION.forward + 1e-9


SOME_SHAPES, SPACINGS = st.sampled_from(SHAPES), st.floats(12.0, 60.0)


@pytest.mark.flies
@settings(deadline=None, max_examples=150)
@given(SOME_SHAPES, SOME_SHAPES, st.integers(1, 9), SPACINGS, SPACINGS)
def test_no_two_come_within_the_limit_between_any_two_shapes(
    first, second, count, spacing, other_spacing
):
    begin = points(shape_slots(first, count, spacing))
    offsets = {name: (point.forward, point.right) for name, point in begin.items()}
    places = assigned(offsets, shape_slots(second, count, other_spacing))
    end = {name: Point(*place) for name, place in places.items()}
    distances = flown_distances(transition(begin, end, MOTION))
    assert distances.min() >= LEAST_M - 0.05


@pytest.mark.flies
@settings(deadline=None, max_examples=150)
@given(
    st.lists(st.tuples(st.floats(-120, 60), st.floats(-90, 90)), min_size=2, max_size=7),
    st.randoms(use_true_random=False),
)
def test_an_order_by_name_keeps_the_limit_or_is_refused_in_words(places, random):
    everybody = [(0.0, 0.0), *places]
    assume(all(math.dist(one, other) > 9.0 for one, other in combinations(everybody, 2)))
    mixed, reason, found = random.sample(places, len(places)), "", None
    try:
        found = transition(points(places), points(mixed), MOTION)
    except RefusedOrderError as refusal:
        reason = str(refusal)
    refused = "would come within" in reason
    assert refused or (found is not None and flown_distances(found).min() >= LEAST_M - 0.05)


@given(st.lists(st.tuples(st.floats(-90, 0), st.floats(-90, 90)), min_size=2, max_size=6))
def test_interchangeable_vehicles_keep_the_least_distance_over_the_root_of_two(places):
    assume(all(math.dist(one, other) > 12.0 for one, other in combinations(places, 2)))
    begin = points(shape_slots("trail", len(places), 12.0))
    offsets = {name: (point.forward, point.right) for name, point in begin.items()}
    ways = [
        SlotMove(vehicle=name, begin=begin[name], end=Point(*place))
        for name, place in assigned(offsets, places).items()
    ]
    for one, other in combinations(ways, 2):
        assert approach_of(one, other, 0.0, 10.0).distance >= 12.0 / math.sqrt(2.0) - 1e-6


def test_two_that_change_places_cross_in_layers():
    begin = points([(-20.0, -20.0), (-20.0, 20.0)])
    found = transition(begin, {"f1": begin["f2"], "f2": begin["f1"]}, MOTION)
    assert {place.layer for place in found.places} == {None, LAYER_M}
    # 20 m behind the leader nobody comes nearer to it; the two pass each other 12 m apart.
    assert flown_distances(found).min() == pytest.approx(LAYER_M, abs=0.1)
    # 12 m at 2 m/s at most.
    assert found.climb_s == pytest.approx(12.0 / 2.0 / 0.7)
    # Who would meet the leader crosses above it.
    found = transition({"f1": Point(-20.0, 0.0)}, {"f1": Point(20.0, 0.0)}, MOTION)
    assert [place.layer for place in found.places] == [LAYER_M]


@pytest.mark.parametrize(
    ("begin", "end", "sentence"),
    [
        ((-40.0, 0.0), [(-20.0, 0.0), (-23.0, 0.0)], r"slots of f1 and f2 would be 3\.0 m apart"),
        # They stand 3 m apart before anybody has climbed: no layer helps.
        ((-23.0, 0.0), [(-20.0, 20.0), (-40.0, 0.0)], r"f1 and f2 .* within 3\.0 m .* 0 s after"),
    ],
)
def test_slots_that_are_too_near_are_refused_with_pair_time_and_distance(begin, end, sentence):
    with pytest.raises(RefusedOrderError, match=sentence):
        transition(points([(-20.0, 0.0), begin]), points(end), MOTION)


def test_no_times_are_looked_for_where_nobody_asks(monkeypatch):
    # A hundred followers: that took half a second of a companion's loop.
    asked: list[float] = []

    def look(share: float, duration_s: float) -> float:
        asked.append(share * duration_s)
        return 7.0

    monkeypatch.setattr("vfguide.formation.transition.time_of", look)
    places = [
        SlotMove(vehicle=f"f{n}", begin=Point(-10.0 * n, 0.0), end=Point(-20.0 * n, 0.0))
        for n in range(1, 101)
    ]
    found = approaches(places, 0.0, 10.0, "leader")
    assert len(found) == 5050
    assert not asked
    assert min(found, key=lambda one: one.distance).time_s == 7.0
    assert len(asked) == 1
