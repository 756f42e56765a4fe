"""The others in the air, as a vehicle knows them: where they are now, and what they may do next.

Three kinds. One that is steered by its companion and heard flies with the formation, and keeps clear itself.
One that is heard and not steered may do anything that a plane can: fly on along its arc, level out, turn
either way at its bank limit. One that is silent flies on with the formation, where only the link is lost,
holds its last course, where its companion has died, or turns on, where its autopilot hangs.
"""

import cmath
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vfguide.companion.hearing import Hearing
from vfguide.companion.plan import OtherVehicle
from vfguide.companion.shared_clock import SharedClock
from vfguide.elementwise import BoolArray, FloatArray, clip
from vfguide.frames import LocalFrame
from vfguide.guidance.predicted_tracks import (
    HORIZON_S,
    TIMES,
    ComplexArray,
    arc,
    formation_tracks,
    in_formation,
    place_of,
    velocity_of,
)
from vfguide.guidance.separation import FLOOR_M, Others
from vfguide.state import HeardState, LeaderState

JOIN_M = 11.0
"""Distance that a vehicle keeps from a steered one while it is away from its slot."""

HOLD_M = 8.0
"""Distance that one in its slot keeps: a vehicle that is astray keeps more, and goes round it."""

ASTRAY_M = 5.0
"""From its slot: from here on a follower is astray."""

SPACING_SHARE = 0.65
"""Of the distance between two slots, at most this is kept: who flies in close formation wants to."""

BERTH_M = 15.0
"""Distance that is kept from the predicted arc of one that is not under guidance."""

SILENT_S = 2.4
"""Of a vehicle that has not been heard for longer it is not known whether its companion still steers.

In a turn, where that matters, ten states were lost in a row: at a loss of 30 % that is rare (6e-6). On a
circle of 150 m at 20 m/s a course that is held has by then left the slot by 8 m.
"""

LATER_S = 0.3
"""A vehicle that was heard by so much later than another shows that the link works without the other."""

STOPPED_S = 0.7
"""A leader publishes a state for each report. One that was not heard for longer may have stopped, as one
under a parachute has: the place where it was last heard is not flown through."""

DRIFT_M_S = 1.0
"""How fast a silent vehicle may leave the places where it is believed to be, m/s."""

LAST_TURN_S = 1.0
"""A course that is held after a turn lies this much of the turn ahead of the last one flown: 1 / alpha."""

FORGET_S = 12.0
"""After this its place is not known well enough to be avoided."""

LEVEL_S = 4.0
"""How far ahead a vehicle that is not under guidance is thought to level out."""

TURNS_OFF_M_S = 3.0
"""A vehicle that moves faster than this in the formation's frame may also fly on along its arc."""

ALONG_S = 4.0
"""How far ahead steered vehicles are looked at: they keep clear themselves, and go for their slots."""

ARC_S = 2.0
"""How far ahead it may."""

HOLDS_S = 3.0
"""How far ahead a silent vehicle may hold its last course: most silences are those of the link."""

ABOVE_M = 30.0
"""Vehicles farther above or below than this are not in the way."""

SAFE_M = 30.0
"""Vehicles farther away than this, and what both can fly within the horizon, are not looked at."""

CHORD_M = 0.5
"""How much shorter chords are than arcs, at most: 0.2 m after 2.4 s of a turn by 0.13 rad/s at 20 m/s."""

LEADER_WEIGHT = 3.0
"""What the leader counts where not all distances can be kept: it does not make room itself."""

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewpoint:
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
    astray: float
    """Distance from its slot, m."""
    reaction_s: float
    """Until it answers to something new: the age of what it hears, its dead time and lag."""


