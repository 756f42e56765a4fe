"""How an autopilot answered on a flight that was flown for another purpose, and how sure that is.

Nobody has stepped courses and speeds: the setpoints of the flight have to do, and where they hardly changed
nothing can be told.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.identification.fit import (
    Model,
    Response,
    Samples,
    course_response,
    fit_response,
    mean_setpoint,
    smoothed,
    speed_response,
)
from vfguide.identification.profile import response_lines, slip_line
from vfguide.identification.slip import Slip
from vfguide.record.vehicle import VehicleRecord
from vfguide.state import Airframe

LONGEST_S = 240.0
"""s of flight that are fitted: more takes minutes, and says little more."""

LEAST_S = 20.0
"""Less says nothing."""

FITTED_HZ = 10.0
"""Samples a second that are fitted: responses take longer than a tenth of a second."""

FORGOTTEN_S = 5.0
"""s at the beginning that are not fitted: the vehicle was on its way to something that is not known."""

MODEL_SHARE = 0.15
"""By which a bandwidth is uncertain at least: a steady turn shows only the sum of its inverse and the dead
time, and no autopilot is quite of the model's kind. ArduPlane's alpha is 0.72 1/s by long steps and 0.78 to
0.84 by steady turns."""

OTHER_SHARES = (-0.6, -0.4, -0.25, -0.15, 0.15, 0.25, 0.4)
"""Of the bandwidth's inverse: what a dead time might be longer by in its place."""

OTHER_LAGS_S = (0.0, 0.2, 0.4)
"""s: what a lag might be in place of as much dead time."""

AS_GOOD = 2.0
"""What leaves up to so many times as much explains a flight nearly as well: PX4's 0.9 1/s leaves 1.1 to 2
times what 1.3 to 1.4 1/s with a dead time of 0.45 s leave of a circle."""

DOUBT = 5.0
"""Times the share of the motion that the model leaves unexplained by which its bandwidth is uncertain: with a
twenty-fifth of it unexplained nothing is known well. ArduPlane's answer to small changes of speed is such."""

MOST_DOUBT = 0.6
"""Share of a bandwidth: a wider interval is reported as no answer."""

LEAST_DOUBT = 1.0 / 6.0
"""Share of a bandwidth: a narrower interval counts as known well. ArduPlane's 0.95 (0.78 to 1.12) of a circle
is not: long steps show 0.72."""

WIND_S = 1.0
"""The wind is the mean over so long: a log knows it at each moment, and it may swing within seconds."""

LEAST_TURN = 0.1
"""rad: courses that were asked for have to change by so much..."""

LEAST_CHANGE = 0.7
"""m/s: ... and speeds by so much, from the greatest to the least, for anything to be told."""

Loop = Literal["course", "speed"]

