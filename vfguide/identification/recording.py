"""Steps of an identification flight, their recording and the responses learned from it.

The whole flight is given to the model by which companions learn: `guidance.response` finds the response
among a grid of hypotheses. The same data are then learned again, with a finer grid around the best of the
pass before. The bounds are those of the first finer pass, which is wide enough. Missing results are reported
in one line with reason and remedy.
"""

import math
from dataclasses import dataclass, field
from enum import Enum
from itertools import pairwise

import msgspec
import numpy as np
from msgspec.structs import replace

from vfguide.companion.learned_response import LEAST_EXPLAINED
from vfguide.elementwise import FloatArray, clip
from vfguide.guidance.airframe import (
    bank_limited_turn_rate,
    coordinated_turn_rate,
    held_direction,
    held_speed,
)
from vfguide.guidance.response import COURSE, SPEED, HoldKind, HoldLearner, HoldResponse
from vfguide.identification.slip import Banks, Slip
from vfguide.record.archive import IntegerArray
from vfguide.state import Airframe, VehicleState

FINER = ((0.1, 1.1), (0.03, 1.03), (0.01, 1.01))
"""(Step between delays in s, factor between gains) of each pass after the first."""

SPEED_EXPLAINED = 0.9
"""Minimum explained share of a speed's motion. A total-energy hold is not of first order: its pitch responds
at once and its throttle later. ArduPlane's on a circle reaches 0.87."""

SETTLED_S = 1.0
"""Straight flight before the measured steps that is included, s."""

MODEL_SHARE, NOISE_SHARE = 0.02, 1.0 / 3.0
"""Share of the motion that no hypothesis explains, and factor on a companion's noise, since a whole flight
shows more than a few seconds."""


NO_OFFSET_S, ANY_OFFSET_S = 1e6, 1e-3
"""Evidence for no offset, s: courses have no offset, airspeed sensors do."""


FORGOTTEN_S = 2.0
"""Ignored time at the beginning, s, when the vehicle still followed an unknown setpoint."""


class HoldSamples(msgspec.Struct, frozen=True, kw_only=True):
    """Setpoints and measurements of one hold on a stretch of a flight."""

    time_s: FloatArray
    """Times of the reports, s."""
    value: FloatArray
    """Held value: course, rad, or speed, m/s."""
    limit: FloatArray
    """Maximum rate of the held value at each report, rad/s or m/s²."""
    setpoint_s: FloatArray
    """Times of the setpoints, s; the first precedes the first report."""
    setpoint: FloatArray
    """Setpoints: course, unwrapped, rad, or speed, m/s."""
    turned: FloatArray | None = None
    """Direction that is turned to change the course, heading or course, unwrapped, rad; None for a speed."""

    @property
    def seen(self) -> FloatArray:
        """Value that the autopilot changes: the direction, or the speed."""
        return self.value if self.turned is None else self.turned


def turn_limits(airframe: Airframe, speed: FloatArray) -> FloatArray:
    """Return the maximum turn rate (rad/s) at each speed (m/s)."""
    slowest = np.maximum(speed, 1.0)
    return np.array([coordinated_turn_rate(airframe.max_bank, one) for one in slowest.tolist()])


def as_seen(samples: HoldSamples) -> HoldSamples:
    """Return the samples with setpoints on the scale of the measurement.

    Setpoints are indicated airspeeds, measurements are true ones, and sensors have offsets.
    """
    off = float(np.median(samples.value - samples.setpoint[held_at(samples, samples.time_s)]))
    return replace(samples, setpoint=samples.setpoint + off)


def held_at(samples: HoldSamples, time_s: FloatArray) -> IntegerArray:
    """Return the indices of the setpoints active at some times; 0 before the first."""
    return np.maximum(np.searchsorted(samples.setpoint_s, time_s, side="right") - 1, 0)


