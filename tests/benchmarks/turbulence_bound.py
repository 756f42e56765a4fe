"""The least slot error that any causal law can have in the emulator's turbulence, beside what is flown.

    python -m tests.benchmarks.turbulence_bound

A follower and its leader at 20 m/s through Dryden's isotropic field as `sitl_stub.air` has it, on a straight
line, each axis by itself. The gusts of both are one vector autoregression, fitted to the field's covariances
(Yule and Walker), so that a follower behind its leader may even know what it will fly into. The controller
knows all gusts and states exactly, up to now, and is the linear quadratic regulator: least E[e² + rho a²] for
the plants of the emulator, with its setpoint late by some steps of 1/20 s. What is wider than a limit allows
is weighed away: rho is raised until the acceleration that is asked for has the limit as its root mean square.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import brentq

import vfguide
from sitl_stub.air import low_altitude_intensity
from tests.kit.figures import heading, row, tell
from tests.kit.missions import shipped
from vfguide.elementwise import FloatArray

STEP_S, SPEED_M_S, LAGS = 0.05, 20.0, 50
SLOTS_M = ((-20.0, -20.0), (-20.0, 20.0), (-40.0, 0.0))
HEIGHT_M = 100.0
GUSTS = low_altitude_intensity("moderate", HEIGHT_M)


@dataclass(frozen=True)
class Axis:
    """One direction of a follower's motion: an airspeed or a course that answers with a first-order lag."""

    name: str
    response: float
    """beta or alpha, 1/s."""
    limit: float
    """Greatest acceleration, m/s²."""
    across: bool
    """Whether it is the one across the way."""


AXES = (Axis("along", 0.8, 3.0, across=False), Axis("across", 1.2, 9.81, across=True))


def covariance(along_m: float, right_m: float, *, across: bool) -> float:
    """Of a component of the gusts at two places, m²/s²: Batchelor's isotropic tensor of Dryden's spectra."""
    away = math.hypot(along_m, right_m)
    f = math.exp(-away / GUSTS.length_m)
    g = (1.0 - 0.5 * away / GUSTS.length_m) * f
    part = (right_m if across else along_m) ** 2 / away**2 if away else 1.0
    return GUSTS.deviation_m_s**2 * (g + (f - g) * part)


def gusts(slot_m: tuple[float, float], *, across: bool) -> tuple[FloatArray, FloatArray]:
    """(transition, covariance of what is new) of the gusts at leader and follower and `LAGS` steps before."""
    places = np.array([(0.0, 0.0), slot_m])

    def between(lag: int) -> FloatArray:
        way = SPEED_M_S * STEP_S * lag
        return np.array(
            [
                [covariance(way + a[0] - b[0], a[1] - b[1], across=across) for b in places]
                for a in places
            ]
        )

    lags = {lag: between(lag) for lag in range(-LAGS, LAGS + 1)}
    ridge = 1e-6 * GUSTS.deviation_m_s**2 * np.eye(2 * LAGS)
    past = np.block([[lags[j - i] for j in range(LAGS)] for i in range(LAGS)]) + ridge
    next_one = np.hstack([lags[j + 1] for j in range(LAGS)])
    weights = np.linalg.solve(past.T, next_one.T).T
    transition = np.zeros((2 * LAGS, 2 * LAGS))
    transition[:2], transition[2:, :-2] = weights, np.eye(2 * LAGS - 2)
    new = lags[0] - weights @ next_one.T
    noise = np.zeros_like(transition)
    noise[:2, :2] = 0.5 * (new + new.T)
    return transition, noise


