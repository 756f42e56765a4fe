"""A leader state as it crosses the link."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from vfguide.link.codec import LeaderMessage

PLAIN = LeaderMessage(
    sequence=7,
    time_s=123.25,
    latitude_deg=47.397742,
    longitude_deg=8.545594,
    altitude_amsl=588.0,
    course=0.5,
    ground_speed=22.0,
    acceleration=-0.25,
    turn_rate=0.125,
    turn_acceleration=0.0625,
    climb_rate=3.0,
    term=2,
    arrangement=5,
)


@pytest.fixture(scope="session")
def leader_message() -> Callable[..., LeaderMessage]:
    """Makes a leader state with some values of interest."""

    def make(**values: float) -> LeaderMessage:
        return replace(PLAIN, **values)

    return make
