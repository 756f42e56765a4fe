"""The steps that are flown, what was seen and said on them, and what is learned of it.

All of a flight at once is given to the model by which companions learn. `guidance.response` finds the
response among a grid of hypotheses. Here the whole flight is at hand: it is given to the same learner again,
with a finer grid around the best of the pass before. The bounds are those of the first of these passes, which
looks widely enough. What a flight did not tell is said in one line, with why, and what to do about it.
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
"""Share of the motion that has to be explained of a speed: a total-energy hold, whose pitch answers at once
and whose throttle later, is none of first order. Of ArduPlane's on a circle it is 0.87."""

SETTLED_S = 1.0
"""Before the steps that are measured the vehicle has flown straight on for at least this long, s."""

MODEL_SHARE, NOISE_SHARE = 0.02, 1.0 / 3.0
"""Of the motion, the part that no hypothesis is expected to explain, and of the noise that a companion
reckons with: a whole flight shows more than a few seconds of it."""


NO_OFFSET_S, ANY_OFFSET_S = 1e6, 1e-3
"""Evidence for no offset, s: a course has none, and airspeed sensors are off."""


FORGOTTEN_S = 2.0
"""s at the beginning that count for nothing: the vehicle was on its way to something that is not known."""


class HoldSamples(msgspec.Struct, frozen=True, kw_only=True):
    """What was asked of one hold on a stretch of a flight, and what was seen of it."""

    time_s: FloatArray
    """Times of the reports, s."""
    value: FloatArray
    """What is held: course, rad, or speed, m/s."""
    limit: FloatArray
    """Greatest rate of that at each report, rad/s or m/s²."""
    setpoint_s: FloatArray
    """When setpoints went out, s; the first before the first report."""
    setpoint: FloatArray
    """The setpoints: course, unwrapped, rad, or speed, m/s."""
    turned: FloatArray | None = None
    """The direction that is turned to change the course, heading or course itself, unwrapped, rad; None of a
    speed."""

    @property
    def seen(self) -> FloatArray:
        """What the autopilot changes: the direction, or the speed."""
        return self.value if self.turned is None else self.turned


def turn_limits(airframe: Airframe, speed: FloatArray) -> FloatArray:
    """Return the greatest turn rate at some speeds (m/s), rad/s."""
    slowest = np.maximum(speed, 1.0)
    return np.array([coordinated_turn_rate(airframe.max_bank, one) for one in slowest.tolist()])


def as_seen(samples: HoldSamples) -> HoldSamples:
    """Return the same, with setpoints on the scale of what was seen.

    Speeds are asked for as indicated airspeeds and seen as true ones, and sensors are off.
    """
    off = float(np.median(samples.value - samples.setpoint[held_at(samples, samples.time_s)]))
    return replace(samples, setpoint=samples.setpoint + off)


def held_at(samples: HoldSamples, time_s: FloatArray) -> IntegerArray:
    """Return the numbers of the setpoints that held at some times; before the first there was its like."""
    return np.maximum(np.searchsorted(samples.setpoint_s, time_s, side="right") - 1, 0)


def response_in(samples: HoldSamples) -> HoldResponse | None:
    """Return how a hold answered, or None where nothing explains what it did."""
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
    """Return what a learner with these hypotheses makes of a stretch."""
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
    """Return what a response would have made of the setpoints: directions (rad) or speeds (m/s)."""
    targets = samples.setpoint[held_at(samples, samples.time_s - found.dead_time)].tolist()
    # What is held differs from what is turned by the drift in the wind.
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
"""Greatest step of the course, rad."""

SPEED_STEP = 2.0
"""Greatest step of the airspeed, m/s."""

LIMIT_SHARE = 0.6
"""Part of the turn rate and of the acceleration that steps may take: at a limit nothing is learned."""

SPEED_MARGIN = 0.5
"""Kept from the ends of the airspeed range, m/s."""

COURSE_HOLDS_S = (6.0, 5.0, 7.0, 5.5)
SPEED_HOLDS_S = (10.0, 9.0, 11.0, 9.5)
"""How long each of a group of steps lasts; different, so that no period hides in them."""

SETTLE_S = 8.0
"""Straight on, before anything is measured."""

TURN_S = 14.0
"""For each half of the turn back."""

