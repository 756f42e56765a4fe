"""Keys of a formation, and what its members sign with."""

from pathlib import Path

from vfguide.link.keys import key_places, make_keys, read_private_key, read_roster
from vfguide.link.trust import Trust, new_session
from vfguide.mission import Mission


def trusts_of(mission: Mission, file: Path) -> dict[str, Trust]:
    """Make keys beside a mission's file; what each of its companions signs with, and whom it believes."""
    places, names = key_places(file), mission.companions
    make_keys(places, mission.name, names)
    roster = read_roster(places.roster)
    return {
        name: Trust(
            formation=mission.name,
            name=name,
            leader=mission.leader.vehicle,
            session=new_session(),
            roster=roster,
            key=read_private_key(places.private(name)),
        )
        for name in names
    }
