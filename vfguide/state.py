"""States of the own vehicle, the leader and other vehicles, and setpoints and limits of the autopilot."""

import math
from typing import Literal, NamedTuple, Self

import msgspec

Hold = Literal["heading-hold", "course-hold"]
"""Variables of an autopilot's two first-order loops: heading and airspeed, or course and ground speed."""


SpeedHold = Literal["first-order", "total-energy"]
"""Response of a speed hold: acceleration proportional to the error, or throttle and pitch."""


GAP_S = 1.0
"""Maximum gap in received data, s; after a longer one, rates, filters and learned values start anew."""


class NamedState(msgspec.Struct, frozen=True, kw_only=True):
    """Base of states; user-defined laws may still write it with a number type in brackets."""

    def __class_getitem__(cls, numbers: object) -> type[Self]:
        """Return the class itself: its numbers are floats."""
        del numbers
        return cls


class Gusts(msgspec.Struct, frozen=True, kw_only=True):
    """Gusts in the wind, from the innovations of its filter; rates cannot predict them."""

    share: float
    """0: the wind changes smoothly, or the apparent gusts are noise; 1: all changes are gusts."""
    surprise_north: float
    """Last innovation of the north wind, m/s."""
    surprise_east: float
    """Last innovation of the east wind, m/s."""
    power: float
    """Mean square of the innovations, (m/s)²."""
    correlation: float
    """Mean product of each innovation with the one before, (m/s)²: above 0 where the filter lags behind."""


class VehicleState(NamedState, frozen=True, kw_only=True):
    """Navigated state of a vehicle, in the formation's local frame."""

    time_s: float
    """Time of validity, s, on the clock that the formation shares."""
    north: float
    """North of the mission's origin, m."""
    east: float
    """East of the mission's origin, m."""
    course: float
    """chi, rad, direction of the ground velocity."""
    ground_speed: float
    """V_g, m/s."""
    heading: float
    """psi, rad, direction of the nose."""
    airspeed: float
    """V_a, true airspeed, m/s."""
    wind_north: float
    """North component of the air's velocity, m/s."""
    wind_east: float
    """East component of the air's velocity, m/s."""
    wind_rate_north: float
    """Rate of the north wind, m/s²."""
    wind_rate_east: float
    """Rate of the east wind, m/s²."""
    wind_jerk_north: float
    """Second derivative of the north wind, m/s³."""
    wind_jerk_east: float
    """Second derivative of the east wind, m/s³."""
    height: float = 0.0
    """Height above the mission's origin, m."""
    climb_rate: float = 0.0
    """Climb rate, m/s, positive up."""
    gusts: Gusts | None = None
    """Gusts learned by the wind filter; None before two reports with a measured ground velocity."""

    @property
    def gust_share(self) -> float:
        """0 in smooth air, 1 where the wind changes by gusts alone."""
        return 0.0 if self.gusts is None else self.gusts.share


class LeaderState(NamedState, frozen=True, kw_only=True):
    """State of the leader for its followers: position, velocity and their changes."""

    time_s: float
    """Time of validity, s, on the clock that the formation shares."""
    north: float
    """North of the mission's origin, m."""
    east: float
    """East of the mission's origin, m."""
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
    """North velocity over ground beyond that of course and ground speed, m/s, for a leader whose course and
    ground speed are the intended ones."""
    drift_east: float = 0.0
    """East velocity over ground beyond that of course and ground speed, m/s, for a leader whose course and
    ground speed are the intended ones."""
    height: float = 0.0
    """Height above the mission's origin, m."""
    climb_rate: float = 0.0
    """Climb rate, m/s, positive up."""


class LeaderFix(NamedTuple):
    """Position and time of a leader from one of its states."""

    time_s: float
    """The leader's time stamp, s on the clock that the formation shares."""
    north: float
    """North of the mission's origin, m."""
    east: float
    """East of the mission's origin, m."""
    altitude_amsl: float
    """Altitude above mean sea level, m."""


class HeardState(LeaderState, frozen=True, kw_only=True):
    """State of a vehicle as received by others."""

    altitude_amsl: float
    """Altitude above mean sea level, m."""
    steered: bool
    """Whether the vehicle's companion steers it."""
    term: int = 0
    """Term of the leader that the vehicle obeys, or is."""
    arrangement: int = 0
    """Number of the newest order that the vehicle flies or is about to fly; 0 before the first."""
    course_setpoint: float = math.nan
    """Course setpoint of the autopilot, rad; NaN if the vehicle is not steered, or does not report it."""
    height_sense: int = 0
    """Direction of a height change under way: 1 up, -1 down; 0 for none, or not reported."""
    satellite_m: float = math.nan
    """Height of the satellite altitude above `altitude_amsl`, m; NaN if not reported."""
    leader_fix: LeaderFix | None = None
    """Position of the vehicle's own leader in the newest leader state received; None if not reported."""


class Setpoint(msgspec.Struct, frozen=True, kw_only=True):
    """Setpoint for an autopilot."""

    course: float
    """chi^c, course over ground, rad, not wrapped."""
    speed: float
    """V_a^c for a vehicle that holds airspeed, V_g^c for one that holds ground speed, m/s."""
    turn_limited: bool = False
    """Whether the bank limit cut the turn that the law commanded."""
    speed_limited: bool = False
    """Whether the acceleration limit or speed range cut the law's command."""

    @property
    def limited(self) -> bool:
        """Whether a limit of the vehicle cut the law's command."""
        return self.turn_limited or self.speed_limited


class Airframe(msgspec.Struct, frozen=True, kw_only=True):
    """Response and limits of a vehicle, as its mission file declares them."""

    hold: Hold = "heading-hold"
    """Variables of the autopilot's loops."""
    alpha: float = 1.2
    """Bandwidth of the course (or heading) hold, 1/s."""
    beta: float = 0.8
    """Bandwidth of the speed hold, 1/s."""
    airspeed_min: float = 12.0
    """Minimum airspeed, m/s."""
    airspeed_max: float = 32.0
    """Maximum airspeed, m/s."""
    max_bank: float = 0.7853981633974483
    """Maximum bank angle, rad."""
    max_acceleration: float = 3.0
    """Maximum acceleration along the flight path, m/s²."""
    cruise: float = 20.0
    """Airspeed at which alpha is declared, m/s."""
    course_dead_time: float = 0.0
    """Dead time from a course setpoint to the first change of the bank, s."""
    course_lag: float = 0.0
    """Time constant of the roll, s."""
    speed_dead_time: float = 0.0
    """Dead time from a speed setpoint to the first change of the acceleration, s."""
    speed_lag: float = 0.0
    """Time constant of the acceleration, s."""
    speed_hold: SpeedHold = "first-order"
    """Type of the speed hold."""
    height_delay: float = 2.0
    """Lag of the height behind a setpoint that climbs steadily, s."""
    climb_max: float = 4.0
    """Maximum climb rate, m/s."""
    sink_max: float = 3.0
    """Maximum sink rate, m/s, positive down."""

    @property
    def is_ideal(self) -> bool:
        """Whether both holds are the article's first-order ones, without dead time or lag."""
        times = (self.course_dead_time, self.course_lag, self.speed_dead_time, self.speed_lag)
        return max(times) == 0.0 and self.speed_hold == "first-order"
