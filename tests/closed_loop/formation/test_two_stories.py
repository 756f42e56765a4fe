"""A key of the leader's that tells followers different places: noticed, told, and nobody comes near."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.formation import Formation
from tests.kit.missions import in_place
from vfguide.frames import LocalFrame
from vfguide.link.codec import decode, encode
from vfguide.link.memory import Mail

BEGIN_S, END_S, FLOWN_S = 8.0, 18.0, 30.0

DRIFTS = {"f1": (1.5, 0.0), "f2": (2.0, 3.7), "f3": (4.0, math.pi)}
"""How fast (m/s) and by which course (rad) the leader drifts off in the stories of each."""


def formation_told(lies: dict[str, tuple[float, float]]) -> Formation:
    """Make a formation in which some hear of a leader that drifts off for a while."""

    def tell(name: str, mail: Mail, now: float) -> Mail:
        sender, data = mail
        if sender != "leader" or name not in lies or not BEGIN_S < now < END_S:
            return mail
        rate, course = lies[name]
        said, off = decode(data), rate * (now - BEGIN_S)
        frame = LocalFrame(said.latitude_deg, said.longitude_deg, 0.0)
        latitude, longitude = frame.shifted(
            said.latitude_deg, said.longitude_deg, off * math.cos(course), off * math.sin(course)
        )
        return sender, encode(replace(said, latitude_deg=latitude, longitude_deg=longitude))

    return Formation(in_place("circle-wind", rate_hz=10.0), tell=tell)


@pytest.mark.parametrize(
    "lies",
    [DRIFTS, {"f3": (4.0, math.pi)}, {"f1": (3.0, 0.0), "f2": (3.0, 0.0)}],
    ids=["each another place", "one of three", "two the same place"],
)
def test_followers_that_are_told_different_places_find_out_and_keep_clear(lies):
    formation = formation_told(lies)
    flight = formation.fly(FLOWN_S)
    assert flight.nearest() > 11.0
    for name in formation.names:
        first = min(
            event.time_s for event in flight.events[name] if "a place of the leader" in event.text
        )
        assert first < BEGIN_S + 1.0
    # Who is told of a leader that drifts finds that out by its velocity, too.
    for name in lies:
        words = flight.words(name)
        assert "not followed until they agree" in words or "reports what cannot be" in words
    assert formation.modes() == {"tracking"}
    assert set(formation.flight_modes().values()) == {"GUIDED"}
