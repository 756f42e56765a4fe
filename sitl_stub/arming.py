"""Arming and disarming, with the checks before it; what refuses, and in which words, is the autopilot's."""

from collections.abc import Callable

from sitl_stub.commands import Command, Result
from sitl_stub.flight import Flight

FORCED = 21196.0
"""param2 that disarms in flight."""

FORCED_ARMING = 2989.0
"""param2 that arms against all checks."""


class Arming:
    """MAV_CMD_COMPONENT_ARM_DISARM, for one autopilot."""

    def __init__(self, check: Callable[[Flight], str | None], *, refused: Result) -> None:
        """Take the autopilot's own checks.

        Args:
            check: tells why arming is refused, or None.
            refused: result of a refusal.
        """
        self.ready_from_us = 0
        """Simulation time at which the sensors have settled."""
        self._check = check
        self._refused = refused

    def is_ready(self, flight: Flight) -> bool:
        """Whether the sensors have settled."""
        return flight.time_us >= self.ready_from_us

    def fault(self, flight: Flight) -> str | None:
        """Why it would not arm now."""
        if not self.is_ready(flight):
            return "Waiting for GPS and estimator"
        return self._check(flight)

    def handle(self, flight: Flight, command: Command) -> Result:
        """400: param1 = 1 arms, 0 disarms; param2 forces it."""
        (wanted,) = command.used(1)
        if wanted == 1.0:
            return self._arm(flight, command)
        if wanted == 0.0:
            return self._disarm(flight, command)
        return Result.UNSUPPORTED

    def report(self, flight: Flight, _command: Command) -> Result:
        """401: say what is wrong, without arming."""
        fault = self.fault(flight)
        if fault is not None:
            flight.texts.append(f"PreArm: {fault}")
        return Result.ACCEPTED

    def _arm(self, flight: Flight, command: Command) -> Result:
        fault = self.fault(flight)
        if fault is not None and not flight.armed and command.parameters[1] != FORCED_ARMING:
            flight.texts.append(f"Arm: {fault}")
            return self._refused
        flight.set_armed(armed=True)
        return Result.ACCEPTED

    def _disarm(self, flight: Flight, command: Command) -> Result:
        if flight.armed and not flight.on_ground and command.parameters[1] != FORCED:
            flight.texts.append("Disarming refused: in the air")
            return self._refused
        flight.set_armed(armed=False)
        return Result.ACCEPTED
