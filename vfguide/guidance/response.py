"""How an aircraft answers to its setpoints, learned in flight, and how fast its loops may then be.

**Response.** After a dead time T and through a lag tau, a hold changes its value at a rate in proportion to
the error, within its limit:

    rate(t) = lag(limited(gain * (setpoint(t - T) - value(t)))) + offset.

The gain is alpha (course) or beta (speed). A grid of gains, dead times and lags holds hypotheses, each of
which predicts the rate. The residuals, with an exponential memory, tell how likely each is. All that
explain the flight nearly as well as the best one are the responses that the aircraft may have (Ljung,
System Identification, 1999, chapters 7 and 11). Least squares interpolate between two gains. At a limit the
set stays open above; an oscillation is known by its timing.

Both sides pass the same low-pass, so that no measured value has to be differentiated: the low-pass of a
derivative is (value - low-pass of the value) / time constant.

**Bandwidth.** A loop of gain g around a hold that answers k times as strongly as believed, D seconds late, is

    L(s) = k g exp(-D s) / s.

Its phase margin is 90 degrees less k g D, its gain margin pi / (2 k g D): 45 degrees and 6 dB are kept where

    g <= (pi / 4) / (k D).

k and D are the greatest that the response may have. k is the spread of its gain. D sums the loop's own
period and delay, the share of the known delay that prediction leaves, and the delay that may come on top.
Within that bound `sharpness` chooses how quick the loop is around the most probable response, and how many
times quicker than the hold that it commands. A loop around another one is slower by `NESTING` (Astrom and
Murray, Feedback Systems, 2nd edition, chapters 10 and 14).
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
"""Steps to either side of a finer grid's middle; twice as many for gains."""

AS_LIKELY = 3.0
"""Log-likelihood below the best by which a hypothesis still counts: 95 % of two free parameters."""

GRID_S = 0.08
"""Half a step between two delays of the grid, s."""

MOST_S = 60.0
"""More evidence makes no surer, s: no autopilot is quite of the model's kind."""

LEAST_S = 2.0
"""Less evidence tells nothing, s."""

TAKE_S = 0.09
"""Evidence is taken no more often than this, s: responses take longer."""


