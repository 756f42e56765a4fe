"""Formation keeping by model predictive control: a baseline for the fields.

A quadratic programme over some seconds. In the frame of the slot's motion, with along + i right as one
complex number, the error p and the velocity v relative to the slot obey

    dp/dt = -i omega p - v        dv/dt = a

The slot's own motion (speed, turn rate and their rates) is predicted along the leader's arc and fed forward,
so that a = 0 keeps the slot. The sum of |p|² + q |v|² + r |a|² over the horizon is minimised, with the
infinite-horizon cost of the linear-quadratic regulator at its end. Bounds apply to lateral acceleration
(bank), longitudinal acceleration, cross velocity and the speed hold's setpoint. The latter is V + a / beta,
within the airspeed range by the wind triangle on the slot's course. The first acceleration passes the same
wind triangle and limits as those of the fields.

Rawlings, Mayne and Diehl, Model Predictive Control, 2nd edition, 2017, chapters 1 and 8. Solved by OSQP,
warm-started with the previous solution: Stellato et al., Mathematical Programming Computation 12, 2020.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vfguide.elementwise import FloatArray, wrap_angle
from vfguide.guidance.airframe import GRAVITY, ground_speed_on_course, resolve
from vfguide.guidance.formation import (
    LEAST_SLOT_SPEED,
    Offset,
    Slot,
    SlotMotion,
    aimed_error,
    no_offset,
    update_offset,
)
from vfguide.guidance.response import Bandwidth
from vfguide.laws.base import DesiredMotion, Law, View, law
from vfguide.mission.quantity import Duration, Gain, NotNegative, Number, Section
from vfguide.state import LeaderState, VehicleState

ComplexArray = NDArray[np.complex128]

TOLERANCE = 1e-4
"""Tolerance of the programme's residuals, m/s²: far below the rounding of setpoints."""

MOST_ITERATIONS = 400
"""Largest number of solver iterations: the result is then near enough for 50 ms."""

RHO_INTERVAL = 25
"""Iterations between adaptations of the solver's step: counted, not timed, for repeatable flights."""


class MpcGains(Section):
    """The baseline `mpc`: a quadratic programme over the next seconds; a metre of error weighs 1.

    The defaults are what a search on the calm missions found (docs/benchmarks.md).
    """

    horizon_s: Annotated[Number, Field(ge=0.5, le=20.0)] = 4.0
    """How far it looks, s."""

    intervals: Annotated[int, Field(strict=True, ge=2, le=100)] = 28
    """Into how many intervals of constant acceleration the horizon is cut."""

    velocity_weight_s2: Annotated[NotNegative, Field(le=1e4)] = 0.01
    """Weight of the velocity relative to the slot, s²."""

    acceleration_weight_s4: Annotated[Gain, Field(le=1e4)] = 0.0016
    """Weight of the acceleration relative to the slot, s⁴."""

    max_course_deg: Annotated[Number, Field(ge=1.0, le=90.0)] = 45.0
    """Largest course relative to the slot's that is planned, degrees."""

    integral_s: Duration = 0.75
    """Time in which it learns what keeps a follower off its slot, s; 0: never."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Horizon:
    """Motion of the slot at the knots, relative to now."""

    turned: FloatArray
    """theta at the N + 1 knots: future turn of the slot's course, rad."""
    course: FloatArray
    """chi_s at the middle of the N intervals, rad."""
    speed: FloatArray
    """V_s, m/s."""
    turn_rate: FloatArray
    """omega_s, rad/s."""
    acceleration: FloatArray
    """dV_s/dt, m/s²."""


def predicted_slot(leader: LeaderState, slot: Slot, *, interval: float, count: int) -> Horizon:
    """Predict a slot over the next `count` intervals (s), its leader going on along its arc.

    This is `slot_motion` at each interval's middle; the slot continues its motion in the formation.
    """
    middle = (np.arange(count) + 0.5) * interval
    turn_rate = leader.turn_rate + leader.turn_acceleration * middle
    ground_speed = np.maximum(leader.ground_speed + leader.acceleration * middle, 1.0)
    forward_rate = slot.forward_rate + slot.forward_acceleration * middle
    right_rate = slot.right_rate + slot.right_acceleration * middle
    forward = slot.forward + 0.5 * (slot.forward_rate + forward_rate) * middle
    right = slot.right + 0.5 * (slot.right_rate + right_rate) * middle
    along = np.maximum(ground_speed - turn_rate * right + forward_rate, LEAST_SLOT_SPEED)
    aside = turn_rate * forward + right_rate
    along_rate = (
        leader.acceleration
        - leader.turn_acceleration * right
        - turn_rate * right_rate
        + slot.forward_acceleration
    )
    aside_rate = (
        leader.turn_acceleration * forward + turn_rate * forward_rate + slot.right_acceleration
    )
    speed = np.hypot(along, aside)
    turning = turn_rate + (along * aside_rate - aside * along_rate) / (speed * speed)
    leader_course = leader.course + (leader.turn_rate + turn_rate) * (0.5 * middle)
    return Horizon(
        turned=np.concatenate(([0.0], np.cumsum(turning) * interval)),
        course=leader_course + np.arctan2(aside, along),
        speed=speed,
        turn_rate=turning,
        acceleration=(along * along_rate + aside * aside_rate) / speed,
    )


