"""The others in the air, as a follower knows them: where they are now, and how far to keep from them."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from vfguide.companion.hearing import Hearing
from vfguide.companion.shared_clock import SharedClock
from vfguide.elementwise import clip
from vfguide.frames import LocalFrame
from vfguide.guidance.formation import predict_leader
from vfguide.guidance.separation import Obstacle
from vfguide.guidance.wind_triangle import compose
from vfguide.state import LeaderState

JOIN_M = 10.0
"""Distance that a follower keeps while it is away from its slot."""

HOLD_M = 7.0
"""Distance that one in its slot keeps: whoever is astray keeps more, and does the going round."""

ASTRAY_M = 5.0
"""From its slot: from here on a follower is astray."""

SPACING_SHARE = 0.65
"""Of the distance between two slots, at most this is kept: who flies in close formation wants to."""

SILENT_S = 1.0
"""Of somebody who has not been heard for longer than this nobody knows whether its companion still steers."""

DRIFT_M_S = 0.5
"""How fast somebody without a companion may leave the place where it is believed to be, m/s."""

LAST_TURN_S = 1.0
"""A course that is held after a turn lies this much of the turn ahead of the last one flown: 1 / alpha."""

FORGET_S = 15.0
"""After this nobody knows where it is, either."""


class Traffic:
    """The other vehicles of a formation."""

    def __init__(self, spacing: Mapping[str, float], frame: LocalFrame, clock: SharedClock) -> None:
        """Make it, with nobody heard yet.

        Args:
            spacing: for each of the others, the distance between its slot and one's own, m.
            frame: the formation's local frame.
            clock: that the formation shares.
        """
        self._spacing = spacing
        self._heard = {vehicle: Hearing(frame, clock) for vehicle in spacing}

    @property
    def counters(self) -> Counter[str]:
        """States of others that were not used, by reason."""
        total: Counter[str] = Counter()
        for hearing in self._heard.values():
            total += hearing.counters
        return total

    def receive(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of another follower; those of strangers are nobody's business."""
        hearing = self._heard.get(vehicle)
        if hearing is not None:
            hearing.take(data, now)

    def obstacles(self, now: float, distance: float, *, linked: bool) -> list[Obstacle[float]]:
        """Where the other followers are.

        Args:
            now: on one's own clock, s.
            distance: from one's own slot, m.
            linked: whether the link is known to work, so that silence means something.
        """
        return [
            obstacle
            for vehicle, hearing in self._heard.items()
            if hearing.newest is not None
            for obstacle in possible_obstacles(
                hearing.newest, now, kept_distance(self._spacing[vehicle], distance), linked=linked
            )
        ]


def possible_obstacles(
    heard: LeaderState[float], now: float, keep: float, *, linked: bool
) -> list[Obstacle[float]]:
    """Where somebody who was last heard like this may be now.

    One whose companion is cut off flies on along the formation's arc; one whose companion has died flies on
    straight, more or less, since an autopilot holds the last course that it was given.

    Args:
        heard: its last state.
        now: s.
        keep: distance to be kept from it, m.
        linked: whether the link works, so that the silence is not one's own deafness.
    """
    age = now - heard.time_s
    if age > FORGET_S:
        return []
    arc = predict_leader(heard, now)
    if age <= SILENT_S or not linked:
        return [obstacle_of(arc, keep)]
    held = replace(
        predict_leader(heard, heard.time_s + LAST_TURN_S),
        acceleration=0.0,
        turn_rate=0.0,
        turn_acceleration=0.0,
    )
    unsure = keep + DRIFT_M_S * (age - SILENT_S)
    return [obstacle_of(arc, keep), obstacle_of(predict_leader(held, now), unsure)]


def kept_distance(spacing: float, distance: float) -> float:
    """How far (m) to keep from somebody whose slot is this far from one's own, at this distance from that."""
    astray = clip(distance / ASTRAY_M, 0.0, 1.0)
    kept = HOLD_M + (JOIN_M - HOLD_M) * astray
    return min(kept, SPACING_SHARE * spacing)


def obstacle_of(motion: LeaderState[float], keep: float) -> Obstacle[float]:
    """A vehicle in the way."""
    north, east = compose(motion.ground_speed, 0.0, motion.course)
    return Obstacle(
        north=motion.north,
        east=motion.east,
        velocity_north=north,
        velocity_east=east,
        keep=keep,
    )