class HoldKind(msgspec.Struct, frozen=True, kw_only=True):
    """What can be known beforehand of a kind of hold."""

    gains: tuple[float, float]
    """Least and greatest gain, 1/s."""
    dead_times: Sequence[float]
    """Grid of dead times, s."""
    lags: Sequence[float]
    """Grid of lags, s."""
    filter_s: float
    """Low-pass on both sides of the model, s."""
    noise: float
    """Rate that is noise after the low-pass: rad/s of a course, m/s² of a speed."""
    gain_step: float = 1.3
    """Factor between two gains of the grid."""
    memory_s: float = 60.0
    """Time constant with which old evidence fades, s."""
    offset_prior_s: float = 4.0
    """Seconds of evidence that speak for no offset: a steady turn tells the gain, too."""
    settled_s: float = 0.5
    """Beyond the low-pass, until lags and filters have forgotten their beginning, s."""
    model_share: float = 0.05
    """Of the motion, the part that no hypothesis is expected to explain."""

    def around(self, found: "HoldResponse", step_s: float, factor: float) -> "HoldKind":
        """Return the same with a finer grid around a response.

        Args:
            found: in the middle.
            step_s: between two dead times, or lags, s.
            factor: between two gains.
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
    """How one hold answers, as far as the flight has shown."""

    gain: float
    """alpha or beta of the most likely hypothesis, 1/s."""
    least: float
    """Least plausible gain, 1/s."""
    greatest: float
    """Greatest plausible gain, 1/s."""
    dead_time: float
    """From a setpoint to the first answer, s."""
    lag: float
    """Time constant with which the rate then follows, s."""
    earliest: float
    """Least plausible sum of dead time and lag, s."""
    latest: float
    """Greatest plausible sum of dead time and lag, s."""
    explained: float
    """Share of the motion that the model explains, 0 to 1."""
    seconds: float
    """Evidence that is remembered, s."""

    @property
    def spread(self) -> float:
        """The true gain lies within gain / spread and gain * spread; 1 or more."""
        return max(self.greatest / self.gain, self.gain / self.least)

    @property
    def doubt(self) -> float:
        """Half of the range of plausible gains, in parts of the gain."""
        return 0.5 * (self.greatest - self.least) / self.gain

    @property
    def late(self) -> float:
        """Dead time and lag together, s."""
        return self.dead_time + self.lag


def apart(value: float, other: float, *, angle: bool) -> float:
    """Return the difference of two values; of two directions the shorter way, rad."""
    return math.remainder(value - other, math.tau) if angle else value - other


class HoldLearner:
    """Learns the response of one hold."""

    def __init__(self, kind: HoldKind) -> None:
        """Know nothing yet.

        Args:
            kind: of the hold.
        """
        self._kind = kind
        least, greatest = kind.gains
        steps = math.ceil(math.log(greatest / least) / math.log(kind.gain_step))
        gains = [least * kind.gain_step**step for step in range(steps + 1)]
        grid = list(product(kind.dead_times, kind.lags, gains))
        columns: FloatArray = np.array(grid).T
        self._dead_times, self._lags, self._gains = columns
        self._for_each_dead_time = len(kind.lags) * len(gains)
        self._setpoints: deque[tuple[float, float]] = deque()
        # Sums of 1, x, y, xx, xy, yy over the seconds that are remembered; x is what a hypothesis predicts.
        self._seconds = self._y = self._yy = 0.0
        self._x, self._xx, self._xy = np.zeros((3, len(grid)))
        self._time_s = -math.inf
        self._lagged = self._filtered = np.zeros(len(grid))
        self._rate = self._value = self._direction = self._settling_s = 0.0
        self._rate_seen: float | None = None

    def note(self, setpoint: float, time_s: float) -> None:
        """A setpoint (rad, unwrapped or not, or m/s) has gone out at a time (s)."""
        self._setpoints.append((time_s, setpoint))
        oldest = time_s - self._kind.dead_times[-1] - GAP_S
        while len(self._setpoints) > 1 and self._setpoints[1][0] < oldest:
            self._setpoints.popleft()

    def forget_setpoints(self) -> None:
        """Nothing is on its way to the autopilot: it does not fly by setpoints now."""
        self._setpoints.clear()
        self.interrupt()

    def interrupt(self) -> None:
        """The hold is not seen for a moment: it does not follow for a reason of its own."""
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
        """Take what the aircraft does.

        Args:
            time_s: when, s.
            value: what is held: course, rad, or speed, m/s.
            rate: how fast that changes as far as the autopilot decides it: rad/s, m/s²; None to see it by
                the changes of what it turns.
            limit: greatest rate of the aircraft, rad/s or m/s².
            angle: whether value and setpoints are directions.
            turned: what the autopilot turns to change it, rad, as the heading; None where that is the value.
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
        if period > GAP_S or self._settling_s == 0.0:
            self._settling_s = min(period, GAP_S)
            errors = self._errors(time_s, 0.0, value, angle=angle)
            predicted = np.minimum(np.maximum(self._gains * errors, -limit), limit)
            self._lagged, self._filtered, self._rate = predicted, predicted, rate or 0.0
            return
        # Everything is the mean over the period, so that nothing is half a period early or late.
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
        """Mean setpoint over a period that ends now, less the mean value, for each hypothesis."""
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
                # Before the first that is known there was another like it.
                error = apart(self._setpoints[0][1], value, angle=angle)
            errors.append(error if period == 0.0 else (total + (until - since) * error) / period)
        return np.array(errors).repeat(self._for_each_dead_time)

    def _learn(self, period: float) -> None:
        """Add one moment to the sums."""
        fade = math.exp(-period / self._kind.memory_s)
        x, y = self._filtered, self._rate
        self._seconds = fade * self._seconds + period
        self._y = fade * self._y + period * y
        self._yy = fade * self._yy + period * y * y
        self._x = fade * self._x + period * x
        self._xx = fade * self._xx + period * x * x
        self._xy = fade * self._xy + (period * y) * x

    def explained_by(self, gain: float, dead_time: float, lag: float) -> float:
        """Return the share of the motion that a response explains; 1 while nothing can be told.

        The nearest hypothesis stands for it.

        Args:
            gain: 1/s.
            dead_time: s.
            lag: s.
        """
        if self._seconds < LEAST_S or self._yy <= 0.0:
            return 1.0
        off_s = np.abs(self._dead_times + self._lags - dead_time - lag)
        apart = np.abs(np.log(self._gains / gain))
        nearest = int(np.argmin(apart + off_s + 0.5 * np.abs(self._lags - lag)))
        left = self._left(np.ones_like(self._x))
        return 1.0 - float(left[nearest]) / self._yy

    def _left(self, factors: FloatArray) -> FloatArray:
        """Return what each hypothesis leaves, its gain multiplied by a factor and its offset free."""
        weight = self._seconds + self._kind.offset_prior_s
        offsets = (self._y - factors * self._x) / weight
        left: FloatArray = (
            self._yy + factors * (factors * self._xx - 2.0 * self._xy) - offsets * offsets * weight
        )
        return np.maximum(left, 0.0)

    def response(self) -> HoldResponse | None:
        """Return how the hold answers; None while nothing can be told."""
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
        # The low-pass makes neighbouring moments one piece of evidence.
        pieces = min(seconds, MOST_S) / (2.0 * self._kind.filter_s)
        likelihoods = -0.5 * pieces * np.log(left)
        best = int(np.argmax(likelihoods))
        possible = likelihoods >= likelihoods[best] - AS_LIKELY
        gain = float(self._gains[best] * factors[best])
        gains, late = self._gains[possible], (self._dead_times + self._lags)[possible]
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
"""Greatest k g D, rad: 45 degrees of phase and 6 dB of gain are left."""