def regulator(
    interval: float, velocity: float, acceleration: float
) -> tuple[FloatArray, FloatArray]:
    """Return (cost, gain) of the linear-quadratic regulator, from the stationary Riccati equation.

    The 2 x 2 cost of (p, v) applies beyond the horizon; a = -gain (p, v). The model is p' = p - h v - h²/2 a,
    v' = v + h a, the weights are 1, `velocity` and `acceleration`.
    """
    from scipy.linalg import solve_discrete_are

    transition = np.array([[1.0, -interval], [0.0, 1.0]])
    drive = np.array([[-0.5 * interval**2], [interval]])
    weights = np.diag([1.0, velocity])
    cost = solve_discrete_are(transition, drive, weights, np.array([[acceleration]]))
    gain = drive.T @ cost @ transition / (acceleration + drive.T @ cost @ drive)
    return cost, gain[0]


class Programme:
    """Constant parts of the quadratic programme, and a solver that remembers its solution."""

    def __init__(self, weights: MpcGains, beta: float) -> None:
        """Set the solver up; beta is the response of the speed hold, 1/s."""
        # Deferred: the solver loads 40 MB of libraries that no other law needs.
        import osqp
        from scipy import sparse

        self.count = weights.intervals
        """N, number of intervals."""
        self.interval = weights.horizon_s / weights.intervals
        """h, s."""
        count, step = self.count, self.interval
        self._weights = weights
        self._end, self._gain = regulator(
            step, weights.velocity_weight_s2, weights.acceleration_weight_s4
        )
        lower = np.tril(np.ones((count, count)))
        # Velocities at each interval's middle and end due to the accelerations up to there.
        self._middle_velocity = step * (lower - 0.5 * np.eye(count))
        self._end_velocity = step * lower
        self._begun_velocity = step * (lower - np.eye(count))
        velocities = self._end_velocity.T @ self._end_velocity
        self._effort = (
            weights.velocity_weight_s2 * velocities + weights.acceleration_weight_s4 * np.eye(count)
        )
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
        """Return the first interval's acceleration a, m/s²; the regulator's where there is no solution.

        Args:
            error: p now, along + i right, m.
            velocity: v now, m/s.
            turned: theta at the knots, rad.
            bounds: (lowest, highest) of a along, a right, speed setpoint and velocity right, relative to the
                part due to v alone; 4 N each.
        """
        quadratic, driven = self._quadratic(turned)
        count, weights, end = self.count, self._weights, self._end
        spin = np.exp(-1j * turned[1:])
        carried = self._carried(turned) @ np.ones(count)
        free_error = spin * error - self.interval * carried * velocity
        pull = driven.conj().T @ free_error
        pull += (weights.velocity_weight_s2 * velocity) * self._end_velocity.sum(axis=0)
        last_driven, last_velocity = driven[-1].conj(), self._end_velocity[-1]
        rest = end - np.diag([1.0, weights.velocity_weight_s2])
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
        """Return the frame's turn from the middle of interval j to the knot K after it; 0 for a later j."""
        middle = 0.5 * (turned[1:] + turned[:-1])
        return np.where(self._lower, np.exp(-1j * (turned[1:, None] - middle)), 0.0)

    def _quadratic(self, turned: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Return (P, G): the programme's matrix, and p at the knots for each acceleration, p = free + G a."""
        driven = -self.interval * (self._carried(turned) @ self._middle_velocity)
        rest = self._end - np.diag([1.0, self._weights.velocity_weight_s2])
        last, speed = driven[-1:], self._end_velocity[-1:]
        cross = rest[0, 1] * (last.conj().T @ speed)
        hermitian = driven.conj().T @ driven + self._effort
        hermitian = hermitian + rest[0, 0] * (last.conj().T @ last) + cross + cross.conj().T
        hermitian = hermitian + rest[1, 1] * (speed.T @ speed)
        return np.block(
            [[hermitian.real, -hermitian.imag], [hermitian.imag, hermitian.real]]
        ), driven


@law("mpc")
class Mpc(Law):
    """Model predictive control of the error from a point beyond the slot by a learned offset.

    Without the learned offset a disturbance that the model lacks would leave a lasting error. The solver
    starts from its previous solution, which is kept here: the start does not affect the optimum.
    """

    Gains = MpcGains
    libraries = ("osqp", "scipy")
    _programme: Programme | None = None

    def within(self, bandwidth: Bandwidth) -> Self:
        """Return the law with accelerations expensive enough to keep it within the bandwidth.

        The regulator's poles lie at acceleration_weight ** (-1/4), 1/s.
        """
        bounded = super().within(bandwidth)
        fastest = min(bandwidth.course, bandwidth.speed)
        gains = self.gains
        changes = {"acceleration_weight_s4": max(gains.acceleration_weight_s4, fastest**-4)}
        if gains.acceleration_weight_s4 < fastest**-4:
            changes["integral_s"] = gains.integral_s and max(gains.integral_s, 4.0 / fastest)
            changes["horizon_s"] = min(max(gains.horizon_s, 3.0 / fastest), 20.0)
        bounded.gains = gains.model_copy(update=changes)
        return bounded

    def start(self, view: View) -> Offset:
        """Return the offset before anything is learned."""
        del view
        return no_offset()

    def step(self, view: View, memory: Offset) -> tuple[DesiredMotion, Offset]:
        """Return the motion of the first acceleration of the best plan."""
        if self._programme is None:
            self._programme = Programme(self.gains, self.airframe.beta)
        programme = self._programme
        state, motion = view.state, view.motion
        aimed = aimed_error(view.error, memory, self.gains.integral_s, motion)
        relative_course = wrap_angle(state.course - motion.course)
        ahead, aside = math.cos(relative_course), math.sin(relative_course)
        velocity = complex(state.ground_speed * ahead - motion.speed, state.ground_speed * aside)
        horizon = predicted_slot(
            view.leader, view.slot, interval=programme.interval, count=programme.count
        )
        wanted = programme.solve(
            complex(aimed.along_track, aimed.cross_track),
            velocity,
            horizon.turned,
            self._bounds(programme, state, velocity, motion, horizon),
        )
        # From the slot's axes to the follower's own: along and right of its course.
        along, right = wanted.real + motion.acceleration, wanted.imag
        acceleration = along * ahead + right * aside
        turning = (right * ahead - along * aside) / max(state.ground_speed, 1.0)
        desired = DesiredMotion(
            course=motion.course,
            speed=motion.speed,
            course_rate=motion.turn_rate + turning,
            acceleration=acceleration,
        )
        return desired, memory

    def learn(self, view: View, memory: Offset, *, limited: bool) -> Offset:
        """Return the updated offset."""
        integral_s = self.gains.integral_s
        return update_offset(
            memory, view.error, integral_s, view.motion, period=view.period, held=limited
        )

    def _bounds(
        self,
        programme: Programme,
        state: VehicleState,
        velocity: complex,
        motion: SlotMotion,
        horizon: Horizon,
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of the programme's rows, each widened to what is reachable: never empty."""
        airframe, interval = self.airframe, programme.interval
        wind_along, wind_right = resolve(state.wind_rate_north, state.wind_rate_east, motion.course)
        # The vehicle's limits are accelerations relative to the air; the wind's own is added.
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
        slowest, fastest = (
            ground_speed_on_course(np.full_like(horizon.course, airspeed), horizon.course, *wind)
            for airspeed in (airframe.airspeed_min, airframe.airspeed_max)
        )
        # The hold's setpoint is V_s + v + (a + dV_s/dt) / beta; the present v is no variable.
        known = horizon.speed + horizon.acceleration / airframe.beta + velocity.real
        least = _summed(highest_along, interval) + highest_along / airframe.beta
        most = _summed(lowest_along, interval) + lowest_along / airframe.beta
        low_told = np.minimum(slowest - known, least)
        high_told = np.maximum(fastest - known, most)
        across = horizon.speed * math.sin(math.radians(self.gains.max_course_deg))
        low_across = np.minimum(-across - velocity.imag, np.cumsum(highest_right) * interval)
        high_across = np.maximum(across - velocity.imag, np.cumsum(lowest_right) * interval)
        return (
            np.concatenate([lowest_along, lowest_right, low_told, low_across]),
            np.concatenate([highest_along, highest_right, high_told, high_across]),
        )


def _summed(acceleration: FloatArray, interval: float) -> FloatArray:
    """Return the velocity gained by the beginning of each interval, m/s."""
    return (np.cumsum(acceleration) - acceleration) * interval
