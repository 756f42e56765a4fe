"""An aircraft's response to setpoints, learned in flight, and the loop bandwidths that it permits.

**Response.** After a dead time T and through a lag tau, a hold changes its value at a rate proportional to
the error, within its limit:

    rate(t) = lag(limited(gain * (setpoint(t - T) - value(t)))) + offset.

The gain is alpha (course) or beta (speed). A grid of gains, dead times and lags holds hypotheses, each of
which predicts the rate. Residuals with an exponential memory give their likelihoods. All hypotheses nearly as
likely as the best are possible responses (Ljung, System Identification, 1999, chapters 7 and 11). Least
squares interpolate between two gains. At a limit the gain has no upper bound; the timing of an oscillation
identifies it.

Both sides pass the same low-pass, so that no measured value has to be differentiated: the low-pass of a
derivative is (value - low-pass of the value) / time constant.

**Bandwidth.** Around a hold with k times its believed gain, D seconds late, a loop of gain g is

    L(s) = k g exp(-D s) / s.

Its phase margin is 90 degrees minus k g D, its gain margin pi / (2 k g D): 45 degrees and 6 dB are kept where

    g <= (pi / 4) / (k D).

k and D are the largest possible values. k is the spread of the hold's gain. D sums the loop's own period and
delay, the unpredicted share of the known delay, and the possible additional delay. Within that bound
`sharpness` sets how fast the loop is around the most probable response, and relative to the hold that it
commands. An outer loop is slower by `NESTING` (Astrom and Murray, Feedback Systems, 2nd edition, chapters 10
and 14).
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import product

import msgspec
import numpy as np
from msgspec.structs import replace

from vfguide.elementwise import FloatArray
from vfguide.guidance.sliding_laws import LEAST_PERIOD
from vfguide.state import GAP_S, Airframe

AROUND = 4
"""Steps of a finer grid to either side of its middle; twice as many for gains."""

AS_LIKELY = 3.0
"""Log-likelihood distance to the best hypothesis that still counts: 95 % for two free parameters."""

GRID_S = 0.08
"""Half a step between two delays of the grid, s."""

MOST_S = 60.0
"""Limit of counted evidence, s: no autopilot matches the model exactly."""

USUAL_LATE_S = 1.0
"""Mean of the exponential prior of delays, s: a steady turn alone fits any pair of gain and delay."""

LEAST_S = 2.0
"""Least evidence for a response, s."""

TAKE_S = 0.09
"""Shortest sampling interval, s: responses take longer."""


class HoldKind(msgspec.Struct, frozen=True, kw_only=True):
    """Prior knowledge of a kind of hold."""

    gains: tuple[float, float]
    """Smallest and largest gain, 1/s."""
    dead_times: Sequence[float]
    """Grid of dead times, s."""
    lags: Sequence[float]
    """Grid of lags, s."""
    filter_s: float
    """Time constant of the low-pass on both sides of the model, s."""
    noise: float
    """Noise of the rate after the low-pass: rad/s of a course, m/s² of a speed."""
    gain_step: float = 1.3
    """Factor between neighbouring gains of the grid."""
    memory_s: float = 60.0
    """Time constant of fading evidence, s."""
    offset_prior_s: float = 4.0
    """Weight of the prior for no offset, s of evidence: a steady turn tells the gain, too."""
    settled_s: float = 0.5
    """Settling time of lags and filters beyond the low-pass, s."""
    model_share: float = 0.05
    """Share of the motion that no hypothesis is expected to explain."""

    def around(self, found: "HoldResponse", step_s: float, factor: float) -> "HoldKind":
        """Return this kind with a finer grid around a response.

        `step_s` is the step of dead times and lags, s; `factor` the ratio of neighbouring gains.
        """
        steps = range(-AROUND, AROUND + 1)
        dead_times, lags = (
            tuple(
                round(max(middle + step * step_s, 0.0), 6)
                for step in steps
                if middle + step * step_s > -0.5 * step_s
            )
            for middle in (found.dead_time, found.lag)
        )
        width = factor ** (2 * AROUND)
        return replace(
            self,
            gains=(found.gain / width, found.gain * width),
            gain_step=factor,
            dead_times=dead_times,
            lags=lags,
        )


COURSE = HoldKind(
    gains=(0.1, 5.0),
    dead_times=(0.0, 0.1, 0.2, 0.3, 0.45, 0.6),
    lags=(0.0, 0.15, 0.3, 0.5, 0.8),
    filter_s=0.4,
    noise=0.006,
)
SPEED = HoldKind(
    gains=(0.1, 3.5),
    dead_times=(0.0, 0.15, 0.3, 0.5, 0.8),
    lags=(0.0, 0.3, 0.6, 1.2),
    filter_s=1.0,
    noise=0.06,
)


class HoldResponse(msgspec.Struct, frozen=True, kw_only=True):
    """Response of one hold, as learned so far."""

    gain: float
    """alpha or beta of the most likely hypothesis, 1/s."""
    least: float
    """Smallest plausible gain, 1/s."""
    greatest: float
    """Largest plausible gain, 1/s."""
    dead_time: float
    """Time from a setpoint to the first response, s."""
    lag: float
    """Time constant of the rate after the dead time, s."""
    earliest: float
    """Smallest plausible sum of dead time and lag, s."""
    latest: float
    """Largest plausible sum of dead time and lag, s."""
    explained: float
    """Share of the motion that the model explains, 0 to 1."""
    seconds: float
    """Remembered evidence, s."""

    @property
    def spread(self) -> float:
        """Factor, 1 or more: the true gain is between gain / spread and gain * spread."""
        return max(self.greatest / self.gain, self.gain / self.least)

    @property
    def doubt(self) -> float:
        """Half of the range of plausible gains, relative to the gain."""
        return 0.5 * (self.greatest - self.least) / self.gain

    @property
    def late(self) -> float:
        """Sum of dead time and lag, s."""
        return self.dead_time + self.lag


def apart(value: float, other: float, *, angle: bool) -> float:
    """Return the difference of two values; of two directions the shorter way, rad."""
    return math.remainder(value - other, math.tau) if angle else value - other


class HoldLearner:
    """Estimator of one hold's response."""

    def __init__(self, kind: HoldKind) -> None:
        """Start without evidence."""
        self._kind = kind
        least, greatest = kind.gains
        steps = math.ceil(math.log(greatest / least) / math.log(kind.gain_step))
        gains = [least * kind.gain_step**step for step in range(steps + 1)]
        grid = list(product(kind.dead_times, kind.lags, gains))
        columns: FloatArray = np.array(grid).T
        self._dead_times, self._lags, self._gains = columns
        self._for_each_dead_time = len(kind.lags) * len(gains)
        self._setpoints: deque[tuple[float, float]] = deque()
        # Sums of 1, x, y, xx, xy, yy over remembered seconds; x is a hypothesis' prediction.
        self._seconds = self._y = self._yy = 0.0
        self._x, self._xx, self._xy = np.zeros((3, len(grid)))
        self._time_s = -math.inf
        self._lagged = self._filtered = np.zeros(len(grid))
        self._rate = self._value = self._direction = self._settling_s = 0.0
        self._rate_seen: float | None = None

    def note(self, setpoint: float, time_s: float) -> None:
        """Record a setpoint (rad, unwrapped or not, or m/s) sent at a time (s)."""
        self._setpoints.append((time_s, setpoint))
        oldest = time_s - self._kind.dead_times[-1] - GAP_S
        while len(self._setpoints) > 1 and self._setpoints[1][0] < oldest:
            self._setpoints.popleft()

    def forget_setpoints(self) -> None:
        """Forget the setpoints: the autopilot does not follow any now."""
        self._setpoints.clear()
        self.interrupt()

    def interrupt(self) -> None:
        """Pause: the hold does not follow setpoints for the moment, for a known reason."""
        self._settling_s = 0.0

    def observe(
        self,
        time_s: float,
        value: float,
        rate: float | None,
        *,
        limit: float,
        angle: bool = False,
        turned: float | None = None,
    ) -> None:
        """Add a measurement of the held value and its rate.

        Args:
            time_s: time of the measurement, s.
            value: held course, rad, or speed, m/s.
            rate: rate due to the autopilot, rad/s or m/s²; None takes the differences of `turned` or `value`.
            limit: largest rate of the aircraft, rad/s or m/s².
            angle: whether value and setpoints are directions.
            turned: direction that the autopilot turns, as the heading, rad; None where that is the value.
        """
        if not self._setpoints:
            return
        period = time_s - self._time_s
        if period < TAKE_S:
            return
        before, self._value, self._time_s = self._value, value, time_s
        direction = value if turned is None else turned
        direction_before, self._direction = self._direction, direction
        rate_before, self._rate_seen = self._rate_seen, rate
        commanded_s = time_s - self._setpoints[0][0]
        if period > GAP_S or self._settling_s == 0.0 or commanded_s < self._kind.dead_times[-1]:
            # Earlier commands are unknown; a lag begins at the measured rate, whatever they were.
            self._settling_s = min(period, GAP_S)
            self._rate = rate or 0.0
            self._lagged = self._filtered = np.full_like(self._gains, self._rate)
            return
        # All quantities are means over the period, so that none is half a period early or late.
        change = apart(value, before, angle=angle)
        errors = self._errors(time_s, period, before + 0.5 * change, angle=angle)
        predicted = np.minimum(np.maximum(self._gains * errors, -limit), limit)
        if rate is None:
            rate = apart(direction, direction_before, angle=angle) / period
        elif rate_before is not None:
            rate = 0.5 * (rate_before + rate)
        kept = np.exp(-period / np.maximum(self._lags, 1e-9))
        ahead = self._lagged - predicted
        mean = predicted + (self._lags / period) * (1.0 - kept) * ahead
        self._lagged = predicted + kept * ahead
        share = period / (self._kind.filter_s + period)
        self._filtered = self._filtered + share * (mean - self._filtered)
        self._rate += share * (rate - self._rate)
        self._settling_s += period
        if self._settling_s > 2.0 * self._kind.filter_s + self._kind.settled_s:
            self._learn(period)

    def _errors(self, time_s: float, period: float, value: float, *, angle: bool) -> FloatArray:
        """Return the mean setpoint minus the mean value over the last period, for each hypothesis."""
        errors = []
        for dead_time in self._kind.dead_times:
            until, since = time_s - dead_time, time_s - dead_time - period
            total = 0.0
            for sent_s, sent in reversed(self._setpoints):
                if sent_s >= until:
                    continue
                error = apart(sent, value, angle=angle)
                if sent_s <= since:
                    break
                total += (until - sent_s) * error
                until = sent_s
            else:
                # Before the first known setpoint, assume the same one.
                error = apart(self._setpoints[0][1], value, angle=angle)
            errors.append(error if period == 0.0 else (total + (until - since) * error) / period)
        return np.array(errors).repeat(self._for_each_dead_time)

    def _learn(self, period: float) -> None:
        """Add one sample to the sums."""
        fade = math.exp(-period / self._kind.memory_s)
        x, y = self._filtered, self._rate
        self._seconds = fade * self._seconds + period
        self._y = fade * self._y + period * y
        self._yy = fade * self._yy + period * y * y
        self._x = fade * self._x + period * x
        self._xx = fade * self._xx + period * x * x
        self._xy = fade * self._xy + (period * y) * x

    def explained_by(self, gain: float, dead_time: float, lag: float) -> float:
        """Return the share of the motion that a response explains; 1 without evidence.

        The nearest hypothesis represents the response. Gain in 1/s; dead time and lag in s.
        """
        if self._seconds < LEAST_S or self._yy <= 0.0:
            return 1.0
        off_s = np.abs(self._dead_times + self._lags - dead_time - lag)
        apart = np.abs(np.log(self._gains / gain))
        nearest = int(np.argmin(apart + off_s + 0.5 * np.abs(self._lags - lag)))
        left = self._left(np.ones_like(self._x))
        return 1.0 - float(left[nearest]) / self._yy

    def _left(self, factors: FloatArray) -> FloatArray:
        """Return each hypothesis' residual sum of squares, its gain scaled by a factor, its offset free."""
        weight = self._seconds + self._kind.offset_prior_s
        offsets = (self._y - factors * self._x) / weight
        left: FloatArray = (
            self._yy + factors * (factors * self._xx - 2.0 * self._xy) - offsets * offsets * weight
        )
        return np.maximum(left, 0.0)

    def response(self) -> HoldResponse | None:
        """Return the response of the hold; None without evidence."""
        seconds = self._seconds
        if seconds < LEAST_S:
            return None
        weight = seconds + self._kind.offset_prior_s
        variation = np.maximum(self._xx * weight - self._x * self._x, 1e-12)
        factors = (self._xy * weight - self._x * self._y) / variation
        half_step = math.sqrt(self._kind.gain_step)
        factors = np.clip(factors, 1.0 / half_step, half_step)
        moved = max(self._yy / seconds, 1e-12)
        floor = self._kind.noise**2 + self._kind.model_share**2 * moved
        left = self._left(factors) / seconds + floor
        # The low-pass makes neighbouring samples one piece of evidence.
        pieces = min(seconds, MOST_S) / (2.0 * self._kind.filter_s)
        lates = self._dead_times + self._lags
        likelihoods = -0.5 * pieces * np.log(left) - lates / USUAL_LATE_S
        best = int(np.argmax(likelihoods))
        possible = likelihoods >= likelihoods[best] - AS_LIKELY
        gain = float(self._gains[best] * factors[best])
        gains, late = self._gains[possible], lates[possible]
        return HoldResponse(
            gain=gain,
            least=min(float(np.min(gains)) / half_step, gain),
            greatest=max(float(np.max(gains)) * half_step, gain),
            dead_time=float(self._dead_times[best]),
            lag=float(self._lags[best]),
            earliest=max(float(np.min(late)) - GRID_S, 0.0),
            latest=float(np.max(late)) + GRID_S,
            explained=1.0 - (float(left[best]) - floor) / moved,
            seconds=seconds,
        )