class Traffic:
    """The other vehicles of a formation."""

    def __init__(
        self, others: Sequence[OtherVehicle], frame: LocalFrame, clock: SharedClock
    ) -> None:
        """Make it, with no vehicle heard yet.

        Args:
            others: the other vehicles; for a follower the leader among them.
            frame: the formation's local frame.
            clock: that the formation shares.
        """
        self.vehicles = tuple(others)
        self._rows = {one.name: row for row, one in enumerate(others)}
        self._hearing = {one.name: Hearing(frame, clock) for one in others if not one.leads}
        self._words: list[str] = []
        self._link_lost_s = -math.inf
        # A row for each, and behind these one for each for the place where it says it is and is not believed.
        count = 2 * len(others)
        self._time = np.full(count, -np.inf)
        self._since = np.full(count, np.inf)
        self._place = np.full(count, complex(np.nan))
        self._ahead = np.full(count, complex(np.nan))
        self._speed, self._acceleration = np.full(count, np.nan), np.full(count, np.nan)
        self._turn_rate, self._altitude = np.full(count, np.nan), np.full(count, np.nan)
        self._steered = np.zeros(count, dtype=bool)
        self._slot = np.array([complex(one.slot.forward, one.slot.right) for one in others] * 2)
        self._offset = self._slot.copy()
        self._drift = np.zeros(count)
        self._wind = np.zeros(count, dtype=np.complex128)
        self._spacing = np.array([one.spacing for one in others] * 2)
        self._turning = np.array([one.lateral_acceleration for one in others] * 2)
        self._leads = np.array([one.leads for one in others] + [False] * len(others), dtype=bool)
        self._weight = np.array([LEADER_WEIGHT if one.leads else 1.0 for one in others] * 2)

    @property
    def counters(self) -> Counter[str]:
        """States of others that were not used, by reason."""
        total: Counter[str] = Counter()
        for hearing in self._hearing.values():
            total += hearing.counters
        return total

    def receive(self, vehicle: str, data: bytes, now: float) -> None:
        """Take a state of another follower; those of strangers are passed over."""
        hearing = self._hearing.get(vehicle)
        if hearing is None:
            return
        hearing.take(data, now)
        self.note(vehicle, hearing)
        self._words += [f"{vehicle} {words}" for words in hearing.words()]

    def lose_link(self, now: float) -> None:
        """Note that there is no connection to the link now."""
        self._link_lost_s = now

    def words(self) -> list[str]:
        """What a pilot should know of their states, each once: one sentence each."""
        words, self._words = self._words, []
        return words

    def note(self, vehicle: str, hearing: Hearing) -> None:
        """Take what is heard of a vehicle: its state, or both places where it may be."""
        row = self._rows.get(vehicle)
        if row is None:
            return
        doubted_row = row + len(self.vehicles)
        if hearing.doubted is not None:
            reported, carried = hearing.doubted
            self._note(doubted_row, reported)
            self._note(row, carried)
        elif hearing.newest is not None:
            self._note(row, hearing.newest)
            self._time[doubted_row] = -np.inf

    def _note(self, row: int, state: HeardState) -> None:
        if state.time_s - self._time[row] > SILENT_S:
            self._since[row] = state.time_s
        self._time[row] = state.time_s
        self._place[row] = place_of(state)
        self._ahead[row] = cmath.rect(1.0, state.course)
        self._speed[row], self._acceleration[row] = state.ground_speed, state.acceleration
        self._turn_rate[row], self._altitude[row] = state.turn_rate, state.altitude_amsl
        self._steered[row] = state.steered

    def vehicle_of(self, row: int) -> OtherVehicle:
        """The vehicle of a row."""
        return self.vehicles[row % len(self.vehicles)]

    def altitude_of(self, row: int) -> float:
        """Altitude that a vehicle said last, m above mean sea level."""
        return float(self._altitude[row])

    def possibilities(
        self, here: Viewpoint, leader: LeaderState[float] | None
    ) -> tuple[Others, IntArray] | None:
        """What the others may do that could come near, and whose row each possibility is of.

        Args:
            here: the vehicle that looks around.
            leader: of the formation it flies in, at the same time; None for the leader itself, which leaves
                it to the steered ones to keep clear.

        Returns:
            None where no vehicle can come near.
        """
        if self.is_clear(here, leader):
            return None
        age = here.time_s - self._time
        silent = age > SILENT_S
        linked = self._works_for()
        known = age <= FORGET_S
        known &= ~(np.abs(self._altitude - here.altitude_amsl) > ABOVE_M)
        believed = self._steered
        alone = known & ~(believed & ~silent)
        if leader is None:
            # A leader that hears no vehicle is deaf itself: the steered ones keep clear of it.
            alone &= ~believed | linked
        if not (alone if leader is None else known).any():
            return None
        age[~known] = 0.0
        self._wind[~silent] = here.wind
        place, velocity = self._moved(age, here.wind)
        keep = kept_distance(self._spacing, here.astray)
        reach = np.abs(velocity) + max(abs(here.wanted), abs(here.velocity))
        near = alone & (np.abs(place - here.place) < SAFE_M + HORIZON_S * reach)
        drift = np.zeros(len(age))
        if leader is not None:
            offset, relative = in_formation(place, velocity, leader)
            self._offset[~silent] = offset[~silent]
            self._drift[~silent] = np.abs(relative)[~silent]
            drift = self._drift
            own_place, own_drift = in_formation(here.place, here.velocity, leader)
            _, wanted_drift = in_formation(here.place, here.wanted, leader)
            room = np.abs(self._offset - own_place) - keep
            fastest = drift + max(abs(own_drift), abs(wanted_drift))
            near |= known & ~alone & (room < ALONG_S * fastest)
        stopped = known & believed & self._leads & (age > STOPPED_S) & linked
        near |= stopped & (np.abs(self._place - here.place) < SAFE_M + HOLDS_S * abs(here.velocity))
        rows = np.flatnonzero(near)
        if not rows.size:
            return None
        seen = Seen(
            row=rows,
            age=age[rows],
            silent=silent[rows],
            stopped=stopped[rows],
            heard_at=self._place[rows],
            believed=believed[rows],
            place=place[rows],
            velocity=velocity[rows],
            offset=self._offset[rows],
            turn_rate=self._turn_rate[rows],
            hardest=self._turning[rows] / np.maximum(np.abs(velocity[rows]), 1.0),
            keep=keep[rows],
            spacing=self._spacing[rows],
            slot=self._slot[rows],
            drift=drift[rows],
            weight=self._weight[rows],
            # Where all are silent it is this vehicle that is deaf: the others fly on as they did.
            linked=linked[rows],
        )
        return possibilities_of(seen, here, leader)

    def _works_for(self) -> BoolArray:
        """Whether the link has worked since each was heard: another was heard all the time, and after it.

        Not where it has just come back, and one is heard again before another, nor where it was known to be
        lost meanwhile: after a broker's restart the others come back to it one by one.
        """
        heard_before = self._since[None, :] <= self._time[:, None]
        heard_after = self._time[None, :] > self._time[:, None] + LATER_S
        works: BoolArray = np.any(heard_before & heard_after, axis=1)
        return works & (self._time > self._link_lost_s)

    def is_clear(self, here: Viewpoint, leader: LeaderState[float] | None) -> bool:
        """Whether all others are heard and steered, and none can come near: the usual case, at a glance.

        Args:
            here: see `possibilities`.
            leader: see `possibilities`.
        """
        count = len(self.vehicles)
        age = here.time_s - self._time[:count]
        oldest_s = float(age.max(initial=0.0))
        doubted = (self._time[count:] >= here.time_s - FORGET_S).any()
        leader_s = float(age[self._leads[:count]].max(initial=0.0))
        if (
            oldest_s > SILENT_S
            or leader_s > STOPPED_S
            or doubted
            or not self._steered[:count].all()
        ):
            return False
        self._wind[:count] = here.wind
        if leader is None:
            return True
        half_turn = np.exp(0.5j * self._turn_rate[:count] * age)
        velocity = self._speed[:count] * self._ahead[:count] * half_turn
        place = self._place[:count] + velocity * age
        place_led, velocity_led, turn = place_of(leader), velocity_of(leader), 1j * leader.turn_rate
        away = place - place_led
        drift = np.abs(velocity * half_turn - velocity_led - turn * away)
        own = velocity_led + turn * (here.place - place_led)
        fastest = drift + max(abs(here.velocity - own), abs(here.wanted - own))
        # Without the accelerations, and along chords instead of arcs.
        left_out = (
            float(np.abs(self._acceleration[:count]).max()) * oldest_s * (ALONG_S + oldest_s)
            + CHORD_M
        )
        room = np.abs(place - here.place) - kept_distance(self._spacing[:count], here.astray)
        if (room < ALONG_S * fastest + left_out).any():
            return False
        self._drift[:count] = drift
        self._offset[:count] = away * cmath.rect(1.0, -leader.course)
        return True

    def _moved(self, age: FloatArray, wind: complex) -> tuple[ComplexArray, ComplexArray]:
        """(places, velocities) of all, these times (s) after they were heard: along their arcs.

        A wind (m/s) that is not the one of when they fell silent carries them with it.
        """
        first = np.minimum(age, LAST_TURN_S)
        last = self._speed + self._acceleration * first
        mean = np.where(age > LAST_TURN_S, last, self._speed + 0.5 * self._acceleration * first)
        place = arc(self._place, mean * self._ahead, self._turn_rate, age)
        velocity: ComplexArray = last * self._ahead * np.exp(1j * self._turn_rate * age)
        change = wind - self._wind
        return place + 0.5 * change * age, velocity + change


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
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
    offset: ComplexArray
    """From the leader, of those who are silent as it was when they were heard, m: forward + j right."""
    turn_rate: FloatArray
    hardest: FloatArray
    """Turn rate at the bank limit, rad/s."""
    keep: FloatArray
    spacing: FloatArray
    slot: ComplexArray
    """Forward + j right of the leader, m."""
    drift: FloatArray
    """Speed relative to the formation, of those who are silent as it was when they were heard, m/s."""
    weight: FloatArray
    linked: BoolArray
    """Whether the link has worked all the time since they were heard."""


