"""Does a formation stay within its fence when it is flown, and not only by its plan?"""

from collections.abc import Iterator

from vfguide.elementwise import BoolArray
from vfguide.mission.fence_check import Track, tracks_beyond_the_fence
from vfguide.mission.finding import Finding
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord


def beyond_when_flown(
    mission: Mission, record: FlightRecord, during: BoolArray
) -> Iterator[Finding]:
    """Vehicles that leave the fence of a mission and of its path; each is at ("vehicles", name).

    Args:
        mission: on the path that is flown then.
        record: of the flight.
        during: samples of it that count.
    """
    if not during.any():
        return

    def flown(_: Mission) -> Iterator[Track]:
        for one in (record.leader, *record.followers):
            height = one.altitude_amsl_m - mission.origin.altitude_amsl_m
            place = ("vehicles", one.name)
            yield Track(one.name, place, one.north_m[during], one.east_m[during], height[during])

    for finding in tracks_beyond_the_fence(mission, flown):
        if finding.severity == "error":
            yield finding
