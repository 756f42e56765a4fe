"""What a mission chooses about guidance, whatever the law, and what an autopilot that answers late allows.

The ground-speed observer serves where no ground speed is measured: the article's, with the regressor phi
in the place of its printed "d chi^d/d e . d e/d chi". With the estimate in the law, W = rho chi~^2 / 2 +
V~^2 / (2 Gamma) falls as dW/dt = -rho kappa chi~ sat(chi~/epsilon) - sigma V~^2.

Bandwidth limits: each loop around another has to be slower than the one inside. The autopilot's dead time
and lag are predicted away, but no prediction is perfect: the sliding laws are slowed with the delay, and
the fields with them.
"""

from typing import Literal

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import Number
from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.sliding_laws import boundary_layer
from vfguide.state import Airframe, VehicleState


class ObserverGains(msgspec.Struct, frozen=True, kw_only=True):
    """Gains of the observer."""

    gamma: float
    """Gamma: adaptation gain."""
    rho: float
    """rho: weight of the course error in the Lyapunov function."""
    sigma: float
    """sigma: pull toward the reference speed; Gamma sigma is its rate, 1/s."""


def speed_estimate_rate(
    estimate: Number,
    reference_speed: Number,
    course_error: Number,
    regressor: Number,
    gains: ObserverGains,
) -> Number:
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

    def layer(self, period: float) -> float:
        """Boundary layer of a loop with this period in seconds."""
        return self._layer(period, self.boundary_layer_factor)

    def layer_in(
        self, state: VehicleState[Number], airframe: Airframe, period: float
    ) -> Number | float:
        """The same in the air that a vehicle flies in: in gusts no wider than the sampled loop needs.

        Smooth setpoints, which a wider one buys, are worth nothing there; a quick answer is. An autopilot
        that answers late has no quicker one.
        """
        wide = self.layer(period)
        if not airframe.is_ideal:
            return wide
        narrow = self._layer(period, min(self.boundary_layer_factor, GUSTS_FACTOR))
        return wide + state.gust_share * (narrow - wide)

    def _layer(self, period: float, factor: float) -> float:
        return boundary_layer(
            self.kappa,
            self.epsilon,
            period=max(period, LEAST_PERIOD),
            delay=self.loop_delay_s,
            factor=factor,
        )


class PathGains(msgspec.Struct, frozen=True, kw_only=True):
    """Shape of the field around the leader's path."""

    gain: float
    """k, 1/m."""
    approach_angle: float
    """chi_inf, rad."""


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


DELAY_SHARE = 0.2
"""Of a delay that is predicted, what the sliding laws still count as one."""

GREATEST_GAIN = 0.45
"""1/s: of the course law of a vehicle that slips. On ArduPilot's simulated plane 0.7 and 0.25 of its field
kept the yaw swinging at 0.9 Hz for ever."""


def limit_bandwidth(sliding: SlidingGains, delay: float) -> SlidingGains:
    """Gains for an autopilot that answers after a delay (s); the same ones where there is none."""
    if delay <= 0.0:
        return sliding
    return replace(sliding, loop_delay_s=sliding.loop_delay_s + DELAY_SHARE * delay)


def course_delay(sliding: SlidingGains, airframe: Airframe, *, slips: bool, period: float) -> float:
    """What a course setpoint counts as late, s: dead time and lag; more for a vehicle that slips.

    Args:
        sliding: the mission's gains.
        airframe: of the vehicle.
        slips: whether its nose leaves the direction of flight in turns.
        period: of the loop, s.
    """
    delay = airframe.course_dead_time + airframe.course_lag
    if not slips or sliding.boundary_layer_factor <= 0.0:
        return delay
    missing = loop_delay_for(GREATEST_GAIN, sliding, period) - sliding.loop_delay_s
    return max(delay, missing / DELAY_SHARE)


def speed_delay(airframe: Airframe) -> float:
    """What a speed setpoint counts as late, s: dead time and lag."""
    return airframe.speed_dead_time + airframe.speed_lag


def loop_delay_for(gain: float, sliding: SlidingGains, period: float) -> float:
    """Loop delay (s) with which the sliding laws answer with this gain (1/s)."""
    return 1.0 / (sliding.boundary_layer_factor * gain) - max(period, LEAST_PERIOD)
