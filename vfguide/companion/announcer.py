"""What the pilot's ground station is told: texts, each once and never a flood, and values to plot."""

import math
from collections import OrderedDict
from collections.abc import Callable

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.role import RoleStep
from vfguide.companion.supervisor import Control, Mode
from vfguide.mavlink.announcements import INFO, NOTICE, WARNING, named_value, status_texts

QUIET_S = 30.0
"""Until the same warning is sent again."""

PAUSE_S = 2.0
"""From one text to the next: ground stations show them for some seconds, and a radio has little room."""

MOST_WAITING = 16
"""Texts that wait for their turn: when so many wait, the least severe is left to the log."""

MOST_REMEMBERED = 64

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

    def __init__(self, name: str) -> None:
        """Before the first text.

        Args:
            name: of the vehicle.
        """
        self._name = name
        self._waiting: list[tuple[int, str]] = []
        self._told: OrderedDict[str, float] = OrderedDict()
        self._sent_s = self._changed_s = -math.inf
        self._number = 0
        self._mode = Mode.WAITING
        self._control = self._announced = Control.UNKNOWN
        self._control_since = -math.inf

    def warn(self, text: str, now: float) -> None:
        """Send a warning, unless it was sent a short while ago."""
        self._tell(WARNING, text, now)

    def inform(self, text: str, now: float) -> None:
        """Send something that is nothing to worry about, unless it was sent a short while ago."""
        self._tell(INFO, text, now)

    def _tell(self, severity: int, text: str, now: float) -> None:
        if now - self._told.get(text, -math.inf) < QUIET_S or not self._makes_room(severity):
            return
        self._told[text] = now
        self._told.move_to_end(text)
        if len(self._told) > MOST_REMEMBERED:
            self._told.popitem(last=False)
        self._waiting.append((severity, text))

    def _makes_room(self, severity: int) -> bool:
        """Whether another text can wait, after the newest of the least severe ones has made way for it."""
        if len(self._waiting) < MOST_WAITING:
            return True
        least = max(waiting for waiting, _ in self._waiting)
        if least <= severity:
            return False
        newest = max(place for place, (waiting, _) in enumerate(self._waiting) if waiting == least)
        _, text = self._waiting.pop(newest)
        self._told.pop(text, None)
        return True

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
            self.change(sentence())

    def change(self, text: str) -> None:
        """Send a change of mode; texts about the mode before, which still wait, are out of date."""
        self._waiting = [one for one in self._waiting if one[0] != NOTICE]
        self._waiting.append((NOTICE, text))

    def due(self, now: float) -> list[MAVLink_message]:
        """Messages for the text that may be sent now: the most severe, of several the one that came first.

        A change of mode goes before all, waits for no other text and keeps none waiting: it says who steers.
        """
        if not self._waiting:
            return []
        # Severities of MAVLink fall as matters get worse.
        first = min(
            range(len(self._waiting)),
            key=lambda place: (self._waiting[place][0] != NOTICE, self._waiting[place][0]),
        )
        changes = self._waiting[first][0] == NOTICE
        if now - (self._changed_s if changes else self._sent_s) < PAUSE_S:
            return []
        severity, text = self._waiting.pop(first)
        if changes:
            self._changed_s = now
        else:
            self._sent_s = now
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
