"""All of a flight at once, given to the model by which companions learn.

`guidance.response` finds the response among a grid of hypotheses. Here the whole flight is at hand: it is
given to the same learner again, with a finer grid around the best of the pass before. The bounds are those of
the first of these passes, which looks widely enough.
"""

import math
from itertools import pairwise

import msgspec
import numpy as np
from msgspec.structs import replace

from vfguide.companion.learned_response import LEAST_EXPLAINED
from vfguide.elementwise import FloatArray, clip
from vfguide.guidance.airframe import coordinated_turn_rate
from vfguide.guidance.response import COURSE, SPEED, HoldKind, HoldLearner, HoldResponse
from vfguide.record.archive import IntegerArray
from vfguide.state import Airframe

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
