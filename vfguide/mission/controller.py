"""The guidance law of a mission and its gains."""

from typing import Annotated, Literal

from pydantic import Field

from vfguide.mission.quantity import Duration, Gain, NotNegative, Number, Section, Switch

ControllerType = Literal["slot", "article", "pid", "mpc"]
"""The laws that keep a slot."""


class Observer(Section):
    """The adaptive estimate of the ground speed inside the course law."""

    gamma: Gain = 1.0
    """Gamma of the article: adaptation gain."""

    rho: Gain = 200.0
    """rho of the article: weight of the course error in the adaptation."""

    sigma: Annotated[NotNegative, Field(le=100.0)] = 0.5
    """sigma of the article: pull of the estimate toward the measured ground speed."""


class Pid(Section):
    """The baseline `pid`: a correction of course and speed on top of the slot's own motion.

    The defaults are what `tests/benchmarks/tune_pid.py` finds on the calm missions.
    """

    lateral_p_rad_m: Annotated[NotNegative, Field(le=10.0)] = 0.502
    """Course for the error across track, rad/m."""

    lateral_i_rad_m_s: Annotated[NotNegative, Field(le=10.0)] = 1.27
    """Course for its integral, rad/(m s)."""

    lateral_d_rad_s_m: Annotated[NotNegative, Field(le=10.0)] = 0.225
    """Course for its rate, rad s/m."""

    longitudinal_p_1_s: Annotated[NotNegative, Field(le=100.0)] = 12.4
    """Speed for the error along track, m/s per m."""

    longitudinal_i_1_s2: Annotated[NotNegative, Field(le=100.0)] = 22.4
    """Speed for its integral, m/s per m s."""

    longitudinal_d: Annotated[NotNegative, Field(le=100.0)] = 5.79
    """Speed for its rate, m/s per m/s."""

    derivative_filter_s: Duration = 0.2
    """Time constant of the rates, s."""

    max_course_deg: Annotated[Number, Field(ge=1.0, le=90.0)] = 45.0
    """Largest correction of the course, degrees."""

    max_speed_m_s: Annotated[Number, Field(ge=0.1, le=100.0)] = 8.0
    """Largest correction of the speed, m/s."""


class Mpc(Section):
    """The baseline `mpc`: a quadratic programme over the next seconds; a metre of error weighs 1.

    The defaults are what `tests/benchmarks/tune_mpc.py` finds on the calm missions.
    """

    horizon_s: Annotated[Number, Field(ge=0.5, le=20.0)] = 4.0
    """How far it looks, s."""

    intervals: Annotated[int, Field(strict=True, ge=2, le=100)] = 28
    """Into how many intervals of constant acceleration the horizon is cut."""

    velocity_weight_s2: Annotated[NotNegative, Field(le=1e4)] = 0.01
    """Weight of the velocity relative to the slot, s²."""

    acceleration_weight_s4: Annotated[Gain, Field(le=1e4)] = 0.0016
    """Weight of the acceleration relative to the slot, s⁴."""

    max_course_deg: Annotated[Number, Field(ge=1.0, le=90.0)] = 45.0
    """Largest course relative to the slot's that is planned, degrees."""

    integral_s: Duration = 0.75
    """Time in which it learns what keeps a follower off its slot, s; 0: never."""


class Controller(Section):
    """Formation keeping: which law, how sharp, and what is fed forward."""

    type: ControllerType = "slot"
    """`slot`: field around the slot's motion; `article`: around the leader's; `pid`, `mpc`: baselines."""

    k_x: Annotated[Gain, Field(le=10.0)] = 0.2
    """How sharply speed answers the error along track, 1/m."""

    k_y: Annotated[Gain, Field(le=10.0)] = 0.2
    """How sharply course answers the error across track, 1/m."""

    chi_inf_deg: Annotated[Number, Field(ge=1.0, le=90.0)] = 45.0
    """chi_inf of the article: largest course correction of a follower, degrees."""

    v_inf_m_s: Annotated[Number, Field(ge=0.1, le=100.0)] = 8.0
    """V_inf of the article: largest speed correction of a follower, m/s."""

    integral_s: Duration = 0.0
    """Time in which the field of type `slot` learns what keeps a follower off its slot, s; 0: never."""

    kappa: Annotated[Gain, Field(le=100.0)] = 3.0
    """kappa of the article: rate at which course and speed errors are driven out, per hold bandwidth."""

    epsilon: Annotated[Gain, Field(le=10.0)] = 0.01
    """epsilon of the article: the least width of the boundary layer in which the switching term is linear."""

    boundary_layer_factor: Annotated[NotNegative, Field(le=100.0)] = 3.5
    """The layer is max(epsilon, this * kappa * (loop period + loop delay)); below 0.5 the loop chatters."""

    rho: Gain = 50.0
    """rho of the article: weight of speed against position in the speed law; smaller pulls harder at x_E."""

    loop_delay_s: Duration = 0.0
    """Known delay between a measurement and its effect, beyond one loop period, s."""

    leader_speed_source: Literal["measured", "observer"] = "measured"
    """Where the leader's own course law takes its ground speed from."""

    observer: Observer = Observer()
    """Gains of the ground-speed observer."""

    position_filter_s: Duration = 2.0
    """Time constant of the follower's position filter, s; 0 switches it off."""

    wind_filter_s: Duration = 0.35
    """Time constant of the wind estimate, s; 0 switches the filter off."""

    rate_filter_s: Duration = 0.6
    """Time constant of the leader's turn rate and acceleration estimates, s; 0 switches it off."""

    predict_leader: Switch = True
    """Carry the received leader state forward to the follower's own time."""

    wind_feedforward: Switch = True
    """Feed the estimated change of wind forward."""

    rate_feedforward: Switch = True
    """Let a follower's field know how the slot's course and speed change."""

    give_way: Switch = True
    """Let the leader change its airspeed when a slot would leave its follower's airspeed range."""

    slot_frame: Literal["leader", "path"] = "path"
    """What slots turn with: the leader's course as its path has it where gusts shake it, or as measured."""

    pid: Pid = Pid()
    """Gains of the baseline `pid`."""

    mpc: Mpc = Mpc()
    """Weights of the baseline `mpc`."""
