"""What keeps clear of what: the least change of a wanted motion that keeps the distances from all others.

A barrier of predicted manoeuvres. For a manoeuvre m that this vehicle can really fly (its turn rate, bank,
speed range and delays are in its track) and for everything u that the others may do,

    h(m) = min over others, u, t of  |p_own(t; m) - p_other(t; u)| - keep

is a lower bound of the room that is left. What is wanted is flown as long as h(wanted) >= 0; else the
manoeuvre that changes least among those with h >= 0, and where there is none the one that intrudes least.
A manoeuvre that was clear is there again a step later: clear stays clear as long as the others do what they
were thought to be able to (backup barriers: Gurriet, Mote, Singletary, Nilsson, Feron, Ames, 2020; why turn
and speed bounds have to be inside a barrier: Molnar, Kannan, Cunningham, Dunlap, Hobbs, Ames, 2024).

Two that meet both keep clear, and neither knows what the other one will choose. Both hold to the way the line
of sight between them turns already: that is the one choice that needs no word between them.

Places and velocities in the plane are complex numbers, north + j east, in metres and m/s: multiplying by
exp(j chi) turns clockwise by chi, as courses count. Rows are vehicles or manoeuvres, columns are `TIMES`.
"""

import cmath
from functools import lru_cache
from typing import TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from vfguide.elementwise import BoolArray, FloatArray, wrap_angle
from vfguide.state import LeaderState

ComplexArray = NDArray[np.complex128]

Plane = TypeVar("Plane", complex, ComplexArray)
"""A place or velocity of one vehicle, or an array of them."""

HORIZON_S = 8.0
"""How far tracks reach: at 20 m/s and 45 degrees of bank an aircraft has turned round in 6.4 s."""

STEP_S = 0.5
"""Interval of two places of a track; closest approaches are found between them."""

TIMES: FloatArray = np.arange(0.0, HORIZON_S + 0.5 * STEP_S, STEP_S)
"""s from now."""

LEAST_TURN_RATE = 0.05
"""rad/s: what is left at least of a turn rate, relative to a formation that turns as hard itself."""


class Agility(msgspec.Struct, frozen=True, kw_only=True):
    """How fast a vehicle answers to setpoints."""

    turn_rate: float
    """Greatest, rad/s."""
    acceleration: float
    """Greatest along the flight path, m/s²."""
    turn_delay: float
    """From a setpoint to the turn: dead time and lag, s."""
    speed_delay: float
    """From a setpoint to the acceleration, s."""
    alpha: float
    """Course response, 1/s."""
    beta: float
    """Speed response, 1/s."""
    speed_min: float
    """Through the air that it is held in, m/s."""
    speed_max: float
    """Through the air that it is held in, m/s."""


class OwnMotion(msgspec.Struct, frozen=True, kw_only=True):
    """The vehicle itself, now."""

    place: complex
    """m."""
    air_velocity: complex
    """Through the air, m/s."""
    wind: complex
    """m/s, toward."""
    turn_rate: float
    """rad/s."""

    @property
    def velocity(self) -> complex:
        """Over the ground, m/s."""
        return self.air_velocity + self.wind


class WantedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """What guidance wants to fly: a velocity that approaches the one of a place in the formation."""

    velocity: complex
    """Over the ground, now, m/s."""
    base_velocity: complex
    """Velocity of the slot, m/s; of a vehicle without one the same as `velocity`."""
    turn_rate: float
    """Turn rate of the slot's velocity, or of the path, rad/s."""
    settle_s: float
    """Time constant with which the first becomes the second, s."""


class Manoeuvres(msgspec.Struct, frozen=True, kw_only=True):
    """What the vehicle may do instead of what is wanted: each is a turn away from it, at a speed."""

    turn: FloatArray
    """By how much to leave the wanted heading, rad, positive right."""
    airspeed: FloatArray
    """m/s; NaN for the wanted one."""


