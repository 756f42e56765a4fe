"""Slot errors and mode as NAMED_VALUE_FLOAT, which ground stations plot and autopilots log."""

import math

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.role import RoleStep
from vfguide.companion.supervisor import Mode
from vfguide.mavlink.announcements import named_value

INTERVAL_S = 0.5
"""Between two values of a name: a ground station draws a curve of them, and a telemetry radio has room."""

OLD_S = 1.0
"""An error that is older than this is not sent: the curve has a gap there."""

MODE_NUMBERS = {
    Mode.WAITING: 0,
    Mode.JOINING: 1,
    Mode.TRACKING: 2,
    Mode.PREDICTING: 3,
    Mode.BREAKAWAY: 4,
    Mode.LOST: 5,
    Mode.PILOT: 6,
}
"""What `form_mode` shows; people's plots go by them, so they stay."""


class PlottedValues:
    """What one companion sends to be plotted."""

    def __init__(self) -> None:
        """Have nothing to send but the mode."""
        self._errors: dict[str, float] = {}
        self._noted_s = self._sent_s = -math.inf

    def note(self, step: RoleStep, now: float) -> None:
        """Take the errors (m) of a step of guidance: a leader's has none along its path."""
        self._noted_s = now
        if math.isnan(step.along_track):
            self._errors = {"path_cross": step.cross_track}
        else:
            self._errors = {
                "slot_along": step.along_track,
                "slot_cross": step.cross_track,
                "slot_up": step.up,
            }

    def due(self, mode: Mode, now: float) -> list[MAVLink_message]:
        """What is to be sent now; twice a second, and errors only while they are of now and finite.

        Args:
            mode: of the companion.
            now: s.
        """
        if now - self._sent_s < INTERVAL_S:
            return []
        self._sent_s = now
        values = {"form_mode": float(MODE_NUMBERS[mode])}
        if now - self._noted_s <= OLD_S:
            values |= {name: value for name, value in self._errors.items() if math.isfinite(value)}
        return [named_value(name, value, now) for name, value in values.items()]
