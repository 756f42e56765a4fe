"""What a follower believes of states from the link: sound, new, of about now, possible, and not contradicted.

Who has a leader's key can tell each follower another place. Each story is possible by itself, so what is
heard of the leader alone shows nothing. But followers say in their own states where their leader was, and
when: two places at one time are two stories.

Nobody can see which story is true. Who is outvoted for a second, or has as many against it as with it,
follows the leader only while the stories are within the radius that the mission's spacing allows. Where two
follow, the key of one can end the following of the other. All keep clear of both places.
"""

import math
from collections import deque
from collections.abc import Callable
from functools import lru_cache

import msgspec
from msgspec.structs import replace

from vfguide.companion.alerts import QUIET_S, Alerts
from vfguide.companion.belief import MOVED_S, Belief
from vfguide.companion.doubt import HeardVehicle
from vfguide.companion.timing import SharedClock
from vfguide.companion.witnesses import CLIMB_M_S, RETURN_S, HeightWitnesses
from vfguide.frames import LocalFrame
from vfguide.guidance.airframe import polar
from vfguide.guidance.navigation import ReportedMotion, reach_of
from vfguide.link.codec import LinkDataError, decode
from vfguide.mavlink.announcements import WARNING
from vfguide.state import Airframe, HeardState, LeaderFix

FUTURE_S = 0.25
"""A state from farther in the future than this is not believed."""

PAST_S = 60.0
"""A state that is older than this when it arrives is not believed either."""

SAME_S = 2e-3
"""Times that differ by less are one: links tell them to 1 ms, and round differently."""

ANY_REACH = reach_of(Airframe(airspeed_max=60.0, max_bank=math.radians(60.0)))
"""What the aircraft of others can do at most: a listener does not know their limits."""

REMEMBERED = 1024
"""States that have been read: more than are on their way at a time in any rehearsal."""


class StateReceiver(HeardVehicle):
    """The newest state of one other vehicle."""

    def __init__(
        self,
        frame: LocalFrame,
        clock: SharedClock,
        alerts: Alerts | None = None,
        *,
        whose: str = "it",
        moved_s: float = MOVED_S,
        beside: Callable[[HeardState], HeightWitnesses] | None = None,
    ) -> None:
        """Make it, with nothing heard yet.

        Args:
            frame: the formation's local frame.
            clock: that the times of states are on.
            alerts: takes what a pilot should know.
            whose: states these are, as texts begin.
            moved_s: for how long states from where it cannot be have to agree before they are believed.
            beside: finds what there is beside the altitude of a state.
        """
        super().__init__(Belief(ANY_REACH, moved_s=moved_s), alerts, whose, beside)
        self._frame = frame
        self._clock = clock
        self._judged_s = -math.inf

    def take(self, data: bytes, now: float) -> bool:
        """Take a state if it is sound and newer than the one before; whether it was."""
        try:
            motion = motion_of(data, self._frame)
        except LinkDataError:
            self.counters["malformed"] += 1
            return False
        time_s = self._clock.to_own(motion.time_s)
        if time_s > now + FUTURE_S:
            self.counters["from the future"] += 1
        # Not "below": where the shared clock is not known yet the time is NaN.
        elif not time_s >= now - PAST_S:
            self.counters["too old"] += 1
        elif time_s <= self._judged_s + SAME_S:
            self.counters["not newer"] += 1
        else:
            return self._judge(motion, time_s)
        return False

    def _judge(self, said: HeardState, time_s: float) -> bool:
        """Whether a state can be true, after those before; it was so at a time (s) of one's own clock."""
        self._judged_s = time_s
        # On one's own clock: the formation's jumps when the leader's computer starts anew.
        motion = ReportedMotion(
            time_s, said.north, said.east, *polar(said.ground_speed, said.course)
        )
        if time_s != said.time_s:
            said = replace(said, time_s=time_s)
        believed = self.believe(motion, said)
        self.newest = believed or self.newest
        return believed is not None