MARGIN = math.pi / 4.0
"""Largest k g D, rad: leaves 45 degrees of phase and 6 dB of gain."""

NESTING = 2.0
"""Ratio of the bandwidths of an inner and an outer loop."""

FORETOLD_SHARE = 0.2
"""Share of a predicted delay that still counts as delay: no prediction is perfect."""

SLIPPING_BANDWIDTH = 0.45
"""Course bandwidth if slipping, 1/s: at 0.7 ArduPilot's simulated plane kept a yaw oscillation of 0.9 Hz."""

USUAL_AMPLIFICATION, AMPLIFICATION_STEP = 4.0, 4.0
"""Amplification, a loop's bandwidth over its hold's, at sharpness 0.5; and the factor from there to 1."""

LATE_HOLD_SHARE = 0.2
"""Share of the amplification for a course hold with delay: at sharpness 0.5 its loop is 0.8 times as fast as
the hold. A faster one rolls in each gust, up to five times as fast as a gust alone makes it."""

QUIET_BANDWIDTH = 0.5
"""Course bandwidth at which noise rolls no aircraft, however slow its hold, 1/s."""

GUST_M_S = 1.5
"""Speed error of gusts and noise, m/s: at sharpness 0.5 it alone commands full acceleration."""

QUICKEST_FACTOR = 1.0 / MARGIN
"""Layer factor at sharpness 1, which just keeps the margins."""

