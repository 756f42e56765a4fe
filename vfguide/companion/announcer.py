"""What the pilot's ground station is sent: texts, changes of mode in words, and values to plot."""

import math
from collections.abc import Callable

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.alerts import Alerts
from vfguide.companion.role import RoleStep
from vfguide.companion.supervisor import Control, Mode
from vfguide.mavlink.announcements import named_value, status_texts

LASTS_S = 2.0
"""Why nothing is steered is told once it has lasted for so long: it changes on the way into steering."""

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


class Announcer:
    """Texts of one companion."""

    def __init__(self, name: str, alerts: Alerts) -> None:
        """Before the first text.

        Args:
            name: of the vehicle.
            alerts: what is said.
        """
        self._name = name
        self._alerts = alerts
        self._number = 0
        self._mode = Mode.WAITING
        self._control = self._announced = Control.UNKNOWN
        self._control_since = -math.inf

    def watch(self, mode: Mode, control: Control, sentence: Callable[[], str], now: float) -> None:
        """Announce a change of mode at once, and another reason for not steering once it lasts.

        Args:
            mode: of the companion, now.
            control: in whose hands the vehicle is, now.
            sentence: says what that means, and what to do.
            now: s.
        """
        if control is not self._control:
            self._control, self._control_since = control, now
        changed, self._mode = mode is not self._mode, mode
        idle = mode is Mode.WAITING and control in {Control.GUIDED, Control.UNKNOWN}
        lasts = now - self._control_since >= LASTS_S
        if changed or (idle and lasts and control is not self._announced):
            self._announced = control
            self._alerts.show_mode(sentence())

    def due(self, now: float) -> list[MAVLink_message]:
        """Messages for the text that may be sent now."""
        alert = self._alerts.due(now)
        if alert is None:
            return []
        severity, text = alert
        self._number = self._number % 65_535 + 1
        return status_texts(f"vfguide {self._name}: {text}", severity, self._number)


def mode_sentence(
    mode: Mode, control: Control, flight_mode: str, guided: str, returns_s: float | None
) -> str:
    """What has happened, and what to do.

    Args:
        mode: of the companion, now.
        control: in whose hands the vehicle is.
        flight_mode: of the autopilot.
        guided: what the autopilot calls the mode in which it is steered.
        returns_s: silence of the positions (s) after which it is handed back; None where it was not steered.
    """
    if mode is Mode.WAITING:
        return waiting_sentence(control, flight_mode, guided, returns_s)
    return {
        Mode.JOINING: f"steering to its place; leave {guided} to take over",
        Mode.TRACKING: "in its place, nothing to do",
        Mode.PREDICTING: f"leader not heard, steering by its path; leave {guided} to take over",
        Mode.BREAKAWAY: f"leader lost, flying away from the others; leave {guided} to take over",
        Mode.LOST: f"leader lost, handing back to the autopilot; select {guided} once it is heard",
        Mode.PILOT: pilot_sentence(control, flight_mode, guided),
    }[mode]


def pilot_sentence(control: Control, flight_mode: str, guided: str) -> str:
    """Who flies where nothing is steered."""
    if control is Control.PILOT and flight_mode == guided:
        return (
            f"the autopilot denies being in {guided}, which its heartbeats show: not steering;"
            " watch it, or take over"
        )
    return f"{flight_mode}: the pilot flies; select {guided} to be steered"


def waiting_sentence(
    control: Control, flight_mode: str, guided: str, returns_s: float | None
) -> str:
    """Why nothing is steered."""
    if control is Control.GUIDED and returns_s is not None:
        return (
            f"no position heard, not steering; after {returns_s:g} s without one it is handed back to the"
            " autopilot; watch it, or take over"
        )
    if control is Control.GUIDED:
        return "not steering, no position or no leader heard; watch it, or take over"
    if control is Control.UNKNOWN:
        return "no heartbeat heard, not steering; check the telemetry, or take over"
    if control is Control.DISARMED:
        return "disarmed, not steering; nothing to do"
    return f"{flight_mode}, not steering; select {guided} to be steered"


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
