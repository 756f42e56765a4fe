"""An aircraft of one's own for the emulator: course and speed as second-order models, as measured by steps.

    vfguide fly circle-wind --plugin own_plant.py --plant measured
    sitl-stub --system-id 1 --mavlink udpout://127.0.0.1:14550 --plugin own_plant.py --plant measured

`--set rehearsal.emulator.plant_options.course_damping=0.4`, or `--plant-option course_damping=0.4` of the
emulator, changes a number of it. What the companion takes the vehicle for, the mission says in `vehicles`:
`vfguide identify` finds it out as it would for an aircraft.
"""

import math
from dataclasses import dataclass

from sitl_stub import AirPlant, AirRates, AirState, plant
from sitl_stub.geometry import wrap_to_pi
from sitl_stub.loops import Targets, bank_limited_turn_rate_rad_s, clamped


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """What was measured; `--plant-option NAME=VALUE` and `rehearsal.emulator.plant_options` change it."""

    course_frequency_rad_s: float = 1.5
    course_damping: float = 0.8
    speed_frequency_rad_s: float = 1.0
    speed_damping: float = 0.9


@plant("measured")
class Measured(AirPlant):
    """Course and airspeed go to what is commanded as masses on springs do."""

    Options = Response
    memory = (0.0, 0.0)
    """Turn rate in rad/s, and acceleration in m/s²."""

    def rates(self, targets: Targets, state: AirState) -> AirRates:
        """The second derivatives of heading and airspeed, within the limits of the aircraft."""
        model, limits = self.options, self.parameters
        turn_rate, acceleration = state.memory
        off = wrap_to_pi(targets.turn.angle_rad - state.course_rad)
        pull = model.course_frequency_rad_s**2 * off
        drag = 2.0 * model.course_damping * model.course_frequency_rad_s * turn_rate
        slow = targets.speed.speed_m_s - state.airspeed_m_s
        push = model.speed_frequency_rad_s**2 * slow
        brake = 2.0 * model.speed_damping * model.speed_frequency_rad_s * acceleration
        fastest = bank_limited_turn_rate_rad_s(limits.max_bank_rad, state.airspeed_m_s)
        return AirRates(
            turn_rate_rad_s=clamped(turn_rate, fastest),
            acceleration_m_s2=clamped(acceleration, limits.max_acceleration_m_s2),
            memory=(
                0.0
                if abs(turn_rate) > fastest and turn_rate * (pull - drag) > 0.0
                else pull - drag,
                math.copysign(min(abs(push - brake), 10.0), push - brake),
            ),
        )