def least_error(
    axis: Axis, slot_m: tuple[float, float], late: int, rho: float
) -> tuple[float, float]:
    """(error in m, acceleration in m/s²), root mean squares, of the best law.

    State: error, follower's and leader's motion through the air, setpoints on their way, gusts. Across the
    way both autopilots turn against their gusts by themselves; along it both hold their airspeeds.
    """
    drive, noise = gusts(slot_m, across=axis.across)
    first = 3 + late
    size, decay = first + len(drive), math.exp(-axis.response * STEP_S)
    a, b, q = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((size, size))
    leader, follower = first, first + 1
    a[0, 0] = 1.0
    a[0, [leader, follower]] = STEP_S, -STEP_S
    a[0, [2, 1]] = STEP_S, -STEP_S
    a[1, 1] = a[2, 2] = decay
    a[1, 2 + late] = 1.0 - decay
    if axis.across:
        a[1, follower] = a[2, leader] = decay - 1.0
    for one in range(late - 1):
        a[4 + one, 3 + one] = 1.0
    b[3, 0] = 1.0
    a[first:, first:], q[first:, first:] = drive, noise
    # The acceleration that the setpoint asks for when it takes effect.
    pull = np.zeros((1, size))
    pull[0, [1, 2 + late]] = -axis.response, axis.response
    if axis.across:
        pull[0, follower] = -axis.response
    weight = rho * pull.T @ pull
    weight[0, 0] += 1.0
    value = solve_discrete_are(a, b, weight, np.array([[1e-9]]))
    gain = np.linalg.solve(b.T @ value @ b + 1e-9, b.T @ value @ a)
    spread = solve_discrete_lyapunov(a - b @ gain, q)
    return math.sqrt(max(spread[0, 0], 0.0)), math.sqrt((pull @ spread @ pull.T)[0, 0])


def limited_error(axis: Axis, slot_m: tuple[float, float], late: int) -> float:
    """Root mean square (m) of the best law's error whose acceleration has the limit as its own."""

    def excess(power: float) -> float:
        return least_error(axis, slot_m, late, 10.0**power)[1] - axis.limit

    return least_error(axis, slot_m, late, 10.0 ** brentq(excess, -8.0, 3.0, xtol=0.01))[0]


def mean_distance(along: float, across: float) -> float:
    """Mean distance (m) of two normal errors of these root mean squares, by quadrature over the angle."""
    angle = np.linspace(0.0, 2.0 * math.pi, 3600, endpoint=False)
    radius = np.hypot(along * np.cos(angle), across * np.sin(angle))
    return float(math.sqrt(math.pi / 2.0) * radius.mean())


WIDE: dict[str, object] = {
    f"vehicles.{name}.{key}": value
    for name in ("leader", "f1", "f2", "f3")
    for key, value in (
        ("max_acceleration_m_s2", 30.0),
        ("max_bank_deg", 75.0),
        ("airspeed_range_m_s", [6.0, 60.0]),
    )
}
AT_ONCE: dict[str, object] = {"rehearsal.link_delay_s": 0.0}
STIFF: dict[str, object] = {"controller.k_x": 0.84, "controller.k_y": 0.56}
FLIGHTS: tuple[tuple[str, dict[str, object], float], ...] = (
    ("as shipped", {}, 20.0),
    ("no delay on the link", AT_ONCE, 20.0),
    ("50 Hz", {}, 50.0),
    ("wide limits", WIDE, 20.0),
    ("gains of the field times 2", STIFF, 20.0),
    ("all of these", WIDE | AT_ONCE | STIFF, 50.0),
)
"""What is changed, and the rate in Hz."""


def bounds() -> None:
    """Print the table of the bound."""
    heading(
        *("slot", "setpoint late by, s", "along", "across", "mean distance, m"),
        *("limits kept: along", "across", "mean"),
    )
    for slot in SLOTS_M[1:]:
        for late in (1, 3):
            free = [least_error(axis, slot, late, 1e-8)[0] for axis in AXES]
            kept = [limited_error(axis, slot, late) for axis in AXES]
            cells = (*free, mean_distance(*free), *kept, mean_distance(*kept))
            row(slot, f"{late * STEP_S:.2f}", *(f"{cell:.3f}" for cell in cells))


def flights(duration_s: float) -> None:
    """Print the table of what is flown."""
    tell()
    heading("flown", "from the slots as meant, m", "as they are, m")
    mission = shipped("line-wind")
    for name, settings, rate_hz in FLIGHTS:
        changed = {"wind.turbulence": "moderate", **settings}
        found = vfguide.fly(mission, settings=changed, rate_hz=rate_hz, duration_s=duration_s)
        formation = found.summary.formation
        row(name, f"{formation.intended_error_m:.2f}", f"{formation.mean_error_m:.2f}")


if __name__ == "__main__":
    bounds()
    flights(150.0)