@lru_cache(maxsize=REMEMBERED)
def motion_of(data: bytes, frame: LocalFrame) -> HeardState:
    """A state from the link, in the local frame and at its time on the shared clock.

    Remembered, since the companions of a rehearsal, a hundred in one process, all hear the same bytes.

    Raises:
        LinkDataError: the bytes are no sound state.
    """
    message = decode(data)
    north, east = frame.to_local(message.latitude_deg, message.longitude_deg)
    sighting = message.sighting
    return HeardState(
        time_s=message.time_s,
        north=north,
        east=east,
        course=message.course,
        ground_speed=message.ground_speed,
        acceleration=message.acceleration,
        turn_rate=message.turn_rate,
        turn_acceleration=message.turn_acceleration,
        altitude_amsl=message.altitude_amsl,
        height=message.altitude_amsl - frame.altitude_m,
        climb_rate=message.climb_rate,
        steered=message.steered,
        term=message.term,
        arrangement=message.arrangement,
        course_setpoint=message.course_setpoint,
        height_sense=message.height_sense,
        satellite_m=message.satellite_m,
        leader_fix=None
        if sighting is None
        else LeaderFix(
            time_s=message.time_s - sighting.age_s,
            north=north + sighting.north,
            east=east + sighting.east,
            altitude_amsl=message.altitude_amsl + sighting.up,
        ),
    )


def place_said(said: HeardState) -> LeaderFix:
    """Where a leader says that it is, on the clock that the formation shares."""
    return LeaderFix(said.time_s, said.north, said.east, said.altitude_amsl)


SAME_M = 1.0
"""Places that differ by less are one: they are told to 0.1 m and 1 ms, and met on a chord, not on an arc."""

REMEMBERED_S = 5.0
"""For so long it is known where the leader was: longer than a state of a follower is on its way."""

APART_S = 0.6
"""States of the leader that are farther apart tell no place between them."""

CERTAIN_S = 1.0
"""A follower that is outvoted for so long does not follow: everybody has told twice by then."""

SAID_S = 1.5
"""For so long a follower's word counts: it says one 2.5 times a second at least."""


class Story(msgspec.Struct, frozen=True, kw_only=True):
    """Where a follower's leader was, against what this vehicle was told of that time."""

    said_s: float
    """When the follower said it, s of the own clock."""
    north: float
    """From the place that this vehicle was told, m."""
    east: float
    """m."""
    up: float
    """m."""

    @property
    def apart(self) -> float:
        """Distance of both places, m."""
        return math.hypot(self.north, self.east, self.up)


