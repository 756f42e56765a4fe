"""Separation: the least change of a wanted motion that keeps the distances from all other vehicles.

A barrier of predicted manoeuvres. For a flyable manoeuvre m of this vehicle (its track includes turn rate,
bank, speed range and delays) and all possible motions u of the others,

    h(m) = min over others, u, t of  |p_own(t; m) - p_other(t; u)| - keep

is a lower bound of the clearance left. The wanted motion is flown while h(wanted) >= 0. Otherwise the
manoeuvre with the smallest change among those with h >= 0 is flown. Where there is none, it is the manoeuvre
with the smallest intrusion. A clear manoeuvre is available again a step later: clear stays clear while the
others stay within their assumed motions (backup barriers: Gurriet, Mote, Singletary, Nilsson, Feron, Ames,
2020; why turn and speed bounds must be inside a barrier: Molnar, Kannan, Cunningham, Dunlap, Hobbs, Ames,
2024).

Two vehicles that meet both keep clear without knowing each other's choice. Both keep the present rotation of
the line of sight between them: the one choice that needs no communication.

Horizontal positions and velocities are complex numbers, north + j east, in metres and m/s: multiplying by
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
"""Position or velocity of one vehicle, or an array of them."""

Rates = TypeVar("Rates", FloatArray, ComplexArray)
"""Rates of change, one row for each track, one column for each time."""

HORIZON_S = 8.0
"""Length of tracks, s: at 20 m/s and 45 degrees of bank an aircraft has turned round in 6.4 s."""

STEP_S = 0.5
"""Interval of track points, s; closest points of approach are found between them."""

TIMES: FloatArray = np.arange(0.0, HORIZON_S + 0.5 * STEP_S, STEP_S)
"""Times of track points, s from now."""

LEAST_TURN_RATE = 0.05
"""Lower bound of ownship's turn rate relative to a formation that turns as hard itself, rad/s."""


class Agility(msgspec.Struct, frozen=True, kw_only=True):
    """Response of a vehicle to setpoints."""

    turn_rate: float
    """Largest turn rate, rad/s."""
    acceleration: float
    """Largest acceleration along the flight path, m/s²."""
    turn_delay: float
    """Dead time and lag from a setpoint to the turn, s."""
    speed_delay: float
    """Dead time and lag from a setpoint to the acceleration, s."""
    alpha: float
    """Course response, 1/s."""
    beta: float
    """Speed response, 1/s."""
    speed_min: float
    """Lowest speed relative to the air, m/s."""
    speed_max: float
    """Highest speed relative to the air, m/s."""


class OwnMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Present motion of ownship, the vehicle itself."""

    place: complex
    """Position, m."""
    air_velocity: complex
    """Velocity relative to the air, m/s."""
    wind: complex
    """Wind velocity, toward, m/s."""
    turn_rate: float
    """Turn rate, rad/s."""

    @property
    def velocity(self) -> complex:
        """Velocity over ground, m/s."""
        return self.air_velocity + self.wind


class WantedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Motion that guidance wants: a velocity that approaches that of a place in the formation."""

    velocity: complex
    """Velocity over ground now, m/s."""
    base_velocity: complex
    """Velocity of the slot, m/s; without a slot equal to `velocity`."""
    turn_rate: float
    """Turn rate of the slot's velocity, or of the path, rad/s."""
    settle_s: float
    """Time constant with which `velocity` approaches `base_velocity`, s."""


class Manoeuvres(msgspec.Struct, frozen=True, kw_only=True):
    """Alternatives to the wanted motion: each is a turn away from it, at an airspeed."""

    turn: FloatArray
    """Turn from the wanted heading, rad, positive right."""
    airspeed: FloatArray
    """Airspeed, m/s; NaN for the wanted one."""