USUAL_FACTOR = 3.5
"""Layer factor at sharpness 0.5: leaves 74 degrees of phase and 15 dB of gain."""


class HoldCertainty(msgspec.Struct, frozen=True, kw_only=True):
    """Certainty of one hold's response."""

    spread: float
    """Factor, 1 or more: the true gain is between gain / spread and gain * spread."""
    late: float
    """Possible delay beyond the known one, s."""


class Certainty(msgspec.Struct, frozen=True, kw_only=True):
    """Certainty of an aircraft's response."""

    course: HoldCertainty
    """Certainty of the course (or heading) hold."""
    speed: HoldCertainty
    """Certainty of the speed hold."""


DECLARED = HoldCertainty(spread=1.1, late=0.0)
"""Certainty of a mission's values: measured, until flight contradicts."""

AS_DECLARED = Certainty(course=DECLARED, speed=DECLARED)
"""Both holds as declared by the mission."""

TOLD = HoldCertainty(spread=1.5, late=0.15)
"""Certainty of the autopilot's own parameters: the airframe adds what they do not state."""

UNKNOWN = HoldCertainty(spread=3.0, late=0.4)
"""Certainty without any information."""


class Bandwidth(msgspec.Struct, frozen=True, kw_only=True):
    """Permitted loop bandwidths of one aircraft, 1/s; infinite where unbounded."""

    course: float = math.inf
    """Loop from the course error to the turn rate."""
    speed: float = math.inf
    """Loop from the speed error to the acceleration."""
    energy_field: float = math.inf
    """Loop from the error along track to the speed, around a total-energy hold."""

    @property
    def course_field(self) -> float:
        """Loop from the error across track to the course."""
        return self.course / NESTING

    @property
    def speed_field(self) -> float:
        """Loop from the error along track to the speed."""
        return self.speed / NESTING


