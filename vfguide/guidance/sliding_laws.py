"""The sliding-mode laws of course and speed with their gains, and the setpoints that fly what they ask.

How fast the laws may be around a late or uncertain autopilot is in `response.py`. The boundary layer of the
course law follows the loop that it runs in.

The observer estimates the ground speed where none is measured. It is the article's, with the regressor phi
in the place of its printed "d chi^d/d e . d e/d chi". With the estimate in the law, W = rho chi~^2 / 2 +
V~^2 / (2 Gamma) falls as dW/dt = -rho kappa chi~ sat(chi~/epsilon) - sigma V~^2.
"""

import math
from typing import Literal

import msgspec

from vfguide.elementwise import clip
from vfguide.guidance.airframe import (
    GREATEST_LEAD,
    air_relative_rates,
    bank_limited_turn_rate,
    ground_speed_on_course,
    heading_rate_at_constant_airspeed,
    saturation,
    speed_range,
)
from vfguide.guidance.navigation import FilterTimes
from vfguide.state import Airframe, Setpoint, VehicleState


class ObserverGains(msgspec.Struct, frozen=True, kw_only=True):
    """Gains of the observer."""

    gamma: float
    """Gamma: adaptation gain."""
    rho: float
    """rho: weight of the course error in the Lyapunov function."""
    sigma: float
    """sigma: pull toward the reference speed; Gamma sigma is its rate, 1/s."""


def speed_estimate_rate(
    estimate: float,
    reference_speed: float,
    course_error: float,
    regressor: float,
    gains: ObserverGains,
) -> float:
    """dV^_g/dt = -Gamma rho chi~ phi - sigma Gamma (V^_g - V_ref), m/s².

    Args:
        estimate: V^_g, m/s.
        reference_speed: V_ref, m/s: the measured ground speed while it is fresh, else the airspeed.
        course_error: chi~ = wrap(chi - chi^d), rad.
        regressor: phi, rad/m.
        gains: Gamma, rho, sigma.
    """
    adaptation = gains.rho * course_error * regressor
    return -gains.gamma * (adaptation + gains.sigma * (estimate - reference_speed))


SpeedSource = Literal["measured", "observer"]
"""Where the leader's law takes its ground speed from."""

SlotFrame = Literal["leader", "path", "plan"]
"""What slots are fixed to: the leader's measured motion, that with what is noise in it taken from the path,
or the path alone while the leader is on it."""


LEAST_PERIOD = 0.05
"""s: a faster loop keeps the boundary layer of this one. The rounding of MAVLink's velocities does not get
finer with the rate, and a thinner layer would turn it into chatter."""


GUSTS_FACTOR = 2.5
"""Boundary layer over kappa times the period in gusts: a quarter more than the least that keeps clear of the
sampled loop's limit cycle."""


class SlidingGains(msgspec.Struct, frozen=True, kw_only=True):
    """Gains of the sliding-mode laws."""

    kappa: float
    """kappa, rad/s in the course law and m/s² in the speed law."""
    epsilon: float
    """Least boundary layer, rad and m/s."""
    boundary_layer_factor: float
    """Boundary layer over kappa times period and delay."""
    loop_delay_s: float
    """From measurement to the aircraft's response, beyond the sampling period, s."""
    rho: float
    """Weight of the Lyapunov function, s²."""
    amplification: float = math.inf
    """How many times quicker than the hold that it commands a loop may be."""
    course_bandwidth: float = math.inf
    """Greatest gain of the course law within its layer, 1/s."""
    speed_bandwidth: float = math.inf
    """Greatest gain of the speed law within its layer, 1/s."""

    def layer(self, period: float, bandwidth: float = math.inf) -> float:
        """Boundary layer of a loop with this period in s, whose gain stays below a bandwidth in 1/s."""
        return self._layer(period, self.boundary_layer_factor, bandwidth)

    def layer_in(
        self,
        state: VehicleState,
        airframe: Airframe,
        period: float,
        bandwidth: float = math.inf,
    ) -> float:
        """The same in the air that a vehicle flies in: in gusts no wider than the sampled loop needs.

        Smooth setpoints, which a wider one buys, are worth nothing there; a quick answer is. An autopilot
        that answers late has no quicker one.
        """
        wide = self.layer(period, bandwidth)
        if not airframe.is_ideal:
            return wide
        narrow = self._layer(period, min(self.boundary_layer_factor, GUSTS_FACTOR), bandwidth)
        return wide + state.gust_share * (narrow - wide)

    def _layer(self, period: float, factor: float, bandwidth: float) -> float:
        least = boundary_layer(
            self.kappa,
            self.epsilon,
            period=max(period, LEAST_PERIOD),
            delay=self.loop_delay_s,
            factor=factor,
        )
        return max(least, self.kappa / bandwidth)