def arc(
    place: ComplexArray | complex,
    velocity: ComplexArray | complex,
    turn_rate: FloatArray | float,
    times: FloatArray = TIMES,
) -> ComplexArray:
    """Places after some times (s) on arcs at constant speed: the chord runs along the mean course."""
    half = 0.5 * turn_rate * times
    # The chord's share of the arc, sin x / x; np.sinc takes several times as long.
    share = np.sin(half) / np.where(half == 0.0, 1.0, half) + (half == 0.0)
    places: ComplexArray = place + velocity * times * share * np.exp(1j * half)
    return places


def place_of(state: LeaderState) -> complex:
    """Place of a vehicle that was heard, m."""
    return complex(state.north, state.east)


def velocity_of(state: LeaderState) -> complex:
    """Velocity over the ground of a vehicle that was heard, m/s."""
    drift = complex(state.drift_north, state.drift_east)
    return cmath.rect(state.ground_speed, state.course) + drift


def in_formation(place: Plane, velocity: Plane, leader: LeaderState) -> tuple[Plane, Plane]:
    """(place, velocity) of vehicles in the leader's turning course frame, m and m/s: forward + j right."""
    turned = cmath.exp(-1j * leader.course)
    offset = (place - place_of(leader)) * turned
    drift = (velocity - velocity_of(leader)) * turned - 1j * leader.turn_rate * offset
    return offset, drift


def formation_tracks(
    place: ComplexArray,
    velocity: ComplexArray,
    slot: ComplexArray,
    settle_s: FloatArray,
    leader: LeaderState,
    *,
    slot_rate: ComplexArray | complex = 0j,
) -> ComplexArray:
    """Tracks of vehicles that go for their slots: in the formation, critically damped.

    One that moves straight at its slot reaches it exponentially; one that passes it turns back to it.

    Args:
        place: of each vehicle, m.
        velocity: of each vehicle over the ground, m/s.
        slot: of each vehicle, forward + j right of the leader, m.
        settle_s: time constant of each, s.
        leader: at the same time; it flies on along an arc.
        slot_rate: how each slot moves in the formation, m/s.
    """
    offset, drift = in_formation(place, velocity, leader)
    away = (offset - slot)[:, None]
    settle = settle_s[:, None]
    drift = drift - slot_rate
    relative = slot[:, None] + (away + (drift[:, None] + away / settle) * TIMES) * np.exp(
        -TIMES / settle
    )
    if np.any(slot_rate):
        relative = relative + np.multiply.outer(slot_rate, TIMES)
    course = np.exp(1j * (leader.course + leader.turn_rate * TIMES))
    led = arc(place_of(leader), velocity_of(leader), leader.turn_rate)
    tracks: ComplexArray = led + course * relative
    return tracks


def own_tracks(
    own: OwnMotion, wanted: WantedMotion, manoeuvres: Manoeuvres, agility: Agility
) -> ComplexArray:
    """The vehicle's own tracks, one for each manoeuvre.

    After its delay it turns toward the heading of the manoeuvre at alpha times what is left, no faster than
    its bank allows; speeds likewise. The wanted velocity turns with the formation, and so do all manoeuvres.
    """
    since = np.maximum(TIMES - agility.turn_delay, 0.0)
    round_s = np.exp(1j * wanted.turn_rate * TIMES)
    excess = wanted.velocity - wanted.base_velocity
    air = round_s * (wanted.base_velocity + excess * np.exp(-TIMES / wanted.settle_s)) - own.wind
    heading = continuous_angle(air)
    flown = cmath.phase(own.air_velocity)
    # At the end of the delay, relative to a heading that turns on.
    error = wrap_angle(
        flown + (own.turn_rate - wanted.turn_rate) * agility.turn_delay - float(heading[0])
    )
    off = wrap_angle(error - manoeuvres.turn)[:, None]
    left = max(agility.turn_rate + wanted.turn_rate, LEAST_TURN_RATE) * since
    right = max(agility.turn_rate - wanted.turn_rate, LEAST_TURN_RATE) * since
    share = -np.expm1(-agility.alpha * since)
    off = off - np.minimum(np.maximum(off * share, -right), left)
    before = (own.turn_rate - wanted.turn_rate) * np.maximum(agility.turn_delay - TIMES, 0.0)
    nose = heading + manoeuvres.turn[:, None] + off - before
    speed = _speeds(abs(own.air_velocity), np.abs(air), manoeuvres, agility)
    velocity = speed * np.exp(1j * nose) + own.wind
    steps = np.cumsum(0.5 * (velocity[:, 1:] + velocity[:, :-1]) * STEP_S, axis=1)
    tracks = np.empty(velocity.shape, dtype=np.complex128)
    tracks[:, 0] = own.place
    tracks[:, 1:] = own.place + steps
    return tracks


