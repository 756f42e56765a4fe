"""Before take-off: does every vehicle of the formation stay within the fence?

Each slot is taken along the whole path, turned into its course: on a turn the outermost aircraft leaves an
area that the leader stays in.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import compose
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
from vfguide.mission.flight_path import Location, path_of
from vfguide.mission.model import Mission
from vfguide.mission.path_frame import frame_of
from vfguide.mission.place import Fence

STEP_M = 5.0
MOST_STEPS = 50_000
"""Along the path."""

SPARE_M = 10.0
"""Nearer to the fence than this is worth a word: gusts, and what satellite navigation is off."""


@dataclass(frozen=True, slots=True)
class Track:
    """Where a vehicle flies along the path."""

    name: str
    """Name of the vehicle."""
    location: Location
    """Where the mission places it."""
    north: FloatArray
    """m."""
    east: FloatArray
    """m."""
    height: FloatArray
    """Above the mission's origin, m."""


def tracks(mission: Mission) -> Iterator[Track]:
    """The leader's along its path, and that of each slot."""
    path = path_of(mission.path)
    length = path.length
    if not math.isfinite(length):
        length = mission.leader.airspeed_m_s * mission.rehearsal.duration_s
    count = min(max(2, math.ceil(length / STEP_M)), MOST_STEPS)
    places = path.at(np.linspace(0.0, length, count))
    height = mission.height_above_origin_m + np.broadcast_to(places.height, (count,))
    yield Track(mission.leader.vehicle, ("path",), places.north, places.east, height)
    for index, follower in enumerate(mission.followers):
        slot = follower.slot
        forward, right = np.full(count, slot.forward_m), np.full(count, slot.right_m)
        north, east = compose(forward, right, places.course)
        yield Track(
            follower.vehicle,
            ("followers", index, "slot"),
            places.north + north,
            places.east + east,
            height + slot.up_m,
        )


def hold_tracks(
    mission: Mission, north: float, east: float, radius: float, height: float
) -> Iterator[Track]:
    """The leader's once round a circle to the right, and that of each slot.

    Args:
        mission: with the slots of the hold.
        north: of the centre, m.
        east: of the centre, m.
        radius: m.
        height: of the leader above the mission's origin, m.
    """
    count = max(8, math.ceil(math.tau * radius / STEP_M))
    angle = np.linspace(0.0, math.tau, count, endpoint=False)
    slots = [(mission.leader.vehicle, 0.0, 0.0, 0.0)]
    slots += [
        (one.vehicle, one.slot.forward_m, one.slot.right_m, one.slot.up_m)
        for one in mission.followers
    ]
    for name, forward, right, up in slots:
        ahead, inward = np.full(count, forward), np.full(count, right - radius)
        along, across = compose(ahead, inward, angle)
        yield Track(name, ("followers",), north + along, east + across, np.full(count, height + up))


def beyond_the_fence(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Vehicles whose way along the path leaves the fence, or comes near it; and heights."""
    del conditions
    yield from tracks_beyond_the_fence(mission, tracks)
    yield from _rally_points_beyond(mission)


def fences_of(mission: Mission) -> list[Fence]:
    """The mission's own and that of its plan, where they limit anything."""
    return [one for one in (mission.fence, mission.path.fence) if one is not None and one.exists]


def top_of(fences: Iterable[Fence | None]) -> float:
    """Greatest height that all of these fences allow, m above the origin; infinite where none limits it."""
    limits = [one.max_height_m for one in fences if one is not None and one.max_height_m]
    return min(limits, default=math.inf)


def tracks_beyond_the_fence(
    mission: Mission, found: Callable[[Mission], Iterable[Track]]
) -> Iterator[Finding]:
    """Tracks that leave the mission's fence, or come near it; they are asked for only where there is one."""
    fences = fences_of(mission)
    if not fences:
        return
    frame = frame_of(mission.model_dump())
    highest = top_of(fences)
    for track in found(mission):
        rooms = [one.room(track.north, track.east, frame) for one in fences]
        room = np.min(rooms, axis=0)
        worst = int(room.argmin())
        if room[worst] < SPARE_M:
            yield _near(track, float(room[worst]), worst)
        top = int(track.height.argmax())
        if track.height[top] > highest:
            yield Finding(
                "error",
                track.location,
                f"'{track.name}' flies {track.height[top]:.0f} m above the origin {_place(track, top)}, the"
                f" fence ends at {highest:g} m",
                "lower height_above_origin_m, the waypoints or the slot",
            )


def _rally_points_beyond(mission: Mission) -> Iterator[Finding]:
    fences = fences_of(mission)
    frame = frame_of(mission.model_dump()) if fences else None
    for index, point in enumerate(mission.path.rally_points):
        north, east = (np.array([one]) for one in point.local(frame))
        if any(one.room(north, east, frame)[0] < 0.0 for one in fences):
            yield Finding(
                "warning",
                ("path", "file"),
                f"rally point {index + 1} (north {north[0]:.0f} m, east {east[0]:.0f} m) is beyond the fence",
                "move it inside, or an aircraft that returns there leaves the fence",
            )


def _near(track: Track, room: float, worst: int) -> Finding:
    place = _place(track, worst)
    if room < 0.0:
        return Finding(
            "error",
            track.location,
            f"'{track.name}' leaves the fence by {-room:.0f} m {place}",
            "move the path or the slot inwards, or make the turns smaller there",
        )
    return Finding(
        "warning",
        track.location,
        f"'{track.name}' comes within {room:.0f} m of the fence {place}",
        f"leave {SPARE_M:g} m for gusts and for what the navigation is off",
    )


def _place(track: Track, index: int) -> str:
    return f"near north {track.north[index]:.0f} m, east {track.east[index]:.0f} m"


def left_out_of_the_plan(mission: Mission) -> Iterator[Finding]:
    """What a plan also asks for, and a formation does not do."""
    if mission.path.left_out:
        what = ", ".join(mission.path.left_out[:12])
        yield Finding("note", ("path", "file"), f"not flown of this plan: {what}")
