"""What a limit of 3 m/s² along the way leaves of any law's nearness in the emulator's moderate turbulence.

    python -m tests.benchmarks.turbulence_limits

`turbulence_bound` takes a limit for a root mean square. Here it is a limit: a follower's airspeed changes by
3 m/s² at most, in the emulator's own gusts on a straight line at 20 m/s, along the way alone. The own motion
is known exactly and at once, the leader's place and velocity 0.1 s late. The laws:

- the slot field as the missions have it, without its integral;
- the best found of the laws that know the limit: onto the curve v = -f(e) on which a part of the limit still
  brings the follower to rest in its slot (linear near it), as fast as `NEARING_1_S`;
- the field, told what its leader met where the follower is about to be, as far ahead as that is known.

The gusts ahead are weighed by how the follower would answer a push, as the linear quadratic regulator does.
"""

import math
from collections.abc import Callable
from itertools import product

import numpy as np
from scipy.linalg import expm

from sitl_stub.air import TurbulenceField
from tests.benchmarks.turbulence_bound import GUSTS, SPEED_M_S, STEP_S
from tests.kit.figures import heading, row
from vfguide.elementwise import FloatArray

LIMIT_M_S2 = 3.0
LATE_STEPS = 2
SEEDS, STEPS, BEGIN = range(8), 1600, 60
SLOTS_M = ((-20.0, 20.0), (-40.0, 0.0), (-20.0, 30.0), (-60.0, 0.0))
SLOPE_1_S, K_X_1_M, KAPPA, LAYER_M_S = 8.0 * 2.0 / math.pi, 0.42, 3.0, 4.8 * 3.0 * STEP_S
NEARING_1_S = (4.0, 8.0, 16.0)
BRAKING_M_S2, AT_REST_1_S = (1.0, 1.5, 2.0, 2.5), (1.5, 3.0, 5.0)
AHEAD = 20
"""Steps of gusts that are looked ahead at."""

Law = Callable[[FloatArray, FloatArray], FloatArray]
"""Acceleration, m/s², for errors (m, positive where the slot is ahead) and their rates (m/s)."""


def field(error: FloatArray, rate: FloatArray) -> FloatArray:
    """The slot field and the sliding law beneath it."""
    scaled = K_X_1_M * error
    push, slope = SLOPE_1_S * np.arctan(scaled), SLOPE_1_S * K_X_1_M / (1.0 + scaled**2)
    return slope * rate + KAPPA * np.clip((rate + push) / LAYER_M_S, -1.0, 1.0)


def switching(braking: float, at_rest: float, nearing: float) -> Law:
    """A law that is at rest in the slot by an acceleration (m/s²) that the limit allows."""

    def law(error: FloatArray, rate: FloatArray) -> FloatArray:
        size, linear_m = np.abs(error), braking / at_rest**2
        root = np.sqrt(np.maximum(2.0 * braking * (size - 0.5 * linear_m), 1e-9))
        near = size < linear_m
        wanted = np.sign(error) * np.where(near, at_rest * size, root)
        return np.where(near, at_rest, braking / root) * rate + nearing * (rate + wanted)

    return law


def met(slot_m: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Gusts along the way (m/s) at the leader and at a slot: one row for each seed."""
    north = np.arange(STEPS + BEGIN) * STEP_S * SPEED_M_S
    still = np.zeros_like(north)
    fields = [TurbulenceField(GUSTS, seed) for seed in SEEDS]
    leader = [one.at(np.array([north, still, still]))[0] for one in fields]
    slot = [one.at(np.array([north + slot_m[0], still + slot_m[1], still]))[0] for one in fields]
    return np.array(leader), np.array(slot)


def foretold(leader: FloatArray, behind_m: float) -> FloatArray:
    """What the gusts ahead ask for (m/s²) if a follower meets them as its leader did, by seed and step."""
    slope, nearing = SLOPE_1_S * K_X_1_M, KAPPA / LAYER_M_S
    gains = np.array([slope * nearing, slope + nearing])
    answer = np.array([[0.0, 1.0], -gains])
    lag, asked = round(behind_m / SPEED_M_S / STEP_S), np.zeros_like(leader)
    for ahead in range(min(AHEAD, lag - LATE_STEPS - 1)):
        back = lag - ahead
        change = np.zeros_like(leader)
        change[:, back:] = np.diff(leader, axis=1)[:, : leader.shape[1] - back]
        asked -= float(gains @ expm(answer * STEP_S * ahead)[:, 1]) * change
    return asked


def flown(law: Law, slot_m: tuple[float, float], *, foresees: bool = False) -> tuple[float, float]:
    """(mean error in m, share of the time at the limit)."""
    leader, slot = met(slot_m)
    ahead = foretold(leader, -slot_m[0]) if foresees else np.zeros_like(leader)
    error, airspeed = np.zeros(len(leader)), np.zeros(len(leader))
    errors, at_limit = [], []
    for step in range(BEGIN, STEPS + BEGIN - 1):
        known = leader[:, step - LATE_STEPS]
        passed = leader[:, step - LATE_STEPS : step + 1]
        # The leader's place is carried on by the velocity that was heard last.
        missed = STEP_S * (np.sum(passed, axis=1) - 0.5 * (passed[:, 0] + passed[:, -1]))
        believed = error - missed + STEP_S * LATE_STEPS * known
        asked = law(believed, known - slot[:, step] - airspeed) + ahead[:, step]
        after = airspeed + STEP_S * np.clip(asked, -LIMIT_M_S2, LIMIT_M_S2)
        gusts = leader[:, step : step + 2].mean(axis=1) - slot[:, step : step + 2].mean(axis=1)
        error = error + STEP_S * (gusts - 0.5 * (airspeed + after))
        airspeed = after
        if step >= 200:
            errors.append(np.abs(error))
            at_limit.append(np.abs(asked) > LIMIT_M_S2)
    return float(np.mean(errors)), float(np.mean(at_limit))


def main() -> None:
    """Print the table."""
    heading(
        *("slot", "the field", "the best that knows its limit"),
        "the field, told the leader's gusts",
    )
    for slot in SLOTS_M:
        laws = [switching(*gains) for gains in product(BRAKING_M_S2, AT_REST_1_S, NEARING_1_S)]
        found = (
            flown(field, slot),
            min(flown(law, slot) for law in laws),
            flown(field, slot, foresees=True),
        )
        row(slot, *(f"{mean:.3f} m, {share:.0%} limited" for mean, share in found))


if __name__ == "__main__":
    main()