def continuous_angle(directions: ComplexArray) -> FloatArray:
    """Angles (rad) of directions that follow each other by less than half a turn, without a jump."""
    angle = np.empty(directions.shape)
    angle[0] = cmath.phase(directions[0])
    angle[1:] = np.angle(directions[1:] * directions[:-1].conj())
    continuous: FloatArray = np.add.accumulate(angle)
    return continuous


def _speeds(
    flown: float, wanted: FloatArray, manoeuvres: Manoeuvres, agility: Agility
) -> FloatArray:
    """Airspeeds of the manoeuvres, m/s: at beta times what is left, within the acceleration."""
    since = np.maximum(TIMES - agility.speed_delay, 0.0)
    share, most = -np.expm1(-agility.beta * since), agility.acceleration * since
    target = np.where(np.isnan(manoeuvres.airspeed)[:, None], wanted, manoeuvres.airspeed[:, None])
    left = flown - target[:, :1]
    speed = target + left - np.minimum(np.maximum(left * share, -most), most)
    return np.minimum(np.maximum(speed, agility.speed_min), agility.speed_max)


FLOOR_M = 7.0
"""Everything is done to prevent less than this: the 5 m of the promise, and what predictions are off."""

INTRUSION = 100.0
"""Cost of coming within the floor, relative to that of coming within the kept distance."""

PATIENCE_S = 4.0
"""Time constant with which what is predicted counts less: what is far ahead may still change."""

TURN_COST = 0.12
"""Cost of turning away, times 1 - cos of the angle."""

SPEED_COST = 0.01
"""Cost of each m/s of another airspeed than the wanted one."""

SPEEDS = 5
"""Airspeeds that are looked at beside the wanted one."""

CHANGE_COST = 0.04
"""Cost of changing sides."""

LEFT_COST = 0.004
"""Cost of going left: two that meet head on both go right."""

MEETING_M_S = 6.0
"""Two meet that are faster than this relative to each other: in slots, also in gusts, they are slower."""

OTHER_SIDE_M = 11.0
"""A pass on the other side than both hold to has to leave so much more: as much as is kept between two that
join, since what one of them gains by turning round the other takes away."""

TURNS_RAD: FloatArray = np.radians(
    [0, 6, -6, 12, -12, 20, -20, 30, -30, 45, -45, 65, -65, 90, -90, 120, -120, 150, -150]
)
"""Turns away from the wanted heading that are looked at; the wanted motion itself comes first."""


ESCAPES_RAD: FloatArray = np.radians([0.0, 179.0, -179.0])
"""Straight on, and half a turn to either side."""


class Others(msgspec.Struct, frozen=True, kw_only=True):
    """What the others may do, one row for each possibility of each of them."""

    tracks: ComplexArray
    """Places at `TIMES`, m."""
    horizon_s: FloatArray
    """Up to when each is looked at, s."""
    keep: FloatArray
    """Distance to be kept, m."""
    floor: FloatArray
    """Distance that is not to be fallen short of if anything can be done, m."""
    weight: FloatArray
    """How much it counts where not all can be had."""
    passes: FloatArray
    """Which way the line of sight to it turns where both keep clear, see `passing`."""
    margin: FloatArray
    """What each track may be off by in each interval of `TIMES`, m: so much nearer counts as near."""
    worth: FloatArray | None = None
    """What the height between both is worth in the plane, in each interval, m; None: it does not count."""


