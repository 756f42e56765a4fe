"""How an aircraft answers to its setpoints, learned from what is flown anyway.

A hold is described by three numbers: after a dead time T and through a lag tau it changes what it holds at a
rate in proportion to the error,

    rate(t) = gain * lag(setpoint(t - T) - value(t)) + offset.

The gain is alpha (course) or beta (speed). Dead times and lags are a grid of hypotheses. For each of them
gain and offset follow by least squares with an exponential memory, and what it leaves unexplained tells how
likely it is. All hypotheses that explain the flight nearly as well as the best one are the set of responses
that the aircraft may have (Ljung, System Identification, 1999, chapters 7 and 11).

Both sides pass the same low-pass, so that no measured value has to be differentiated: the low-pass of a
derivative is (value - low-pass of the value) / time constant.
"""

import math
from collections import deque
from collections.abc import Sequence

import msgspec
import numpy as np

from vfguide.elementwise import FloatArray

MEMORY_S = 60.0
"""Time constant with which old evidence fades, s."""

OFFSET_PRIOR_S = 4.0
"""Seconds of evidence that speak for no offset: a steady turn tells the gain, too."""

MODEL_SHARE = 0.05
"""Of the motion, the part that no hypothesis is expected to explain."""

AS_LIKELY = 3.0
"""Log-likelihood below the best by which a hypothesis still counts: 95 % of two free parameters."""

SURE = 2.0
"""Standard deviations of a gain that count as possible."""

GRID_S, GRID_SPREAD = 0.08, 1.1
"""Half a step between two hypotheses, s, and what that may make of a gain."""

GAP_S = 1.0
"""After a longer silence the filters begin anew; what was learned is kept, s."""

TAKE_S = 0.09
"""Evidence is taken no more often than this, s: responses take longer."""


class HoldKind(msgspec.Struct, frozen=True, kw_only=True):
    """What can be known beforehand of a kind of hold."""

    dead_times: Sequence[float]
    """Grid of dead times, s."""
    lags: Sequence[float]
    """Grid of lags, s."""
    filter_s: float
    """Low-pass on both sides of the model, s."""
    noise: float
    """Rate that is noise after the low-pass: rad/s of a course, m/s² of a speed."""
    greatest_error: float
    """Larger setpoint errors are answered at a limit: rad, m/s."""


COURSE = HoldKind(
    dead_times=(0.0, 0.1, 0.2, 0.3, 0.45, 0.6),
    lags=(0.0, 0.15, 0.3, 0.5, 0.8),
    filter_s=0.4,
    noise=0.006,
    greatest_error=0.9,
)
SPEED = HoldKind(
    dead_times=(0.0, 0.15, 0.3, 0.5, 0.8),
    lags=(0.0, 0.3, 0.6, 1.2),
    filter_s=1.0,
    noise=0.06,
    greatest_error=4.0,
)


class HoldResponse(msgspec.Struct, frozen=True, kw_only=True):
    """How one hold answers, as far as the flight has shown."""

    gain: float
    """alpha or beta of the most likely hypothesis, 1/s."""
    spread: float
    """The true gain lies within gain / spread and gain * spread, 95 %; 1 or more."""
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
    def late(self) -> float:
        """Dead time and lag together, s."""
        return self.dead_time + self.lag