LEAST_REPORTS = 100
"""Fewer of them say nothing."""

UNSEEN = (
    "too few reports of its steps, or what it did is no answer to them; see that telemetry comes at"
    " rehearsal.rate_hz, and that the air is calm"
)
"""Why nothing is known of a hold."""

KNOWN_SHARE = 0.2
"""A bandwidth is known well within this share of it."""


class Phase(Enum):
    """What a segment is for."""

    SETTLE = "settle"
    """Nothing is measured."""
    COURSE = "course"
    """Steps of the course."""
    SPEED = "speed"
    """Steps of the airspeed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A setpoint that is held for a while."""

    phase: Phase
    """What for."""
    course: float
    """Relative to the first course, rad."""
    speed: float
    """m/s, of the kind that the vehicle holds."""
    duration_s: float
    """How long."""


def course_step(airframe: Airframe) -> float:
    """Step of the course (rad) that stays clear of the bank limit."""
    greatest = bank_limited_turn_rate(airframe.max_bank, airframe.cruise)
    return min(COURSE_STEP, LIMIT_SHARE * greatest / airframe.alpha)


def speed_step(airframe: Airframe) -> float:
    """Step of the airspeed (m/s) that stays clear of the acceleration limit and the airspeed range."""
    room = min(airframe.airspeed_max - airframe.cruise, airframe.cruise - airframe.airspeed_min)
    by_limit = LIMIT_SHARE * airframe.max_acceleration / airframe.beta
    return max(min(SPEED_STEP, room - SPEED_MARGIN, by_limit), 0.0)


def segments(airframe: Airframe, repeats: int) -> list[Segment]:
    """Out with steps of course, a turn, and back with steps of speed.

    Args:
        airframe: what the vehicle can do; its cruise is the speed of everything.
        repeats: how often each group of steps is flown.
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
    """The plan in words, for the crew that has to clear the sky for it."""
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
    """What a flight tells."""

    course: HoldResponse | None
    """None where there are too few reports."""
    course_samples: HoldSamples | None
    """What it was found from."""
    speed: HoldResponse | None
    """The same of the speed; None, too, where there was no room for steps."""
    speed_samples: HoldSamples | None
    """What it was found from."""
    slip: Slip | None = None
    """None where the autopilot told no banks, or has turned too little."""


@dataclass(slots=True)
class StepsRecording:
    """A flight as it happens."""

    airframe: Airframe
    """Limits, and what is held."""
    reports: list[tuple[VehicleState, Phase]] = field(default_factory=list)
    """Every navigated state, and what was being flown then."""
    setpoints: list[tuple[float, float, float]] = field(default_factory=list)
    """Time (s), course (rad) and speed (m/s) of every setpoint."""
    banks: Banks = field(default_factory=Banks)
    """The banks by which it turned."""

    def note(self, state: VehicleState, segment: Segment) -> None:
        """A navigated report."""
        self.reports.append((state, segment.phase))

    def note_setpoint(self, time_s: float, course: float, speed: float) -> None:
        """A setpoint that went out, if it is another one than before."""
        if not self.setpoints or self.setpoints[-1][1:] != (course, speed):
            self.setpoints.append((time_s, course, speed))

    def findings(self) -> Findings:
        """Return what is learned of all that was seen so far."""
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
        """The stretch of one kind of steps, with the settled moment before it."""
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
        # Both without jumps, and on the same turn of the circle: they are drawn into one plot.
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
    """Return whether a response is known well enough to be flown by: its bandwidth within a fifth."""
    return found.doubt < KNOWN_SHARE


def shortcoming(findings: Findings, airframe: Airframe, ended: str | None) -> str | None:
    """What was not learned, why, and the remedy; None where both responses are known well.

    Args:
        findings: what the flight told.
        airframe: by which it was flown.
        ended: why it ended before its time; None where all steps were flown.
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
    """What is not known of the course response; None where it is known well."""
    if findings.course is None:
        return f"alpha_1_s ({UNSEEN})"
    if is_good(findings.course):
        return None
    return f"alpha_1_s ({wide(findings.course)}; fly again in calmer air, or with more --repeats)"


def speed_missing(findings: Findings, airframe: Airframe) -> str | None:
    """What is not known of the speed response; None where it is known well."""
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