class Clearance(msgspec.Struct, frozen=True, kw_only=True):
    """What to fly."""

    turn: float
    """Away from the wanted heading, rad, positive right."""
    airspeed: float
    """m/s; NaN for the wanted one."""
    changed: bool
    """Whether this is not what was wanted."""
    nearest: FloatArray
    """Closest approach to each possibility, m."""
    wanted_nearest: FloatArray
    """The same for what was wanted, m."""


BEGINNINGS = TIMES[:-1]
"""Beginnings of the intervals in which closest approaches are looked for, s from now."""

FADE: FloatArray = np.exp(-BEGINNINGS / PATIENCE_S)
"""Weight of each interval."""

WANTED = Manoeuvres(turn=np.zeros(1), airspeed=np.full(1, np.nan))
"""What guidance wants."""


@lru_cache(maxsize=16)
def manoeuvres_between(speed_min: float, speed_max: float) -> Manoeuvres:
    """Everything that is looked at: each turn at the wanted airspeed and at some between these (m/s)."""
    speeds = np.array([np.nan, *np.linspace(speed_min, speed_max, SPEEDS)])
    return Manoeuvres(
        turn=np.tile(TURNS_RAD, len(speeds)), airspeed=np.repeat(speeds, len(TURNS_RAD))
    )


def closest_approaches(tracks: ComplexArray, others: Others) -> FloatArray:
    """Distances (m) of closest approach in each interval of `TIMES`: manoeuvre, possibility, interval.

    Between two times both fly straight; beyond the horizon of a possibility the distance is infinite.
    """
    apart = tracks[:, None, :] - others.tracks[None, :, :]
    start = apart[..., :-1]
    way = apart[..., 1:] - start
    square = np.maximum(way.real * way.real + way.imag * way.imag, 1e-9)
    share = -(start.real * way.real + start.imag * way.imag) / square
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    distance = np.maximum(np.abs(start + share * way) - others.margin, 0.0)
    if others.worth is not None:
        distance = np.hypot(distance, others.worth)
    return np.where(others.horizon_s[:, None] > BEGINNINGS, distance, np.inf)


def passing(apart: ComplexArray, closing: ComplexArray) -> FloatArray:
    """Which way the line of sight to others turns as they are passed: 1 right, -1 left; 0: either way.

    It turns on the way it turns. Both of two that meet see the same, so they do not turn toward each other,
    each to pass behind the other one (Snape, van den Berg, Guy, Manocha, 2011). Where it does not turn at
    all it is to turn left: both go right.

    Args:
        apart: places of the others, less the own one, m.
        closing: their velocities, less the own one, m/s.
    """
    turning = apart.conj() * closing
    meets = (np.abs(closing) > MEETING_M_S) & (turning.real < 0.0)
    return np.where(meets, np.where(turning.imag > 0.0, 1.0, -1.0), 0.0)


def on_other_side(tracks: ComplexArray, others: Others) -> BoolArray:
    """Whether the line of sight turns the other way than both hold to: manoeuvre, possibility, interval."""
    apart = others.tracks[None, :, :] - tracks[:, None, :]
    turning = (apart[..., :-1].conj() * np.diff(apart)).imag
    other: BoolArray = turning * others.passes[:, None] < 0.0
    return other


def intrusion_cost(distance: FloatArray, others: Others) -> FloatArray:
    """Cost of each manoeuvre for what it does to the distances; 0 where all are kept.

    How long and how deep a kept distance is fallen short of, and how far the floor is: a vehicle that
    lies about its place, and is already nearer than anything can change, adds the same to all manoeuvres.

    Args:
        distance: see `closest_approaches`.
        others: what the others may do.
    """
    keep, floor = others.keep[:, None], others.floor[:, None]
    within = np.maximum(1.0 - distance / keep, 0.0) * FADE
    below = np.maximum(1.0 - distance / floor, 0.0) * FADE
    lasting = within.sum(axis=2) * (STEP_S / HORIZON_S)
    cost: FloatArray = (lasting + INTRUSION * below.max(axis=2) ** 2) @ others.weight
    return cost


