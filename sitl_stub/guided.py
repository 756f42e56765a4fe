"""ArduPlane's GUIDED mode: course, airspeed and altitude by commands that are held for ever."""

import math

from sitl_stub.commands import (
    DO_CHANGE_SPEED,
    GUIDED_CHANGE_ALTITUDE,
    GUIDED_CHANGE_HEADING,
    GUIDED_CHANGE_SPEED,
    Command,
    Handler,
    Handlers,
    Result,
    finite,
    height_target,
    is_flyable_airspeed,
)
from sitl_stub.flight import Flight
from sitl_stub.modes import GUIDED
from sitl_stub.targets import SpeedTarget, TurnTarget

MIN_LATERAL_ACCELERATION_M_S2 = 0.05
"""What a lateral acceleration limit of zero becomes: the aircraft as good as does not turn."""

COURSE, HEADING, CANCEL = 0.0, 1.0, 2.0
"""param1 of GUIDED_CHANGE_HEADING."""

AIRSPEED, GROUND_SPEED = 0.0, 1.0
"""SPEED_TYPE."""

NO_CHANGE, DEFAULT_SPEED = -1.0, -2.0
"""DO_CHANGE_SPEED's special values of a speed."""


class Guided:
    """The commands of one aircraft's GUIDED mode."""

    def __init__(self) -> None:
        self.commands: Handlers = {
            DO_CHANGE_SPEED: self._change_speed,
            GUIDED_CHANGE_HEADING: _only_guided(change_heading),
            GUIDED_CHANGE_SPEED: _only_guided(self._guided_change_speed),
            GUIDED_CHANGE_ALTITUDE: _only_guided(change_altitude),
        }
        self._guided_speed_used = False

    def forget(self) -> None:
        """The mode was left, or is entered anew."""
        self._guided_speed_used = False

    def _guided_change_speed(self, flight: Flight, command: Command) -> Result:
        """43000: param1 type, param2 m/s, param3 acceleration (0: the plant's own)."""
        kind, speed_m_s, acceleration_m_s2 = command.used(1, 2, 3)
        if acceleration_m_s2 < 0.0:
            return Result.DENIED
        limit = acceleration_m_s2 or math.inf
        if kind == AIRSPEED:
            if not is_flyable_airspeed(flight, speed_m_s):
                return Result.FAILED
            target = SpeedTarget("airspeed", speed_m_s, limit)
        elif kind == GROUND_SPEED and flight.plant.kind == "course-hold":
            # The real one denies this; the article's ideal ground speed hold is what takes it.
            if speed_m_s <= 0.0:
                return Result.FAILED
            target = SpeedTarget("ground-speed", speed_m_s, limit)
        else:
            return Result.DENIED
        self._guided_speed_used = True
        flight.hold_speed(target)
        return Result.ACCEPTED

    def _change_speed(self, flight: Flight, command: Command) -> Result:
        """178: accepted, and without any effect once 43000 was used in this visit to GUIDED.

        A ground speed would only set a floor, which is not modelled: accepted without effect.
        """
        kind, speed_m_s = command.used(1, 2)
        if self._guided_speed_used:
            flight.texts.append("DO_CHANGE_SPEED ignored: guided speed in use")
            return Result.ACCEPTED
        if kind not in {AIRSPEED, GROUND_SPEED}:
            return Result.DENIED
        if kind == GROUND_SPEED or speed_m_s == NO_CHANGE:
            return Result.ACCEPTED
        if speed_m_s == DEFAULT_SPEED:
            flight.cruise()
            return Result.ACCEPTED
        if not is_flyable_airspeed(flight, speed_m_s):
            return Result.FAILED
        flight.hold_speed(SpeedTarget("airspeed", speed_m_s))
        return Result.ACCEPTED


def _only_guided(handler: Handler) -> Handler:
    """The handler, failing outside GUIDED."""

    def guarded(flight: Flight, command: Command) -> Result:
        return handler(flight, command) if flight.mode is GUIDED else Result.FAILED

    return guarded


def change_heading(flight: Flight, command: Command) -> Result:
    """43002: param1 course, heading or cancel; param2 in [0, 360) deg; param3 lateral m/s^2."""
    (kind,) = command.used(1)
    if kind == CANCEL:
        flight.circle()
        return Result.ACCEPTED
    angle_deg, acceleration_m_s2 = command.used(2, 3)
    if kind not in {COURSE, HEADING} or not 0.0 <= angle_deg < 360.0:
        return Result.DENIED
    limit = max(acceleration_m_s2, MIN_LATERAL_ACCELERATION_M_S2)
    hold = TurnTarget("course" if kind == COURSE else "heading", math.radians(angle_deg), limit)
    flight.hold_turn(hold)
    return Result.ACCEPTED


def change_altitude(flight: Flight, command: Command) -> Result:
    """43001: `z` in a global frame, param3 climb rate (0: the plant's own)."""
    (climb_rate_m_s,) = command.used(3)
    (z,) = finite(command.z)
    target = height_target(flight, command.frame, z, climb_rate_m_s or math.inf)
    if target is None or climb_rate_m_s < 0.0:
        return Result.DENIED
    flight.hold_height(target)
    return Result.ACCEPTED
