"""Where the vehicle will be when a setpoint takes effect, from the setpoints that are on their way to it.

An autopilot answers to a setpoint after a dead time; what it does until then was decided by those before.
The vehicle's own model carries its state on to that moment (Smith, "Closer control of loops with dead time",
1957; for states: Manitius and Olbrot, 1979), and what the vehicle does beyond its model is watched and taken
off what is asked of it (Ohnishi's disturbance observer).
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
"""Longest step of the prediction."""

WATCH_S = 0.6
"""Time constant with which bank and acceleration of a vehicle that nobody steers are seen."""

ENERGY_S = 10.0
"""Memory of the acceleration of a total-energy hold, whose pitch swings (PX4's simulated plane: at 0.5 Hz;
that of ArduPilot's with the yaw): taken off at once it would feed the swing."""

GREATEST_BIAS = Bias(turn_rate=0.2, acceleration=1.0)
"""What a model may be off by; more is no bias but a vehicle that does something else."""


class Memory(msgspec.Struct, frozen=True, kw_only=True):
    """Time constants with which a vehicle's departures from its model are learned, and it is answered."""

    turn_rate_s: float = 0.6
    """Time constant for departures of the turn rate, s."""
    acceleration_s: float = 0.6
    """Time constant for departures of the acceleration, s."""
    answer_s: float = 0.0
    """Low-pass on the turn rate asked of it, s; 0 lets everything through."""


SLIPPING = Memory(turn_rate_s=3.0, answer_s=0.5)
"""Of a vehicle that slips. Its yaw swings with little damping (ArduPilot's simulated plane: at 0.9 Hz): what
a swing adds to the turn rate would feed it, taken off at once. Nor may what it adds to the course come back
as roll: the low-pass on the answer leaves a third of it."""


def memory_of(*, slips: bool, speed_hold: SpeedHold, course_bandwidth: float = math.inf) -> Memory:
    """How fast departures of such a vehicle from its model are learned.

    What is learned is taken off what is asked: that is a loop, too, which an aircraft has to bear.

    Args:
        slips: whether it slips.
        speed_hold: kind of its speed hold.
        course_bandwidth: that its course hold bears, 1/s.
    """
    memory = SLIPPING if slips else Memory()
    memory = replace(memory, turn_rate_s=max(memory.turn_rate_s, 1.0 / course_bandwidth))
    return replace(memory, acceleration_s=ENERGY_S) if speed_hold == "total-energy" else memory


Law = Callable[[VehicleState], Setpoint]
"""Setpoint for a state."""


class DelayCompensator:
    """The near future of one vehicle."""

    def __init__(self, airframe: Airframe, *, memory: Memory | None = None) -> None:
        """Make one that has seen nothing yet.

        Args:
            airframe: of the vehicle.
            memory: how fast its departures from its model are learned; a usual one's if absent.
        """
        self._airframe = airframe
        self._memory = Memory() if memory is None else memory
        self._sent: deque[tuple[float, Setpoint]] = deque()
        self._state: VehicleState | None = None
        self._inner = Inner()
        self._bias = Bias()
        self._direction = self._speed = 0.0
        self._asked: tuple[float, float] | None = None

    def retune(self, airframe: Airframe, memory: Memory) -> None:
        """Go on with another response, and other time constants, of the same vehicle."""
        self._airframe, self._memory = airframe, memory

    def note(self, setpoint: Setpoint, time_s: float) -> None:
        """A setpoint has gone out."""
        self._sent.append((time_s, setpoint))
        airframe = self._airframe
        oldest = time_s - max(airframe.course_dead_time, airframe.speed_dead_time) - GAP_S
        while len(self._sent) > 1 and self._sent[1][0] < oldest:
            self._sent.popleft()

    def forget(self) -> None:
        """The vehicle is not steered: nothing is on its way."""
        self._sent.clear()
        self._asked = None

    def observe(self, state: VehicleState) -> None:
        """Take a navigated state: how far is the vehicle from what its model does?"""
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
        """Move the bias toward what one period has shown beyond model and bias."""
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
        """Nobody steers it from here: its bank and acceleration are what they show."""
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
        """What the laws ask for of the vehicle as it will be, turned into what has to be sent now.

        Args:
            course_law: of its setpoint the course is used.
            speed_law: of its setpoint the speed is used.
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
        """The same for the course alone; the speed is what the law says without any lead."""
        airframe = self._airframe
        at, after = self._ahead(airframe.course_dead_time, airframe.course_lag)
        wanted = law(after)
        turn_rate = self._answered(airframe.alpha * (wanted.course - after.course), after.time_s)
        turn_rate -= self._bias.turn_rate
        error = course_error_for(turn_rate, turning_speed(at, airframe), airframe)
        return replace(wanted, course=at.course + error)

    def _answered(self, turn_rate: float, time_s: float) -> float:
        """The turn rate asked for at a time, through the low-pass; rad/s, s."""
        if self._asked is not None and 0.0 < time_s - self._asked[0] <= GAP_S:
            before_s, before = self._asked
            turn_rate = low_pass(before, turn_rate, time_s - before_s, self._memory.answer_s)
        self._asked = time_s, turn_rate
        return turn_rate

    def _ahead(self, dead_time: float, lag: float) -> tuple[VehicleState, VehicleState]:
        """The vehicle after a dead time (s), and a lag later at the bank and acceleration it then has."""
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
        """The setpoint that the loops act on at a time."""
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
    """Equal steps that make up a span, none longer than allowed."""
    count = math.ceil(span_s / STEP_S - 1e-9)
    for _ in range(count):
        yield span_s / count
