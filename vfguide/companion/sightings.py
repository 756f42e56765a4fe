"""What was heard last of the other vehicles, as arrays, and where that puts them now."""

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.predicted_tracks import ComplexArray, arc

SILENT_S = 2.4
"""Of a vehicle that has not been heard for longer it is not known whether its companion still steers.

In a turn, where that matters, ten states were lost in a row: at a loss of 30 % that is rare (6e-6). On a
circle of 150 m at 20 m/s a course that is held has by then left the slot by 8 m.
"""

LAST_TURN_S = 1.0
"""A course that is held after a turn lies this much of the turn ahead of the last one flown: 1 / alpha."""


WIND_S = 0.6
"""A vehicle that was heard this short a time ago flies in the wind of now."""


class Sightings:
    """What was heard last of some vehicles, one row for each."""

    __slots__ = (
        "acceleration",
        "ahead",
        "altitude",
        "carried",
        "climb_rate",
        "drift",
        "held",
        "offset",
        "place",
        "since",
        "speed",
        "steered",
        "time",
        "turn_rate",
        "wind",
    )

    def __init__(self, count: int) -> None:
        """Make rows of vehicles that have not been heard yet."""
        self.time = np.full(count, -np.inf)
        """When, s."""
        self.since = np.full(count, np.inf)
        """Since when without a silence, s."""
        self.place = np.full(count, complex(np.nan))
        """m."""
        self.ahead = np.full(count, complex(np.nan))
        """Unit vector along the course."""
        self.speed = np.full(count, np.nan)
        """Over the ground, m/s."""
        self.acceleration = np.full(count, np.nan)
        """Along the course, m/s²."""
        self.turn_rate = np.full(count, np.nan)
        """rad/s."""
        self.altitude = np.full(count, np.nan)
        """m above mean sea level."""
        self.climb_rate = np.zeros(count)
        """m/s, positive up."""
        self.steered = np.zeros(count, dtype=bool)
        """Whether their companions steered them."""
        self.offset = np.zeros(count, dtype=np.complex128)
        """From the leader, forward + j right, m."""
        self.drift = np.zeros(count)
        """Speed relative to the formation, m/s."""
        self.held = np.full(count, complex(np.nan))
        """Unit vector along the course that their autopilots were told to hold; NaN where not known."""
        self.wind = np.zeros(count, dtype=np.complex128)
        """Of then, as the own vehicle knew it, toward, m/s."""
        self.carried = np.zeros(count, dtype=np.complex128)
        """How far the wind has carried each since then beyond where that wind would have, m."""

    def carry(self, age: FloatArray, wind: complex, passed_s: float) -> None:
        """Let the wind (m/s) carry those who are silent for some time (s).

        A wind that swings comes back to where it was: what it is now says little of what it has been.

        Args:
            age: how long each has not been heard, s.
            wind: now.
            passed_s: since this was done last.
        """
        fresh = age <= WIND_S
        self.carried += (wind - self.wind) * np.minimum(age, passed_s)
        self.carried[fresh] = 0.0
        # That of then: in a wind that swings it is another one two seconds later.
        self.wind[fresh] = wind

    def rows(self, begin: int, end: int) -> "Sightings":
        """The rows from one to before another: the same memory."""
        part = Sightings(0)
        for name in self.__slots__:
            setattr(part, name, getattr(self, name)[begin:end])
        return part

    def propagate(self, age: FloatArray, wind: complex) -> tuple[ComplexArray, ComplexArray]:
        """(places, velocities) of all, these times (s) after they were heard: along their arcs.

        A wind (m/s) that is not the one of when they fell silent carries them with it (`carry`).
        """
        first = np.minimum(age, LAST_TURN_S)
        last = self.speed + self.acceleration * first
        mean = np.where(age > LAST_TURN_S, last, self.speed + 0.5 * self.acceleration * first)
        place = arc(self.place, mean * self.ahead, self.turn_rate, age)
        velocity: ComplexArray = last * self.ahead * np.exp(1j * self.turn_rate * age)
        return place + self.carried, velocity + (wind - self.wind)
