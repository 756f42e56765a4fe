"""Formation keeping by model predictive control: what the fields are measured against.

A quadratic programme over some seconds. In the frame of the slot's motion, along + i right as one complex
number, the error p and the velocity v relative to the slot obey

    dp/dt = -i omega p - v        dv/dt = a

with the slot's own motion (speed, turn rate and their rates) predicted along the leader's arc and fed
forward, so that a = 0 keeps the slot. The sum of |p|² + q |v|² + r |a|² over the horizon is minimised, its
end weighed by the cost of the linear-quadratic regulator from there on. Bounds: lateral acceleration
(bank), longitudinal acceleration, what the speed hold would have to be told (V + a / beta, within the
airspeed range by the wind triangle on the slot's course), velocity across. The first of the accelerations
goes through the same wind triangle and limits as those of the fields.

Rawlings, Mayne and Diehl, Model Predictive Control, 2nd edition, 2017, chapters 1 and 8. Solved by OSQP,
each time from the solution before: Stellato et al., Mathematical Programming Computation 12, 2020.
"""

import math
from dataclasses import dataclass

import numpy as np
import osqp
from numpy.typing import NDArray
from scipy import sparse

from vfguide.angles import wrap_angle
from vfguide.elementwise import FloatArray
from vfguide.guidance.follower import FollowerGuidance
from vfguide.guidance.formation import FormationError, Slot, SlotMotion, lyapunov, slot_motion
from vfguide.guidance.limits import GRAVITY, ground_speed_range
from vfguide.guidance.setpoint import setpoint_for
from vfguide.guidance.settings import MpcWeights
from vfguide.guidance.wind_triangle import resolve
from vfguide.state import Airframe, LeaderState, VehicleState

ComplexArray = NDArray[np.complex128]

RICCATI_STEPS = 2000
"""Backward steps to the stationary cost; a hundred seconds of them, many time constants of the regulator."""

TOLERANCE = 1e-4
"""m/s² of the programme's residuals: far below what a setpoint's rounding makes of them."""

MOST_ITERATIONS = 400
"""Of the solver. What it has then is near enough for 50 ms."""

RHO_INTERVAL = 25
"""Iterations between adaptations of the solver's step: counted, not timed, or no flight could be repeated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Horizon:
    """The slot's motion at the knots, relative to now."""

    turned: FloatArray
    """theta at the N + 1 knots: how far the slot's course will have turned, rad."""
    course: FloatArray
    """chi_s at the middle of the N intervals, rad."""
    speed: FloatArray
    """V_s, m/s."""
    turn_rate: FloatArray
    """omega_s, rad/s."""
    acceleration: FloatArray
    """dV_s/dt, m/s²."""


def predicted_slot(
    leader: LeaderState[float], slot: Slot[float], *, interval: float, count: int
) -> Horizon:
    """How a slot moves over the next `count` intervals (s), its leader going on along its arc."""
    middle = (np.arange(count) + 0.5) * interval
    still = np.zeros(count)
    turn_rate = leader.turn_rate + leader.turn_acceleration * middle
    ahead = LeaderState(
        time_s=leader.time_s,
        north=still,
        east=still,
        course=leader.course + (leader.turn_rate + turn_rate) * (0.5 * middle),
        ground_speed=np.maximum(leader.ground_speed + leader.acceleration * middle, 1.0),
        acceleration=still + leader.acceleration,
        turn_rate=turn_rate,
        turn_acceleration=still + leader.turn_acceleration,
    )
    motion = slot_motion(ahead, Slot(forward=still + slot.forward, right=still + slot.right))
    return Horizon(
        turned=np.concatenate(([0.0], np.cumsum(motion.turn_rate) * interval)),
        course=motion.course,
        speed=motion.speed,
        turn_rate=motion.turn_rate,
        acceleration=motion.acceleration,
    )


def regulator(
    interval: float, velocity: float, acceleration: float
) -> tuple[FloatArray, FloatArray]:
    """(cost, gain) of the linear-quadratic regulator: the stationary solution of Riccati's equation.

    The cost is 2 x 2, of (p, v) from the horizon's end on; a = -gain (p, v).

    For p' = p - h v - h²/2 a, v' = v + h a, weights 1, `velocity` and `acceleration`.
    """
    transition = np.array([[1.0, -interval], [0.0, 1.0]])
    drive = np.array([[-0.5 * interval**2], [interval]])
    weights = np.diag([1.0, velocity])
    cost, gain = weights, np.zeros((1, 2))
    for _ in range(RICCATI_STEPS):
        gain = drive.T @ cost @ transition / (acceleration + drive.T @ cost @ drive)
        cost = weights + transition.T @ cost @ (transition - drive @ gain)
    return cost, gain[0]


