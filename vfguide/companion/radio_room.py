"""How much a telemetry radio bears: what a companion sends is bounded by what RADIO_STATUS says.

Radios of SiK's kind tell how much of their buffer is free. One that is full drops what comes, setpoints too.
"""

from vfguide.companion.alerts import Alerts
from vfguide.mavlink.announcements import WARNING
from vfguide.mavlink.reports import RadioReport

SHORT, FULL = 0.5, 0.2
"""Free shares of the buffer below which setpoints go at half their rate, and below which only they go."""

BELIEVED_S = 5.0
"""s after which a report says nothing any more: radios send one a second."""

KEY = "radio room"


class RadioRoom:
    """The newest word of the radio to the autopilot; without one there is room for everything."""

    def __init__(self, alerts: Alerts) -> None:
        """Have heard of no radio.

        Args:
            alerts: takes what a pilot should know.
        """
        self._alerts = alerts
        self._free, self._heard_s = 1.0, float("-inf")

    def note(self, report: RadioReport, now: float) -> None:
        """Take what a radio says of its buffer, now (s)."""
        self._free, self._heard_s = report.free, now
        if report.free < SHORT:
            sent = "setpoints at half their rate"
            if report.free < FULL:
                sent = "nothing but setpoints, warnings and heartbeats is sent"
            self._alerts.say(
                KEY,
                WARNING,
                f"the radio to the autopilot is behind, {report.free:.0%} of its buffer are free: {sent};"
                " lower the rates of telemetry, or use a faster radio",
            )

    def is_short(self, now: float) -> bool:
        """Whether setpoints have to go more rarely."""
        return self._free < SHORT and now - self._heard_s <= BELIEVED_S

    def is_full(self, now: float) -> bool:
        """Whether nothing may go beside what steers and what keeps the autopilot's fail-safe away."""
        return self._free < FULL and now - self._heard_s <= BELIEVED_S
