"""Last sightings of other vehicles, and the tracks on which each of them may fly next.

A steered vehicle flies with the formation. One that is heard and not steered may do anything that an aircraft
can: continue its arc, level out, or turn either way at its bank limit. A silent one may fly on with the
formation, if only the link is lost. It holds its last course or heading if its companion has died, and turns
on if its autopilot hangs.
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
    integrals,
    passing,
    place_of,
    velocity_of,
)
from vfguide.state import LeaderState

SILENT_S = 2.4
"""Silence after which it is unknown whether a vehicle's companion still steers, s.

In a turn, where that matters, ten states are then lost in a row: at a loss of 30 % that is rare (6e-6). On a
circle of 150 m at 20 m/s, a vehicle that holds its course has left the slot by 8 m by then.
"""

LAST_TURN_S = 1.0
"""Time by which a course held after a turn leads the last one flown, s: 1 / alpha."""


WIND_S = 0.9
"""Age of a state up to which the present wind is taken for that of the vehicle, s."""

AIRSPEED_S = 2.0
"""Time constant of others' airspeeds, s: ground speeds show each gust, airspeeds what is held."""

SPACING_SHARE = 0.65
"""Greatest share of the slot spacing that is kept as distance: close formations are meant to be close."""

BERTH_M = 15.0
"""Distance kept from the predicted arc of a vehicle that is not under guidance, m."""

DRIFT_M_S = 1.0
"""Speed at which a silent vehicle may leave its predicted places, m/s."""

MOST_GUSTS_M = 5.0
"""Limit on the distance that gusts add to a held course, m. Without it followers left their slots by up to
168 m, beside the vehicle that they had to let pass."""

TURNS_OFF_M_S = 3.0
"""Speed relative to the formation beyond which a vehicle may also continue its arc, m/s."""

ALONG_S = 4.0
"""Horizon for steered vehicles, which keep clear themselves, and others that level out or hang, s."""

ARC_S = 2.0
"""Horizon for vehicles of the formation that continue their arc, s."""

STANDING_M = 5.5
"""Distance kept from where a vehicle may stand, m: the promised 5 m and the error of places. Nothing is
predicted there. A follower right behind has to leave its slot by as much."""

TURNS_RAD_S = 0.1
"""Turn rate beyond which a vehicle may be rolling into a turn at its bank limit, rad/s."""

PAST_SHARES: FloatArray = np.linspace(0.0, 1.0, 12, endpoint=False)
"""Steps since the last state of a silent vehicle, as shares of its age."""

HOLDS_S = 5.0
"""Horizon for a silent vehicle that holds its last course, s.

With a shorter horizon a vehicle speeds up and crosses in front of it, where there was time to let it pass.
"""

STANDS_S = 3.0
"""Horizon for a vehicle that stands where it was last heard, s: most silences are those of the link."""


