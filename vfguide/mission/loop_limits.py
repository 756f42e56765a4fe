"""Before take-off: is the guidance loop fast enough for its gains, and are its inputs fresh enough?"""

import math
from collections.abc import Iterator

from vfguide.guidance.settings import LEAST_PERIOD
from vfguide.guidance.sliding_laws import boundary_layer
from vfguide.mission.controller import Controller
from vfguide.mission.finding import Finding
from vfguide.mission.model import Mission

LIMIT_CYCLE = 2.0
"""kappa (period + delay) / epsilon above which the sampled law limit-cycles."""

RESTLESS = 0.5
"""kappa (period + delay) / epsilon above which the setpoint still overshoots at every step."""

WIDEST_LAYER = math.pi / 4.0
"""rad; course errors up to a quarter turn wide would be answered with less than full authority."""

STALE_S = 1.0
"""Age of a leader state (s) beyond which its prediction is a guess."""

RADIO_BYTES = 56
"""Bytes of a leader's state on a radio."""


def effective_layer(controller: Controller, period: float) -> float:
    """Boundary layer epsilon (rad, m/s) that the laws use in a loop with this period in s."""
    return boundary_layer(
        controller.kappa,
        controller.epsilon,
        period=max(period, LEAST_PERIOD),
        delay=controller.loop_delay_s,
        factor=controller.layer_factor,
    )


def layer_crossing(kappa: float, layer: float, *, period: float, delay: float) -> float:
    """Boundary layers that the law crosses before it sees the result: kappa (dt + delay) / epsilon.

    Above 2 the error changes sign by more than its size at every step: a limit cycle.

    Args:
        kappa: rad/s.
        layer: epsilon, rad.
        period: dt, s.
        delay: from measurement to effect, s.
    """
    return kappa * (period + delay) / layer


def loop_too_slow(mission: Mission) -> Iterator[Finding]:
    """A loop that chatters, or one whose boundary layer makes it soft."""
    controller = mission.controller
    rate = mission.rehearsal.rate_hz
    layer = effective_layer(controller, 1.0 / rate)
    crossing = layer_crossing(
        controller.kappa, layer, period=1.0 / rate, delay=controller.loop_delay_s
    )
    if crossing > RESTLESS:
        word = "limit-cycles" if crossing > LIMIT_CYCLE else "is restless"
        message = (
            f"at {rate:g} Hz the law crosses {crossing:.1f} boundary layers in one step and {word}"
        )
        remedy = "set boundary_layer_factor to 2 or more (3.5 to 5 are usual), or raise rehearsal.rate_hz"
        location = ("controller", "boundary_layer_factor")
        yield Finding("error" if crossing > LIMIT_CYCLE else "warning", location, message, remedy)
    if layer > WIDEST_LAYER:
        message = (
            f"at {rate:g} Hz kappa {controller.kappa:g} takes a boundary layer of {layer:.2f} rad, "
            f"wider than {WIDEST_LAYER:.2f}: the formation is kept softly"
        )
        remedy = "raise rehearsal.rate_hz, or lower controller.kappa or boundary_layer_factor"
        yield Finding("warning", ("controller", "kappa"), message, remedy)


def mean_leader_age(mission: Mission) -> float:
    """Mean age (s) of the newest leader state: delay, and what losses add; jitter goes either way.

    Of states sent every dt with a share p lost, the newest is older by dt p / (1 - p) on average.
    """
    rehearsal = mission.rehearsal
    radio = rehearsal.radio
    if radio is not None:
        # Half an interval of its own states, half a step before they are looked at, and the way.
        way_s = RADIO_BYTES * (20.0 / radio.baud + 1.0 / radio.air_bytes_s)
        lost = radio.loss + radio.bursts - radio.loss * radio.bursts
        return way_s + (0.5 + lost / (1.0 - lost)) / radio.leader_hz + 0.5 / rehearsal.rate_hz
    wait = rehearsal.link_loss / (1.0 - rehearsal.link_loss) / rehearsal.rate_hz
    return rehearsal.link_delay_s + wait


def unknown_delay(mission: Mission) -> Iterator[Finding]:
    """A leader without a companion of which nobody has said how late it is heard."""
    if mission.leader.least_delay_s is not None:
        return
    behind = 0.1 * mission.leader.airspeed_m_s
    message = (
        "how long its messages take at least is not told: followers ask it for its time, and where it does"
        f" not answer they fly {behind:.1f} m behind their slots for each 0.1 s"
    )
    remedy = "measure it on the ground, and write least_delay_s"
    yield Finding("note", ("leader", "least_delay_s"), message, remedy)


def leader_state_too_old(mission: Mission) -> Iterator[Finding]:
    """Leader states that are old when they are used."""
    if not mission.followers:
        return
    if mission.leader.is_foreign:
        yield from unknown_delay(mission)
        return
    age = mean_leader_age(mission)
    patience = mission.patience.leader_s
    if age > patience:
        message = (
            f"leader states are {age:.1f} s old on average: no follower ever hears one that is fresh "
            f"within patience.leader_s, {patience:g} s, and none joins"
        )
        remedy = f"a link below {patience:g} s, or a longer patience.leader_s"
        yield Finding("error", ("rehearsal", "link_delay_s"), message, remedy)
    elif age > STALE_S:
        message = f"leader states are {age:.1f} s old on average, more than prediction bridges well"
        yield Finding(
            "warning", ("rehearsal", "link_delay_s"), message, "expect a less precise formation"
        )
    behind = age * mission.leader.airspeed_m_s
    if not mission.controller.predict_leader and behind > 0.1:
        message = (
            f"leader states are {age:.2f} s old on average: "
            f"followers fly {behind:.1f} m behind their slots"
        )
        remedy = "set predict_leader: true"
        yield Finding("warning", ("controller", "predict_leader"), message, remedy)


def observer_out_of_tune(mission: Mission) -> Iterator[Finding]:
    """A ground-speed observer that drifts, or that its own step makes unstable."""
    controller = mission.controller
    if controller.leader_speed_source != "observer":
        return
    location = ("controller", "observer", "sigma")
    pull = controller.observer.gamma * controller.observer.sigma
    if pull == 0.0:
        message = "without sigma nothing holds the estimate to the airspeed: it drifts"
        yield Finding("warning", location, message, "set sigma to 0.5 or so")
    elif pull / mission.rehearsal.rate_hz > LIMIT_CYCLE:
        rate = mission.rehearsal.rate_hz
        message = f"gamma * sigma = {pull:g} 1/s is too fast for {rate:g} Hz: it diverges"
        yield Finding(
            "error", location, message, "lower gamma or sigma, or raise rehearsal.rate_hz"
        )
