"""What a mission chooses about guidance, whatever the law, and what an autopilot that answers late allows.

The ground-speed observer serves where no ground speed is measured: the article's, with the regressor phi
in the place of its printed "d chi^d/d e . d e/d chi". With the estimate in the law, W = rho chi~^2 / 2 +
V~^2 / (2 Gamma) falls as dW/dt = -rho kappa chi~ sat(chi~/epsilon) - sigma V~^2.

How fast the laws may be around an autopilot that answers late, or is not well known, says `bandwidth.py`.
"""

import math
from typing import Literal

import msgspec

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