class PathGains(msgspec.Struct, frozen=True, kw_only=True):
    """Shape of the field around the leader's path."""

    gain: float
    """k, 1/m."""
    approach_angle: float
    """chi_inf, rad."""
    chosen: bool = False
    """Whether the mission has chosen the gain itself."""


class GuidanceSettings(msgspec.Struct, frozen=True, kw_only=True):
    """What a mission sets for every law: for the leader's, and around that of the followers."""

    sliding: SlidingGains
    """The course and speed laws."""
    observer: ObserverGains
    """The leader's ground-speed observer."""
    filters: FilterTimes
    """Navigation."""
    rate_filter_s: float
    """Time constant of the leader's acceleration and turn rate, s."""
    speed_source: SpeedSource
    """Where the leader's law takes its ground speed from."""
    predict_leader: bool
    """Carry the leader's state on to the time of use."""
    wind_feedforward: bool
    """Take the wind's own rate of change off what is asked of the autopilot."""
    give_way: bool
    """Let the leader change its airspeed where a slot would need one that its follower does not have."""
    slot_frame: SlotFrame = "leader"
    """What slots turn with; see `intended_motion`."""


def boundary_layer(
    gain: float, least: float, *, period: float, delay: float, factor: float
) -> float:
    """Boundary layer epsilon of the sampled law: max(epsilon, factor kappa (dt + delay)).

    The article's kappa = 3, epsilon = 0.01 is a continuous-time law. Sampled every dt it limit-cycles
    as soon as kappa dt / epsilon > 2; a factor of 2 is the least that keeps clear of that with a margin,
    and a greater one buys a smoother setpoint with a little accuracy.

    Args:
        gain: kappa, in the law's unit per second.
        least: the article's epsilon, in the law's unit.
        period: the loop's period dt, s.
        delay: from measurement to effect, s.
        factor: without dimension.
    """
    return max(least, factor * gain * (period + delay))


def sliding_course_rate(
    course_error: float, desired_rate: float, gain: float, layer: float
) -> float:
    """Course rate (rad/s) that brings the course onto the field: d chi^d/dt - kappa sat(chi~ / epsilon).

    Args:
        course_error: chi~ = wrap(chi - chi^d), rad.
        desired_rate: d chi^d/dt, rad/s.
        gain: kappa, rad/s.
        layer: epsilon, rad.
    """
    return desired_rate - gain * saturation(course_error / layer)


def course_command(course: float, course_rate: float, alpha: float, hold: float = 0.0) -> float:
    """chi^c = chi + (d chi/dt) (1 / alpha + T / 2), rad: what a first-order hold turns into the wanted rate.

    With `sliding_course_rate` and T = 0 this is the article's chi^c. A setpoint that stands for T seconds
    while the course turns toward it loses half of that turn on average: T / 2 makes it good. Not wrapped.

    Args:
        course: chi, rad.
        course_rate: d chi/dt, rad/s.
        alpha: response, 1/s.
        hold: T, s.
    """
    lead = course_rate * (1.0 / alpha + 0.5 * hold)
    return course + clip(lead, -GREATEST_LEAD, GREATEST_LEAD)


POSITION_SHARE = 1.0 / 3.0
"""Share of kappa that x_E / rho may have. Beyond kappa it would outweigh the sliding term, and a follower
100 m behind would ask for a speed without end."""


def sliding_acceleration(
    speed_error: float,
    along_track_error: float,
    desired_acceleration: float,
    *,
    gain: float,
    layer: float,
    rho: float,
) -> float:
    """Acceleration (m/s²) that brings the speed onto the field: dV^d/dt + x_E/rho - kappa sat(V~/epsilon).

    Args:
        speed_error: V~ = V_f - V^d, m/s.
        along_track_error: x_E, m, positive where the slot is ahead.
        desired_acceleration: dV^d/dt, m/s².
        gain: kappa, m/s².
        layer: epsilon, m/s.
        rho: weight of the Lyapunov function, s².
    """
    bound = POSITION_SHARE * gain
    position_term = clip(along_track_error / rho, -bound, bound)
    return desired_acceleration + position_term - gain * saturation(speed_error / layer)


def speed_command(speed: float, acceleration: float, beta: float, hold: float = 0.0) -> float:
    """V^c = V + (dV/dt) (1 / beta + T / 2), m/s: what a first-order hold turns into the wanted acceleration.

    T is how long the setpoint stands, s; see `course_command`.
    """
    return speed + acceleration * (1.0 / beta + 0.5 * hold)


def acceleration_toward(command: float, speed: float, beta: float, hold: float = 0.0) -> float:
    """Acceleration (m/s²) for which `speed_command` gives this command (m/s)."""
    return (command - speed) / (1.0 / beta + 0.5 * hold)


LEAST_GROUND_SPEED = 1.0
"""m/s: an aircraft that stands still turns at no rate that can be worked out."""


def foretold_share(state: VehicleState, *, wind_feedforward: bool) -> float:
    """Share of the wind's rate that is fed forward: none of it in gusts, whose rate foretells nothing."""
    return 1.0 - state.gust_share if wind_feedforward else 0.0


