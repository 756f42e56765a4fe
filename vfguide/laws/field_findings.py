"""Before take-off: do the loops around a slot follow each other, each slower than the one inside it?

What `vfguide check` says of the field's gains. Nelson et al., Vector field path following for miniature air
vehicles, IEEE T-RO 2007, for how fast a field turns.

Before take-off: how precise will a formation be that the field keeps?

Estimates for steady flight of vehicles that answer as the article's do, in wind without turbulence, with
white noise on their positions. What a mission has beyond that makes it worse, and is named.
"""

import math
from collections.abc import Iterator

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.formation import Slot, field_slope
from vfguide.guidance.limits import bank_limited_turn_rate
from vfguide.guidance.slot_integral import learning_growth
from vfguide.laws.field import FieldGains, SlotGains
from vfguide.mission.conditions import ARTICLE_WIND_PERIOD_S, Conditions, article_wind
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


def article_turn_error(
    mission: Mission, conditions: Conditions, gains: FieldGains, slot: Slot[float]
) -> float:
    """Mean steady error (m) of the article's field on the turns of the path; 0 on a line.

    A rigid slot moves with (V_l - omega g_y, omega g_x), the field aims at (V_l, 0): the difference in
    course and speed has to come from an error that never goes away.
    """
    turning = conditions.curvature != 0.0
    if not turning.any():
        return 0.0
    along, right = conditions.slot_velocity(mission.leader.airspeed_m_s, slot)
    extra_speed = np.hypot(along, right) - conditions.ground_speed(mission.leader.airspeed_m_s)
    lateral = error_for_correction(np.arctan2(right, along), gains.chi_inf, gains.k_y)
    ahead = error_for_correction(extra_speed, gains.v_inf_m_s, gains.k_x)
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


def noise_error(mission: Mission) -> float:
    """Mean distance (m) from the slot by white noise of reported positions, the follower's and the leader's.

    The position filter leans on each report with g = dt / (tau + dt) and so passes g / (2 - g) of the
    variance; of two equal normal errors on each axis the mean distance is sqrt(pi / 2) deviations.
    """
    period = 1.0 / mission.rehearsal.rate_hz
    lean = period / (mission.controller.position_filter_s + period)
    deviation = mission.rehearsal.position_noise_m * math.sqrt(2.0 * lean / (2.0 - lean))
    return deviation * math.sqrt(math.pi / 2.0)


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


def wind_error(
    gains: FieldGains, acceleration: float, *, speed: float, layer: float, kappa: float
) -> float:
    """Formation error (m) under an acceleration that nothing compensates.

    Inside the boundary layer the laws answer an error chi~ or V~ with kappa / epsilon of it, so the
    disturbance leaves chi~ = (a / V) epsilon / kappa and V~ = a epsilon / kappa, and the dual field turns
    those into distances: |y_E| <= tan(pi chi~ / (2 chi_inf)) / k_y. An equal share of the acceleration is
    taken to lie along and across the track. The integral learns some of it, at the frequency at which the
    wind's rate changes.

    Args:
        gains: of the field.
        acceleration: a, m/s².
        speed: of the vehicle, m/s.
        layer: effective boundary layer epsilon.
        kappa: of the sliding-mode laws.
    """
    share = acceleration / math.sqrt(2.0)
    speed_error = np.asarray(share * layer / kappa)
    lateral = error_for_correction(speed_error / speed, gains.chi_inf, gains.k_y)
    ahead = error_for_correction(speed_error, gains.v_inf_m_s, gains.k_x)
    if isinstance(gains, SlotGains):
        rate, jerk, _ = article_wind_rates()
        across = field_slope(gains.k_y, gains.chi_inf) * speed
        along = field_slope(gains.k_x, gains.v_inf_m_s)
        lateral = lateral * integral_share(across, gains.integral_s, jerk / rate)
        ahead = ahead * integral_share(along, gains.integral_s, jerk / rate)
    return float(np.hypot(lateral, ahead))


