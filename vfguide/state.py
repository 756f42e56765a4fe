"""What a companion knows of its own vehicle, what it is told of the leader, and what it asks for."""

import math
from typing import Literal, NamedTuple, Self

import msgspec

Hold = Literal["heading-hold", "course-hold"]
"""What an autopilot's two first-order loops act on: heading and airspeed, or course and ground speed."""


SpeedHold = Literal["first-order", "total-energy"]
"""How a speed hold answers: by an acceleration in proportion to the error, or by throttle and pitch."""


GAP_S = 1.0
"""After a longer gap in what is heard, rates, filters and what is learned start anew."""


class NamedState(msgspec.Struct, frozen=True, kw_only=True):
    """Values that laws of one's own may still name with their numbers in brackets."""

    def __class_getitem__(cls, numbers: object) -> type[Self]:
        """The class itself: its numbers are floats."""
        del numbers
        return cls


class Gusts(msgspec.Struct, frozen=True, kw_only=True):
    """How far the wind changes as gusts do, which no rate foretells, by the innovations of its filter."""

    share: float
    """0: the wind changes smoothly, or what looks like gusts is noise; 1: all of it is gusts."""
    surprise_north: float
    """Last innovation of the wind, m/s."""
    surprise_east: float
    """m/s."""
    power: float
    """Mean square of the innovations, (m/s)²."""
    correlation: float
    """Mean product of each innovation with the one before, (m/s)²: above 0 where the filter lags behind."""


class VehicleState(NamedState, frozen=True, kw_only=True):
    """Navigated state of a vehicle, in the formation's local frame."""

    time_s: float
    """When it was true, s, on the clock that the formation shares."""
    north: float
    """m from the mission's origin."""
    east: float
    """m from the mission's origin."""
    course: float
    """chi, rad, direction of the ground velocity."""
    ground_speed: float
    """V_g, m/s."""
    heading: float
    """psi, rad, where the nose points."""
    airspeed: float
    """V_a, true airspeed, m/s."""
    wind_north: float
    """m/s, toward."""
    wind_east: float
    """m/s, toward."""
    wind_rate_north: float
    """m/s²."""
    wind_rate_east: float
    """m/s²."""
    wind_jerk_north: float
    """m/s³."""
    wind_jerk_east: float
    """m/s³."""
    height: float = 0.0
    """m above the mission's origin."""
    climb_rate: float = 0.0
    """m/s, positive up."""
    gusts: Gusts | None = None
    """What the wind filter has learned of them; None before two reports with a measured ground velocity."""

    @property
    def gust_share(self) -> float:
        """0 in smooth air, 1 where the wind changes by gusts alone."""
        return 0.0 if self.gusts is None else self.gusts.share


class LeaderState(NamedState, frozen=True, kw_only=True):
    """What followers need of their leader: where it is, and how its motion changes."""

    time_s: float
    """When it was true, s, on the clock that the formation shares."""
    north: float
    """m from the mission's origin."""
    east: float
    """m from the mission's origin."""
    course: float
    """chi_l, rad."""
    ground_speed: float
    """V_l, m/s."""
    acceleration: float
    """dV_l/dt, m/s²."""
    turn_rate: float
    """omega = dchi_l/dt, rad/s."""
    turn_acceleration: float
    """domega/dt, rad/s²."""
    drift_north: float = 0.0
    """Velocity over ground beyond that of course and ground speed, m/s, of a leader whose course and ground
    speed are those that it means to fly."""
    drift_east: float = 0.0
    """m/s."""
    height: float = 0.0
    """m above the mission's origin."""
    climb_rate: float = 0.0
    """m/s, positive up."""


class LeaderFix(NamedTuple):
    """Where a leader was, and when, by one of its states."""

    time_s: float
    """By the leader's stamp, s on the clock that the formation shares."""
    north: float
    """m from the mission's origin."""
    east: float
    """m from the mission's origin."""
    altitude_amsl: float
    """m above mean sea level."""


class HeardState(LeaderState, frozen=True, kw_only=True):
    """A vehicle's state as the others hear it."""

    altitude_amsl: float
    """m above mean sea level."""
    steered: bool
    """Whether its companion steers it."""
    term: int = 0
    """Term of the leader that it obeys, or is."""
    arrangement: int = 0
    """float of the newest order that it flies by or is about to; 0 before the first."""
    course_setpoint: float = math.nan
    """Course that its autopilot was told to hold, rad; NaN where it is not steered, or was not told."""
    height_sense: int = 0
    """1: it is on its way up to another height, -1: down, 0: neither, or it does not tell."""
    satellite_m: float = math.nan
    """By how much its altitude by satellites is above `altitude_amsl`, m; NaN where it does not tell."""
    leader_fix: LeaderFix | None = None
    """Where its own leader was, by the newest leader state that it has heard; None where it does not tell."""


class Setpoint(msgspec.Struct, frozen=True, kw_only=True):
    """What an autopilot is asked to hold."""

    course: float
    """chi^c, course over ground, rad, not wrapped."""
    speed: float
    """V_a^c for a vehicle that holds airspeed, V_g^c for one that holds ground speed, m/s."""
    turn_limited: bool = False
    """Whether the greatest bank cut the turn that the law asked for."""
    speed_limited: bool = False
    """Whether acceleration or speed range cut what the law asked for."""

    @property
    def limited(self) -> bool:
        """Whether a limit of the vehicle cut what the law asked for."""
        return self.turn_limited or self.speed_limited


class Airframe(msgspec.Struct, frozen=True, kw_only=True):
    """A vehicle's response and limits, as its mission file declares them."""

    hold: Hold = "heading-hold"
    """What the autopilot's loops act on."""
    alpha: float = 1.2
    """Course (or heading) response, 1/s."""
    beta: float = 0.8
    """Speed response, 1/s."""
    airspeed_min: float = 12.0
    """m/s."""
    airspeed_max: float = 32.0
    """m/s."""
    max_bank: float = 0.7853981633974483
    """rad."""
    max_acceleration: float = 3.0
    """Along the flight path, m/s²."""
    cruise: float = 20.0
    """Airspeed at which alpha is declared, m/s."""
    course_dead_time: float = 0.0
    """From a course setpoint to the first change of the bank, s."""
    course_lag: float = 0.0
    """Time constant of the roll, s."""
    speed_dead_time: float = 0.0
    """From a speed setpoint to the first change of the acceleration, s."""
    speed_lag: float = 0.0
    """Time constant of the acceleration, s."""
    speed_hold: SpeedHold = "first-order"
    """What kind of hold beta is of."""
    height_delay: float = 2.0
    """By how much the height lags behind one that climbs steadily, s."""
    climb_max: float = 4.0
    """m/s."""
    sink_max: float = 3.0
    """m/s, above zero."""

    @property
    def is_ideal(self) -> bool:
        """Whether both holds are the first-order ones of the article, which answer at once."""
        times = (self.course_dead_time, self.course_lag, self.speed_dead_time, self.speed_lag)
        return max(times) == 0.0 and self.speed_hold == "first-order"