def possibilities_of(
    seen: Seen, here: Viewpoint, leader: LeaderState[float] | None
) -> tuple[Others, IntArray] | None:
    """What each of those who may come near may do, kind by kind; None where nothing is known of any."""
    found: list[tuple[IntArray, ComplexArray, float, FloatArray]] = []
    grown = DRIFT_M_S * np.maximum(seen.age - SILENT_S, 0.0)
    floor = np.minimum(FLOOR_M, seen.keep)
    # However uncertain the places are, slots are flown: the mission put them this near.
    keep = np.maximum(np.minimum(seen.keep + grown, SPACING_SHARE * seen.spacing), seen.keep)
    berth = grown + np.clip(SPACING_SHARE * seen.spacing, FLOOR_M, BERTH_M)

    def arcs(which: BoolArray, turn_rate: FloatArray, horizon_s: float, keep: FloatArray) -> None:
        tracks = arc(seen.place[which, None], seen.velocity[which, None], turn_rate[which, None])
        found.append((np.flatnonzero(which), tracks, horizon_s, keep))

    straight = np.zeros(len(seen.row))
    if leader is not None and seen.believed.any():
        along = seen.believed
        place, velocity = with_formation(seen, leader)
        left = np.abs(seen.slot - seen.offset)[along]
        settle = clip(left / (seen.drift[along] + 1e-3), 1.0, HORIZON_S)
        tracks = formation_tracks(place[along], velocity[along], seen.slot[along], settle, leader)
        found.append((np.flatnonzero(along), tracks, ALONG_S, keep))
        # Also one that is silent: an autopilot that hangs in a turn turns on.
        off = along & (~seen.silent | seen.linked) & (seen.drift > TURNS_OFF_M_S)
        if off.any():
            arcs(off, seen.turn_rate, ARC_S, keep)
        hangs = off & seen.silent
        if hangs.any():
            found.append((np.flatnonzero(hangs), tightened(seen)[hangs], ARC_S, floor + grown))
    holds = seen.believed & seen.silent & seen.linked
    if holds.any():
        place, velocity = course_held(seen)
        tracks = arc(place[holds, None], velocity[holds, None], 0.0)
        found.append((np.flatnonzero(holds), tracks, HOLDS_S, keep))
    if seen.stopped.any():
        tracks = np.repeat(seen.heard_at[seen.stopped, None], len(TIMES), axis=1)
        found.append((np.flatnonzero(seen.stopped), tracks, HOLDS_S, floor))
    free = ~seen.believed
    if free.any():
        arcs(free, seen.turn_rate, HORIZON_S, berth)
        arcs(free, straight, LEVEL_S, berth)
        arcs(free, seen.hardest, here.reaction_s, floor)
        arcs(free, -seen.hardest, here.reaction_s, floor)
    if not found:
        return None
    rows = np.concatenate([which for which, *_ in found])
    keep = np.concatenate([distance[which] for which, _, _, distance in found])
    others = Others(
        tracks=np.concatenate([tracks for _, tracks, _, _ in found]),
        horizon_s=np.concatenate([np.full(len(which), end) for which, _, end, _ in found]),
        keep=keep,
        floor=np.minimum(floor[rows], keep),
        weight=seen.weight[rows],
    )
    return others, seen.row[rows]


