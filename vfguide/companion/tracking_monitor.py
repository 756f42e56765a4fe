"""Whether the vehicle obeys: its course follows the setpoints, its altitude stays.

An autopilot may acknowledge every setpoint and fly none: PX4 1.16.0 ignored velocities of fixed wings,
ArduPlane does not turn where it is given no lateral acceleration.
"""

import math

from vfguide.angles import wrap_angle
from vfguide.elementwise import low_pass
from vfguide.guidance.airframe import bank_limited_turn_rate, held_direction
from vfguide.state import Airframe, Setpoint, VehicleState

MEMORY_S = 3.0
"""Time constant of the turn rates that are compared."""

EXPECTED_LEAST = 0.05
"""rad/s: less than this is not asked for long enough to be judged."""

FOLLOWED_SHARE = 0.2
"""Below this share of the turn that is expected, a course does not follow."""

PATIENCE_S = 4.0
"""How long that has to last, on top of the memory."""

ALTITUDE_M = 20.0
"""Farther from the altitude of the mission than this is worth a text."""

GAP_S = 1.0


class TrackingMonitor:
    """Watches one vehicle while it is being steered."""

    def __init__(self, airframe: Airframe) -> None:
        self._airframe = airframe
        self._complained = self._astray = False
        self.reset()

    def reset(self) -> None:
        """The vehicle is not being steered: nothing can be expected of it."""
        self._before: tuple[VehicleState[float], Setpoint[float]] | None = None
        self._expected = self._turned = 0.0
        self._since: float | None = None

    def watch(self, state: VehicleState[float], setpoint: Setpoint[float]) -> str | None:
        """Take a state and the setpoint that goes out with it; a complaint, or None."""
        before, self._before = self._before, (state, setpoint)
        if before is None:
            return None
        earlier, asked = before
        period = state.time_s - earlier.time_s
        if not 0.0 < period <= GAP_S:
            return None
        # In a wind that swings the nose of a heading hold turns, so that the course need not.
        direction = held_direction(state, self._airframe)
        turned = wrap_angle(direction - held_direction(earlier, self._airframe)) / period
        expected = expected_turn_rate(earlier, asked, self._airframe)
        self._expected = low_pass(self._expected, expected, period, MEMORY_S)
        self._turned = low_pass(self._turned, turned, period, MEMORY_S)
        return self._judge(state.time_s)

    def watch_altitude(self, off: float) -> str | None:
        """Take how far above the wanted altitude (m) one is that cannot be told it; a complaint, or None."""
        if abs(off) <= ALTITUDE_M or self._astray:
            self._astray = abs(off) > ALTITUDE_M / 2.0 and self._astray
            return None
        self._astray = True
        side = "above" if off > 0.0 else "below"
        return (
            f"{abs(off):.0f} m {side} the mission's altitude, which this autopilot cannot be told:"
            " take it there by hand before it is engaged"
        )

    def _judge(self, now: float) -> str | None:
        follows = abs(self._expected) < EXPECTED_LEAST or self._turned * math.copysign(
            1.0, self._expected
        ) > FOLLOWED_SHARE * abs(self._expected)
        if follows:
            self._since = None
            if self._complained and abs(self._expected) >= EXPECTED_LEAST:
                self._complained = False
                return "the course follows again, nothing to do"
            return None
        if self._since is None:
            self._since = now
        if self._complained or now - self._since < PATIENCE_S:
            return None
        self._complained = True
        return (
            "the course does not follow the setpoints: asked to turn at"
            f" {math.degrees(self._expected):.0f} degrees a second, turning at"
            f" {math.degrees(self._turned):.0f}; be ready to take over; does this autopilot fly courses?"
        )


def expected_turn_rate(
    state: VehicleState[float], setpoint: Setpoint[float], airframe: Airframe
) -> float:
    """Turn rate (rad/s) that a setpoint should bring about: alpha times the course error, within the bank."""
    limit = bank_limited_turn_rate(airframe.max_bank, max(state.airspeed, 1.0))
    wanted = airframe.alpha * wrap_angle(setpoint.course - state.course)
    return min(max(wanted, -limit), limit)
