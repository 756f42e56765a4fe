"""A first-order low-pass filter, step by step."""

import pytest

from vfguide.elementwise import low_pass


def test_a_low_pass_moves_by_its_share() -> None:
    # 0.1/(0.3 + 0.1) = a quarter of the way from 1 to 5
    assert low_pass(1.0, 5.0, 0.1, 0.3) == pytest.approx(2.0)
    assert low_pass(1.0, 5.0, 0.1, 0.0) == 5.0
