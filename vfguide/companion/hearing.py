"""What a follower believes of the states that come over the link: sound, new, and of about now."""

from collections import Counter
from dataclasses import replace
from functools import lru_cache

from vfguide.companion.shared_clock import SharedClock
from vfguide.frames import LocalFrame
from vfguide.link.codec import LinkDataError, decode
from vfguide.state import LeaderState

FUTURE_S = 0.25
"""A state from farther in the future than this is not believed."""

PAST_S = 60.0
"""A state that is older than this when it arrives is not believed either."""


REMEMBERED = 1024
"""States that have been read: more than are on their way at a time in any rehearsal."""


class Hearing:
    """The newest state of one other vehicle."""

    def __init__(self, frame: LocalFrame, clock: SharedClock) -> None:
        """Make it, with nothing heard yet.

        Args:
            frame: the formation's local frame.
            clock: that the times of states are on.
        """
        self._frame = frame
        self._clock = clock
        self.counters: Counter[str] = Counter()
        """States that were not used, by reason."""
        self.newest: LeaderState[float] | None = None
        """Times on one's own clock."""

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
        elif self.newest is not None and time_s <= self.newest.time_s:
            self.counters["not newer"] += 1
        else:
            self.newest = motion if time_s == motion.time_s else replace(motion, time_s=time_s)
            return True
        return False


@lru_cache(maxsize=REMEMBERED)
def motion_of(data: bytes, frame: LocalFrame) -> LeaderState[float]:
    """A state from the link, in the local frame and at its time on the shared clock.

    Remembered, since the companions of a rehearsal, a hundred in one process, all hear the same bytes.

    Raises:
        LinkDataError: the bytes are no sound state.
    """
    message = decode(data)
    north, east = frame.to_local(message.latitude_deg, message.longitude_deg)
    return LeaderState(
        time_s=message.time_s,
        north=north,
        east=east,
        course=message.course,
        ground_speed=message.ground_speed,
        acceleration=message.acceleration,
        turn_rate=message.turn_rate,
        turn_acceleration=message.turn_acceleration,
    )