class Softness(msgspec.Struct, frozen=True, kw_only=True):
    """Factors on bandwidths, in (0, 1]: below 1 where a guard has found the aircraft strained."""

    course: float = 1.0
    """Factor on course loops."""
    speed: float = 1.0
    """Factor on speed loops."""


FIRM = Softness()
"""Softness of an aircraft that is not strained."""

UNBOUNDED = Bandwidth()
"""Bandwidths without bounds."""


def factor_of(sharpness: float) -> float:
    """Return the boundary layer over kappa times the delay, for a sharpness from 0 to 1.

    1 is the fastest loop that keeps the margins, 0.5 the usual one; the scale is logarithmic.
    """
    return float(QUICKEST_FACTOR * (USUAL_FACTOR / QUICKEST_FACTOR) ** (2.0 * (1.0 - sharpness)))


def amplification_of(sharpness: float) -> float:
    """Return the largest bandwidth of a loop relative to its hold, for a sharpness from 0 to 1.

    A loop of gain g around a hold of gain alpha amplifies its measurements, noise included, by g / alpha.
    More than the hold can follow only wears its servos.
    """
    return float(USUAL_AMPLIFICATION * AMPLIFICATION_STEP ** (2.0 * sharpness - 1.0))


def bearable(
    gain_delay: float, certainty: HoldCertainty, *, period: float, loop_delay: float, factor: float
) -> float:
    """Return the largest bandwidth of a loop around one hold, 1/s.

    Args:
        gain_delay: known dead time and lag of the hold, s.
        certainty: certainty of the hold's response.
        period: sampling period of the loop, s.
        loop_delay: delay from measurement to effect beyond the period, s.
        factor: layer factor from `sharpness` or the mission; 0 asks for the fastest loop.
    """
    delay = max(period, LEAST_PERIOD) + loop_delay + FORETOLD_SHARE * gain_delay
    bound = MARGIN / (certainty.spread * (delay + certainty.late))
    if gain_delay > 0.0 and factor > 0.0:
        bound = min(bound, 1.0 / (factor * delay))
    return bound


