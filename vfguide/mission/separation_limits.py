"""Before take-off: how near may a vehicle come that leaves its slot, whatever it does?

For every two vehicles: one leaves guidance and turns at its bank limit, to either side and for as long as it
likes, from straight flight in the formation. The other hears of it, answers after its dead time and lag, and
flies one full manoeuvre whatever the first does then; what it really does, looking again at every report, is
no worse. The same kinematics as those of the study in docs/accuracy.md.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vfguide.guidance.limits import GRAVITY
from vfguide.guidance.predicted_tracks import TIMES, Agility, ComplexArray, OwnMotion, arc
from vfguide.guidance.separation import escape_distance
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
from vfguide.mission.model import Mission

PROMISED_M = 5.0
"""No vehicle under guidance is to come nearer than this to another."""

PUBLISH_S = 0.1
"""Between states of a vehicle that is not under guidance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Guarantee:
    """The pair of vehicles that could come nearest, in space."""

    distance_m: float
    """How near."""
    own: str
    """The vehicle that keeps clear."""
    other: str
    """The vehicle that leaves its place."""


def least_guarantee(mission: Mission) -> Guarantee | None:
    """The least distance that is kept from a vehicle that leaves its slot; None for a single vehicle.

    Heights of slots are kept meanwhile: the distance in space is that in the plane and that of the heights.
    """
    places, heights = {mission.leader.vehicle: 0j}, {mission.leader.vehicle: 0.0}
    for follower in mission.followers:
        places[follower.vehicle] = complex(follower.slot.forward_m, follower.slot.right_m)
        heights[follower.vehicle] = follower.slot.up_m
    found = [
        Guarantee(
            distance_m=math.hypot(
                kept_from(mission, own, places, other), heights[own] - heights[other]
            ),
            own=own,
            other=other,
        )
        for own in places
        for other in places
        if own != other
    ]
    return min(found, key=lambda one: one.distance_m, default=None)


def kept_from(mission: Mission, own: str, places: dict[str, complex], other: str) -> float:
    """Distance (m) in the plane that a vehicle can keep from another that turns at its bank limit.

    Args:
        mission: the mission.
        own: name of the vehicle that keeps clear.
        places: of all vehicles, m: forward + j right.
        other: name of the vehicle that turns.
    """
    vehicle, cruise = mission.vehicles[own], mission.leader.airspeed_m_s
    rehearsal = mission.rehearsal
    heard_s = PUBLISH_S + rehearsal.link_delay_s + 1.0 / rehearsal.rate_hz
    lowest, highest = vehicle.airspeed_range_m_s
    agility = Agility(
        turn_rate=turn_rate_of(mission, own),
        acceleration=vehicle.max_acceleration_m_s2,
        turn_delay=heard_s + vehicle.course_dead_time_s + vehicle.course_lag_s,
        speed_delay=heard_s + vehicle.speed_dead_time_s + vehicle.speed_lag_s,
        alpha=10.0,
        beta=10.0,
        speed_min=lowest,
        speed_max=highest,
    )
    motion = OwnMotion(place=places[own], air_velocity=complex(cruise, 0.0), wind=0j, turn_rate=0.0)
    hardest = turn_rate_of(mission, other)
    return min(
        escape_distance(motion, agility, turning_tracks(places[other], cruise, side * hardest))
        for side in (1.0, -1.0)
    )


def turning_tracks(place: complex, speed: float, turn_rate: float) -> ComplexArray:
    """Tracks that turn at a rate (rad/s) from straight flight, for different times, and go straight on."""
    tracks = []
    for turning_s in TIMES[1:]:
        first = np.minimum(TIMES, turning_s)
        turned = arc(place, complex(speed, 0.0), turn_rate, first)
        away = speed * np.exp(1j * turn_rate * first)
        tracks.append(turned + away * (TIMES - first))
    return np.array(tracks)


def turn_rate_of(mission: Mission, name: str) -> float:
    """Greatest turn rate of a vehicle at the mission's airspeed, rad/s."""
    bank = math.radians(mission.vehicles[name].max_bank_deg)
    return GRAVITY * math.tan(bank) / mission.leader.airspeed_m_s


def distance_kept_from_strays(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """What the mission's numbers guarantee, and slots that are too close for the promise."""
    del conditions
    least = least_guarantee(mission)
    if least is None:
        return
    what = (
        f"should '{least.other}' leave its place in one turn at its bank limit, '{least.own}' can stay "
        f"{least.distance_m:.0f} m clear of it"
    )
    if least.distance_m >= PROMISED_M:
        yield Finding(
            "note",
            ("followers",),
            f"{what}, the least of any two; nearer where it turns again: docs/accuracy.md, Keeping clear",
        )
        return
    remedy = "move their slots apart, or give them different heights (slot.up_m)"
    yield Finding("warning", ("followers",), f"{what}, less than {PROMISED_M:g} m", remedy)