def arc(
    place: ComplexArray | complex,
    velocity: ComplexArray | complex,
    turn_rate: FloatArray | float,
    times: FloatArray = TIMES,
) -> ComplexArray:
    """Return positions after times (s) on arcs at constant speed: the chord runs along the mean course."""
    half = 0.5 * turn_rate * times
    # The chord's share of the arc is sin x / x; np.sinc takes several times as long.
    share = np.sin(half) / np.where(half == 0.0, 1.0, half) + (half == 0.0)
    places: ComplexArray = place + velocity * times * share * np.exp(1j * half)
    return places


def place_of(state: LeaderState) -> complex:
    """Return the position of a received state, m."""
    return complex(state.north, state.east)


def velocity_of(state: LeaderState) -> complex:
    """Return the velocity over ground of a received state, m/s."""
    drift = complex(state.drift_north, state.drift_east)
    return cmath.rect(state.ground_speed, state.course) + drift


def in_formation(place: Plane, velocity: Plane, leader: LeaderState) -> tuple[Plane, Plane]:
    """Return (position, velocity) in the leader's turning course frame, m and m/s: forward + j right."""
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
    """Return the tracks of vehicles that approach their slots, critically damped in the formation.

    A vehicle that moves straight at its slot reaches it exponentially; one that passes the slot turns back.
    Positions (m), velocities over ground and slot rates (m/s) and time constants (s) have one entry per
    vehicle. Slots are forward + j right of the leader, which flies on along an arc.
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
    """Return ownship's tracks, one for each manoeuvre.

    After its delay the vehicle turns toward the manoeuvre's heading at alpha times the error, within its bank
    limit; speeds likewise. The wanted velocity turns with the formation, and so do all manoeuvres.
    """
    since = np.maximum(TIMES - agility.turn_delay, 0.0)
    round_s = np.exp(1j * wanted.turn_rate * TIMES)
    excess = wanted.velocity - wanted.base_velocity
    air = round_s * (wanted.base_velocity + excess * np.exp(-TIMES / wanted.settle_s)) - own.wind
    heading = continuous_angle(air)
    flown = cmath.phase(own.air_velocity)
    # Heading error at the end of the delay, relative to a heading that turns on.
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
    tracks: ComplexArray = own.place + integrals(velocity, STEP_S)
    return tracks


def integrals(rates: Rates, intervals_s: FloatArray | float) -> Rates:
    """Return integrals of rates from the first column to each, which are `intervals_s` apart."""
    found = np.zeros_like(rates)
    np.cumsum(0.5 * (rates[:, 1:] + rates[:, :-1]) * intervals_s, axis=1, out=found[:, 1:])
    return found


def continuous_angle(directions: ComplexArray) -> FloatArray:
    """Return the continuous angles (rad) of directions less than half a turn apart."""
    angle = np.empty(directions.shape)
    angle[0] = cmath.phase(directions[0])
    angle[1:] = np.angle(directions[1:] * directions[:-1].conj())
    continuous: FloatArray = np.add.accumulate(angle)
    return continuous


def _speeds(
    flown: float, wanted: FloatArray, manoeuvres: Manoeuvres, agility: Agility
) -> FloatArray:
    """Return the airspeeds of the manoeuvres, m/s: beta times the error, within the acceleration limit."""
    since = np.maximum(TIMES - agility.speed_delay, 0.0)
    share, most = -np.expm1(-agility.beta * since), agility.acceleration * since
    target = np.where(np.isnan(manoeuvres.airspeed)[:, None], wanted, manoeuvres.airspeed[:, None])
    left = flown - target[:, :1]
    speed = target + left - np.minimum(np.maximum(left * share, -most), most)
    return np.minimum(np.maximum(speed, agility.speed_min), agility.speed_max)


FLOOR_M = 7.0
"""Distance below which prevention outweighs all else, m: the promised 5 m plus prediction errors."""

INTRUSION = 100.0
"""Cost of an intrusion below the floor relative to one below the kept distance."""

PATIENCE_S = 4.0
"""Time constant with which predictions lose weight, s: the far future may still change."""

TURN_COST = 0.12
"""Cost of a turn, times 1 - cos of its angle."""

SPEED_COST = 0.01
"""Cost per m/s of difference from the wanted airspeed."""

SPEEDS = 5
"""Number of airspeeds tried beside the wanted one."""

CHANGE_COST = 0.04
"""Cost of changing sides. Without it two that cross on line-calm, by the example's law, turn round each other
until they are 10 m apart and change their heights; with it they keep 24 m."""

LEFT_COST = 0.004
"""Cost of a turn to the left: two that meet head on both go right."""

MEETING_M_S = 6.0
"""Relative speed above which two vehicles meet, m/s: in slots, also in gusts, they are slower."""

OTHER_SIDE_M = 11.0
"""Additional distance required of a pass on the other side than both keep, m. It is the distance kept between
two joining vehicles: a gain by turning round one of them is lost by the other."""

TURNS_RAD: FloatArray = np.radians(
    [0, 6, -6, 12, -12, 20, -20, 30, -30, 45, -45, 65, -65, 90, -90, 120, -120, 150, -150]
)
"""Turns from the wanted heading that are tried, rad; the wanted motion comes first."""


ESCAPES_RAD: FloatArray = np.radians([0.0, 179.0, -179.0])
"""Turns of full manoeuvres, rad: straight on, and half a turn to either side."""


class Others(msgspec.Struct, frozen=True, kw_only=True):
    """Possible motions of other vehicles, one row for each possibility of each vehicle."""

    tracks: ComplexArray
    """Positions at `TIMES`, m."""
    horizon_s: FloatArray
    """Time up to which each possibility counts, s."""
    keep: FloatArray
    """Distance to keep, m."""
    floor: FloatArray
    """Distance to defend by all means, m."""
    weight: FloatArray
    """Weight in the cost of intrusion."""
    passes: FloatArray
    """Rotation of the line of sight that both keep as they pass, see `passing`."""
    margin: FloatArray
    """Error bound of each track in each interval of `TIMES`, subtracted from distances, m."""
    worth: FloatArray | None = None
    """Horizontal equivalent of the vertical distance in each interval, m; None ignores heights."""


class Clearance(msgspec.Struct, frozen=True, kw_only=True):
    """Chosen manoeuvre and its clearances."""

    turn: float
    """Turn from the wanted heading, rad, positive right."""
    airspeed: float
    """Airspeed, m/s; NaN for the wanted one."""
    changed: bool
    """Whether the manoeuvre differs from the wanted motion."""
    nearest: FloatArray
    """Distance at the closest point of approach to each possibility, m."""
    wanted_nearest: FloatArray
    """Distance at the closest point of approach if the wanted motion is flown, m."""


BEGINNINGS = TIMES[:-1]
"""Beginnings of the intervals searched for closest points of approach, s from now."""

FADE: FloatArray = np.exp(-BEGINNINGS / PATIENCE_S)
"""Weight of each interval."""

WANTED = Manoeuvres(turn=np.zeros(1), airspeed=np.full(1, np.nan))
"""Manoeuvre of the wanted motion."""


@lru_cache(maxsize=16)
def manoeuvres_between(speed_min: float, speed_max: float) -> Manoeuvres:
    """Return all manoeuvres to try: each turn at the wanted airspeed and at some in a range (m/s)."""
    speeds = np.array([np.nan, *np.linspace(speed_min, speed_max, SPEEDS)])
    return Manoeuvres(
        turn=np.tile(TURNS_RAD, len(speeds)), airspeed=np.repeat(speeds, len(TURNS_RAD))
    )


def closest_approaches(tracks: ComplexArray, others: Others) -> FloatArray:
    """Return closest distances (m) in each interval of `TIMES`: manoeuvre, possibility, interval.

    Within an interval both fly straight; beyond a possibility's horizon the distance is infinite.
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
    """Return the rotation of the line of sight to keep in passing: 1 right, -1 left, 0 either way.

    `apart` and `closing` are positions and velocities of the others minus ownship's, m and m/s. Present
    rotations are kept. Both vehicles see the same rotation, so each passes behind the other instead of
    turning toward it (Snape, van den Berg, Guy, Manocha, 2011). Without rotation it becomes left: both go
    right.
    """
    turning = apart.conj() * closing
    meets = (np.abs(closing) > MEETING_M_S) & (turning.real < 0.0)
    return np.where(meets, np.where(turning.imag > 0.0, 1.0, -1.0), 0.0)