def response_in(samples: HoldSamples) -> HoldResponse | None:
    """Return the response of a hold, or None if no hypothesis explains its motion."""
    by_course = samples.turned is not None
    usual = COURSE if by_course else SPEED
    kind = replace(
        usual,
        memory_s=math.inf,
        model_share=MODEL_SHARE,
        settled_s=FORGOTTEN_S,
        noise=NOISE_SHARE * usual.noise,
        offset_prior_s=NO_OFFSET_S if by_course else ANY_OFFSET_S,
    )
    best = learned(kind, samples)
    bounds = None
    for step_s, factor in FINER:
        if best is None or best.explained < (LEAST_EXPLAINED if by_course else SPEED_EXPLAINED):
            return None
        best = learned(kind.around(best, step_s, factor), samples)
        bounds = bounds or best
    if best is None or bounds is None:
        return None
    return replace(
        bounds,
        gain=best.gain,
        least=min(bounds.least, best.gain),
        greatest=max(bounds.greatest, best.gain),
        dead_time=best.dead_time,
        lag=best.lag,
        earliest=min(bounds.earliest, best.late),
        latest=max(bounds.latest, best.late),
        explained=best.explained,
    )


def learned(kind: HoldKind, samples: HoldSamples) -> HoldResponse | None:
    """Return the response that a learner with these hypotheses finds on a stretch."""
    learner = HoldLearner(kind)
    sent = zip(samples.setpoint_s.tolist(), samples.setpoint.tolist(), strict=True)
    waiting = next(sent, None)
    turned = samples.turned
    directions = [None] * len(samples.time_s) if turned is None else turned.tolist()
    rows = zip(
        *(values.tolist() for values in (samples.time_s, samples.value, samples.limit)),
        directions,
        strict=True,
    )
    for now, value, limit, direction in rows:
        while waiting is not None and waiting[0] <= now:
            learner.note(waiting[1], waiting[0])
            waiting = next(sent, None)
        learner.observe(now, value, None, limit=limit, angle=turned is not None, turned=direction)
    return learner.response()


def followed(samples: HoldSamples, found: HoldResponse) -> FloatArray:
    """Simulate a response to the setpoints: directions (rad) or speeds (m/s)."""
    targets = samples.setpoint[held_at(samples, samples.time_s - found.dead_time)].tolist()
    # The held course and the turned heading differ by the wind drift.
    drift = (samples.value - samples.seen).tolist()
    value, rate, values = float(samples.seen[0]), 0.0, [float(samples.seen[0])]
    for number, (before, now) in enumerate(pairwise(samples.time_s.tolist())):
        error = targets[number] - value - drift[number]
        if samples.turned is not None:
            error = math.remainder(error, math.tau)
        limit = float(samples.limit[number])
        wanted = clip(found.gain * error, -limit, limit)
        kept = math.exp(-(now - before) / found.lag) if found.lag > 0.0 else 0.0
        rate = wanted + kept * (rate - wanted)
        value += (now - before) * rate
        values.append(value)
    return np.array(values)


COURSE_STEP = math.radians(15.0)
"""Maximum step of the course, rad."""

SPEED_STEP = 2.0
"""Maximum step of the airspeed, m/s."""

LIMIT_SHARE = 0.6
"""Share of the turn rate and acceleration limits that steps may use: nothing is learned at a limit."""

SPEED_MARGIN = 0.5
"""Distance from the ends of the airspeed range, m/s."""

COURSE_HOLDS_S = (6.0, 5.0, 7.0, 5.5)
SPEED_HOLDS_S = (10.0, 9.0, 11.0, 9.5)
"""Durations of the steps of a group, s; different, so that they hide no periodic motion."""

SETTLE_S = 8.0
"""Straight flight before measurements, s."""

TURN_S = 14.0
"""Duration of each half of the turn back, s."""

LEAST_REPORTS = 100
"""Minimum number of reports for an identification."""

UNSEEN = (
    "too few reports of its steps, or what it did is no answer to them; see that telemetry comes at"
    " rehearsal.rate_hz, and that the air is calm"
)
"""Why a hold is unknown."""

KNOWN_SHARE = 0.2
"""Relative uncertainty below which a bandwidth is known well."""


class Phase(Enum):
    """Purpose of a segment."""

    SETTLE = "settle"
    """Straight flight or turn without measurement."""
    COURSE = "course"
    SPEED = "speed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A setpoint that is held for a while."""

    phase: Phase
    course: float
    """Course relative to the first course, rad."""
    speed: float
    """Airspeed or ground speed, whichever the vehicle holds, m/s."""
    duration_s: float


def course_step(airframe: Airframe) -> float:
    """Return a step of the course (rad) that stays clear of the bank limit."""
    greatest = bank_limited_turn_rate(airframe.max_bank, airframe.cruise)
    return min(COURSE_STEP, LIMIT_SHARE * greatest / airframe.alpha)