class HoldLearner:
    """Learns the response of one hold."""

    def __init__(self, kind: HoldKind) -> None:
        """Know nothing yet.

        Args:
            kind: of the hold.
        """
        self._kind = kind
        grid = [(dead_time, lag) for dead_time in kind.dead_times for lag in kind.lags]
        self._dead_times: FloatArray = np.array([one[0] for one in grid])
        self._lags: FloatArray = np.array([one[1] for one in grid])
        self._setpoints: deque[tuple[float, float]] = deque()
        # Sums of 1, x, y, xx, xy, yy over the seconds that are remembered.
        self._seconds = self._y = self._yy = 0.0
        self._x = np.zeros(len(grid))
        self._xx = np.zeros(len(grid))
        self._xy = np.zeros(len(grid))
        self._time_s = -math.inf
        self._lagged = np.zeros(len(grid))
        self._filtered = np.zeros(len(grid))
        self._rate = self._value = self._settling_s = 0.0

    def note(self, setpoint: float, time_s: float) -> None:
        """A setpoint (rad, unwrapped or not, or m/s) has gone out at a time (s)."""
        self._setpoints.append((time_s, setpoint))
        oldest = time_s - self._kind.dead_times[-1] - GAP_S
        while len(self._setpoints) > 1 and self._setpoints[1][0] < oldest:
            self._setpoints.popleft()

    def forget_setpoints(self) -> None:
        """Nothing is on its way to the autopilot: it does not fly by setpoints now."""
        self._setpoints.clear()
        self._settling_s = 0.0

    def observe(
        self, time_s: float, value: float, rate: float | None, *, limited: bool, angle: bool = False
    ) -> None:
        """Take what the aircraft does.

        Args:
            time_s: when, s.
            value: what is held: course, rad, or speed, m/s.
            rate: how fast that changes as far as the autopilot decides it: rad/s, m/s²; None to see it by
                the value's own changes.
            limited: whether the aircraft is at one of its limits, where it does not answer to errors.
            angle: whether value and setpoints are directions.
        """
        if not self._setpoints:
            return
        period = time_s - self._time_s
        if period < TAKE_S:
            return
        errors = self._errors(time_s, value, angle=angle)
        before, self._value = self._value, value
        if rate is None:
            rate = (value - before) / period if period <= GAP_S else 0.0
        if period > GAP_S or self._settling_s == 0.0:
            self._time_s, self._settling_s = time_s, 1e-9
            self._lagged, self._filtered, self._rate = errors, errors.copy(), rate
            return
        self._time_s = time_s
        self._lagged = self._lagged + (period / (self._lags + period)) * (errors - self._lagged)
        share = period / (self._kind.filter_s + period)
        self._filtered = self._filtered + share * (self._lagged - self._filtered)
        self._rate += share * (rate - self._rate)
        greatest = float(np.max(np.abs(errors)))
        if limited or greatest > self._kind.greatest_error:
            # What follows for a while is still the way back from the limit.
            self._settling_s = 1e-9
            return
        self._settling_s += period
        if self._settling_s > self._settled_s:
            self._learn(period)

    @property
    def _settled_s(self) -> float:
        """Until filters have forgotten their beginning, s."""
        return 2.0 * self._kind.filter_s + 0.5

    def _errors(self, time_s: float, value: float, *, angle: bool) -> FloatArray:
        """Setpoint less value for each hypothesis."""
        latest: dict[float, float] = {}
        for dead_time in self._kind.dead_times:
            setpoint = self._setpoints[0][1]
            for sent_s, sent in reversed(self._setpoints):
                if sent_s <= time_s - dead_time:
                    setpoint = sent
                    break
            error = setpoint - value
            latest[dead_time] = math.remainder(error, math.tau) if angle else error
        return np.repeat(
            [latest[dead_time] for dead_time in self._kind.dead_times], len(self._kind.lags)
        )

    def _learn(self, period: float) -> None:
        """Add one moment to the sums."""
        fade = math.exp(-period / MEMORY_S)
        x, y = self._filtered, self._rate
        self._seconds = fade * self._seconds + period
        self._y = fade * self._y + period * y
        self._yy = fade * self._yy + period * y * y
        self._x = fade * self._x + period * x
        self._xx = fade * self._xx + period * x * x
        self._xy = fade * self._xy + period * x * y

    def explained_by(self, gain: float, dead_time: float, lag: float) -> float:
        """Return the share of the motion that a response explains; 1 while nothing can be told.

        Args:
            gain: 1/s.
            dead_time: s; the nearest hypothesis stands for it and the lag.
            lag: s.
        """
        if self._seconds < 4.0 * self._kind.filter_s or self._yy <= 0.0:
            return 1.0
        off = np.abs(self._dead_times + self._lags - dead_time - lag)
        nearest = int(np.argmin(off + 0.5 * np.abs(self._lags - lag)))
        weight = self._seconds + OFFSET_PRIOR_S
        x, xx, xy = (float(sums[nearest]) for sums in (self._x, self._xx, self._xy))
        offset = (self._y - gain * x) / weight
        left = self._yy + gain * gain * xx - 2.0 * gain * xy - offset * offset * weight
        return 1.0 - left / self._yy

    def response(self) -> HoldResponse | None:
        """How the hold answers; None while nothing can be told."""
        seconds = self._seconds
        if seconds < 4.0 * self._kind.filter_s:
            return None
        weight = seconds + OFFSET_PRIOR_S
        determinant = self._xx * weight - self._x * self._x
        if float(np.max(determinant)) <= 0.0:
            return None
        determinant = np.maximum(determinant, 1e-12)
        gains = (self._xy * weight - self._x * self._y) / determinant
        offsets = (self._xx * self._y - self._x * self._xy) / determinant
        moved = max(self._yy / seconds, 1e-12)
        left = (self._yy - gains * self._xy - offsets * self._y) / seconds
        floor = self._kind.noise**2 + MODEL_SHARE**2 * moved
        left = np.maximum(left, 0.0) + floor
        # The low-pass makes neighbouring moments one piece of evidence.
        pieces = seconds / (2.0 * self._kind.filter_s)
        likelihoods = -0.5 * pieces * np.log(left)
        likelihoods = np.where(gains > 0.0, likelihoods, -np.inf)
        best = int(np.argmax(likelihoods))
        if not math.isfinite(likelihoods[best]):
            return None
        deviations = np.sqrt(left * 2.0 * self._kind.filter_s * weight / determinant)
        possible = likelihoods >= likelihoods[best] - AS_LIKELY
        gain = float(gains[best])
        lowest = max(float(np.min((gains - SURE * deviations)[possible])), 0.02 * gain)
        highest = float(np.max((gains + SURE * deviations)[possible]))
        late = self._dead_times + self._lags
        return HoldResponse(
            gain=gain,
            spread=GRID_SPREAD * max(highest / gain, gain / lowest),
            dead_time=float(self._dead_times[best]),
            lag=float(self._lags[best]),
            earliest=max(float(np.min(late[possible])) - GRID_S, 0.0),
            latest=float(np.max(late[possible])) + GRID_S,
            explained=1.0 - (float(left[best]) - floor) / moved,
            seconds=seconds,
        )