def on_other_side(tracks: ComplexArray, others: Others) -> BoolArray:
    """Check whether the line of sight turns against `passes`: manoeuvre, possibility, interval."""
    apart = others.tracks[None, :, :] - tracks[:, None, :]
    turning = (apart[..., :-1].conj() * np.diff(apart)).imag
    other: BoolArray = turning * others.passes[:, None] < 0.0
    return other


def intrusion_cost(distance: FloatArray, others: Others) -> FloatArray:
    """Return each manoeuvre's cost of intrusions; 0 where all distances are kept.

    The cost has the duration and depth below the kept distance, and the depth below the floor. A vehicle that
    reports a false position, already nearer than anything can change, adds the same to all manoeuvres.
    """
    keep, floor = others.keep[:, None], others.floor[:, None]
    within = np.maximum(1.0 - distance / keep, 0.0) * FADE
    below = np.maximum(1.0 - distance / floor, 0.0) * FADE
    lasting = within.sum(axis=2) * (STEP_S / HORIZON_S)
    cost: FloatArray = (lasting + INTRUSION * below.max(axis=2) ** 2) @ others.weight
    return cost


def change_cost(manoeuvres: Manoeuvres, airspeed: float, side: float) -> FloatArray:
    """Return each manoeuvre's cost of leaving the wanted airspeed (m/s), heading and former side (rad)."""
    turn = manoeuvres.turn
    cost = TURN_COST * (1.0 - np.cos(turn)) + LEFT_COST * (turn < 0.0)
    faster = np.abs(manoeuvres.airspeed - airspeed)
    cost = cost + SPEED_COST * np.where(np.isnan(faster), 0.0, faster)
    if side != 0.0:
        cost = cost + CHANGE_COST * (turn * side < 0.0)
    return cost