def with_formation(seen: Seen, leader: LeaderState[float]) -> tuple[ComplexArray, ComplexArray]:
    """(places, velocities) of those who fly with the formation, silent ones as they flew in it; m, m/s."""
    frame = cmath.exp(1j * leader.course)
    carried = place_of(leader) + frame * seen.offset
    carried_velocity = velocity_of(leader) + 1j * leader.turn_rate * frame * seen.offset
    return (
        np.where(seen.silent, carried, seen.place),
        np.where(seen.silent, carried_velocity, seen.velocity),
    )


def tightened(seen: Seen) -> ComplexArray:
    """Tracks of vehicles that, when they fell silent, rolled on to the bank limit of their turn, m.

    A turn that has only begun is reported late: 0.1 rad/s of it are 20 m after four seconds.
    """
    heard = seen.velocity * np.exp(-1j * seen.turn_rate * seen.age)
    hardest = np.copysign(seen.hardest, seen.turn_rate)
    times = seen.age[:, None] + TIMES
    return arc(seen.heard_at[:, None], heard[:, None], hardest[:, None], times)


def course_held(seen: Seen) -> tuple[ComplexArray, ComplexArray]:
    """(places, velocities) of those who have turned onto their last course since they were heard; m, m/s."""
    # Back along the arc to where they were heard, on for the last turn, and straight from there.
    turned = seen.velocity * np.exp(1j * seen.turn_rate * (LAST_TURN_S - seen.age))
    back = arc(seen.place, seen.velocity, seen.turn_rate, LAST_TURN_S - seen.age)
    return back + turned * (seen.age - LAST_TURN_S), turned


def kept_distance(spacing: FloatArray, astray: float) -> FloatArray:
    """Distances (m) to keep, by how far their slots are from one's own and that is from the vehicle, m."""
    share = min(max(astray / ASTRAY_M, 0.0), 1.0)
    kept: FloatArray = np.minimum(HOLD_M + (JOIN_M - HOLD_M) * share, SPACING_SHARE * spacing)
    return kept


def reaction_time(delay_s: float) -> float:
    """For how far ahead (s) the hardest turns of others are looked at, by the own delay (s).

    What is heard is half a second old; the own turn begins after the delay and has to undo what both cost.
    """
    return 1.5 + 2.0 * delay_s
