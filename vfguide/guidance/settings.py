"""What a mission chooses about guidance."""

from dataclasses import dataclass
from typing import Generic, Literal

from vfguide.elementwise import Number
from vfguide.guidance.course_law import boundary_layer
from vfguide.guidance.formation import FieldGains, FieldType
from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.observer import ObserverGains

SpeedSource = Literal["measured", "observer"]
"""Where the leader's law takes its ground speed from."""

FollowerLaw = Literal["field", "pid", "mpc"]
"""What keeps a follower on its slot: the dual field, or one of the baselines that it is measured against."""


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
class AxisGains(Generic[Number]):
    """Gains of one PID controller, whose answer u is rad of course or m/s of speed."""

    proportional: Number
    """u per m."""
    integral: Number
    """u per m and s."""
    derivative: Number
    """u per m/s."""
    derivative_filter_s: float
    """Time constant of the error's rate, s."""
    greatest: Number
    """Greatest |u|; the integral alone may be that much too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PidGains(Generic[Number]):
    """Both PID controllers of a follower."""

    lateral: AxisGains[Number]
    """Cross-track error to course."""
    longitudinal: AxisGains[Number]
    """Along-track error to ground speed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MpcWeights:
    """The predictive controller: how far it looks, and what it weighs. A metre of error weighs 1/m²."""

    horizon_s: float
    """How far it looks, s."""
    intervals: int
    """Into how many of them the horizon is cut; the accelerations are constant on each."""
    velocity: float
    """Of the velocity relative to the slot, s²/m²."""
    acceleration: float
    """Of the acceleration relative to the slot, s⁴/m²."""
    max_course: float
    """Greatest course relative to the slot's that is planned, rad."""
    integral_s: float = 0.0
    """T, s: time in which it learns what keeps a follower off its slot; 0: never."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceSettings:
    """Everything of the laws that a mission can set."""

    field_type: FieldType
    """How a slot is taken to move."""
    field: FieldGains
    """The followers' dual field."""
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
    rate_feedforward: bool = True
    """Let a follower's field know how the slot's course and speed change."""
    slot_frame: Literal["leader", "path"] = "leader"
    """What slots turn with; `path`: see `intended_motion`."""
    answers_course_error: bool = True
    """Whether a follower turns toward its field, or with its slot alone; where only its speed counts."""
    law: FollowerLaw = "field"
    """What keeps a follower on its slot."""
    pid: PidGains[float] | None = None
    """Where the law is `pid`."""
    mpc: MpcWeights | None = None
    """Where the law is `mpc`."""
