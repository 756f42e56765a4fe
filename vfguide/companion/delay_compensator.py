"""Prediction of the vehicle to the moment at which a setpoint takes effect, by setpoints on their way.

An autopilot answers a setpoint after a dead time, until which earlier setpoints decide. The vehicle's own
model predicts its state at that moment (Smith, "Closer control of loops with dead time", 1957; for states:
Manitius and Olbrot, 1979). What the vehicle does beyond its model is observed and subtracted from the demand
(Ohnishi's disturbance observer).
"""

import math
from collections import deque
from collections.abc import Callable, Iterator

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import low_pass, wrap_angle
from vfguide.guidance.airframe import (
    ActiveSetpoint,
    Bias,
    Inner,
    coordinated_bank,
    course_error_for,
    held_direction,
    held_speed,
    propagate,
    propagate_inner,
    speed_range,
    turning_speed,
)
from vfguide.state import GAP_S, Airframe, Setpoint, SpeedHold, VehicleState

STEP_S = 0.05
"""Longest step of the prediction, s."""

WATCH_S = 0.6
"""Time constant for bank angle and acceleration of a vehicle that is not steered, s."""

ENERGY_S = 10.0
"""Time constant of the acceleration bias of a total-energy hold, s. Its pitch swings (PX4's simulated plane:
at 0.5 Hz; ArduPilot's with the yaw), and a fast correction would feed the swing."""

GREATEST_BIAS = Bias(turn_rate=0.2, acceleration=1.0)
"""Limit of the model's bias, rad/s and m/s²; beyond it the vehicle does something else."""


class Memory(msgspec.Struct, frozen=True, kw_only=True):
    """Time constants of the learned bias of a vehicle's model, and of the demand."""

    turn_rate_s: float = 0.6
    """Time constant of the turn rate's bias, s."""
    acceleration_s: float = 0.6
    """Time constant of the acceleration's bias, s."""
    answer_s: float = 0.0
    """Time constant of the low-pass on the demanded turn rate, s; 0 passes everything."""


SLIPPING = Memory(turn_rate_s=3.0, answer_s=0.5)
"""Time constants for a vehicle that slips. Its yaw swings with little damping (ArduPilot's simulated plane:
at 0.9 Hz), and a fast correction of the turn rate would feed the swing. Nor may the course's swing come back
as roll: the low-pass on the demand leaves a third of it."""


def memory_of(*, slips: bool, speed_hold: SpeedHold, course_bandwidth: float = math.inf) -> Memory:
    """Return the time constants for a kind of vehicle; the course hold bears a bandwidth, 1/s.

    The learned bias is subtracted from the demand. That is a loop, too, which an aircraft has to bear.
    """
    memory = SLIPPING if slips else Memory()
    memory = replace(memory, turn_rate_s=max(memory.turn_rate_s, 1.0 / course_bandwidth))
    return replace(memory, acceleration_s=ENERGY_S) if speed_hold == "total-energy" else memory


Law = Callable[[VehicleState], Setpoint]
"""Function from a state to a setpoint."""