def change_cost(manoeuvres: Manoeuvres, airspeed: float, side: float) -> FloatArray:
    """Cost of each manoeuvre for not being the wanted one (m/s), after a turn to a side (rad)."""
    turn = manoeuvres.turn
    cost = TURN_COST * (1.0 - np.cos(turn)) + LEFT_COST * (turn < 0.0)
    faster = np.abs(manoeuvres.airspeed - airspeed)
    cost = cost + SPEED_COST * np.where(np.isnan(faster), 0.0, faster)
    if side != 0.0:
        cost = cost + CHANGE_COST * (turn * side < 0.0)
    return cost


def keep_clear(
    own: OwnMotion,
    wanted: WantedMotion,
    others: Others,
    agility: Agility,
    *,
    side: float = 0.0,
) -> Clearance:
    """The manoeuvre to fly.

    Args:
        own: the vehicle now.
        wanted: what guidance wants.
        others: what the others may do.
        agility: how the vehicle answers.
        side: turn (rad) that was flown the step before, whose sign is kept where that is as good.
    """
    distance = closest_approaches(own_tracks(own, wanted, WANTED, agility), others)
    cost = intrusion_cost(distance, others)
    before = distance.min(axis=2)[0]
    if cost[0] <= 0.0:
        return Clearance(
            turn=0.0, airspeed=np.nan, changed=False, nearest=before, wanted_nearest=before
        )
    manoeuvres = manoeuvres_between(agility.speed_min, agility.speed_max)
    tracks = own_tracks(own, wanted, manoeuvres, agility)
    distance = counted = closest_approaches(tracks, others)
    if others.passes.any():
        counted = distance - OTHER_SIDE_M * on_other_side(tracks, others)
    total = intrusion_cost(counted, others) + change_cost(
        manoeuvres, abs(wanted.velocity - own.wind), side
    )
    best = int(total.argmin())
    return Clearance(
        turn=float(manoeuvres.turn[best]),
        airspeed=float(manoeuvres.airspeed[best]),
        changed=best != 0,
        nearest=distance[best].min(axis=1),
        wanted_nearest=before,
    )


def distances(
    own: OwnMotion,
    wanted: WantedMotion,
    clear: Clearance | None,
    others: Others,
    agility: Agility,
) -> tuple[FloatArray, FloatArray]:
    """(closest approaches in m, how long until then in s) of what is flown; None: of what is wanted."""
    flown = WANTED
    if clear is not None:
        flown = Manoeuvres(turn=np.array([clear.turn]), airspeed=np.array([clear.airspeed]))
    found = closest_approaches(own_tracks(own, wanted, flown, agility), others)
    return found[0].min(axis=1), BEGINNINGS[found[0].argmin(axis=1)]


def escape_tracks(own: OwnMotion, agility: Agility) -> ComplexArray:
    """Tracks of every full manoeuvre: on, left and right at the bank limit, at three airspeeds."""
    straight = WantedMotion(
        velocity=own.velocity, base_velocity=own.velocity, turn_rate=0.0, settle_s=HORIZON_S
    )
    speeds = np.array([np.nan, agility.speed_min, agility.speed_max])
    full = Manoeuvres(turn=np.tile(ESCAPES_RAD, 3), airspeed=np.repeat(speeds, len(ESCAPES_RAD)))
    return own_tracks(own, straight, full, agility)


def escape_distance(own: OwnMotion, agility: Agility, tracks: ComplexArray) -> float:
    """Distance (m) that one full manoeuvre keeps from all tracks that another may fly; the best one's."""
    count = len(tracks)
    others = Others(
        tracks=tracks,
        horizon_s=np.full(count, HORIZON_S),
        keep=np.ones(count),
        floor=np.ones(count),
        weight=np.ones(count),
        passes=np.zeros(count),
        margin=np.zeros((count, len(BEGINNINGS))),
    )
    nearest = closest_approaches(escape_tracks(own, agility), others)
    return float(nearest.min(axis=(1, 2)).max())
