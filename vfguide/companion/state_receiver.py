"""What a follower believes of the states that come over the link: sound, new, of about now, and possible."""

import math
from collections import Counter
from collections.abc import Callable
from functools import lru_cache

from msgspec.structs import replace

from vfguide.companion.alerts import Alerts
from vfguide.companion.belief import MOVED_S, Belief
from vfguide.companion.height_belief import HeightBelief, HeightWitnesses
from vfguide.companion.timing import SharedClock
from vfguide.frames import LocalFrame
from vfguide.guidance.navigation import ReportedMotion, reach_of
from vfguide.guidance.wind_triangle import polar
from vfguide.link.codec import LinkDataError, decode
from vfguide.mavlink.announcements import WARNING
from vfguide.state import Airframe, HeardState, LeaderFix

FUTURE_S = 0.25
"""A state from farther in the future than this is not believed."""

PAST_S = 60.0
"""A state that is older than this when it arrives is not believed either."""


COPY_S = 1e-3
"""States whose times are as near as that are copies of one, over links that round times differently."""

ANY_REACH = reach_of(Airframe(airspeed_max=60.0, max_bank=math.radians(60.0)))
"""What the aircraft of others can do at most: a listener does not know their limits."""

REMEMBERED = 1024
"""States that have been read: more than are on their way at a time in any rehearsal."""


class StateReceiver:
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
        self._frame = frame
        self._clock = clock
        self._belief = Belief(ANY_REACH, moved_s=moved_s)
        self._altitude = HeightBelief()
        self._beside = beside
        self._doubted = False
        self._judged_s = -math.inf
        self._alerts = alerts or Alerts()
        self._whose = whose
        self.counters: Counter[str] = Counter()
        """States that were not used, by reason."""
        self.newest: HeardState | None = None
        """Times on one's own clock."""
        self.doubted: tuple[HeardState, HeardState] | None = None
        """Where the sender says it is while that is not believed, and where its velocities lead: it may
        be at either place."""

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
        elif time_s <= self._judged_s + COPY_S:
            self.counters["not newer"] += 1
        else:
            return self._judge(motion, time_s)
        return False

    def _say(self, text: str) -> None:
        """Tell a pilot something of the states; a sentence's end, after the sender's name."""
        self._alerts.say(f"state of {self._whose}", WARNING, f"{self._whose} {text}")

    def _judge_altitude(self, motion: HeardState, time_s: float) -> float:
        """The altitude of a state (m), NaN while it is doubted."""
        before = self._altitude.doubted
        known = self._altitude.is_known
        beside = None if known or self._beside is None else self._beside(motion)
        altitude = self._altitude.judge(motion.altitude_amsl, time_s, beside)
        if self._altitude.doubted and not before:
            self.counters["altitude steps"] += 1
            self._say(self._altitude.sentence)
        return altitude

    def _judge(self, motion: HeardState, time_s: float) -> bool:
        """Whether a state can be true, after those before; it was so at a time (s) of one's own clock."""
        self._judged_s = time_s
        north, east = polar(motion.ground_speed, motion.course)
        believed = self._belief.take(
            ReportedMotion(
                # On one's own clock: the formation's jumps when the leader's computer starts anew.
                time_s=time_s,
                north=motion.north,
                east=motion.east,
                velocity_north=north,
                velocity_east=east,
            )
        )
        altitude = self._judge_altitude(motion, time_s)
        same = time_s == motion.time_s and altitude == motion.altitude_amsl
        height = altitude - self._frame.altitude_m
        state = (
            motion
            if same
            else replace(motion, time_s=time_s, altitude_amsl=altitude, height=height)
        )
        if not believed.is_reported:
            if believed.leads:
                carried = replace(state, north=believed.north, east=believed.east)
                self.doubted = replace(state, steered=False), carried
            self.counters["impossible"] += 1
            if not self._doubted:
                self._say(
                    f"reports what cannot be ({believed.reason}): not believed;"
                    " be ready to take over should it come near"
                )
            self._doubted = True
            return False
        if self._doubted:
            self._say("reports what can be again: believed, nothing to do")
        self._doubted = False
        self.doubted, self.newest = None, state
        return True


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