def setpoint_for(
    state: VehicleState,
    acceleration: float,
    course_rate: float,
    airframe: Airframe,
    *,
    wind_feedforward: bool,
    hold: float = 0.0,
) -> Setpoint:
    """Setpoint for a wanted ground acceleration (m/s²) and course rate (rad/s).

    Args:
        state: navigated state of the vehicle.
        acceleration: wanted dV_g/dt.
        course_rate: wanted dchi/dt.
        airframe: what the autopilot holds, how it responds, what the vehicle can do.
        wind_feedforward: whether the wind's rate of change is taken off.
        hold: how long the setpoint stands, s.
    """
    if airframe.hold == "course-hold":
        return _course_hold(state, acceleration, course_rate, airframe, hold)
    share = foretold_share(state, wind_feedforward=wind_feedforward)
    airspeed_rate, heading_rate = air_relative_rates(
        acceleration,
        course_rate,
        ground_speed=state.ground_speed,
        course=state.course,
        airspeed=state.airspeed,
        heading=state.heading,
        wind_rate_north=share * state.wind_rate_north,
        wind_rate_east=share * state.wind_rate_east,
    )
    return heading_hold(state, airspeed_rate, heading_rate, airframe, hold=hold)


def cruise_setpoint(
    state: VehicleState,
    airspeed: float,
    course_rate: float,
    airframe: Airframe,
    *,
    wind_feedforward: bool,
    hold: float = 0.0,
) -> Setpoint:
    """Setpoint that turns the course at a rate (rad/s) and keeps an airspeed (m/s).

    Args:
        state: navigated state of the vehicle.
        airspeed: to be kept.
        course_rate: wanted dchi/dt.
        airframe: what the autopilot holds, how it responds, what the vehicle can do.
        wind_feedforward: whether the wind's rate of change is taken off.
        hold: how long the setpoint stands, s.
    """
    if airframe.hold == "course-hold":
        wind = (state.wind_north, state.wind_east)
        wanted = ground_speed_on_course(airspeed, state.course, *wind)
        acceleration = acceleration_toward(wanted, state.ground_speed, airframe.beta, hold)
        return setpoint_for(
            state, acceleration, course_rate, airframe, wind_feedforward=False, hold=hold
        )
    share = foretold_share(state, wind_feedforward=wind_feedforward)
    heading_rate = heading_rate_at_constant_airspeed(
        course_rate,
        ground_speed=state.ground_speed,
        course=state.course,
        airspeed=state.airspeed,
        heading=state.heading,
        wind_rate_north=share * state.wind_rate_north,
        wind_rate_east=share * state.wind_rate_east,
    )
    # The airspeed setpoint is the airspeed itself: this hold needs no lead.
    airspeed_rate = acceleration_toward(airspeed, state.airspeed, airframe.beta, hold)
    return heading_hold(state, airspeed_rate, heading_rate, airframe, hold=hold)


def heading_hold(
    state: VehicleState,
    airspeed_rate: float,
    heading_rate: float,
    airframe: Airframe,
    *,
    hold: float = 0.0,
) -> Setpoint:
    """Setpoint for heading and airspeed holds that stands for `hold` seconds.

    The course is commanded, and the autopilot flies it as a heading through the drift it measures: a
    course setpoint (heading rate)/alpha ahead of the course turns the heading at that rate.
    """
    turn_limit = bank_limited_turn_rate(airframe.max_bank, state.airspeed)
    turn = clip(heading_rate, -turn_limit, turn_limit)
    rate = clip(airspeed_rate, -airframe.max_acceleration, airframe.max_acceleration)
    wanted = speed_command(state.airspeed, rate, airframe.beta, hold)
    airspeed = clip(wanted, *speed_range(state, airframe))
    return Setpoint(
        course=course_command(state.course, turn, airframe.alpha, hold),
        speed=airspeed,
        turn_limited=turn != heading_rate,
        speed_limited=rate != airspeed_rate or airspeed != wanted,
    )


def _course_hold(
    state: VehicleState,
    acceleration: float,
    course_rate: float,
    airframe: Airframe,
    hold: float,
) -> Setpoint:
    """Setpoint for course and ground-speed holds: the article's equations."""
    turn_limit = bank_limited_turn_rate(
        airframe.max_bank, max(state.ground_speed, LEAST_GROUND_SPEED)
    )
    turn = clip(course_rate, -turn_limit, turn_limit)
    rate = clip(acceleration, -airframe.max_acceleration, airframe.max_acceleration)
    wanted = speed_command(state.ground_speed, rate, airframe.beta, hold)
    speed = clip(wanted, *speed_range(state, airframe))
    return Setpoint(
        course=course_command(state.course, turn, airframe.alpha, hold),
        speed=speed,
        turn_limited=turn != course_rate,
        speed_limited=rate != acceleration or speed != wanted,
    )
