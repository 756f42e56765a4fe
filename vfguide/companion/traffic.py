"""The others in the air, as a follower knows them: where they are now, and how far to keep from them."""

import heapq
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from vfguide.companion.hearing import Hearing
from vfguide.companion.lookout import (
    ROOM_M,
    TURNED_M_S,
    Standpoint,
    calm_for,
    calm_within,
    greatest_wish,
    room_to,
)
from vfguide.companion.shared_clock import SharedClock
from vfguide.elementwise import clip
from vfguide.frames import LocalFrame
from vfguide.guidance.formation import FieldGains, predict_leader
from vfguide.guidance.separation import Obstacle
from vfguide.guidance.wind_triangle import compose
from vfguide.state import LeaderState

JOIN_M = 11.0
"""Distance that a follower keeps while it is away from its slot."""

HOLD_M = 8.0
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

ARC_STEP_S = 1.0
"""Longest step along an arc."""

FORGET_S = 15.0
"""After this nobody knows where it is, either."""


@dataclass(slots=True)
class Neighbour:
    """One of the others, and when it has to be looked at."""

    hearing: Hearing
    """What was heard of it, and read."""
    spacing: float
    """From its slot to one's own, m."""
    calm_until: float = -math.inf
    """Before this its barrier cannot bind, s; infinitely long ago: it may now."""
    aside_until: float = -math.inf
    """The same, should somebody else's turn the wish."""
    places: Sequence[Obstacle[float]] = ()
    """Where it may be, when it was looked at last."""
    arrived: float = -math.inf
    """When something came last, s."""

    def disturb(self) -> None:
        """What calmed is not so any more."""
        self.calm_until = self.aside_until = -math.inf


class Traffic:
    """The other vehicles of a formation."""

    def __init__(
        self,
        spacing: Mapping[str, float],
        frame: LocalFrame,
        clock: SharedClock,
        gains: FieldGains,
    ) -> None:
        """Make it, with nobody heard yet.

        Args:
            spacing: for each of the others, the distance between its slot and one's own, m.
            frame: the formation's local frame.
            clock: that the formation shares.
            gains: of the field, which bound what the follower may wish for.
        """
        self._neighbours = {
            vehicle: Neighbour(Hearing(frame, clock), apart) for vehicle, apart in spacing.items()
        }
        self._queue: list[tuple[float, str]] = []
        """A heap of all others, by when they have to be looked at: most are not touched in a step."""
        self._queue_up()
        self._gains = gains
        self._foreseen = -math.inf

    @property
    def counters(self) -> Counter[str]:
        """States of others that were not used, by reason."""
        total: Counter[str] = Counter()
        for neighbour in self._neighbours.values():
            total += neighbour.hearing.counters
        return total

    def receive(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of another follower; those of strangers are nobody's business."""
        neighbour = self._neighbours.get(vehicle)
        if neighbour is None:
            return
        if not neighbour.hearing.take(data, now):
            return
        # After a silence the guess that calmed is worth nothing.
        if now - neighbour.arrived > SILENT_S:
            neighbour.disturb()
            self._queue_up()
        neighbour.arrived = now

    def obstacles(
        self,
        here: Standpoint,
        *,
        linked: bool,
        leading: Sequence[Obstacle[float]] = (),
        lead_s: float = 0.0,
    ) -> list[Obstacle[float]]:
        """Those who may be in the way now: nobody, or everybody who is near enough then.

        Args:
            here: the follower itself.
            linked: whether the link is known to work, so that silence means something.
            leading: the leader, of whom the link tells more often.
            lead_s: how far ahead of now the laws look, s: by then somebody's barrier may bind.
        """
        now = here.time_s
        ahead = 2.0 * here.foreseen + ROOM_M
        if here.foreseen > self._foreseen:
            for neighbour in self._neighbours.values():
                neighbour.disturb()
            self._queue_up()
            self._foreseen = ahead
        self._foreseen = min(self._foreseen, ahead)
        slot_speed = math.hypot(here.slot_north, here.slot_east)
        wish = greatest_wish(self._foreseen, slot_speed, self._gains)
        until = now + lead_s
        due = self._due(until)
        for vehicle, neighbour in due.items():
            look(neighbour, here, wish, linked=linked)
            heapq.heappush(self._queue, (neighbour.calm_until, vehicle))
        binding = [one for one in due.values() if one.calm_until <= until and one.places]
        if not binding and all(calm_for(here, place, wish) > lead_s for place in leading):
            return []
        found = list(leading)
        for neighbour in self._neighbours.values():
            if neighbour.aside_until <= until:
                if neighbour.calm_until > until:
                    look(neighbour, here, wish, linked=linked)
                found += neighbour.places if neighbour.aside_until <= until else ()
        # Some were looked at before their time.
        self._queue_up()
        return found

    def _due(self, until: float) -> dict[str, Neighbour]:
        """Those who have to be looked at by a time (s), taken out of the queue."""
        due = {}
        while self._queue and self._queue[0][0] <= until:
            vehicle = heapq.heappop(self._queue)[1]
            due[vehicle] = self._neighbours[vehicle]
        return due

    def _queue_up(self) -> None:
        """Everybody anew: some have another time than the queue knows."""
        self._queue = [(one.calm_until, vehicle) for vehicle, one in self._neighbours.items()]
        heapq.heapify(self._queue)


def look(neighbour: Neighbour, here: Standpoint, wish: float, *, linked: bool) -> None:
    """Find out where one of the others may be, and for how long that is nowhere near."""
    heard = neighbour.hearing.newest
    if heard is None:
        return
    now = here.time_s
    keep = kept_distance(neighbour.spacing, here.distance)
    neighbour.places = possible_obstacles(heard, now, keep, linked=linked)
    neighbour.disturb()
    rooms = [room_to(here, place) for place in neighbour.places]
    if not rooms:
        return
    calm_s = min([calm_within(*room, wish) for room in rooms])
    aside_s = min([calm_within(*room, wish + TURNED_M_S) for room in rooms])
    if calm_s > 0.0:
        neighbour.calm_until = now + calm_s
    if aside_s > 0.0:
        neighbour.aside_until = now + aside_s


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
    arc = along_arc(heard, now)
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


def along_arc(heard: LeaderState[float], now: float) -> LeaderState[float]:
    """Somebody who flies on as heard: for a second by all its rates, then at that speed along the circle.

    In steps, since the prediction is one along a chord.
    """
    motion = predict_leader(heard, min(now, heard.time_s + LAST_TURN_S))
    while motion.time_s < now:
        steady = replace(motion, acceleration=0.0, turn_acceleration=0.0)
        motion = predict_leader(steady, min(now, motion.time_s + ARC_STEP_S))
    return motion


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
