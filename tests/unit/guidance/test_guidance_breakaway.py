import math
from itertools import product

import numpy as np
import pytest

from vfguide.guidance.formation import Slot, breakaway_course


@pytest.mark.parametrize(
    ("leader_deg", "right", "course_deg"),
    [
        (0.0, 20.0, 60.0),
        (0.0, -20.0, -60.0),
        (45.0, 20.0, 105.0),
        (45.0, -20.0, -15.0),
        (270.0, 100.0, 330.0),
        (-90.0, -7.0, -150.0),
        # On the leader's track: straight on.
        (45.0, 0.0, 45.0),
        (45.0, 4.999, 45.0),
        (45.0, -4.999, 45.0),
        # From 5 m on it is at the side.
        (45.0, 5.0, 105.0),
        (45.0, -5.0, -15.0),
    ],
)
@pytest.mark.parametrize("forward", [-40.0, 0.0, 30.0])
def test_each_turns_away_to_the_side_of_its_slot(
    leader_deg: float, right: float, course_deg: float, forward: float
) -> None:
    course = breakaway_course(math.radians(leader_deg), Slot(forward=forward, right=right))
    assert course == pytest.approx(math.radians(course_deg))


def test_courses_in_a_batch_are_those_alone() -> None:
    rights = np.array([-20.0, -5.0, -4.0, 0.0, 4.0, 5.0, 20.0])
    courses = np.linspace(-3.0, 3.0, rights.size)
    batch = breakaway_course(courses, Slot(forward=rights * 0.0 - 20.0, right=rights))
    alone = [
        breakaway_course(course, Slot(forward=-20.0, right=right))
        for course, right in zip(courses.tolist(), rights.tolist(), strict=True)
    ]
    assert batch.tolist() == pytest.approx(alone, abs=1e-15)


@pytest.mark.parametrize(("wind_north", "wind_east"), list(product([-8.0, 0.0, 8.0], repeat=2)))
def test_nobody_comes_nearer_to_anybody_while_flying_away(
    wind_north: float, wind_east: float
) -> None:
    """The formation of the shipped missions, each at 20 m/s through the air from where its slot is."""
    slots = [Slot(forward=-20.0, right=-20.0), Slot(forward=-20.0, right=20.0)]
    slots.append(Slot(forward=-40.0, right=0.0))
    places = []
    for slot in slots:
        course = breakaway_course(0.0, slot)
        cross = wind_east * math.cos(course) - wind_north * math.sin(course)
        tail = wind_north * math.cos(course) + wind_east * math.sin(course)
        speed = tail + math.sqrt(20.0**2 - cross**2)
        places.append(
            [
                (
                    slot.forward + speed * time_s * math.cos(course),
                    slot.right + speed * time_s * math.sin(course),
                )
                for time_s in (0.0, 5.0, 10.0, 25.0)
            ]
        )
    left, right, middle = places
    assert math.dist(left[-1], right[-1]) > 200.0
    for one, other in ((left, right), (left, middle), (right, middle)):
        assert all(math.dist(*pair) >= 15.0 for pair in zip(one, other, strict=True))