def predicted_mean_error(mission: Mission, conditions: Conditions, gains: FieldGains) -> float:
    """Estimate of the mean formation error (m) over all followers in steady flight."""
    controller = mission.controller
    layer = effective_layer(controller, 1.0 / mission.rehearsal.rate_hz)
    airspeed = mission.leader.airspeed_m_s
    errors = []
    for follower in mission.followers:
        acceleration = wind_left_over(mission, follower.vehicle)
        error = wind_error(gains, acceleration, speed=airspeed, layer=layer, kappa=controller.kappa)
        slot = Slot(forward=follower.slot.forward_m, right=follower.slot.right_m)
        error += frame_error(mission, slot) + noise_error(mission)
        if not isinstance(gains, SlotGains):
            error += article_turn_error(mission, conditions, gains, slot)
        if not controller.predict_leader:
            error += airspeed * mean_leader_age(mission)
        errors.append(error)
    return sum(errors) / len(errors) if errors else 0.0


def beyond_the_estimate(mission: Mission) -> list[str]:
    """What a mission declares that the estimate does not include, in words."""
    rehearsal, wind = mission.rehearsal, mission.wind
    vehicles, emulator = mission.vehicles.values(), rehearsal.emulator
    delays = ("course_dead_time_s", "course_lag_s", "speed_dead_time_s", "speed_lag_s")
    answers_late = any(
        one.slips or one.speed_hold != "first-order" or any(getattr(one, name) for name in delays)
        for one in vehicles
    )
    plain = {"plant": None, "speed_response": "first-order", "course_dead_time_s": 0.0}
    another = any(getattr(emulator, name) != usual for name, usual in plain.items())
    named = {
        "vehicles that answer late or slip": answers_late,
        "responses measured in flight": any(one.response == "auto" for one in vehicles),
        "emulated autopilots that answer in another way than declared": another,
        f"{wind.turbulence} turbulence": wind.turbulence != "none",
        "gusts": bool(wind.gusts),
        f"sensors of grade {rehearsal.sensors}": rehearsal.sensors != "ideal",
        "losses or jitter on the link": rehearsal.link_loss > 0.0 or rehearsal.link_jitter_s > 0.0,
    }
    return [words for words, present in named.items() if present]


