"""Where vehicles will be over the next seconds: the own one by each manoeuvre, others by what they may do.

Places and velocities in the plane are complex numbers, north + j east, in metres and m/s: multiplying by
exp(j chi) turns clockwise by chi, as courses count. Rows are vehicles or manoeuvres, columns are `TIMES`.
"""

import cmath
from typing import TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from vfguide.elementwise import FloatArray, wrap_angle
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