class DelayCompensator:
    """Prediction of the near future of one vehicle."""

    def __init__(self, airframe: Airframe, *, memory: Memory | None = None) -> None:
        """Begin with nothing observed; the default memory is that of an ordinary vehicle."""
        self._airframe = airframe
        self._memory = Memory() if memory is None else memory
        self._sent: deque[tuple[float, Setpoint]] = deque()
        self._state: VehicleState | None = None
        self._inner = Inner()
        self._bias = Bias()
        self._direction = self._speed = 0.0
        self._asked: tuple[float, float] | None = None

    def retune(self, airframe: Airframe, memory: Memory) -> None:
        """Use another response, and other time constants, of the same vehicle."""
        self._airframe, self._memory = airframe, memory

    def note(self, setpoint: Setpoint, time_s: float) -> None:
        """Note a setpoint that was sent."""
        self._sent.append((time_s, setpoint))
        airframe = self._airframe
        oldest = time_s - max(airframe.course_dead_time, airframe.speed_dead_time) - GAP_S
        while len(self._sent) > 1 and self._sent[1][0] < oldest:
            self._sent.popleft()

    def forget(self) -> None:
        """Forget all setpoints, as the vehicle is not steered."""
        self._sent.clear()
        self._asked = None

    def observe(self, state: VehicleState) -> None:
        """Process a navigated state, and learn by how much the vehicle departs from its model."""
        before, self._state = self._state, state
        airframe = self._airframe
        direction, speed = held_direction(state, airframe), held_speed(state, airframe)
        period = math.inf if before is None else state.time_s - before.time_s
        if before is None or not 0.0 < period <= GAP_S:
            self._inner, self._bias = Inner(), Bias()
            self._direction, self._speed = direction, speed
            return
        active = self._active_at(before.time_s + 0.5 * period)
        if active.course is None:
            self._watch(before, state, period)
            return
        self._inner = propagate_inner(self._inner, before, active, period, airframe)
        expected = propagate(before, self._inner, self._bias, period, airframe)
        turned = wrap_angle(held_direction(expected, airframe) - held_direction(before, airframe))
        self._learn(
            wrap_angle(direction - self._direction - turned),
            speed - self._speed - (held_speed(expected, airframe) - held_speed(before, airframe)),
            period,
        )
        # Observed values follow the measured ones; only the difference matters.
        self._direction, self._speed = direction, speed

    def _learn(self, direction_surprise: float, speed_surprise: float, period: float) -> None:
        """Move the bias toward the departure from model and bias in one period."""
        greatest = GREATEST_BIAS
        turn_share = period / (self._memory.turn_rate_s + period)
        speed_share = period / (self._memory.acceleration_s + period)
        turn_rate = self._bias.turn_rate + turn_share * direction_surprise / period
        acceleration = self._bias.acceleration + speed_share * speed_surprise / period
        self._bias = Bias(
            turn_rate=min(max(turn_rate, -greatest.turn_rate), greatest.turn_rate),
            acceleration=min(max(acceleration, -greatest.acceleration), greatest.acceleration),
        )

    def _watch(self, before: VehicleState, state: VehicleState, period: float) -> None:
        """Estimate bank angle and acceleration of a vehicle that is not steered from its motion."""
        airframe = self._airframe
        share = period / (WATCH_S + period)
        direction, speed = held_direction(state, airframe), held_speed(state, airframe)
        turn_rate = wrap_angle(direction - held_direction(before, airframe)) / period
        bank = coordinated_bank(turn_rate, turning_speed(state, airframe), airframe.max_bank)
        acceleration = (speed - held_speed(before, airframe)) / period
        self._inner = Inner(
            bank=self._inner.bank + share * (bank - self._inner.bank),
            acceleration=self._inner.acceleration
            + share * (acceleration - self._inner.acceleration),
        )
        self._direction, self._speed, self._bias = direction, speed, Bias()

    def setpoint(self, course_law: Law, speed_law: Law) -> Setpoint:
        """Return the setpoint to send now for the laws' demands on the predicted vehicle.

        Only the course of `course_law` and only the speed of `speed_law` are used.
        """
        airframe = self._airframe
        course = self.course_setpoint(course_law)
        at, after = self._ahead(airframe.speed_dead_time, airframe.speed_lag)
        wanted = speed_law(after)
        rate = airframe.beta * (wanted.speed - held_speed(after, airframe))
        speed = held_speed(at, airframe) + (rate - self._bias.acceleration) / airframe.beta
        slowest, fastest = speed_range(at, airframe)
        return replace(
            course, speed=min(max(speed, slowest), fastest), speed_limited=wanted.speed_limited
        )

    def course_setpoint(self, law: Law) -> Setpoint:
        """Return the setpoint with a compensated course alone; the speed is the law's, without any lead."""
        airframe = self._airframe
        at, after = self._ahead(airframe.course_dead_time, airframe.course_lag)
        wanted = law(after)
        turn_rate = self._answered(airframe.alpha * (wanted.course - after.course), after.time_s)
        turn_rate -= self._bias.turn_rate
        error = course_error_for(turn_rate, turning_speed(at, airframe), airframe)
        return replace(wanted, course=at.course + error)

    def _answered(self, turn_rate: float, time_s: float) -> float:
        """Return the demanded turn rate, rad/s, at a time, s, after the low-pass."""
        if self._asked is not None and 0.0 < time_s - self._asked[0] <= GAP_S:
            before_s, before = self._asked
            turn_rate = low_pass(before, turn_rate, time_s - before_s, self._memory.answer_s)
        self._asked = time_s, turn_rate
        return turn_rate

    def _ahead(self, dead_time: float, lag: float) -> tuple[VehicleState, VehicleState]:
        """Return the state after a dead time, s, and after a further lag, s, at its bank and acceleration."""
        state, inner = self._state, self._inner
        if state is None:
            raise RuntimeError("nothing was observed yet")
        airframe = self._airframe
        for step in steps(dead_time):
            active = self._active_at(state.time_s + 0.5 * step)
            inner = propagate_inner(inner, state, active, step, airframe)
            state = propagate(state, inner, self._bias, step, airframe)
        at = state
        for step in steps(lag):
            state = propagate(state, inner, self._bias, step, airframe)
        return at, state

    def _active_at(self, time_s: float) -> ActiveSetpoint:
        """Return the setpoint that the autopilot's loops act on at a time, s."""
        airframe = self._airframe
        course = self._newest_before(time_s - airframe.course_dead_time)
        speed = self._newest_before(time_s - airframe.speed_dead_time)
        return ActiveSetpoint(
            course=None if course is None else course.course,
            speed=None if speed is None else speed.speed,
        )

    def _newest_before(self, time_s: float) -> Setpoint | None:
        for sent_s, setpoint in reversed(self._sent):
            if sent_s <= time_s:
                return setpoint
        return None


def steps(span_s: float) -> Iterator[float]:
    """Yield equal steps that make up a span, none longer than STEP_S."""
    count = math.ceil(span_s / STEP_S - 1e-9)
    for _ in range(count):
        yield span_s / count
