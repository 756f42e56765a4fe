"""A shape is known again by its slots, whoever flies in them."""

import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.formation.shapes import SHAPES, Shape, named_shape, shape_slots


@given(
    st.sampled_from(get_args(Shape)),
    st.integers(4, 12),
    st.floats(8.0, 100.0),
    st.randoms(use_true_random=False),
)
def test_a_shape_is_known_again_by_slots_that_orders_have_rounded(shape, count, spacing, random):
    slots = [
        (round(forward, 1), round(right, 1))
        for forward, right in shape_slots(shape, count, spacing)
    ]
    random.shuffle(slots)  # type: ignore[attr-defined]
    found = named_shape(slots)
    assert found is not None
    name, apart = found
    assert apart == pytest.approx(spacing, abs=0.1)
    # With four followers, and with some other numbers, two shapes have the same slots.
    near = [
        min(math.dist(slot, one) for one in shape_slots(name, count, spacing)) for slot in slots
    ]
    assert max(near) < 0.5


def test_other_slots_are_no_shape():
    assert named_shape([(-20.0, 0.0), (-50.0, 30.0)]) is None
    assert named_shape([(0.0, 0.0)]) is None
    assert named_shape([]) is None
    assert named_shape([(-20.0, 0.0), (-40.0, 0.0)]) == ("trail", pytest.approx(20.0))
    assert len(SHAPES) == 7