class Sightings:
    """Last sightings of some vehicles, one row for each."""

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
        self.time = np.full(count, -np.inf)
        """Time of the last state, s."""
        self.since = np.full(count, np.inf)
        """Beginning of the present run of states without a silence, s."""
        self.place = np.full(count, complex(np.nan))
        """Place, m north + j m east."""
        self.ahead = np.full(count, complex(np.nan))
        """Unit vector along the course."""
        self.speed = np.full(count, np.nan)
        """Ground speed, m/s."""
        self.acceleration = np.full(count, np.nan)
        """Acceleration along the course, m/s²."""
        self.turn_rate = np.full(count, np.nan)
        """Turn rate, rad/s."""
        self.altitude = np.full(count, np.nan)
        """Altitude, m above mean sea level."""
        self.climb_rate = np.zeros(count)
        """Climb rate, m/s, positive up."""
        self.steered = np.zeros(count, dtype=bool)
        """Whether the vehicle's companion steered it."""
        self.offset = np.zeros(count, dtype=np.complex128)
        """Place as forward + j right of the leader, m."""
        self.drift = np.zeros(count)
        """Speed relative to the formation, m/s."""
        self.held = np.full(count, complex(np.nan))
        """Unit vector along the autopilot's course setpoint; NaN where not known."""
        self.sense = np.zeros(count, dtype=np.int8)
        """Direction in which the vehicle leaves its height, see `HeardState.height_sense`."""
        self.wind = np.zeros(count, dtype=np.complex128)
        """Wind at the last state as the own vehicle knew it, toward, m/s."""
        self.carried = np.zeros(count, dtype=np.complex128)
        """Drift since the last state in addition to that of the wind at that time, m."""
        self.airspeed = np.full(count, np.nan)
        """Filtered airspeed by the own vehicle's wind, m/s; NaN before the first."""
        self.flies = np.full(count, np.nan)
        """Airspeed that the vehicle is assumed to hold, m/s."""
        self.run = np.zeros(count)
        """Distance flown since the last state if the vehicle holds its course, m; NaN before the first."""

    def carry(self, age: FloatArray, here: "Viewpoint", passed_s: float) -> None:
        """Advance the drift and the run of silent vehicles at their ages, s, by `passed_s`.

        The drift is integrated, as the present wind says little of a swinging wind's past. In gusts others
        are assumed to hold their mean airspeed. In calm air they hold the last one, with what they gained
        while they answered their last setpoint.
        """
        wind, fresh = here.wind, age <= WIND_S
        # A swinging wind is another one two seconds later.
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
        """Return the rows from `begin` to before `end`, as views of the same memory."""
        part = Sightings(0)
        for name in self.__slots__:
            setattr(part, name, getattr(self, name)[begin:end])
        return part

    def propagate(self, age: FloatArray, wind: complex) -> tuple[ComplexArray, ComplexArray]:
        """Return (places, velocities) along arcs at these ages, s; the wind, m/s, carries the silent."""
        first = np.minimum(age, LAST_TURN_S)
        last = self.speed + self.acceleration * first
        mean = np.where(age > LAST_TURN_S, last, self.speed + 0.5 * self.acceleration * first)
        place = arc(self.place, mean * self.ahead, self.turn_rate, age)
        velocity: ComplexArray = last * self.ahead * np.exp(1j * self.turn_rate * age)
        return place + self.carried, velocity + (wind - self.wind)


IntArray = NDArray[np.intp]


class Viewpoint(msgspec.Struct, frozen=True, kw_only=True):
    """Own vehicle, from which others are seen."""

    time_s: float
    """Own time, s."""
    place: complex
    """Place, m north + j m east."""
    velocity: complex
    """Velocity over ground, m/s."""
    wanted: complex
    """Velocity that guidance asks for, m/s."""
    altitude_amsl: float
    """Altitude, m above mean sea level."""
    wind: complex
    """Wind as the vehicle knows it, toward, m/s."""
    climb_rate: float
    """Climb rate, m/s."""
    astray: float
    """Distance from the slot, m; for a leader the distance from flying along its path."""
    reaction_s: float
    """Reaction time, s: age of what is heard, dead time and lag."""
    gusts: float = 0.0
    """Speed at which gusts carry a vehicle away from the course and speed that it holds, m/s."""


