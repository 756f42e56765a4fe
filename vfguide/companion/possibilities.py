"""What was heard last of other vehicles, and what each may do next: the tracks that it is kept clear of.

A vehicle that is steered flies with the formation. One that is heard and not steered may do anything that
a plane can: fly on along its arc, level out, turn either way at its bank limit. One that is silent flies
on with the formation, where only the link is lost, holds its last course or heading, where its companion
has died, or turns on, where its autopilot hangs.
"""

import cmath

import msgspec
import numpy as np
from numpy.typing import NDArray

from vfguide.elementwise import BoolArray, FloatArray, clip
from vfguide.guidance.separation import (
    BEGINNINGS,
    FLOOR_M,
    HORIZON_S,
    TIMES,
    ComplexArray,
    Others,
    arc,
    formation_tracks,
    passing,
    place_of,
    velocity_of,
)
from vfguide.state import LeaderState

SILENT_S = 2.4
"""Of a vehicle that has not been heard for longer it is not known whether its companion still steers.

In a turn, where that matters, ten states were lost in a row: at a loss of 30 % that is rare (6e-6). On a
circle of 150 m at 20 m/s a course that is held has by then left the slot by 8 m.
"""

LAST_TURN_S = 1.0
"""A course that is held after a turn lies this much of the turn ahead of the last one flown: 1 / alpha."""


WIND_S = 0.9
"""A vehicle that was heard this short a time ago flies in the wind of now."""

AIRSPEED_S = 2.0
"""Memory of the airspeeds of others. Over the ground each gust shows; through the air it is what is held."""

SPACING_SHARE = 0.65
"""Of the distance between two slots, at most this is kept: who flies in close formation wants to."""

BERTH_M = 15.0
"""Distance that is kept from the predicted arc of one that is not under guidance."""

DRIFT_M_S = 1.0
"""How fast a silent vehicle may leave the places where it is believed to be, m/s."""

MOST_GUSTS_M = 5.0
"""Most that gusts add to the distance from a course that is held. Without this bound followers left their
slots by up to 168 m, beside the vehicle that they were to let pass."""

TURNS_OFF_M_S = 3.0
"""A vehicle that moves faster than this in the formation's frame may also fly on along its arc."""

ALONG_S = 4.0
"""How far ahead steered vehicles are looked at, that keep clear themselves, and others that level out."""

ARC_S = 2.0
"""How far ahead it may."""

STANDING_M = 5.5
"""Distance that is kept from a place where one may stand: the 5 m of the promise, and what places are off.
Nothing has to be predicted of it. A follower right behind has to leave its slot by as much."""

HOLDS_S = 5.0
"""How far ahead a silent vehicle may hold its last course.

Who sees less far ahead speeds up and crosses in front of it where there was time to let it pass.
"""

STANDS_S = 3.0
"""How far ahead it may stand where it was last heard: most silences are those of the link."""


