"""Before take-off: how precise will the formation be?

Estimates for steady flight, without measurement noise, saturation and the model errors of real aircraft.
"""

import math
from collections.abc import Iterator

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.formation import Slot, field_slope
from vfguide.mission.conditions import ARTICLE_WIND_PERIOD_S, Conditions, article_wind
from vfguide.mission.controller import Controller
from vfguide.mission.finding import Finding
from vfguide.mission.loop_limits import effective_layer, mean_leader_age
from vfguide.mission.model import Mission
from vfguide.mission.rehearsal import ArticleWind


def error_for_correction(correction: FloatArray, greatest: float, gain: float) -> FloatArray:
    """Error (m) at which the dual field gives a correction: tan(pi c / (2 c_inf)) / k; infinite beyond c_inf.

    Inverse of the article's c_inf (2/pi) atan(k e).

    Args:
        correction: c, rad of course or m/s of speed.
        greatest: c_inf, the field's correction far away, in the same unit.
        gain: k, 1/m.
    """
    share = np.abs(correction) / greatest
    inside = np.minimum(share, 1.0 - 1e-9)
    return np.where(share < 1.0, np.tan(math.pi / 2.0 * inside) / gain, np.inf)


def article_turn_error(mission: Mission, conditions: Conditions, slot: Slot[float]) -> float:
    """Mean steady error (m) of the article's field on the turns of the path; 0 on a line.

    A rigid slot moves with (V_l - omega g_y, omega g_x), the field aims at (V_l, 0): the difference in
    course and speed has to come from an error that never goes away.
    """
    turning = conditions.curvature != 0.0
    if not turning.any():
        return 0.0
    controller = mission.controller
    along, right = conditions.slot_velocity(mission.leader.airspeed_m_s, slot)
    extra_speed = np.hypot(along, right) - conditions.ground_speed(mission.leader.airspeed_m_s)
    lateral = error_for_correction(
        np.arctan2(right, along), math.radians(controller.chi_inf_deg), controller.k_y
    )
    ahead = error_for_correction(extra_speed, controller.v_inf_m_s, controller.k_x)
    return float(np.hypot(lateral, ahead)[turning].mean())


def wind_left_over(mission: Mission, vehicle: str) -> float:
    """Mean acceleration (m/s²) that changes of the declared wind cause and feed-forward does not remove.

    They reach a follower twice. The leader's ground speed changes with dw/dt; its estimate is fed forward, by
    a filter that is tau² d³w/dt³ wrong, and a loop period late. A heading-hold follower is moved by dw/dt
    itself, which is fed forward as late and 3 tau² d³w/dt³ wrong, or not at all.
    """
    if not isinstance(mission.wind, ArticleWind):
        return 0.0
    controller, period = mission.controller, 1.0 / mission.rehearsal.rate_hz
    rate, jerk, snap = article_wind_rates()
    left = controller.rate_filter_s**2 * snap + period * jerk
    if mission.vehicles[vehicle].plant == "heading-hold":
        wrong = 3.0 * controller.wind_filter_s**2 * snap + period * jerk
        left += wrong if controller.wind_feedforward else rate
    return left


def frame_error(mission: Mission, slot: Slot[float]) -> float:
    """How far (m) a slot is beside its place since the leader does not know its own course.

    The wind filter is tau³ d³w/dt³ wrong, the leader's ground velocity with it, and the slots turn with that;
    an equal share is taken to lie along and across the course.
    """
    if not isinstance(mission.wind, ArticleWind):
        return 0.0
    _, _, snap = article_wind_rates()
    wrong = mission.controller.wind_filter_s**3 * snap / math.sqrt(2.0)
    return wrong / mission.leader.airspeed_m_s * math.hypot(slot.forward, slot.right)


def article_wind_rates() -> tuple[float, float, float]:
    """Means of |dw/dt| (m/s²), |d²w/dt²| (m/s³), |d³w/dt³| (m/s⁴) of the article's wind over its period."""
    time = np.linspace(0.0, ARTICLE_WIND_PERIOD_S, 1000)
    step = float(time[1])
    means, derivatives = [], article_wind(time)
    for _ in range(3):
        north, east = (np.gradient(component, step, edge_order=2) for component in derivatives)
        derivatives = (north, east)
        means.append(float(np.hypot(north, east).mean()))
    return means[0], means[1], means[2]