def speed_step(airframe: Airframe) -> float:
    """Return an airspeed step (m/s) that stays clear of the acceleration limit and the airspeed range."""
    room = min(airframe.airspeed_max - airframe.cruise, airframe.cruise - airframe.airspeed_min)
    by_limit = LIMIT_SHARE * airframe.max_acceleration / airframe.beta
    return max(min(SPEED_STEP, room - SPEED_MARGIN, by_limit), 0.0)


def segments(airframe: Airframe, repeats: int) -> list[Segment]:
    """Return the flight: out with course steps, a turn, and back with speed steps.

    It is flown at the airframe's cruise, with each group of steps flown `repeats` times.
    """
    cruise, back = airframe.cruise, math.pi
    turn, push = course_step(airframe), speed_step(airframe)

    def straight(course: float, duration_s: float) -> Segment:
        return Segment(phase=Phase.SETTLE, course=course, speed=cruise, duration_s=duration_s)

    steps = [straight(0.0, SETTLE_S)]
    for _ in range(repeats):
        for share, hold_s in zip((1.0, 0.0, -1.0, 0.0), COURSE_HOLDS_S, strict=True):
            steps.append(
                Segment(phase=Phase.COURSE, course=share * turn, speed=cruise, duration_s=hold_s)
            )
    steps += [straight(back / 2.0, TURN_S), straight(back, TURN_S), straight(back, SETTLE_S)]
    for _ in range(repeats):
        for share, hold_s in zip((1.0, 0.0, -1.0, 0.0), SPEED_HOLDS_S, strict=True):
            speed = cruise + share * push
            steps.append(Segment(phase=Phase.SPEED, course=back, speed=speed, duration_s=hold_s))
    return steps