class Programme:
    """The quadratic programme: what does not change, and the solver that remembers its solution."""

    def __init__(self, weights: MpcWeights, beta: float) -> None:
        """Set the solver up.

        Args:
            weights: of the cost.
            beta: response of the speed hold, 1/s.
        """
        self.count = weights.intervals
        """N, of intervals."""
        self.interval = weights.horizon_s / weights.intervals
        """h, s."""
        count, step = self.count, self.interval
        self._weights = weights
        self._end, self._gain = regulator(step, weights.velocity, weights.acceleration)
        lower = np.tril(np.ones((count, count)))
        # Velocities at the middle of each interval and at its end, by the accelerations up to there.
        self._middle_velocity = step * (lower - 0.5 * np.eye(count))
        self._end_velocity = step * lower
        self._begun_velocity = step * (lower - np.eye(count))
        velocities = self._end_velocity.T @ self._end_velocity
        self._effort = weights.velocity * velocities + weights.acceleration * np.eye(count)
        self._order = np.tril_indices(2 * count)
        self._lower = lower.astype(bool)
        told = self._begun_velocity + np.eye(count) / beta
        rows = np.block(
            [
                [np.eye(2 * count)],
                [told, np.zeros((count, count))],
                [np.zeros((count, count)), self._end_velocity],
            ]
        )
        unbounded = np.full(len(rows), np.inf)
        quadratic, _ = self._quadratic(np.zeros(count + 1))
        columns, across = self._order
        self._solver = osqp.OSQP()
        self._solver.setup(
            sparse.csc_matrix((quadratic[self._order], (across, columns)), quadratic.shape),
            np.zeros(2 * count),
            sparse.csc_matrix(rows),
            -unbounded,
            unbounded,
            eps_abs=TOLERANCE,
            eps_rel=TOLERANCE,
            max_iter=MOST_ITERATIONS,
            adaptive_rho=True,
            adaptive_rho_interval=RHO_INTERVAL,
            verbose=False,
        )

    def solve(
        self,
        error: complex,
        velocity: complex,
        turned: FloatArray,
        bounds: tuple[FloatArray, FloatArray],
    ) -> complex:
        """Acceleration a of the first interval, m/s²; the regulator's own where there is no solution.

        Args:
            error: p now, along + i right, m.
            velocity: v now, m/s.
            turned: theta at the knots, rad.
            bounds: (lowest, highest) of a along, a right, told speed and velocity right, relative to
                what v alone would make of them; 4 N each.
        """
        quadratic, driven = self._quadratic(turned)
        count, weights, end = self.count, self._weights, self._end
        spin = np.exp(-1j * turned[1:])
        carried = self._carried(turned) @ np.ones(count)
        free_error = spin * error - self.interval * carried * velocity
        pull = driven.conj().T @ free_error
        pull += (weights.velocity * velocity) * self._end_velocity.sum(axis=0)
        last_driven, last_velocity = driven[-1].conj(), self._end_velocity[-1]
        rest = end - np.diag([1.0, weights.velocity])
        pull += last_driven * (rest[0, 0] * free_error[-1] + rest[0, 1] * velocity)
        pull += last_velocity * (rest[1, 0] * free_error[-1] + rest[1, 1] * velocity)
        self._solver.update(
            Px=quadratic[self._order],
            q=np.concatenate([pull.real, pull.imag]),
            l=bounds[0],
            u=bounds[1],
        )
        result = self._solver.solve(raise_error=False)
        first = complex(result.x[0], result.x[count])
        if math.isfinite(first.real) and math.isfinite(first.imag):
            return first
        self._solver.warm_start(x=np.zeros(2 * count))
        return complex(-self._gain[0] * error - self._gain[1] * velocity)

    def _carried(self, turned: FloatArray) -> ComplexArray:
        """Turn of the frame from the middle of interval j to the knot K after it; 0 where j is later."""
        middle = 0.5 * (turned[1:] + turned[:-1])
        return np.where(self._lower, np.exp(-1j * (turned[1:, None] - middle)), 0.0)

    def _quadratic(self, turned: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """(P, G): the programme's matrix, and p at the knots for each acceleration, p = free + G a."""
        driven = -self.interval * (self._carried(turned) @ self._middle_velocity)
        rest = self._end - np.diag([1.0, self._weights.velocity])
        last, speed = driven[-1:], self._end_velocity[-1:]
        cross = rest[0, 1] * (last.conj().T @ speed)
        hermitian = driven.conj().T @ driven + self._effort
        hermitian = hermitian + rest[0, 0] * (last.conj().T @ last) + cross + cross.conj().T
        hermitian = hermitian + rest[1, 1] * (speed.T @ speed)
        return np.block(
            [[hermitian.real, -hermitian.imag], [hermitian.imag, hermitian.real]]
        ), driven


class Predictive:
    """Model predictive control of one follower."""

    def __init__(self, weights: MpcWeights, airframe: Airframe) -> None:
        self.programme = Programme(weights, airframe.beta)
        """What it solves."""
        self._weights = weights
        self._airframe = airframe

    def step(
        self,
        state: VehicleState[float],
        leader: LeaderState[float],
        slot: Slot[float],
        motion: SlotMotion[float],
        error: FormationError[float],
        *,
        aimed: FormationError[float],
        wind_feedforward: bool,
        rho: float,
        period: float,
    ) -> FollowerGuidance[float]:
        """Setpoint of the follower.

        Args:
            state: its navigated state.
            leader: at the same time.
            slot: in the formation.
            motion: of the slot, at the same time.
            error: where the slot is, at the same time.
            aimed: where the target is: beyond the slot by what was learned.
            wind_feedforward: whether the wind's rate of change is taken off.
            rho: weight of the Lyapunov function that is reported, s².
            period: until the next step, s.
        """
        programme = self.programme
        relative_course = wrap_angle(state.course - motion.course)
        ahead, aside = math.cos(relative_course), math.sin(relative_course)
        velocity = complex(state.ground_speed * ahead - motion.speed, state.ground_speed * aside)
        horizon = predicted_slot(leader, slot, interval=programme.interval, count=programme.count)
        wanted = programme.solve(
            complex(aimed.along_track, aimed.cross_track),
            velocity,
            horizon.turned,
            self._bounds(state, velocity, motion, horizon),
        )
        # From the slot's axes to the follower's own: along its course, and right of it.
        along, right = wanted.real + motion.acceleration, wanted.imag
        acceleration = along * ahead + right * aside
        turning = (right * ahead - along * aside) / max(state.ground_speed, 1.0)
        speed_error = state.ground_speed - motion.speed
        return FollowerGuidance(
            setpoint=setpoint_for(
                state,
                acceleration,
                motion.turn_rate + turning,
                self._airframe,
                wind_feedforward=wind_feedforward,
                hold=period,
            ),
            error=error,
            course_error=relative_course,
            speed_error=speed_error,
            lyapunov=lyapunov(error, relative_course, speed_error, rho),
        )

    def _bounds(
        self,
        state: VehicleState[float],
        velocity: complex,
        motion: SlotMotion[float],
        horizon: Horizon,
    ) -> tuple[FloatArray, FloatArray]:
        """Bounds of the programme's rows, each widened to what can be reached from here: never empty."""
        airframe, interval = self._airframe, self.programme.interval
        wind_along, wind_right = resolve(state.wind_rate_north, state.wind_rate_east, motion.course)
        # What the vehicle can do is an acceleration through the air; the wind's own comes on top.
        engine = airframe.max_acceleration
        lowest_along = wind_along - engine - horizon.acceleration
        highest_along = wind_along + engine - horizon.acceleration
        turn = GRAVITY * math.tan(airframe.max_bank)
        lowest_right = wind_right - turn - horizon.speed * horizon.turn_rate
        highest_right = wind_right + turn - horizon.speed * horizon.turn_rate
        wind = (
            np.full_like(horizon.speed, state.wind_north),
            np.full_like(horizon.speed, state.wind_east),
        )
        slowest, fastest = ground_speed_range(horizon.course, *wind, airframe)
        # V_s + v + (a + dV_s/dt) / beta is what the hold is told; v now is no variable.
        known = horizon.speed + horizon.acceleration / airframe.beta + velocity.real
        least = _summed(highest_along, interval) + highest_along / airframe.beta
        most = _summed(lowest_along, interval) + lowest_along / airframe.beta
        low_told = np.minimum(slowest - known, least)
        high_told = np.maximum(fastest - known, most)
        across = horizon.speed * math.sin(self._weights.max_course)
        low_across = np.minimum(-across - velocity.imag, np.cumsum(highest_right) * interval)
        high_across = np.maximum(across - velocity.imag, np.cumsum(lowest_right) * interval)
        return (
            np.concatenate([lowest_along, lowest_right, low_told, low_across]),
            np.concatenate([highest_along, highest_right, high_told, high_across]),
        )


def _summed(acceleration: FloatArray, interval: float) -> FloatArray:
    """Velocity gained by the beginning of each interval, m/s."""
    return (np.cumsum(acceleration) - acceleration) * interval