def integral_share(slope: float, integral_s: float, frequency: float) -> float:
    """What the field's integral leaves of an error that swings: |jw (jw + s) / (s/T + s jw - w²)|, at most 1.

    Args:
        slope: s of the field, 1/s.
        integral_s: T, s; 0 learns nothing.
        frequency: w of the disturbance, rad/s.
    """
    if integral_s == 0.0:
        return 1.0
    left = frequency * math.hypot(frequency, slope)
    return min(left / math.hypot(slope / integral_s - frequency**2, slope * frequency), 1.0)


def wind_error(controller: Controller, acceleration: float, *, speed: float, layer: float) -> float:
    """Formation error (m) under an acceleration that nothing compensates.

    Inside the boundary layer the laws answer an error chi~ or V~ with kappa / epsilon of it, so the
    disturbance leaves chi~ = (a / V) epsilon / kappa and V~ = a epsilon / kappa, and the dual field turns
    those into distances: |y_E| <= tan(pi chi~ / (2 chi_inf)) / k_y. An equal share of the acceleration is
    taken to lie along and across the track. The integral learns some of it, at the frequency at which the
    wind's rate changes.

    Args:
        controller: the gains.
        acceleration: a, m/s².
        speed: of the vehicle, m/s.
        layer: effective boundary layer epsilon.
    """
    share = acceleration / math.sqrt(2.0)
    speed_error = np.asarray(share * layer / controller.kappa)
    lateral = error_for_correction(
        speed_error / speed, math.radians(controller.chi_inf_deg), controller.k_y
    )
    ahead = error_for_correction(speed_error, controller.v_inf_m_s, controller.k_x)
    if controller.type == "slot":
        rate, jerk, _ = article_wind_rates()
        across = field_slope(controller.k_y, math.radians(controller.chi_inf_deg)) * speed
        along = field_slope(controller.k_x, controller.v_inf_m_s)
        lateral = lateral * integral_share(across, controller.integral_s, jerk / rate)
        ahead = ahead * integral_share(along, controller.integral_s, jerk / rate)
    return float(np.hypot(lateral, ahead))


def predicted_mean_error(mission: Mission, conditions: Conditions) -> float:
    """Estimate of the mean formation error (m) over all followers in steady flight."""
    controller = mission.controller
    layer = effective_layer(controller, 1.0 / mission.rehearsal.rate_hz)
    airspeed = mission.leader.airspeed_m_s
    errors = []
    for follower in mission.followers:
        acceleration = wind_left_over(mission, follower.vehicle)
        error = wind_error(controller, acceleration, speed=airspeed, layer=layer)
        slot = Slot(forward=follower.slot.forward_m, right=follower.slot.right_m)
        error += frame_error(mission, slot)
        if controller.type == "article":
            error += article_turn_error(mission, conditions, slot)
        if not controller.predict_leader:
            error += airspeed * mean_leader_age(mission)
        errors.append(error)
    return sum(errors) / len(errors) if errors else 0.0


def precision(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """What precision to expect, against what the mission asks for."""
    if not mission.followers:
        return
    expected = predicted_mean_error(mission, conditions)
    asked = mission.acceptance.mean_error_m
    if math.isinf(expected):
        message = "on the turn the field cannot correct as much as the slots' own motion takes"
        yield Finding("warning", ("controller",), message, _remedy(mission))
        return
    amount = "under 0.01" if expected < 0.01 else f"about {expected:.2f}"
    message = (
        f"expect {amount} m of mean formation error in steady flight, before noise and model errors"
    )
    if asked is not None and expected > asked:
        message += f"; acceptance.mean_error_m is {asked:g}"
        yield Finding("warning", ("acceptance", "mean_error_m"), message, _remedy(mission))
    else:
        yield Finding("note", ("controller",), message)


def _remedy(mission: Mission) -> str:
    if mission.controller.type == "article":
        return "use controller type slot, which steers around the slots' own motion"
    return "raise rehearsal.rate_hz, k_x or k_y, or switch the feed-forwards on"
