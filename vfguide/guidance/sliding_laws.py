"""Sliding-mode laws of course and speed, their gains, and setpoints for the rates that they demand.

`response.py` bounds the laws' bandwidth around a late or uncertain autopilot. The boundary layer of the
course law depends on the period and delay of its loop.

The observer estimates the ground speed where none is measured. It is the article's, with the regressor phi in
place of its printed "d chi^d/d e . d e/d chi". With the estimate in the law, W = rho chi~^2 / 2 + V~^2 / (2
Gamma) falls as dW/dt = -rho kappa chi~ sat(chi~/epsilon) - sigma V~^2.
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
    """Gains of the ground-speed observer."""

    gamma: float
    """Gamma: adaptation gain."""
    rho: float
    """rho: weight of the course error in the Lyapunov function."""
    sigma: float
    """sigma: pull toward the reference speed, with a rate of Gamma sigma in 1/s."""


def speed_estimate_rate(
    estimate: float,
    reference_speed: float,
    course_error: float,
    regressor: float,
    gains: ObserverGains,
) -> float:
    """Return dV^_g/dt = -Gamma rho chi~ phi - sigma Gamma (V^_g - V_ref), m/s².

    V_ref is the measured ground speed while it is fresh, else the airspeed, m/s like the estimate V^_g. The
    course error chi~ = wrap(chi - chi^d) is in rad, the regressor phi in rad/m.
    """
    adaptation = gains.rho * course_error * regressor
    return -gains.gamma * (adaptation + gains.sigma * (estimate - reference_speed))


SpeedSource = Literal["measured", "observer"]
"""Source of the ground speed in the leader's law."""

SlotFrame = Literal["leader", "path", "plan"]
"""Motion to which slots are fixed: measured, measured with noise replaced by the path's, or the path's alone
while the leader is on it."""


LEAST_PERIOD = 0.05
"""Shortest period for the boundary layer, s. The rounding of MAVLink's velocities does not get finer with the
rate: a thinner layer would turn it into chatter."""


GUSTS_FACTOR = 2.5
"""Boundary layer over kappa times the period in gusts: a quarter above the smallest that avoids the sampled
loop's limit cycle."""


class SlidingGains(msgspec.Struct, frozen=True, kw_only=True):
    """Gains of the sliding-mode laws."""

    kappa: float
    """kappa, rad/s in the course law and m/s² in the speed law."""
    epsilon: float
    """Smallest boundary layer, rad and m/s."""
    boundary_layer_factor: float
    """Boundary layer over kappa times the sum of period and delay."""
    loop_delay_s: float
    """Delay from measurement to the aircraft's response, beyond the sampling period, s."""
    rho: float
    """Weight of the Lyapunov function, s²."""
    amplification: float = math.inf
    """Largest ratio of a loop's bandwidth to the hold that it commands."""
    course_bandwidth: float = math.inf
    """Largest gain of the course law within its layer, 1/s."""
    speed_bandwidth: float = math.inf
    """Largest gain of the speed law within its layer, 1/s."""

    def layer(self, period: float, bandwidth: float = math.inf) -> float:
        """Return the boundary layer for a period (s) that keeps the gain below a bandwidth (1/s)."""
        return self._layer(period, self.boundary_layer_factor, bandwidth)

    def layer_in(
        self, state: VehicleState, airframe: Airframe, period: float, bandwidth: float = math.inf
    ) -> float:
        """Return the boundary layer for a vehicle's air: in gusts no wider than the sampled loop needs.

        A wider layer buys smooth setpoints, which are worth less in gusts than a fast response. An autopilot
        with delay has no faster response.
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
    """Whether the mission sets the gain."""


class GuidanceSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Settings of a mission for the laws of the leader and the followers."""

    sliding: SlidingGains
    """Gains of the course and speed laws."""
    observer: ObserverGains
    """Gains of the leader's ground-speed observer."""
    filters: FilterTimes
    """Time constants of the navigation filter."""
    rate_filter_s: float
    """Time constant of the leader's acceleration and turn rate, s."""
    speed_source: SpeedSource
    """Source of the ground speed in the leader's law."""
    predict_leader: bool
    """Extrapolate the leader's state to the time of use."""
    wind_feedforward: bool
    """Subtract the wind's rate of change from the demand on the autopilot."""
    give_way: bool
    """Let the leader change its airspeed where a slot needs one beyond its follower's range."""
    slot_frame: SlotFrame = "leader"
    """Motion to which slots are fixed; see `intended_motion`."""


