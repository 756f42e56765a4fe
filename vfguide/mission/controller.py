"""The guidance law of a mission and its gains."""

from typing import Annotated, Literal

from pydantic import Field

from vfguide.mission.quantity import Duration, Gain, NotNegative, Number, Section, Switch


class Observer(Section):
    """The adaptive estimate of the ground speed inside the course law."""

    gamma: Gain = 1.0
    """Gamma of the article: adaptation gain."""

    rho: Gain = 200.0
    """rho of the article: weight of the course error in the adaptation."""

    sigma: Annotated[NotNegative, Field(le=100.0)] = 0.5
    """sigma of the article: pull of the estimate toward the measured ground speed."""


class Controller(Section):
    """Formation keeping: which field, how sharp, and what is fed forward."""

    type: Literal["slot", "article"] = "slot"
    """`slot` steers around the slot's own motion, `article` around the leader's velocity."""

    k_x: Annotated[Gain, Field(le=10.0)] = 0.2
    """How sharply speed answers the error along track, 1/m."""

    k_y: Annotated[Gain, Field(le=10.0)] = 0.2
    """How sharply course answers the error across track, 1/m."""

    chi_inf_deg: Annotated[Number, Field(ge=1.0, le=90.0)] = 45.0
    """chi_inf of the article: largest course correction of a follower, degrees."""

    v_inf_m_s: Annotated[Number, Field(ge=0.1, le=100.0)] = 8.0
    """V_inf of the article: largest speed correction of a follower, m/s."""

    kappa: Annotated[Gain, Field(le=100.0)] = 3.0
    """kappa of the article: rate at which course and speed errors are driven out, per hold bandwidth."""

    epsilon: Annotated[Gain, Field(le=10.0)] = 0.01
    """epsilon of the article: the least width of the boundary layer in which the switching term is linear."""

    boundary_layer_factor: Annotated[NotNegative, Field(le=100.0)] = 5.0
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

    wind_filter_s: Duration = 0.2
    """Time constant of the wind estimate, s; 0 switches the filter off."""

    rate_filter_s: Duration = 0.4
    """Time constant of the leader's turn rate and acceleration estimates, s; 0 switches it off."""

    predict_leader: Switch = True
    """Carry the received leader state forward to the follower's own time."""

    wind_feedforward: Switch = True
    """Feed the estimated change of wind forward."""

    give_way: Switch = True
    """Let the leader change its airspeed when a slot would leave its follower's airspeed range."""