NESTING = 2.0
"""How many times slower than the loop inside it a loop is."""

FORETOLD_SHARE = 0.2
"""Share of a delay that is predicted away and still counts as one: no prediction is perfect."""

SLIPPING_BANDWIDTH = 0.45
"""1/s: of the course loop of an aircraft that slips. On ArduPilot's simulated plane 0.7 kept the yaw
swinging at 0.9 Hz for ever."""

USUAL_AMPLIFICATION, AMPLIFICATION_STEP = 4.0, 4.0
"""How many times quicker than a hold its loop is at sharpness 0.5, and the factor from there to 1."""

LATE_HOLD_SHARE = 0.2
"""Share of that amplification for a course hold that answers late: at sharpness 0.5 its loop is 0.8 times as
quick as the hold. A quicker one rolls to and fro by each gust, up to five times as fast as one alone."""

QUIET_BANDWIDTH = 0.5
"""1/s: a course loop this slow rolls no aircraft by noise, however slow its hold."""

GUST_M_S = 1.5
"""Speed error of gusts and noise: at sharpness 0.5 it asks for all acceleration, and none less does."""

QUICKEST_FACTOR = 1.0 / MARGIN
"""Layer factor at sharpness 1, where the margins are just kept."""

USUAL_FACTOR = 3.5
"""Layer factor at sharpness 0.5: 74 degrees of phase and 15 dB of gain are left."""


class HoldCertainty(msgspec.Struct, frozen=True, kw_only=True):
    """How well the response of one hold is known."""

    spread: float
    """The true gain lies within gain / spread and gain * spread; 1 or more."""
    late: float
    """Delay that may come on top of the known one, s."""


class Certainty(msgspec.Struct, frozen=True, kw_only=True):
    """How well an aircraft's response is known."""

    course: HoldCertainty
    """Of the course (or heading) hold."""
    speed: HoldCertainty
    """Of the speed hold."""


DECLARED = HoldCertainty(spread=1.1, late=0.0)
"""Written in the mission: measured by somebody, until flight contradicts."""

AS_DECLARED = Certainty(course=DECLARED, speed=DECLARED)
"""Both holds as the mission has them."""

TOLD = HoldCertainty(spread=1.5, late=0.15)
"""By the autopilot's own parameters: the airframe adds what they do not say."""

UNKNOWN = HoldCertainty(spread=3.0, late=0.4)
"""Nobody has said anything."""


class Bandwidth(msgspec.Struct, frozen=True, kw_only=True):
    """How fast the loops of one aircraft may be, 1/s; infinite where nothing bounds them."""

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
    """Factors on bandwidths, above 0, at most 1: less where a guard has found the aircraft strained."""

    course: float = 1.0
    """On the loops of the course."""
    speed: float = 1.0
    """On the loops of the speed."""


FIRM = Softness()
"""Of an aircraft that is not strained."""

UNBOUNDED = Bandwidth()
"""Of an aircraft of which nothing has to be minded."""


def factor_of(sharpness: float) -> float:
    """Boundary layer over kappa times the delay, for a sharpness from 0 to 1.

    1 is the quickest loop that keeps the margins, 0.5 the usual one; each tenth is as great a step as any.
    """
    return float(QUICKEST_FACTOR * (USUAL_FACTOR / QUICKEST_FACTOR) ** (2.0 * (1.0 - sharpness)))


def amplification_of(sharpness: float) -> float:
    """How many times quicker than a hold the loop around it may be, for a sharpness from 0 to 1.

    A loop of gain g around a hold of gain alpha sends setpoints that are g / alpha times as great as what it
    has measured, noise included: more than the hold can follow only wears its servos.
    """
    return float(USUAL_AMPLIFICATION * AMPLIFICATION_STEP ** (2.0 * sharpness - 1.0))


def bearable(
    gain_delay: float, certainty: HoldCertainty, *, period: float, loop_delay: float, factor: float
) -> float:
    """Greatest bandwidth of a loop around one hold, 1/s.

    Args:
        gain_delay: known dead time and lag of the hold, s.
        certainty: how well that is known.
        period: of the loop, s.
        loop_delay: from measurement to effect beyond the period, s.
        factor: layer factor that `sharpness` or the mission chose; 0 asks for the quickest loop.
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
    """Bandwidth that every response an aircraft may have bears.

    Args:
        airframe: most probable response.
        certainty: how well it is known.
        slips: whether its nose leaves the direction of flight in turns.
        period: of the loop, s.
        loop_delay: from measurement to effect beyond the period, s.
        factor: see `bearable`.
        amplification: how many times quicker than the hold that it commands a loop may be.
        softness: factors on what results.
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
        speed_late,
        certainty.speed,
        period=period,
        loop_delay=loop_delay,
        factor=factor,
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
    # A hold that is slower than believed by TOLD.spread is still led with a damping of 0.7.
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
    """Return a share of a bandwidth, or of what the sampled loop has anyway where that is less, 1/s."""
    return bound if softness >= 1.0 else softness * min(bound, fastest)