def precision(mission: Mission, conditions: Conditions, gains: FieldGains) -> Iterator[Finding]:
    """What precision to expect, against what the mission asks for."""
    expected = predicted_mean_error(mission, conditions, gains)
    asked = mission.acceptance.mean_error_m
    if math.isinf(expected):
        message = "on the turn the field cannot correct as much as the slots' own motion takes"
        yield Finding("warning", ("controller",), message, _remedy(mission))
        return
    amount = "0.01 m or less" if expected < 0.01 else f"about {expected:.2f} m"
    beyond = beyond_the_estimate(mission)
    if beyond:
        message = (
            f"mean formation error in steady flight: {amount} if there were no {', no '.join(beyond)}; "
            "how much more it is with that, `vfguide fly` shows"
        )
    else:
        message = (
            f"expect {amount} of mean formation error in steady flight, in the declared wind and with "
            "vehicles that answer as declared; a real aircraft, its sensors and gusts add to it"
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


LEAST_DAMPING = 0.5
"""Of the integral's loop; less, and a follower swings through its slot."""


def field_findings(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Everything that is known about a field's gains on a mission; after an error nothing else matters."""
    for check in (
        field_beyond_bank,
        fields_beyond_the_loop,
        integral_too_fast,
        precision,
    ):
        found = list(check(mission, conditions, gains))
        yield from found
        if any(one.severity == "error" for one in found):
            return


def field_pulls(gains: FieldGains, speed: float) -> tuple[float, float]:
    """(along, across) how fast the field draws onto the slot, 1/s, at a speed over ground (m/s)."""
    across = field_slope(gains.k_y, gains.chi_inf) * speed
    return field_slope(gains.k_x, gains.v_inf_m_s), across


def told_apart(first: float, second: float) -> tuple[str, str]:
    """Two numbers with as many digits, one after the point at least, as it takes to tell them apart."""
    for digits in range(1, 4):
        texts = f"{first:.{digits}f}", f"{second:.{digits}f}"
        if texts[0] != texts[1]:
            break
    return texts


def law_pull(mission: Mission) -> float:
    """How fast the laws answer an error of course or speed: kappa / epsilon, 1/s."""
    controller = mission.controller
    return controller.kappa / effective_layer(controller, 1.0 / mission.rehearsal.rate_hz)


def integral_damping(slope: float, integral_s: float) -> float:
    """Damping sqrt(s T) / 2 of a field with this slope (1/s) that learns in this time (s)."""
    return math.sqrt(slope * integral_s) / 2.0


def fields_beyond_the_loop(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Followers' fields that pull faster than the laws beneath them follow: the two then swing."""
    followed = law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).max())
    along, across = field_pulls(gains, speed)
    for name, gain, pull in (("k_y", gains.k_y, across), ("k_x", gains.k_x, along)):
        if pull <= followed:
            continue
        pulls, follows = told_apart(pull, followed)
        message = (
            f"near its slot the field pulls at {pulls} 1/s, "
            f"faster than the {follows} 1/s at which the law follows: the formation swings"
        )
        most = math.floor(1000.0 * gain * followed / pull) / 1000.0
        yield Finding(
            "warning", ("controller", name), message, f"lower {name} to {most:g} 1/m or less"
        )


def integral_too_fast(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """An integral that learns faster than the field beneath it moves: the follower swings, or worse.

    With the law's answer g the loop is e'''/g + e'' + s e' + (s/T) e = 0, stable where T > 1/g (Routh); in a
    turn, where harmonics are learned beside the mean, T counts as so much shorter.
    """
    if not isinstance(gains, SlotGains) or gains.integral_s == 0.0:
        return
    location = ("controller", "integral_s")
    turn_rate = float(abs(conditions.turn_rate(mission.leader.airspeed_m_s)).max())
    shortest = learning_growth(turn_rate, gains.integral_s) / law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).min())
    slope = min(field_pulls(gains, speed))
    usual = math.ceil(10.0 * (2.0 * LEAST_DAMPING) ** 2 / slope) / 10.0
    remedy = f"set it to {max(usual, math.ceil(10.0 * shortest) / 10.0):g} s or more, or to 0"
    if gains.integral_s <= shortest:
        message = (
            f"the field learns in {gains.integral_s:g} s, which the law beneath it follows from "
            f"{shortest:.2f} s on: followers swing ever wider"
        )
        yield Finding("error", location, message, remedy)
    elif (damping := integral_damping(slope, gains.integral_s)) < LEAST_DAMPING:
        message = (
            f"the field learns in {gains.integral_s:g} s and draws onto the slot at "
            f"{slope:.1f} 1/s: a damping of {damping:.2f}, followers swing through their slots"
        )
        yield Finding("warning", location, message, remedy)


def course_field_turn_rate(gain: float, ground_speed: float, greatest: float) -> float:
    """Greatest turn rate (rad/s) of a course field: max of c (2/pi) k V sin(c (2/pi) atan u) / (1 + u^2).

    Unlike `turn_limits.field_turn_rate` also exact for corrections c far below a quarter turn, by looking
    for the greatest value over u = k e.

    Args:
        gain: k, 1/m.
        ground_speed: V, m/s.
        greatest: c, rad.
    """
    share = greatest * (2.0 / math.pi)
    scaled = np.linspace(0.0, 3.0, 301)
    shape = np.sin(share * np.arctan(scaled)) / (1.0 + scaled * scaled)
    return share * gain * ground_speed * float(shape.max())


def field_beyond_bank(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """A followers' course field that turns faster than one of them can, on its slot's speed and turn.

    It is the same field as the one around a path, with k_y and the followers' chi_inf. Worth a note only:
    its setpoint is limited while it joins, and near the slot the field asks for less.
    """
    airspeed = mission.leader.airspeed_m_s
    turn = float(np.abs(conditions.turn_rate(airspeed)).max())
    for follower in mission.followers:
        name, offset = follower.vehicle, follower.slot
        slot = Slot(forward=offset.forward_m, right=offset.right_m)
        speed = float(np.hypot(*conditions.slot_velocity(airspeed, slot)).max())
        allowed = bank_limited_turn_rate(math.radians(mission.vehicles[name].max_bank_deg), speed)
        needed = turn + course_field_turn_rate(gains.k_y, speed, gains.chi_inf)
        if needed > allowed:
            message = (
                f"joining its slot, '{name}' is asked to turn at up to {needed:.2f} rad/s at "
                f"{speed:.1f} m/s over ground; its bank gives {allowed:.2f}, so it joins less sharply"
            )
            yield Finding("note", ("controller", "k_y"), message)
            return
