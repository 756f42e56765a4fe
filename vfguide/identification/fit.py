"""Bandwidth, dead time and lag of a response, with their confidence: least squares over all of it.

SciPy's trust-region method within bounds; the intervals are those of linear regression at the solution, with
as many
independent samples as the residuals' correlation leaves (Ljung, System Identification, 1999, chapter 9).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.identification.models import Parameters

Model = Callable[[Parameters], FloatArray]
"""What would have been seen with some response."""

LOWEST = np.array([0.02, 0.0, 0.02])
HIGHEST = np.array([20.0, 5.0, 5.0])
STARTS: tuple[Parameters, ...] = ((1.0, 0.1, 0.2), (0.5, 0.5, 0.5))

SETTLED = 1e-6
"""A step that lowers the sum of squares by less than this share was the last."""

STEP = 1e-4
"""Of the parameters, relative: models interpolate between reports, and are not smooth below this."""

LEAST_LAG = 0.08
"""s: less cannot be told from a dead time."""

LAG_GAIN = 0.85
"""A lag is believed where it brings the residuals down to less than this of what they are without."""

NORMAL_95 = 1.96


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A value that was measured."""

    value: float
    """The most likely."""
    half_width: float
    """Of the interval that holds the true one in 95 % of all cases, if the model is right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """How a loop answers."""

    bandwidth: Estimate
    """alpha or beta, 1/s."""
    dead_time: Estimate
    """s."""
    lag: Estimate
    """s; 0 where none can be told."""
    residual: float
    """Root mean square of what the model leaves, rad or m/s."""
    modelled: FloatArray
    """What the model would have shown."""


def fit_response(model: Model, seen: FloatArray) -> Response:
    """The response that explains best what was seen; a lag only where it is needed."""
    plain = best_of(model, seen, free=(0, 1))
    lagging = best_of(model, seen, free=(0, 1, 2))
    needed = lagging.residual < LAG_GAIN * plain.residual and lagging.values[2] > LEAST_LAG
    best, free = (lagging, (0, 1, 2)) if needed else (plain, (0, 1))
    values, widths = best.values, half_widths(best, free)
    bandwidth, dead_time, lag = (
        Estimate(value=float(value), half_width=width)
        for value, width in zip(values, widths, strict=True)
    )
    return Response(
        bandwidth=bandwidth,
        dead_time=dead_time,
        lag=lag,
        residual=best.residual,
        modelled=model(as_parameters(values)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The parameters that leave least."""

    values: FloatArray
    """All three; a lag that is not free is 0."""
    rest: FloatArray
    """What they leave of each sample."""
    slope: FloatArray
    """Derivatives of that by the free parameters."""

    @property
    def residual(self) -> float:
        """Root mean square of what they leave."""
        return math.sqrt(float(self.rest @ self.rest) / len(self.rest))


def best_of(model: Model, seen: FloatArray, free: tuple[int, ...]) -> Fit:
    """The best fit from all starts."""
    return min((fit(model, seen, start, free) for start in STARTS), key=lambda one: one.residual)


def fit(model: Model, seen: FloatArray, start: Parameters, free: tuple[int, ...]) -> Fit:
    """The fit that lies below a start."""
    from scipy.optimize import least_squares

    chosen = list(free)

    def values_of(part: FloatArray) -> FloatArray:
        values = np.zeros(3)
        values[chosen] = part
        return values

    found = least_squares(
        lambda part: seen - model(as_parameters(values_of(part))),
        np.array(start)[chosen],
        jac="3-point",
        bounds=(LOWEST[chosen], HIGHEST[chosen]),
        diff_step=STEP,
        ftol=SETTLED,
    )
    return Fit(values=values_of(found.x), rest=found.fun, slope=found.jac)


def half_widths(best: Fit, free: tuple[int, ...]) -> tuple[float, float, float]:
    """Half widths of the 95 % intervals; 0 for what was not fitted."""
    rest = best.rest
    degrees = max(len(rest) - len(free), 1)
    variance = float(rest @ rest) / degrees * correlation_factor(rest)
    covariance = variance * np.linalg.pinv(best.slope.T @ best.slope)
    widths = [0.0, 0.0, 0.0]
    for place, index in enumerate(free):
        widths[index] = NORMAL_95 * math.sqrt(max(float(covariance[place, place]), 0.0))
    return widths[0], widths[1], widths[2]


def correlation_factor(rest: FloatArray) -> float:
    """How many times fewer samples there are than it seems, from the correlation of neighbours."""
    power = float(rest @ rest)
    if power == 0.0:
        return 1.0
    correlation = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), 0.99)
    return (1.0 + correlation) / (1.0 - correlation)


def as_parameters(values: FloatArray) -> Parameters:
    """The array as what models take."""
    bandwidth, dead_time, lag = values.tolist()
    return bandwidth, dead_time, lag
