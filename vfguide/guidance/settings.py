"""What a mission chooses about guidance, whatever the law of its followers."""

from dataclasses import dataclass
from typing import Literal

from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.observer import ObserverGains
from vfguide.guidance.sliding_laws import boundary_layer

SpeedSource = Literal["measured", "observer"]
"""Where the leader's law takes its ground speed from."""

SlotFrame = Literal["leader", "path", "plan"]
"""What slots are fixed to: the leader's measured motion, that with what is noise in it taken from the path,
or the path alone while the leader is on it."""


LEAST_PERIOD = 0.05
"""s: a faster loop keeps the boundary layer of this one. The rounding of MAVLink's velocities does not get
finer with the rate, and a thinner layer would turn it into chatter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingGains:
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
        return boundary_layer(
            self.kappa,
            self.epsilon,
            period=max(period, LEAST_PERIOD),
            delay=self.loop_delay_s,
            factor=self.boundary_layer_factor,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PathGains:
    """Shape of the field around the leader's path."""

    gain: float
    """k, 1/m."""
    approach_angle: float
    """chi_inf, rad."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceSettings:
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