def boundary_layer(
    gain: float, least: float, *, period: float, delay: float, factor: float
) -> float:
    """Return the boundary layer epsilon of the sampled law: max(epsilon, factor kappa (dt + delay)).

    The article's kappa = 3, epsilon = 0.01 is a continuous-time law. Sampled every dt it limit-cycles once
    kappa dt / epsilon > 2. A factor of 2 is the smallest that avoids this with a margin; a larger one gives
    smoother setpoints for a little accuracy.

    Gain kappa in the law's unit per second, `least` (the article's epsilon) in the law's unit; period and
    delay from measurement to effect in s.
    """
    return max(least, factor * gain * (period + delay))


def sliding_course_rate(
    course_error: float, desired_rate: float, gain: float, layer: float
) -> float:
    """Return the course rate (rad/s) onto the field: d chi^d/dt - kappa sat(chi~ / epsilon).

    chi~ = wrap(chi - chi^d) and the layer epsilon in rad; d chi^d/dt and the gain kappa in rad/s.
    """
    return desired_rate - gain * saturation(course_error / layer)


def course_command(course: float, course_rate: float, alpha: float, hold: float = 0.0) -> float:
    """Return the course setpoint (rad, not wrapped): chi^c = chi + (d chi/dt) (1 / alpha + T / 2).

    A first-order hold turns it into the wanted rate. With `sliding_course_rate` and T = 0 this is the
    article's chi^c. A setpoint held for T (`hold`, s) while the course turns toward it loses half of that
    turn on average: T / 2 compensates. Angles in rad, alpha in 1/s.
    """
    lead = course_rate * (1.0 / alpha + 0.5 * hold)
    return course + clip(lead, -GREATEST_LEAD, GREATEST_LEAD)


POSITION_SHARE = 1.0 / 3.0
"""Bound of x_E / rho as a share of kappa: beyond kappa it would outweigh the sliding term, and a follower 100
m behind would demand an unbounded speed."""


def sliding_acceleration(
    speed_error: float,
    along_track_error: float,
    desired_acceleration: float,
    *,
    gain: float,
    layer: float,
    rho: float,
) -> float:
    """Return the acceleration (m/s²) onto the field: dV^d/dt + x_E/rho - kappa sat(V~/epsilon).

    V~ = V_f - V^d and the layer epsilon in m/s, x_E in m, positive where the slot is ahead; dV^d/dt and the
    gain kappa in m/s², rho in s².
    """
    bound = POSITION_SHARE * gain
    position_term = clip(along_track_error / rho, -bound, bound)
    return desired_acceleration + position_term - gain * saturation(speed_error / layer)


def speed_command(speed: float, acceleration: float, beta: float, hold: float = 0.0) -> float:
    """Return the speed setpoint (m/s): V^c = V + (dV/dt) (1 / beta + T / 2).

    A first-order hold turns it into the wanted acceleration; T is `hold`, s, as in `course_command`.
    """
    return speed + acceleration * (1.0 / beta + 0.5 * hold)


def acceleration_toward(command: float, speed: float, beta: float, hold: float = 0.0) -> float:
    """Return the acceleration (m/s²) for which `speed_command` gives a command (m/s)."""
    return (command - speed) / (1.0 / beta + 0.5 * hold)


LEAST_GROUND_SPEED = 1.0
"""Lower bound of the ground speed in turn limits, m/s: a standstill would give an infinite one."""


def foretold_share(state: VehicleState, *, wind_feedforward: bool) -> float:
    """Return the share of the wind's rate to feed forward: less in gusts, whose rate predicts nothing."""
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
    """Return the setpoint for a wanted ground acceleration (m/s²) and course rate (rad/s).

    With `wind_feedforward` the wind's rate of change is subtracted. The setpoint is held for `hold` seconds.
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
    """Return the setpoint that turns the course at a rate (rad/s) and keeps an airspeed (m/s).

    With `wind_feedforward` the wind's rate of change is subtracted. The setpoint is held for `hold` seconds.
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
    """Return the setpoint for heading and airspeed holds, held for `hold` seconds.

    The autopilot flies the commanded course as a heading through the drift it measures. A course setpoint
    (heading rate)/alpha ahead of the course turns the heading at that rate.
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
    state: VehicleState, acceleration: float, course_rate: float, airframe: Airframe, hold: float
) -> Setpoint:
    """Return the setpoint for course and ground-speed holds: the article's equations."""
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
