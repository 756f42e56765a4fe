"""Setpoints on their way from the companions to the autopilots, on arrays."""

import numpy as np

from vfguide.angles import TURN
from vfguide.elementwise import FloatArray
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.setpoint_stream import DIGITS


class Stream:
    """Setpoints on their way to ArduPlane: rounded, and sent where they change or have not been for a while.

    As `vfguide.mavlink.setpoint_stream` does it, for each vehicle and for course and speed apart.
    """

    def __init__(self) -> None:
        self._content: FloatArray | None = None
        self._sent: FloatArray | None = None
        self._told: FloatArray | None = None

    def told(
        self, course: FloatArray, speed: FloatArray, now: float
    ) -> tuple[FloatArray, FloatArray]:
        """(course, speed) that the autopilots hold from now on."""
        degrees = np.round(np.degrees(course % TURN), 3) % 360.0
        fresh = np.stack([degrees, speed])
        content = decimals(fresh)
        if self._content is None or self._sent is None or self._told is None:
            self._content, self._told = content, fresh
            self._sent = np.full_like(fresh, now)
        else:
            due = (content != self._content) | (now - self._sent >= ArduPlane.keep_alive_s)
            self._content = np.where(due, content, self._content)
            self._sent = np.where(due, now, self._sent)
            self._told = np.where(due, fresh, self._told)
        single = self._told.astype(np.float32).astype(np.float64)
        return np.radians(single[0]), single[1]


def decimals(values: FloatArray) -> FloatArray:
    """Hundredths, to the nearest as Python rounds: a product in double precision would invent ties."""
    hundredths: FloatArray = np.rint(values.astype(np.longdouble) * 10**DIGITS).astype(np.float64)
    return hundredths
