"""Shapes: where their slots are, no two nearer than the spacing, and by which they are known again."""

import math
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.formation.arrangement import SHAPES, named_shape, shape_slots

STEP = 20.0 / math.sqrt(2.0)


@pytest.mark.parametrize(
    ("shape", "slots"),
    [
        ("vee", [(-STEP, STEP), (-STEP, -STEP), (-2 * STEP, 2 * STEP)]),
        ("echelon-left", [(-STEP, -STEP), (-2 * STEP, -2 * STEP), (-3 * STEP, -3 * STEP)]),
        ("echelon-right", [(-STEP, STEP), (-2 * STEP, 2 * STEP), (-3 * STEP, 3 * STEP)]),
        ("line-abreast", [(0.0, 20.0), (0.0, -20.0), (0.0, 40.0)]),
        ("trail", [(-20.0, 0.0), (-40.0, 0.0), (-60.0, 0.0)]),
        ("diamond", [(-STEP, STEP), (-STEP, -STEP), (-2 * STEP, 0.0)]),
        ("finger-four", [(-STEP, -STEP), (-STEP, STEP), (-2 * STEP, 2 * STEP)]),
    ],
)
def test_a_shape_puts_three_followers_where_its_name_says(shape, slots):
    for found, expected in zip(shape_slots(shape, 3, 20.0), slots, strict=True):
        assert found == pytest.approx(expected)
    assert len(SHAPES) == 7


def test_a_second_four_flies_behind_the_first_and_an_unknown_shape_is_refused():
    # The first four ends two steps back; the next begins a spacing behind that, under the leader.
    assert shape_slots("finger-four", 4, 20.0)[3] == pytest.approx((-20.0 - 2 * STEP, 0.0))
    with pytest.raises(ValueError, match="'ring': there are vee, echelon-left"):
        shape_slots("ring", 3, 20.0)  # type: ignore[arg-type]


@given(st.sampled_from(SHAPES), st.integers(0, 30), st.floats(5.0, 200.0))
def test_no_two_aircraft_of_a_shape_are_nearer_than_its_spacing(shape, count, spacing):
    places = [(0.0, 0.0), *shape_slots(shape, count, spacing)]
    assert len(places) == count + 1
    for one, other in combinations(places, 2):
        assert math.dist(one, other) >= spacing * (1.0 - 1e-9)


@given(st.sampled_from(SHAPES), st.integers(4, 12), st.floats(8.0, 100.0), st.randoms())
def test_a_shape_is_known_again_by_slots_that_orders_have_rounded(shape, count, spacing, random):
    slots = [(round(x, 1), round(y, 1)) for x, y in shape_slots(shape, count, spacing)]
    random.shuffle(slots)
    found = named_shape(slots)
    name, apart = found
    assert apart == pytest.approx(spacing, abs=0.1)
    # With four followers, and with some other numbers, two shapes have the same slots.
    places = shape_slots(name, count, spacing)
    assert max(min(math.dist(slot, one) for one in places) for slot in slots) < 0.5


def test_other_slots_are_no_shape():
    for slots in ([(-20.0, 0.0), (-50.0, 30.0)], [(0.0, 0.0)], []):
        assert named_shape(slots) is None
    assert named_shape([(-20.0, 0.0), (-40.0, 0.0)]) == ("trail", pytest.approx(20.0))