class VehiclesInSight(msgspec.Struct, frozen=True, kw_only=True):
    """Vehicles that may come near, one element for each."""

    row: IntArray
    age: FloatArray
    silent: BoolArray
    stopped: BoolArray
    """Whether the vehicle may stand where it was last heard."""
    heard_at: ComplexArray
    """Place of the last state, m."""
    believed: BoolArray
    """Whether the last state said that the vehicle was steered."""
    place: ComplexArray
    velocity: ComplexArray
    held: ComplexArray
    """Unit vector along the autopilot's course setpoint; NaN where not known."""
    wind: ComplexArray
    """Wind at the last state, toward, m/s."""
    carried: ComplexArray
    """Drift since the last state in addition to that of the wind at that time, m."""
    velocity_heard: ComplexArray
    """Ground velocity of the last state, m/s."""
    acceleration: FloatArray
    """Acceleration along the course at the last state, m/s²."""
    speed_answer_s: FloatArray
    """Time constant with which it takes up an airspeed, s."""
    airspeed: FloatArray
    """Airspeed that the vehicle is assumed to hold, m/s."""
    run: FloatArray
    """Distance flown since the last state if the vehicle holds its course, m."""
    offset: ComplexArray
    """Place as forward + j right of the leader, m; of silent vehicles at the last state."""
    turn_rate: FloatArray
    lateral_acceleration: FloatArray
    """Limit in turns, g tan(phi_max), m/s²."""
    keep: FloatArray
    spacing: FloatArray
    slot: ComplexArray
    """Slot as forward + j right of the leader, m."""
    slot_rate: ComplexArray
    """Velocity of the slot in the formation's frame, m/s."""
    drift: FloatArray
    """Speed relative to the slot, m/s; of silent vehicles at the last state."""
    weight: FloatArray
    linked: BoolArray
    """Whether the link has worked without a break since the last state."""

    @property
    def hardest(self) -> FloatArray:
        """Turn rate at the limit in turns, rad/s."""
        rates: FloatArray = self.lateral_acceleration / np.maximum(np.abs(self.velocity), 1.0)
        return rates


def possibilities_of(
    seen: VehiclesInSight, here: Viewpoint, leader: LeaderState | None
) -> tuple[Others, IntArray] | None:
    """Return the possible tracks of all vehicles that may come near, with their rows; None for none."""
    found: list[tuple[IntArray, ComplexArray, float, FloatArray]] = []
    grown = DRIFT_M_S * np.maximum(seen.age - SILENT_S, 0.0)
    # However uncertain the places are, slots may be flown: the mission has put them this near.
    most = np.maximum(SPACING_SHARE * seen.spacing, seen.keep)
    keep = np.minimum(seen.keep + grown, most)
    floor = np.minimum(FLOOR_M, seen.keep)
    # Predictions have a larger error where the sender is silent.
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
        off = along & ~seen.silent & (seen.drift > TURNS_OFF_M_S)
        if off.any():
            arcs(off, seen.turn_rate, ARC_S, keep)
    holds = seen.believed & seen.silent & seen.linked
    hangs = holds if leader is None else holds & (seen.drift > TURNS_OFF_M_S)
    least_kept = floor + grown
    found += [
        (which, tracks, ALONG_S, least_kept)
        for which, tracks in tracks_banked(seen, hangs, here.wind)
    ]
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
    # Gusts carry a vehicle that nobody corrects away from its predicted place.
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
    """Return (places in m, velocities in m/s) in the formation, silent vehicles as last heard in it."""
    frame = cmath.exp(1j * leader.course)
    carried = place_of(leader) + frame * seen.offset
    carried_velocity = velocity_of(leader) + 1j * leader.turn_rate * frame * seen.offset
    return (
        np.where(seen.silent, carried, seen.place),
        np.where(seen.silent, carried_velocity, seen.velocity),
    )


def tracks_banked(
    seen: VehiclesInSight, hangs: BoolArray, wind: complex
) -> list[tuple[IntArray, ComplexArray]]:
    """Return (rows, tracks in m) of silent vehicles that keep their bank, as an autopilot does that hangs.

    They go on to the airspeed that they were about to reach, and their turn widens as they get faster. A turn
    is reported late when it has just begun: their bank is the reported one, or the limit.
    """
    if not hangs.any():
        return []
    air = seen.velocity_heard - seen.wind
    begun = np.maximum(np.abs(air), 1.0)
    # In a wind, ground speeds change with a mere turn.
    turning = 1j * seen.turn_rate * air * np.exp(-1j * np.angle(seen.velocity_heard))
    gained = (seen.acceleration - turning.real) * seen.speed_answer_s
    times = np.hstack([seen.age[:, None] * PAST_SHARES, seen.age[:, None] + TIMES])
    steps = np.diff(times)
    share = -np.expm1(-times / seen.speed_answer_s[:, None])
    speed = np.maximum(begun[:, None] + gained[:, None] * share, 1.0)
    drifted = seen.wind * seen.age + seen.carried
    begin = (seen.heard_at + drifted)[:, None] + wind * TIMES
    reported = seen.turn_rate * begun
    limit = np.copysign(seen.lateral_acceleration, seen.turn_rate)

    def tracks(which: BoolArray, lateral: FloatArray) -> tuple[IntArray, ComplexArray]:
        turned = integrals(lateral[:, None] / speed, steps)
        flown = integrals(speed * np.exp(1j * turned), steps)[:, len(PAST_SHARES) :]
        return np.flatnonzero(which), (begin + (air / begun)[:, None] * flown)[which]

    return [tracks(hangs, reported), tracks(hangs & (np.abs(seen.turn_rate) > TURNS_RAD_S), limit)]