class LeaderStories:
    """What one vehicle was told of its leader, and what the followers say of theirs."""

    def __init__(self, most_m: float, alerts: Alerts | None = None, *, leads: bool = False) -> None:
        """Know of no leader yet.

        Args:
            most_m: stories that are farther apart are not followed, m.
            alerts: takes what a pilot should know.
            leads: whether this vehicle is the leader itself.
        """
        self._most_m = most_m
        self._alerts = alerts or Alerts()
        self._leads = leads
        self._term = 0
        self._places: deque[LeaderFix] = deque()
        self._stories: dict[str, Story] = {}
        self._heard_s: dict[str, float] = {}
        self._outvoted_since = math.inf
        self._parted_s = -math.inf
        self._told = False

    @property
    def newest(self) -> LeaderFix | None:
        """Where this vehicle was told last that the leader is."""
        return self._places[-1] if self._places else None

    def hear_leader(self, place: LeaderFix, term: int) -> None:
        """Take what the leader of a term says, or what it says itself where this is the leader."""
        newest = self._places[-1].time_s if self._places else -math.inf
        if term < self._term:
            return
        if term > self._term or place.time_s < newest - REMEMBERED_S:
            self._term = term
            self._places.clear()
            self._stories.clear()
        elif place.time_s <= newest:
            return
        self._places.append(place)
        while self._places[0].time_s < place.time_s - REMEMBERED_S:
            self._places.popleft()

    def hear_follower(self, vehicle: str, said: HeardState, now: float) -> None:
        """Take a follower's state, where it tells of its leader; now: s of the own clock."""
        self._heard_s[vehicle] = now
        place = said.leader_fix
        if place is None or said.term != self._term:
            self._stories.pop(vehicle, None)
            return
        known = self._place_at(place.time_s)
        if known is None:
            return
        self._stories[vehicle] = Story(
            said_s=now,
            north=place.north - known.north,
            east=place.east - known.east,
            up=place.altitude_amsl - known.altitude_amsl,
        )
        self._judge(now)

    def _place_at(self, time_s: float) -> LeaderFix | None:
        """Where this vehicle was told that the leader was, on the chord between two states."""
        later = None
        for place in reversed(self._places):
            if abs(place.time_s - time_s) <= SAME_S:
                return place
            if place.time_s < time_s:
                return None if later is None else between(place, later, time_s)
            later = place
        return None

    def may_be_followed(self, now: float) -> bool:
        """Whether the leader may be followed: no others that count speak against it."""
        return now - self._parted_s > RETURN_S

    def elsewhere(self, leader: HeardState, now: float) -> HeardState | None:
        """The leader where the story that is farthest from the own one has it; None where all are the same.

        Args:
            leader: as this vehicle was told.
            now: s.
        """
        against = self._against(now)
        if not against:
            return None
        story = max(against.values(), key=lambda one: one.apart)
        return replace(
            leader,
            north=leader.north + story.north,
            east=leader.east + story.east,
            height=leader.height + story.up,
            altitude_amsl=leader.altitude_amsl + story.up,
            steered=False,
        )

    def _against(self, now: float) -> dict[str, Story]:
        """The stories that speak against the own one, by who tells them."""
        return {
            name: one
            for name, one in self._stories.items()
            if one.apart > SAME_M and now - one.said_s <= SAID_S
        }

    def _judge(self, now: float) -> None:
        """Find out whether the leader may be followed, and tell the pilot what has changed."""
        against = self._against(now)
        if not against:
            self._outvoted_since = math.inf
            if self._told and self.may_be_followed(now):
                self._told = False
                self._alerts.say(
                    "stories", WARNING, "all fly by the same leader state again: nothing to do"
                )
            return
        # Who has not told yet is not against: the first to speak is not the majority.
        count = sum(now - heard_s <= SAID_S for heard_s in self._heard_s.values())
        apart = max(one.apart for one in against.values())
        far = sum(one.apart > self._most_m for one in against.values())
        outvoted = not self._leads and 2 * len(against) > count
        if self._leads or 2 * far <= count:
            self._outvoted_since = math.inf
        elif now - min(self._outvoted_since, now) >= CERTAIN_S:
            self._parted_s = now
        else:
            self._outvoted_since = min(self._outvoted_since, now)
        self._told = True
        names = " and ".join(sorted(against))
        text = self._sentence(names, apart, outvoted=outvoted, now=now)
        followed = self.may_be_followed(now)
        self._alerts.say(f"stories: {names} {followed}", WARNING, text, quiet_s=QUIET_S)

    def _sentence(self, names: str, apart: float, *, outvoted: bool, now: float) -> str:
        """What does not agree, what follows from it, and what to do."""
        verb = "fly" if " and " in names else "flies"
        begins = f"{names} {verb} by a place of the leader that is {apart:.0f} m from"
        if self._leads:
            return f"{begins} the one that this leader tells: someone else has a key; land, make new keys"
        if not outvoted:
            return (
                f"{begins} what this vehicle and others were told: kept clear of both; see {names}"
            )
        if self.may_be_followed(now):
            return f"{begins} what this vehicle was told: kept clear of both, be ready to take over"
        return (
            f"{begins} what this vehicle was told: the leader is not followed until they agree;"
            " take over, and make new keys"
        )


def between(first: LeaderFix, second: LeaderFix, time_s: float) -> LeaderFix | None:
    """The place on the chord between two; None where they are too far apart, or no aircraft flies so."""
    whole = second.time_s - first.time_s
    level = math.hypot(second.north - first.north, second.east - first.east)
    up = abs(second.altitude_amsl - first.altitude_amsl)
    if whole > APART_S or level > ANY_REACH.speed * whole or up > CLIMB_M_S * whole + SAME_M:
        return None
    share = (time_s - first.time_s) / whole
    return LeaderFix(*(a + share * (b - a) for a, b in zip(first, second, strict=True)))
