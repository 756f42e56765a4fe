"""Bandwidth, dead time and lag of a response, with their confidence: least squares over all of it.

Levenberg and Marquardt's method; the intervals are those of linear regression at the solution, with as many
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

ITERATIONS = 40
SETTLED = 1e-5
"""A step that lowers the sum of squares by less than this share was the last."""

STEP = 1e-4
"""Relative to the parameter, and at least of this size, for differences."""

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
    needed = lagging[1] < LAG_GAIN * plain[1] and lagging[0][2] > LEAST_LAG
    values, residual = lagging if needed else plain
    free = (0, 1, 2) if needed else (0, 1)
    widths = half_widths(model, seen, values, free)
    bandwidth, dead_time, lag = (
        Estimate(value=float(value), half_width=width)
        for value, width in zip(values, widths, strict=True)
    )
    return Response(
        bandwidth=bandwidth,
        dead_time=dead_time,
        lag=lag,
        residual=residual,
        modelled=model(as_parameters(values)),
    )


def best_of(model: Model, seen: FloatArray, free: tuple[int, ...]) -> tuple[FloatArray, float]:
    """(parameters, root mean square residual) of the best of all starts; a lag that is not free is 0."""
    found = []
    for start in STARTS:
        values = np.array(start)
        if 2 not in free:
            values[2] = 0.0
        found.append(descended(model, seen, values, free))
    return min(found, key=lambda one: one[1])


def descended(
    model: Model, seen: FloatArray, values: FloatArray, free: tuple[int, ...]
) -> tuple[FloatArray, float]:
    """(parameters, residual) at the foot of the slope below a start."""
    chosen = np.array(free)
    damping = 1e-3
    rest = seen - model(as_parameters(values))
    for _ in range(ITERATIONS):
        slope = jacobian(model, values, chosen)
        normal = slope.T @ slope
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slope.T @ rest)
        trial = values.copy()
        trial[chosen] = np.clip(values[chosen] + step, LOWEST[chosen], HIGHEST[chosen])
        after = seen - model(as_parameters(trial))
        if float(after @ after) < float(rest @ rest):
            gained = 1.0 - float(after @ after) / float(rest @ rest)
            settled = gained < SETTLED
            values, rest, damping = trial, after, damping / 4.0
            if settled:
                break
        else:
            damping *= 6.0
            if damping > 1e8:
                break
    return values, math.sqrt(float(rest @ rest) / len(seen))


def jacobian(model: Model, values: FloatArray, chosen: FloatArray) -> FloatArray:
    """Derivatives of what is seen by the chosen parameters, by differences."""
    columns = []
    for index in chosen:
        size = STEP * max(1.0, abs(float(values[index])))
        ahead, behind = values.copy(), values.copy()
        ahead[index] += size
        behind[index] = max(behind[index] - size, LOWEST[index] if index else 1e-3)
        difference = model(as_parameters(ahead)) - model(as_parameters(behind))
        columns.append(difference / (ahead[index] - behind[index]))
    return np.stack(columns, axis=1)


def half_widths(
    model: Model, seen: FloatArray, values: FloatArray, free: tuple[int, ...]
) -> tuple[float, float, float]:
    """Half widths of the 95 % intervals; 0 for what was not fitted."""
    rest = seen - model(as_parameters(values))
    slope = jacobian(model, values, np.array(free))
    degrees = max(len(seen) - len(free), 1)
    variance = float(rest @ rest) / degrees * correlation_factor(rest)
    covariance = variance * np.linalg.pinv(slope.T @ slope)
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