def tracks_held(
    seen: VehiclesInSight, holds: BoolArray, here: Viewpoint
) -> list[tuple[IntArray, ComplexArray]]:
    """Return (rows, tracks in m) of silent vehicles that keep what their autopilots held last."""
    found = []
    for hold, which in ((course_held, holds), (heading_held, holds & np.isnan(seen.held))):
        if which.any():
            place, velocity = hold(seen, here.wind)
            tracks = arc(place[which, None], velocity[which, None], 0.0)
            found.append((np.flatnonzero(which), tracks))
    return found


def course_held(seen: VehiclesInSight, wind: complex) -> tuple[ComplexArray, ComplexArray]:
    """Return places, m, and velocities, m/s, after a turn onto the last course; `wind` is toward, m/s.

    The course is the autopilot's setpoint from their states. In gusts the past turn does not show it: ten
    degrees are 25 m after 7 s. Without a setpoint the turn has to do.
    """
    change = wind - seen.wind
    heard = (seen.velocity - change) * np.exp(-1j * seen.turn_rate * seen.age)
    # They turn as a first-order hold does, and have held their airspeed in the winds since then.
    turned = LAST_TURN_S * -np.expm1(-seen.age / LAST_TURN_S)
    place = seen.heard_at + seen.held * seen.run + (heard - np.abs(heard) * seen.held) * turned
    velocity = seen.held * ground_speed_held(seen.airspeed, seen.held, wind)
    # Go back along the arc to where they were heard, on for the last turn, and straight from there.
    guessed = seen.velocity * np.exp(1j * seen.turn_rate * (LAST_TURN_S - seen.age))
    back = arc(seen.place, seen.velocity, seen.turn_rate, LAST_TURN_S - seen.age)
    unknown = np.isnan(seen.held)
    return (
        np.where(unknown, back + guessed * (seen.age - LAST_TURN_S), place),
        np.where(unknown, guessed, velocity),
    )


def ground_speed_held(airspeed: FloatArray, held: ComplexArray, wind: complex) -> FloatArray:
    """Return ground speeds, m/s, of airspeeds on courses (unit vectors) in a wind, toward, m/s."""
    along = wind * np.conj(held)
    root = np.sqrt(np.maximum(airspeed * airspeed - along.imag * along.imag, 0.0))
    speed: FloatArray = along.real + root
    return speed


def heading_held(seen: VehiclesInSight, wind: complex) -> tuple[ComplexArray, ComplexArray]:
    """Return places, m, and velocities, m/s, on the heading of the last turn; `wind` is toward, m/s.

    In a swinging wind the heading turns at another rate than the course, and the wind carries the vehicle.
    """
    change = wind - seen.wind
    heard = (seen.velocity - change) * np.exp(-1j * seen.turn_rate * seen.age)
    air = heard - seen.wind
    rate_of_air = 1j * seen.turn_rate * heard - change / np.maximum(seen.age, 1e-3)
    turn_rate = np.imag(np.conj(air) * rate_of_air) / np.maximum(np.abs(air), 1.0) ** 2
    turned = arc(seen.heard_at, air, turn_rate, np.asarray(LAST_TURN_S))
    held = air * np.exp(1j * turn_rate * LAST_TURN_S)
    carried = seen.wind * seen.age + seen.carried
    return turned + held * (seen.age - LAST_TURN_S) + carried, held + wind