def keep_clear(
    own: OwnMotion, wanted: WantedMotion, others: Others, agility: Agility, *, side: float = 0.0
) -> Clearance:
    """Return the manoeuvre to fly; `side` is the turn of the previous step (rad), whose sign is preferred."""
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
    own: OwnMotion, wanted: WantedMotion, clear: Clearance | None, others: Others, agility: Agility
) -> tuple[FloatArray, FloatArray]:
    """Return (closest distances, m; times until then, s) of a manoeuvre, or the wanted motion for None."""
    flown = WANTED
    if clear is not None:
        flown = Manoeuvres(turn=np.array([clear.turn]), airspeed=np.array([clear.airspeed]))
    found = closest_approaches(own_tracks(own, wanted, flown, agility), others)
    return found[0].min(axis=1), BEGINNINGS[found[0].argmin(axis=1)]


def escape_tracks(own: OwnMotion, agility: Agility) -> ComplexArray:
    """Return tracks of full manoeuvres: straight, left and right at the bank limit, at three airspeeds."""
    straight = WantedMotion(
        velocity=own.velocity, base_velocity=own.velocity, turn_rate=0.0, settle_s=HORIZON_S
    )
    speeds = np.array([np.nan, agility.speed_min, agility.speed_max])
    full = Manoeuvres(turn=np.tile(ESCAPES_RAD, 3), airspeed=np.repeat(speeds, len(ESCAPES_RAD)))
    return own_tracks(own, straight, full, agility)


def escape_distance(own: OwnMotion, agility: Agility, tracks: ComplexArray) -> float:
    """Return the distance (m) that the best full manoeuvre keeps from all possible tracks of another."""
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
