"""Formation keeping by two PID controllers: a baseline for the fields.

Each controller holds one axis in the frame of the slot's motion and corrects the course, or the ground speed.
The slot's velocity and its rates are fed forward, so that only unknown disturbances are left for the
integrals. The derivative is the low-passed rate of the error from measured velocities. An integral stops
while its correction is at its limit and the error would push it further. It also stops while the vehicle's
limits cut the previous setpoint, and fades far from the slot as the field's does (conditional integration:
Astrom and Hagglund, Advanced PID Control, 2006, chapter 3).
"""

import math
from typing import Annotated, Any, Self

import msgspec
from msgspec.structs import replace
from pydantic import Field

from vfguide.elementwise import clip, low_pass
from vfguide.guidance.formation import nearness
from vfguide.guidance.response import Bandwidth
from vfguide.laws.base import DesiredMotion, Law, View, approach, law
from vfguide.mission import quantity
from vfguide.mission.quantity import Duration, NotNegative, Section


class PidGains(Section):
    """The baseline `pid`: a correction of course and speed on top of the slot's own motion.

    The defaults are what a search on the calm missions found (docs/benchmarks.md).
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

    max_course_deg: Annotated[quantity.Number, Field(ge=1.0, le=90.0)] = 45.0
    """Largest correction of the course, degrees."""

    max_speed_m_s: Annotated[quantity.Number, Field(ge=0.1, le=100.0)] = 8.0
    """Largest correction of the speed, m/s."""


class AxisMemory(msgspec.Struct, frozen=True, kw_only=True):
    """Memory of one controller."""

    integral: float
    """Integral part of the correction, rad or m/s."""
    rate: float
    """Low-passed rate of the error, m/s."""


class PidMemory(msgspec.Struct, frozen=True, kw_only=True):
    """Memory of both controllers."""

    lateral: AxisMemory
    """Memory of the course controller."""
    longitudinal: AxisMemory
    """Memory of the speed controller."""
    limited: bool
    """Whether the vehicle's limits cut the setpoint."""


def axis_step(
    error: float,
    error_rate: float,
    memory: AxisMemory,
    *,
    proportional: float,
    integral: float,
    derivative: float,
    filter_s: float,
    greatest: float,
    period: float,
    share: float,
    held: bool,
) -> tuple[float, AxisMemory]:
    """Return (correction, memory) of one controller: P e + integral of I e + D de/dt, within its limit.

    The correction u is rad of course or m/s of speed. The error e is in m; P, I and D are u per m, per m and
    s, and per m/s. `greatest` limits |u| and the integral part. `share`, 0 to 1, of the error is integrated,
    and nothing while the vehicle is at a limit (`held`): it would wind up. The filter of de/dt and the period
    are in s.
    """
    rate = low_pass(memory.rate, error_rate, period, filter_s)
    growth = integral * share * error * period
    wanted = proportional * error + memory.integral + growth + derivative * rate
    correction = clip(wanted, -greatest, greatest)
    pushes_on = wanted != correction and wanted * growth > 0.0
    grown = memory.integral if pushes_on or held else memory.integral + growth
    return correction, AxisMemory(integral=clip(grown, -greatest, greatest), rate=rate)


def slowed(
    gains: tuple[float, float, float], *, hold: float, scale: float, bandwidth: float
) -> tuple[float, float, float]:
    """Return (P, I, D) of a loop that is no faster than a bandwidth.

    `hold` is the hold's bandwidth and `bandwidth` the loop's largest natural frequency, 1/s; `scale` is the
    rate of the error per unit of correction, m/s.
    """
    proportional, integral, derivative = gains
    frequency = math.sqrt(hold * scale * proportional)
    if not frequency > bandwidth:
        return gains
    ratio = bandwidth / frequency
    damped = max(ratio * (1.0 + scale * derivative) - 1.0, 0.0) / scale
    return ratio**2 * proportional, ratio**3 * integral, damped


@law("pid")
class Pid(Law):
    """Two PID controllers, whose corrected course and speed are the demands on first-order holds."""

    Gains = PidGains

    def within(self, bandwidth: Bandwidth) -> Self:
        """Return both controllers slowed until neither is faster than the aircraft permits.

        Around a hold of bandwidth a the loop is e'' + a (1 + c D) e' + a c P e = 0, with c = V for the course
        and 1 for the speed. Slowed r times in time, P scales with r², I with r³ and 1 + c D with r.
        """
        bounded = super().within(bandwidth)
        gains, airframe = self.gains, self.airframe
        lateral = slowed(
            (gains.lateral_p_rad_m, gains.lateral_i_rad_m_s, gains.lateral_d_rad_s_m),
            hold=airframe.alpha,
            scale=airframe.cruise,
            bandwidth=bandwidth.course,
        )
        longitudinal = slowed(
            (gains.longitudinal_p_1_s, gains.longitudinal_i_1_s2, gains.longitudinal_d),
            hold=airframe.beta,
            scale=1.0,
            bandwidth=bandwidth.speed,
        )
        names = (
            "lateral_p_rad_m",
            "lateral_i_rad_m_s",
            "lateral_d_rad_s_m",
            "longitudinal_p_1_s",
            "longitudinal_i_1_s2",
            "longitudinal_d",
        )
        bounded.gains = gains.model_copy(
            update=dict(zip(names, (*lateral, *longitudinal), strict=True))
        )
        return bounded

    def start(self, view: View) -> PidMemory:
        """Return empty integrals, and rates that need not settle."""
        error = view.error
        return PidMemory(
            lateral=AxisMemory(integral=0.0, rate=error.cross_track_rate),
            longitudinal=AxisMemory(integral=0.0, rate=error.along_track_rate),
            limited=False,
        )

    def step(self, view: View, memory: PidMemory) -> tuple[DesiredMotion, PidMemory]:
        """Return the motion of both controllers."""
        gains, motion, error = self.gains, view.motion, view.error
        share = nearness(error)
        turn, lateral = axis_step(
            error.cross_track,
            error.cross_track_rate,
            memory.lateral,
            proportional=gains.lateral_p_rad_m,
            integral=gains.lateral_i_rad_m_s,
            derivative=gains.lateral_d_rad_s_m,
            filter_s=gains.derivative_filter_s,
            greatest=math.radians(gains.max_course_deg),
            period=view.period,
            share=share,
            held=memory.limited,
        )
        push, longitudinal = axis_step(
            error.along_track,
            error.along_track_rate,
            memory.longitudinal,
            proportional=gains.longitudinal_p_1_s,
            integral=gains.longitudinal_i_1_s2,
            derivative=gains.longitudinal_d,
            filter_s=gains.derivative_filter_s,
            greatest=gains.max_speed_m_s,
            period=view.period,
            share=share,
            held=memory.limited,
        )
        wanted = approach(
            view,
            course=motion.course + turn,
            speed=motion.speed + push,
            course_rate=motion.turn_rate,
            acceleration=motion.acceleration,
        )
        return wanted, replace(memory, lateral=lateral, longitudinal=longitudinal)

    def learn(self, view: View, memory: PidMemory, *, limited: bool) -> Any:  # noqa: ANN401 - of the law's own memory
        """Return the memory with the answer whether the integrals must stop in the next step."""
        del view
        return replace(memory, limited=limited)