class Sightings:
    """What was heard last of some vehicles, one row for each."""

    __slots__ = (
        "acceleration",
        "ahead",
        "airspeed",
        "altitude",
        "carried",
        "climb_rate",
        "drift",
        "flies",
        "held",
        "offset",
        "place",
        "run",
        "sense",
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
        self.sense = np.zeros(count, dtype=np.int8)
        """Which way each leaves its height, see `HeardState.height_sense`."""
        self.wind = np.zeros(count, dtype=np.complex128)
        """Of then, as the own vehicle knew it, toward, m/s."""
        self.carried = np.zeros(count, dtype=np.complex128)
        """How far the wind has carried each since then beyond where that wind would have, m."""
        self.airspeed = np.full(count, np.nan)
        """As the own vehicle's wind tells, filtered, m/s; NaN: not found yet."""
        self.flies = np.full(count, np.nan)
        """Airspeed that each is taken to hold, m/s."""
        self.run = np.zeros(count)
        """How far each has flown since then if it flies on its held course, m; NaN: not found yet."""

    def carry(self, age: FloatArray, here: "Viewpoint", passed_s: float) -> None:
        """Let the wind carry those who are silent for some time (s).

        A wind that swings comes back to where it was: what it is now says little of what it has been. In
        gusts others are taken to hold the airspeed that they had in the mean; in calm air the one that they
        had last, with what they gained while they answered their last setpoint.

        Args:
            age: how long each has not been heard, s.
            here: who looks around, with its wind and the gusts.
            passed_s: since this was done last.
        """
        wind, fresh = here.wind, age <= WIND_S
        # That of then: in a wind that swings it is another one two seconds later.
        self.carried += (wind - self.wind) * np.minimum(age, passed_s)
        self.carried[fresh] = 0.0
        self.wind[fresh] = wind
        if here.gusts > 0.0:
            self.flies[:] = self.airspeed
        else:
            found = np.abs(self.speed * self.ahead - self.wind)
            self.flies[:] = found + self.acceleration * np.minimum(age, LAST_TURN_S)
        speed = ground_speed_held(self.flies, self.held, wind)
        run = self.run + speed * np.minimum(age, passed_s)
        self.run[:] = np.where(fresh | np.isnan(run), speed * age, run)

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


IntArray = NDArray[np.intp]


class Viewpoint(msgspec.Struct, frozen=True, kw_only=True):
    """The vehicle that looks around."""

    time_s: float
    """On its own clock."""
    place: complex
    """m."""
    velocity: complex
    """Over the ground, m/s."""
    wanted: complex
    """Velocity that guidance wants, m/s."""
    altitude_amsl: float
    """m."""
    wind: complex
    """As the vehicle knows it, toward, m/s."""
    climb_rate: float
    """m/s."""
    astray: float
    """Distance from its slot, m; of a leader how far it is from flying along its path."""
    reaction_s: float
    """Until it answers to something new: the age of what it hears, its dead time and lag."""
    gusts: float = 0.0
    """How fast gusts carry a vehicle away from the course and the speed that it holds, m/s."""


class VehiclesInSight(msgspec.Struct, frozen=True, kw_only=True):
    """Those who may come near, one element for each."""

    row: IntArray
    age: FloatArray
    silent: BoolArray
    stopped: BoolArray
    """Whether they may stand where they were last heard."""
    heard_at: ComplexArray
    """There, m."""
    believed: BoolArray
    """Whether they said last that they were steered."""
    place: ComplexArray
    velocity: ComplexArray
    held: ComplexArray
    """Unit vector along the course that their autopilots were told to hold; NaN where that is not known."""
    wind: ComplexArray
    """When they were last heard, toward, m/s."""
    carried: ComplexArray
    """How far the wind has carried them since then beyond where that wind would have, m."""
    airspeed: FloatArray
    """That they are taken to hold, m/s."""
    run: FloatArray
    """How far each has flown since then if it flies on its held course, m."""
    offset: ComplexArray
    """From the leader, of those who are silent as it was when they were heard, m: forward + j right."""
    turn_rate: FloatArray
    hardest: FloatArray
    """Turn rate at the bank limit, rad/s."""
    keep: FloatArray
    spacing: FloatArray
    slot: ComplexArray
    """Forward + j right of the leader, m."""
    slot_rate: ComplexArray
    """How that moves in the formation, m/s."""
    drift: FloatArray
    """Speed relative to the slot, of those who are silent as it was when they were heard, m/s."""
    weight: FloatArray
    linked: BoolArray
    """Whether the link has worked all the time since they were heard."""


def possibilities_of(
    seen: VehiclesInSight, here: Viewpoint, leader: LeaderState | None
) -> tuple[Others, IntArray] | None:
    """What each of those who may come near may do, kind by kind; None where nothing is known of any."""
    found: list[tuple[IntArray, ComplexArray, float, FloatArray]] = []
    grown = DRIFT_M_S * np.maximum(seen.age - SILENT_S, 0.0)
    # However uncertain the places are, slots are flown: the mission put them this near.
    most = np.maximum(SPACING_SHARE * seen.spacing, seen.keep)
    keep = np.minimum(seen.keep + grown, most)
    floor = np.minimum(FLOOR_M, seen.keep)
    # What predictions are off is more where the sender is silent.
    least = np.minimum(floor + grown, keep)
    berth = grown + np.clip(SPACING_SHARE * seen.spacing, FLOOR_M, BERTH_M)

    def arcs(which: BoolArray, turn_rate: FloatArray, horizon_s: float, keep: FloatArray) -> None:
        tracks = arc(seen.place[which, None], seen.velocity[which, None], turn_rate[which, None])
        found.append((np.flatnonzero(which), tracks, horizon_s, keep))

    straight = np.zeros(len(seen.row))
    steered = seen.believed & ~seen.silent
    if leader is None and steered.any():
        arcs(steered, seen.turn_rate, ARC_S, floor)
    if leader is not None and seen.believed.any():
        along = seen.believed
        place, velocity = with_formation(seen, leader)
        left = np.abs(seen.slot - seen.offset)[along]
        settle = clip(left / (seen.drift[along] + 1e-3), 1.0, HORIZON_S)
        tracks = formation_tracks(
            place[along],
            velocity[along],
            seen.slot[along],
            settle,
            leader,
            slot_rate=seen.slot_rate[along],
        )
        found.append((np.flatnonzero(along), tracks, ALONG_S, keep))
        # Also one that is silent: an autopilot that hangs in a turn turns on.
        off = along & (~seen.silent | seen.linked) & (seen.drift > TURNS_OFF_M_S)
        if off.any():
            arcs(off, seen.turn_rate, ARC_S, keep)
        hangs = off & seen.silent
        if hangs.any():
            found.append((np.flatnonzero(hangs), tightened(seen)[hangs], ARC_S, floor + grown))
    holds = seen.believed & seen.silent & seen.linked
    first_held = len(found)
    found += [(which, tracks, HOLDS_S, keep) for which, tracks in tracks_held(seen, holds, here)]
    last_held = len(found)
    if seen.stopped.any():
        tracks = np.repeat(seen.heard_at[seen.stopped, None], len(TIMES), axis=1)
        standing = np.minimum(STANDING_M, seen.keep)
        found.append((np.flatnonzero(seen.stopped), tracks, STANDS_S, standing))
    free = ~seen.believed
    if free.any():
        arcs(free, seen.turn_rate, HORIZON_S, berth)
        arcs(free, straight, ALONG_S, berth)
        arcs(free, seen.hardest, here.reaction_s, floor)
        arcs(free, -seen.hardest, here.reaction_s, floor)
    if not found:
        return None
    rows = np.concatenate([which for which, *_ in found])
    # Gusts carry one that nobody corrects away from where it is looked for.
    room = np.minimum(most - keep, MOST_GUSTS_M)
    carried = np.minimum(here.gusts * (seen.age[:, None] + BEGINNINGS), room[:, None])
    sure = np.zeros_like(carried)
    margin = np.concatenate(
        [
            (carried if first_held <= number < last_held else sure)[which]
            for number, (which, *_) in enumerate(found)
        ]
    )
    keep = np.concatenate([distance[which] for which, _, _, distance in found])
    others = Others(
        tracks=np.concatenate([tracks for _, tracks, _, _ in found]),
        horizon_s=np.concatenate([np.full(len(which), end) for which, _, end, _ in found]),
        keep=keep,
        floor=np.minimum(least[rows], keep),
        weight=seen.weight[rows],
        passes=(steered * passing(seen.place - here.place, seen.velocity - here.velocity))[rows],
        margin=margin,
    )
    return others, seen.row[rows]


def with_formation(seen: VehiclesInSight, leader: LeaderState) -> tuple[ComplexArray, ComplexArray]:
    """(places, velocities) of those who fly with the formation, silent ones as they flew in it; m, m/s."""
    frame = cmath.exp(1j * leader.course)
    carried = place_of(leader) + frame * seen.offset
    carried_velocity = velocity_of(leader) + 1j * leader.turn_rate * frame * seen.offset
    return (
        np.where(seen.silent, carried, seen.place),
        np.where(seen.silent, carried_velocity, seen.velocity),
    )


def tightened(seen: VehiclesInSight) -> ComplexArray:
    """Tracks of vehicles that, when they fell silent, rolled on to the bank limit of their turn, m.

    A turn that has only begun is reported late: 0.1 rad/s of it are 20 m after four seconds.
    """
    heard = seen.velocity * np.exp(-1j * seen.turn_rate * seen.age)
    hardest = np.copysign(seen.hardest, seen.turn_rate)
    times = seen.age[:, None] + TIMES
    return arc(seen.heard_at[:, None], heard[:, None], hardest[:, None], times)


def tracks_held(
    seen: VehiclesInSight, holds: BoolArray, here: Viewpoint
) -> list[tuple[IntArray, ComplexArray]]:
    """(who, tracks in m) of silent vehicles that hold what their autopilots held last."""
    found = []
    for hold, which in ((course_held, holds), (heading_held, holds & np.isnan(seen.held))):
        if which.any():
            place, velocity = hold(seen, here.wind)
            tracks = arc(place[which, None], velocity[which, None], 0.0)
            found.append((np.flatnonzero(which), tracks))
    return found


def course_held(seen: VehiclesInSight, wind: complex) -> tuple[ComplexArray, ComplexArray]:
    """(places, velocities) of those who have turned onto their last course since they were heard; m, m/s.

    The course is the one that they have said their autopilots were told to hold. In gusts it cannot be found
    from how they turned: ten degrees are 25 m after 7 s. Where they have not said, it still has to be.

    Args:
        seen: silent vehicles.
        wind: now, toward, m/s.
    """
    change = wind - seen.wind
    heard = (seen.velocity - change) * np.exp(-1j * seen.turn_rate * seen.age)
    # They turn as a hold of first order does, and hold the airspeed that they had in the winds since then.
    turned = LAST_TURN_S * -np.expm1(-seen.age / LAST_TURN_S)
    place = seen.heard_at + seen.held * seen.run + (heard - np.abs(heard) * seen.held) * turned
    velocity = seen.held * ground_speed_held(seen.airspeed, seen.held, wind)
    # Back along the arc to where they were heard, on for the last turn, and straight from there.
    guessed = seen.velocity * np.exp(1j * seen.turn_rate * (LAST_TURN_S - seen.age))
    back = arc(seen.place, seen.velocity, seen.turn_rate, LAST_TURN_S - seen.age)
    unknown = np.isnan(seen.held)
    return (
        np.where(unknown, back + guessed * (seen.age - LAST_TURN_S), place),
        np.where(unknown, guessed, velocity),
    )


def ground_speed_held(airspeed: FloatArray, held: ComplexArray, wind: complex) -> FloatArray:
    """Ground speeds (m/s) of those who fly airspeeds on courses (unit vectors) in a wind toward there."""
    along = wind * np.conj(held)
    root = np.sqrt(np.maximum(airspeed * airspeed - along.imag * along.imag, 0.0))
    speed: FloatArray = along.real + root
    return speed


def heading_held(seen: VehiclesInSight, wind: complex) -> tuple[ComplexArray, ComplexArray]:
    """(places, velocities) of those who hold the heading of their last turn since they were heard; m, m/s.

    In a wind that swings the nose turns at another rate than the course, and the wind carries it since.

    Args:
        seen: silent vehicles.
        wind: now, toward, m/s.
    """
    change = wind - seen.wind
    heard = (seen.velocity - change) * np.exp(-1j * seen.turn_rate * seen.age)
    air = heard - seen.wind
    rate_of_air = 1j * seen.turn_rate * heard - change / seen.age
    turn_rate = np.imag(np.conj(air) * rate_of_air) / np.maximum(np.abs(air), 1.0) ** 2
    turned = arc(seen.heard_at, air, turn_rate, np.asarray(LAST_TURN_S))
    held = air * np.exp(1j * turn_rate * LAST_TURN_S)
    carried = seen.wind * seen.age + seen.carried
    return turned + held * (seen.age - LAST_TURN_S) + carried, held + wind