def described(airframe: Airframe, repeats: int) -> list[str]:
    """Describe the flight for the crew, which has to clear the sky for it."""
    flown = segments(airframe, repeats)
    course_s = sum(one.duration_s for one in flown if one.phase is Phase.COURSE)
    speed_s = sum(one.duration_s for one in flown if one.phase is Phase.SPEED)
    total_s = sum(one.duration_s for one in flown)
    out_m = (SETTLE_S + course_s) * airframe.cruise
    back_m = (SETTLE_S + speed_s) * airframe.cruise
    return [
        (
            f"steps of {math.degrees(course_step(airframe)):.0f} degrees either way of the present course,"
            f" {course_s:.0f} s at {airframe.cruise:g} m/s"
        ),
        f"a turn to the right, back along the way it came, {2.0 * TURN_S:.0f} s",
        f"steps of {speed_step(airframe):.1f} m/s either way, {speed_s:.0f} s",
        (
            f"{total_s:.0f} s in all; keep {out_m:.0f} m ahead, {max(back_m - out_m, 0.0):.0f} m behind and"
            " 300 m to the right clear, and more in wind"
        ),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """Findings of a flight."""

    course: HoldResponse | None
    """Course response; None with too few reports."""
    course_samples: HoldSamples | None
    """Data of the course response."""
    speed: HoldResponse | None
    """Speed response; None with too few reports, or without room for steps."""
    speed_samples: HoldSamples | None
    """Data of the speed response."""
    slip: Slip | None = None
    """Slip; None if the autopilot reported no banks, or turned too little."""


@dataclass(slots=True)
class StepsRecording:
    """Recording of an identification flight."""

    airframe: Airframe
    """Limits of the vehicle, and type of its holds."""
    reports: list[tuple[VehicleState, Phase]] = field(default_factory=list)
    """Every navigated state, with the phase flown at that time."""
    setpoints: list[tuple[float, float, float]] = field(default_factory=list)
    """Time (s), course (rad) and speed (m/s) of every changed setpoint."""
    banks: Banks = field(default_factory=Banks)
    """Reports of bank angles in turns."""

    def note(self, state: VehicleState, segment: Segment) -> None:
        """Record a navigated state."""
        self.reports.append((state, segment.phase))

    def note_setpoint(self, time_s: float, course: float, speed: float) -> None:
        """Record a setpoint that was sent, if it differs from the one before."""
        if not self.setpoints or self.setpoints[-1][1:] != (course, speed):
            self.setpoints.append((time_s, course, speed))

    def findings(self) -> Findings:
        """Return the findings from all data so far."""
        course, speed = self._samples(Phase.COURSE), self._samples(Phase.SPEED)
        has_steps = speed_step(self.airframe) > 0.0
        return Findings(
            course=None if course is None else response_in(course),
            course_samples=course,
            speed=None if speed is None or not has_steps else response_in(speed),
            speed_samples=speed,
            slip=self.banks.slip(),
        )

    def _samples(self, phase: Phase) -> HoldSamples | None:
        """Return the stretch of one kind of steps, with the settled moment before it."""
        times = [state.time_s for state, flown in self.reports if flown is phase]
        if len(times) < LEAST_REPORTS:
            return None
        first, last = times[0] - SETTLED_S, times[-1]
        stretch = [state for state, _ in self.reports if first <= state.time_s <= last]
        airframe = self.airframe
        time_s = np.array([state.time_s for state in stretch])
        speed = np.array([held_speed(state, airframe) for state in stretch])
        is_course = phase is Phase.COURSE
        told = np.array([(at, course, pace) for at, course, pace in self.setpoints if at <= last])
        direction = np.unwrap(np.array([held_direction(state, airframe) for state in stretch]))
        # Both are without jumps and on the same turn of the circle, since one plot shows both.
        setpoint = np.unwrap(told[:, 1])
        asked = setpoint[max(int(np.searchsorted(told[:, 0], first, side="right")) - 1, 0)]
        setpoint += 2.0 * np.pi * np.round((direction[0] - asked) / (2.0 * np.pi))
        if is_course:
            return HoldSamples(
                time_s=time_s,
                value=np.array([state.course for state in stretch]),
                turned=direction,
                limit=turn_limits(airframe, speed),
                setpoint_s=told[:, 0],
                setpoint=setpoint,
            )
        return as_seen(
            HoldSamples(
                time_s=time_s,
                value=speed,
                limit=np.full(len(speed), airframe.max_acceleration),
                setpoint_s=told[:, 0],
                setpoint=told[:, 2],
            )
        )


def is_good(found: HoldResponse) -> bool:
    """Check whether a response is known well enough for flight: its bandwidth within a fifth."""
    return found.doubt < KNOWN_SHARE


def shortcoming(findings: Findings, airframe: Airframe, ended: str | None) -> str | None:
    """Return which response is unknown, why, and the remedy; None if both are known well.

    `ended` is why the flight ended early; None if all steps were flown.
    """
    missing = [
        part
        for part in (course_missing(findings), speed_missing(findings, airframe))
        if part is not None
    ]
    if not missing and ended is None:
        return None
    if ended is None:
        why = "; ".join(missing)
        return f"not learned well enough: {why}; until then leave what the mission says of it"
    lost = f", not learned: {'; '.join(missing)}" if missing else ", and fewer steps than planned"
    return f"the flight ended before its time ({ended}){lost}; fly it again, to its end"


def course_missing(findings: Findings) -> str | None:
    """Return what is unknown of the course response; None if it is known well."""
    if findings.course is None:
        return f"alpha_1_s ({UNSEEN})"
    if is_good(findings.course):
        return None
    return f"alpha_1_s ({wide(findings.course)}; fly again in calmer air, or with more --repeats)"


def speed_missing(findings: Findings, airframe: Airframe) -> str | None:
    """Return what is unknown of the speed response; None if it is known well."""
    if speed_step(airframe) == 0.0:
        return (
            "beta_1_s (airspeed_range_m_s leaves no room for steps around"
            f" {airframe.cruise:g} m/s; widen it)"
        )
    if findings.speed is None:
        return f"beta_1_s ({UNSEEN})"
    if is_good(findings.speed):
        return None
    return (
        f"beta_1_s ({wide(findings.speed)}; fly again in calmer air, or with more --repeats, or take it"
        " from the autopilot's parameters by response: auto, as for a TECS, which is no first-order hold)"
    )


def wide(found: HoldResponse) -> str:
    """Return a bandwidth and its bounds."""
    return (
        f"{found.gain:.2f}, {found.least:.2f} to {found.greatest:.2f} 1/s, and known well is what is within"
        f" {KNOWN_SHARE * 100.0:.0f} %"
    )