BANDWIDTHS: dict[Loop, str] = {"course": "alpha_1_s", "speed": "beta_1_s"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """How one loop of one vehicle answered."""

    vehicle: str
    """Name of the vehicle."""
    loop: Loop
    """Which."""
    response: Response | None
    """None where nothing can be told."""
    why: str
    """Why nothing can be told; empty where something can."""
    mission: float
    """Bandwidth in the mission, 1/s."""

    @property
    def good(self) -> bool:
        """Whether it is known well enough to be flown by; without steps that takes more than with them."""
        if self.response is None:
            return False
        bandwidth = self.response.bandwidth
        return bandwidth.half_width < LEAST_DOUBT * bandwidth.value


def flown_responses(
    time_s: FloatArray,
    vehicle: VehicleRecord,
    guided: BoolArray,
    airframe: Airframe,
    setpoints: FloatArray,
) -> tuple[Answer, Answer]:
    """How course and speed of a vehicle answered to their setpoints.

    Args:
        time_s: of the samples, s, evenly apart.
        vehicle: what it did.
        guided: whether setpoints were flown, one for each sample.
        airframe: what the mission says of it.
        setpoints: rows of when each went out (s), course in rad and airspeed in m/s. Those of the samples are
            up to a step later, and half a step of 0.05 s is 4 % of alpha.
    """
    stretch = fitted_stretch(time_s, vehicle, guided)
    return (
        loop_answer("course", time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints),
        loop_answer("speed", time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints),
    )


def fitted_stretch(time_s: FloatArray, vehicle: VehicleRecord, guided: BoolArray) -> slice:
    """The beginning of the longest guided stretch of which everything is known; samples FITTED_HZ apart."""
    known = guided.copy()
    for values in (
        vehicle.heading_rad,
        vehicle.course_rad,
        vehicle.airspeed_m_s,
        vehicle.wind_north_m_s,
        vehicle.wind_east_m_s,
        vehicle.course_setpoint_rad,
        vehicle.airspeed_setpoint_m_s,
    ):
        known &= np.isfinite(values)
    return evenly(time_s, *longest_run(known), LONGEST_S)


def longest_run(known: BoolArray) -> tuple[int, int]:
    """Where the longest run of what is true begins and ends; (0, 0) without any."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], known.astype(np.int8), [0]))))
    begins, ends = edges[::2], edges[1::2]
    if not len(begins):
        return 0, 0
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]), int(ends[longest])


def evenly(time_s: FloatArray, begin: int, end: int, longest_s: float) -> slice:
    """Samples of a run, FITTED_HZ apart, for so long at most (s)."""
    if end <= begin or len(time_s) < 2:
        return slice(0, 0)
    rate = (len(time_s) - 1) / float(time_s[-1] - time_s[0])
    return slice(begin, min(end, begin + round(longest_s * rate)), max(1, round(rate / FITTED_HZ)))


def loop_answer(
    loop: Loop,
    time_s: FloatArray,
    vehicle: VehicleRecord,
    stretch: slice,
    *,
    airframe: Airframe,
    setpoints: FloatArray,
) -> Answer:
    """How one loop answered on a stretch, or why that cannot be told."""
    mission = airframe.alpha if loop == "course" else airframe.beta
    response, why = None, unknown_because(loop, time_s, vehicle, stretch)
    if not why:
        samples = samples_of(loop, time_s, vehicle, stretch, airframe=airframe, setpoints=setpoints)
        model = course_response if loop == "course" else speed_response
        seen = samples.direction if loop == "course" else samples.speed
        skipped = forgotten(samples)
        response = fit_response(
            lambda values: model(samples, values, airframe)[skipped:], seen[skipped:]
        )
        response = with_doubt(
            response, lambda values: model(samples, values, airframe)[skipped:], seen[skipped:]
        )
        if response.bandwidth.half_width > MOST_DOUBT * response.bandwidth.value:
            response, why = None, "quite other values explain this flight as well"
    return Answer(vehicle=vehicle.name, loop=loop, response=response, why=why, mission=mission)


def with_doubt(response: Response, model: Model, seen: FloatArray) -> Response:
    """The same, its bandwidth no surer than a flight without steps can tell.

    Slow changes show the sum of the bandwidth's inverse, dead time and lag, and hardly which of them it is: a
    bandwidth with others of them that explains the flight nearly as well is within the interval.
    """
    known, late, lag = response.bandwidth, response.dead_time.value, response.lag.value
    unexplained = response.residual / max(float(np.std(seen)), response.residual, 1e-9)
    widest = math.hypot(known.half_width, max(MODEL_SHARE, DOUBT * unexplained) * known.value)
    for share, other_lag in product(OTHER_SHARES, {lag, *OTHER_LAGS_S}):
        other = known.value / (1.0 - share)
        dead_time = late + share / known.value + lag - other_lag
        if dead_time < 0.0:
            continue
        rest = seen - model((other, dead_time, other_lag))
        if math.sqrt(float(rest @ rest) / len(rest)) < AS_GOOD * response.residual:
            widest = max(widest, abs(other - known.value))
    return replace(response, bandwidth=replace(known, half_width=widest))


def unknown_because(loop: Loop, time_s: FloatArray, vehicle: VehicleRecord, stretch: slice) -> str:
    """Why nothing can be told of a loop; empty where something can."""
    lasts_s = float(np.ptp(time_s[stretch])) if len(time_s[stretch]) else 0.0
    if lasts_s == 0.0:
        return "the record holds no setpoints of it with their answers"
    if lasts_s < LEAST_S:
        return f"{lasts_s:.0f} s of setpoints and answers are too short"
    told = vehicle.course_setpoint_rad if loop == "course" else vehicle.airspeed_setpoint_m_s
    asked = told[stretch]
    if loop == "course" and float(np.ptp(np.unwrap(asked))) < LEAST_TURN:
        return "hardly any other course was asked for"
    if loop == "speed" and float(np.ptp(asked)) < LEAST_CHANGE:
        return "hardly any other speed was asked for"
    return ""


def samples_of(
    loop: Loop,
    time_s: FloatArray,
    vehicle: VehicleRecord,
    stretch: slice,
    *,
    airframe: Airframe,
    setpoints: FloatArray,
) -> Samples:
    """What was asked for and what was seen on a stretch."""
    ground = airframe.hold == "course-hold"
    times = time_s[stretch]
    calm = np.zeros(len(times))
    north = calm if ground else smoothed(times, vehicle.wind_north_m_s[stretch], WIND_S)
    east = calm if ground else smoothed(times, vehicle.wind_east_m_s[stretch], WIND_S)
    course = loop == "course"
    # From the one that holds at the first sample on.
    known = setpoints[np.all(np.isfinite(setpoints), axis=1)]
    first = max(int(np.searchsorted(known[:, 0], times[0], side="right")) - 1, 0)
    asked = known[first : int(np.searchsorted(known[:, 0], times[-1], side="right"))]
    told = asked[:, 1 if course else 2]
    samples = Samples(
        time_s=times,
        direction=np.unwrap((vehicle.course_rad if ground else vehicle.heading_rad)[stretch]),
        speed=(vehicle.ground_speed_m_s if ground else vehicle.airspeed_m_s)[stretch],
        wind_north=north,
        wind_east=east,
        setpoint_s=asked[:, 0],
        setpoint=np.unwrap(told) if course else told,
    )
    return samples if course else rescaled(samples)


def forgotten(samples: Samples) -> int:
    """How many samples at the beginning are not fitted."""
    return int(np.searchsorted(samples.time_s, samples.time_s[0] + FORGOTTEN_S))


def rescaled(samples: Samples) -> Samples:
    """The same, with speeds that were asked for on the scale of those that were seen: sensors are off."""
    apart = samples.speed[1:] - mean_setpoint(samples, 0.0)
    return replace(
        samples, setpoint=samples.setpoint + float(np.median(apart[forgotten(samples) :]))
    )


def answer_sentence(answer: Answer) -> str:
    """What was found of one loop, in words."""
    head = f"{answer.vehicle}: {answer.loop}"
    remedy = "fly `vfguide identify` to know it"
    if answer.response is None:
        return f"{head}: cannot be told, {answer.why}; {remedy}"
    bandwidth, dead_time = answer.response.bandwidth, answer.response.dead_time
    name = "alpha" if answer.loop == "course" else "beta"
    low, high = bandwidth.value - bandwidth.half_width, bandwidth.value + bandwidth.half_width
    found = (
        f"{head}: {name} {bandwidth.value:.2f} 1/s, probably within {max(low, 0.0):.2f} to {high:.2f},"
        f" {dead_time.value:.2f} s late (+- {dead_time.half_width:.2f})"
    )
    if not answer.good:
        return f"{found}: not known well enough to fly by; {remedy}"
    if low <= answer.mission <= high:
        return f"{found}: known well; the mission's {answer.mission:.2f} fits"
    return f"{found}: known well; the mission says {answer.mission:.2f}"


def flown_profile(answers: Sequence[Answer], slips: Mapping[str, Slip]) -> str:
    """The fields that are known well, as YAML to be put under each vehicle's name in `vehicles`.

    Args:
        answers: of all loops of all vehicles.
        slips: by vehicle, of those of whom it is known.
    """
    lines: list[str] = []
    for name in dict.fromkeys((*(answer.vehicle for answer in answers), *slips)):
        known = [one for one in answers if one.vehicle == name and one.good]
        if known or name in slips:
            lines.append(f"{name}:  # +- is for 95 %")
        for one in known:
            if one.response is not None:
                lines += response_lines(one.response, BANDWIDTHS[one.loop], one.loop)
        if name in slips:
            lines.append(slip_line(slips[name]))
    return "\n".join(lines)
