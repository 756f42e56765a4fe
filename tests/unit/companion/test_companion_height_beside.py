"""What height beside another vehicle is worth, and which way it is passed."""

import numpy as np
import pytest
from msgspec.structs import replace

from vfguide.companion.height_beside import (
    HEIGHT_OFF_M,
    LEAST_UP_M,
    Obstacle,
    neighbour_of,
    worth_in_plane,
)
from vfguide.guidance.predicted_tracks import TIMES, arc
from vfguide.guidance.separation import BEGINNINGS, Others

LOST = Obstacle(
    name="leader",
    least_m=7.0,
    least_up_m=7.0,
    altitude_amsl=588.0,
    climb_rate=0.0,
    under=True,
    makes_room=False,
    over_m=15.0,
    height_off_m=HEIGHT_OFF_M,
)
"""A vehicle that has just fallen silent."""


def worth(one: Obstacle, heights: list[float]) -> list[float]:
    """What these heights beside it are worth, where 8 m are kept in the plane."""
    tracks = arc(0j, 20.0 + 0j, 0.0)[None, :]
    others = Others(
        tracks=tracks,
        horizon_s=np.array([8.0]),
        keep=np.array([8.0]),
        floor=np.array([7.0]),
        weight=np.array([1.0]),
        margin=np.zeros((1, len(BEGINNINGS))),
    )
    return list(worth_in_plane(np.array(heights), others, [one])[0])


@pytest.mark.parametrize(
    ("change", "up_m", "worth_m"),
    [
        *(({}, up_m, 0.0) for up_m in (0.0, 1.0)),
        *(({}, up_m, 4.0) for up_m in (4.0, -4.0)),
        *(({}, up_m, 8.0) for up_m in (7.0, 20.0)),
        # Beside one that is steered, or whose height is not known, it is worth nothing.
        ({"over_m": 0.0}, 20.0, 0.0),
        ({"altitude_amsl": np.nan}, 20.0, 0.0),
    ],
)
def test_height_over_a_silent_vehicle_is_worth_what_is_kept_in_the_plane(change, up_m, worth_m):
    # Of the height 1 m may be wrong; 6 m of the rest are worth all of the 8 m.
    assert (HEIGHT_OFF_M, LEAST_UP_M) == (1.0, 6.0)
    found = worth(replace(LOST, **change), [588.0 + up_m] * len(TIMES))
    assert found == pytest.approx([worth_m] * len(BEGINNINGS))


def test_height_over_one_that_climbs_counts_from_where_it_will_be():
    # 2 m/s for 3 s: 10 m above it are 4 m soon, and 3 m for certain.
    climbing = replace(LOST, climb_rate=2.0)
    assert worth(climbing, [598.0] * len(TIMES))[0] == pytest.approx(4.0)


def test_what_a_pilot_may_do_to_the_height_counts_for_less_the_sooner_it_is():
    taken = replace(LOST, height_off_m_s=2.0)
    found = worth(taken, [598.0] * len(TIMES))
    # After half a second 10 - 1 - 1 = 8 m are left, after 4 s 10 - 1 - 8 = 1 m.
    assert found[0] == 8.0
    assert found[7] == pytest.approx(8.0 / 6.0)
    assert found[8] == 0.0


@pytest.mark.parametrize(("step_m", "over"), [(20.0, True), (-20.0, False), (0.0, None)])
def test_a_step_beside_a_silent_vehicle_is_not_turned_round_through_its_height(step_m, over):
    found = neighbour_of(
        LOST,
        distance=5.0,
        height=0.0,
        climb_rate=0.0,
        own_height=0.0,
        own_climb_rate=0.0,
        step=step_m,
    )
    assert found.over is over