def bandwidth_of(
    airframe: Airframe,
    certainty: Certainty,
    *,
    slips: bool,
    period: float,
    loop_delay: float,
    factor: float,
    amplification: float = math.inf,
    softness: Softness = FIRM,
) -> Bandwidth:
    """Return the bandwidth that every possible response of an aircraft permits.

    For `period`, `loop_delay` and `factor` see `bearable`. `slips`: the nose leaves the direction of flight
    in turns. `amplification` is the largest ratio of a loop's bandwidth to the hold that it commands;
    `softness` scales the result.
    """
    course = bearable(
        airframe.course_dead_time + airframe.course_lag,
        certainty.course,
        period=period,
        loop_delay=loop_delay,
        factor=factor,
    )
    speed_late = airframe.speed_dead_time + airframe.speed_lag
    speed_delay = max(period, LEAST_PERIOD) + loop_delay + FORETOLD_SHARE * speed_late
    speed = bearable(
        speed_late, certainty.speed, period=period, loop_delay=loop_delay, factor=factor
    )
    quickest = amplification * airframe.alpha
    if airframe.course_dead_time + airframe.course_lag > 0.0:
        quickest = max(LATE_HOLD_SHARE * quickest, min(QUIET_BANDWIDTH, quickest))
    course = min(course, quickest)
    gentle = airframe.max_acceleration / (USUAL_AMPLIFICATION * GUST_M_S)
    speed = min(speed, amplification * min(airframe.beta, gentle))
    if slips and factor > 0.0:
        course = min(course, SLIPPING_BANDWIDTH)
    fastest = (
        1.0 / (factor * (max(period, LEAST_PERIOD) + loop_delay)) if factor > 0.0 else math.inf
    )
    # A hold slower than believed by TOLD.spread still has a damping of 0.7.
    slowest_hold = airframe.beta / max(certainty.speed.spread / TOLD.spread, 1.0)
    energy_field = min(
        slowest_hold / (1.0 + NESTING),
        MARGIN / (NESTING * certainty.speed.spread * (speed_delay + certainty.speed.late)),
    )
    return Bandwidth(
        course=softened(course, softness.course, fastest),
        speed=softened(speed, softness.speed, fastest),
        energy_field=softness.speed * energy_field,
    )


def softened(bound: float, softness: float, fastest: float) -> float:
    """Return a share of a bandwidth, or of the sampled loop's own where that is less, 1/s."""
    return bound if softness >= 1.0 else softness * min(bound, fastest)
