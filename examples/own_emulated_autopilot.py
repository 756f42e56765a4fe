r"""An autopilot for the emulator: three modes, courses and airspeeds as ArduPlane takes them.

    vfguide fly circle-wind --plugin own_emulated_autopilot.py --set rehearsal.emulator.autopilot=brief
    sitl-stub --system-id 1 --mavlink udpout://127.0.0.1:14550 --autopilot brief \
      --plugin own_emulated_autopilot.py

The emulator flies the aircraft, sends telemetry and answers questions; this file says which modes there are
and what commands do. What is not written here has a default (`sitl_stub.Personality`).
"""

import math
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import AutopilotConfig, AutopilotMode, Personality, PlantParameters, personality
from sitl_stub.commands import Command, Result, is_flyable_airspeed
from sitl_stub.flight import EmulatedFlight
from sitl_stub.loops import SpeedTarget, TurnTarget

MANUAL, LOITER, GUIDED = (
    AutopilotMode("MANUAL", 0),
    AutopilotMode("LOITER", 12, "loiter"),
    AutopilotMode("GUIDED", 15, "commanded"),
)


@personality("brief")
class Brief(Personality):
    """An autopilot that is steered in GUIDED alone."""

    firmware = 3  # MAV_AUTOPILOT_ARDUPILOTMEGA
    version = 0x0407_0000
    modes = (MANUAL, LOITER, GUIDED)
    initial_mode = LOITER
    ground_mode = MANUAL
    loops: ClassVar = PlantParameters(kind="bank", course_dead_time_s=0.1)
    """The aircraft that flies where `--plant` names none."""
    max_bank_deg = 40.0

    def __init__(self, config: AutopilotConfig) -> None:
        """Obey two commands beside changes of mode."""
        super().__init__(config)
        self.commands = {
            **self.commands,
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: self._turn,
            mavlink.MAV_CMD_GUIDED_CHANGE_SPEED: self._change_speed,
        }

    def _turn(self, flight: EmulatedFlight, command: Command) -> Result:
        """43002: param2 is the course in degrees, param3 the greatest lateral acceleration in m/s²."""
        course_deg, acceleration_m_s2 = command.used(2, 3)
        if flight.mode is not GUIDED or acceleration_m_s2 <= 0.0:
            return Result.FAILED
        flight.hold_turn(TurnTarget("course", math.radians(course_deg), acceleration_m_s2))
        return Result.ACCEPTED

    def _change_speed(self, flight: EmulatedFlight, command: Command) -> Result:
        """43000: param2 is the airspeed in m/s."""
        (speed_m_s,) = command.used(2)
        if flight.mode is not GUIDED or not is_flyable_airspeed(flight, speed_m_s):
            return Result.FAILED
        flight.hold_speed(SpeedTarget("airspeed", speed_m_s))
        return Result.ACCEPTED
