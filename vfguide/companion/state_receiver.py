"""Acceptance of states from the link: sound, new, of about now, possible, and not contradicted.

Whoever has a leader's key can tell each follower another place, and each of these stories is possible by
itself. But followers also report where their leader was, and when: two places at one time are two stories.

Nobody can see which story is true. A follower that is outvoted for a second follows the leader only while the
stories are within the radius that the slots' spacing allows. So does one with as many against it as with
it. Where two follow, the key of one can end the following of the other. All keep clear of both places.
"""

import math
from collections import deque
from collections.abc import Callable
from functools import lru_cache

import msgspec
from msgspec.structs import replace

from vfguide.companion.alerts import QUIET_S, Alerts
from vfguide.companion.belief import GREATEST_RADIUS_M, MOVED_S, Belief
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
"""Tolerance on states from the future, s."""

PAST_S = 60.0
"""Maximum age of a state on arrival, s."""

SAME_S = 2e-3
"""Tolerance within which times are equal, s: links carry them to 1 ms and round differently."""

ANY_REACH = reach_of(Airframe(airspeed_max=60.0, max_bank=math.radians(60.0)))
"""Flight limits assumed for other aircraft, whose own limits are not known."""

REMEMBERED = 1024
"""Size of the cache of decoded states: more than are ever on their way in a rehearsal."""


class StateReceiver(HeardVehicle):
    """Newest state of one other vehicle."""

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
        """Begin with nothing heard; texts begin with `whose`, and `beside` finds an altitude's witnesses.

        States from an impossible place must agree for `moved_s`, s, before they are believed.
        """
        super().__init__(Belief(ANY_REACH, moved_s=moved_s), alerts, whose, beside)
        self._frame = frame
        self._clock = clock
        self._judged_s = -math.inf

    def take(self, data: bytes, now: float) -> bool:
        """Process a state; return whether it is sound, newer, and believed."""
        try:
            motion = motion_of(data, self._frame)
        except LinkDataError:
            self.counters["malformed"] += 1
            return False
        time_s = self._clock.to_own(motion.time_s)
        if time_s > now + FUTURE_S:
            self.counters["from the future"] += 1
        # The shared clock gives NaN while not known, which fails this test too.
        elif not time_s >= now - PAST_S:
            self.counters["too old"] += 1
        elif time_s <= self._judged_s + SAME_S:
            self.counters["not newer"] += 1
        else:
            return self._judge(motion, time_s)
        return False

    def _judge(self, said: HeardState, time_s: float) -> bool:
        """Judge a state, true at an own time, s, by those before; return whether it is believed."""
        self._judged_s = time_s
        # Use the own clock, as the formation's jumps when the leader's computer restarts.
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
    """Decode a state into the local frame, at its time on the shared clock.

    Results are cached, as up to a hundred companions of a rehearsal in one process hear the same bytes.

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
    """Return where a leader reports itself, on the shared clock."""
    return LeaderFix(said.time_s, said.north, said.east, said.altitude_amsl)


SAME_M = 1.0
"""Tolerance within which places are equal, m: sent to 0.1 m and 1 ms, and met on a chord, not an arc."""

REMEMBERED_S = 5.0
"""Time for which the leader's places are kept, s: longer than the latency of a follower's state."""

APART_S = 0.6
"""Interval between leader's states beyond which no place between them is known, s."""

CERTAIN_S = 1.0
"""Time after which an outvoted follower does not follow, s: all have reported twice by then."""

SAID_S = 1.5
"""Validity of a follower's report, s: it sends at least 2.5 a second."""


class Story(msgspec.Struct, frozen=True, kw_only=True):
    """Offset of a follower's story of its leader's place from what this vehicle was told of that time."""

    said_s: float
    """Own time of the follower's report, s."""
    north: float
    """Offset north, m."""
    east: float
    """Offset east, m."""
    up: float
    """Offset up, m."""

    @property
    def apart(self) -> float:
        """Distance between both places, m."""
        return math.hypot(self.north, self.east, self.up)


class LeaderStories:
    """Comparison of what this vehicle and the followers were told of the leader's place."""

    def __init__(self, alerts: Alerts | None = None, *, leads: bool = False) -> None:
        """Begin with no leader known."""
        self.most_m = GREATEST_RADIUS_M
        """Stories farther apart are not followed, m."""
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
        """Newest place of the leader as told to this vehicle."""
        return self._places[-1] if self._places else None

    def hear_leader(self, place: LeaderFix, term: int) -> None:
        """Process a place of the leader in a term; the leader itself passes its own."""
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
        """Process a follower's state at an own time, s, for its report on its leader."""
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
        """Return the leader's place as told to this vehicle, interpolated on a chord; None if not known."""
        later = None
        for place in reversed(self._places):
            if abs(place.time_s - time_s) <= SAME_S:
                return place
            if place.time_s < time_s:
                return None if later is None else between(place, later, time_s)
            later = place
        return None

    def may_be_followed(self, now: float) -> bool:
        """Check whether the leader may be followed: this vehicle is not outvoted, nor was it lately."""
        return now - self._parted_s > RETURN_S

    def elsewhere(self, leader: HeardState, now: float) -> HeardState | None:
        """Return the leader at the story farthest from `leader`, the own one; None where all agree."""
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
        """Return the recent stories that contradict the own one, by follower."""
        return {
            name: one
            for name, one in self._stories.items()
            if one.apart > SAME_M and now - one.said_s <= SAID_S
        }

    def _judge(self, now: float) -> None:
        """Decide whether the leader may be followed, and tell the pilot of changes."""
        against = self._against(now)
        if not against:
            self._outvoted_since = math.inf
            if self._told and self.may_be_followed(now):
                self._told = False
                self._alerts.say(
                    "stories", WARNING, "all fly by the same leader state again: nothing to do"
                )
            return
        # A follower that has not reported yet is not against: the first to speak is not the majority.
        count = sum(now - heard_s <= SAID_S for heard_s in self._heard_s.values())
        apart = max(one.apart for one in against.values())
        far = sum(one.apart > self.most_m for one in against.values())
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
        """Return text on the disagreement, its consequence, and the remedy."""
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
    """Return the place on the chord between two; None if they are too far apart in time or in space."""
    whole = second.time_s - first.time_s
    level = math.hypot(second.north - first.north, second.east - first.east)
    up = abs(second.altitude_amsl - first.altitude_amsl)
    if whole > APART_S or level > ANY_REACH.speed * whole or up > CLIMB_M_S * whole + SAME_M:
        return None
    share = (time_s - first.time_s) / whole
    return LeaderFix(*(a + share * (b - a) for a, b in zip(first, second, strict=True)))
