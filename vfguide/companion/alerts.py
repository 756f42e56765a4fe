"""Texts for the operator and the pilot of a vehicle: the worst first, and no kind hidden by another.

    alerts.say(key, severity, text)

A key is a kind, or `kind: subject`, and stays quiet for as long as the caller asks. Each kind has its own
queue and memory. Kinds of equal severity take turns: a burst of one delays another by one text and hides
none. A change of mode precedes all.

`heard` collects what was said, at the end of each call of the companion, for log and record. `due` passes it
to the pilot, text by text. An `Announcer` sends texts and changes of mode to the ground station.
"""

import math
from collections import Counter, OrderedDict, deque
from collections.abc import Callable

import msgspec
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.companion.supervisor import Control, Mode
from vfguide.mavlink.announcements import NOTICE, WARNING, status_texts
from vfguide.record.events import EventKind

QUIET_S = 30.0
"""Time until a pilot gets the same text again, s."""

PAUSE_S = 2.0
"""Pause between texts, s: ground stations show them for some seconds, and radios have little room."""

MOST_WAITING = 16
"""Limit on waiting texts of a kind; beyond it the least severe goes to the log only."""

MOST_REMEMBERED = 64
"""Limit on remembered texts of a kind."""

MOST_KEYS = 256
"""Limit on keys that are quiet; a heartbeat's mode is part of some, and may be any number."""

MOST_SAID = 64
"""Limit on texts of a kind between two collections, some tenths of a second: a flood is cut off."""


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """Event for the operator's log and the record."""

    time_s: float
    """Time, s."""
    text: str
    """Text of one line."""
    warning: bool = False
    """Whether it is a warning."""
    kind: EventKind = "text"
    """Kind of event in a record."""


class Alert(msgspec.Struct, frozen=True, kw_only=True):
    """Alert as it was said."""

    key: str
    """Kind, or `kind: subject`."""
    severity: int
    """Severity of MAVLink: lower is worse."""
    text: str
    """Text of one sentence."""
    about: EventKind
    """Kind of event in a record."""
    quiet_s: float
    """Time until the key may be used again, s."""
    told: bool
    """Whether the pilot gets it."""

    @property
    def kind(self) -> str:
        """Kind of the alert, which has a queue of its own."""
        return self.key.partition(":")[0]


class Room(msgspec.Struct):
    """Queue of texts of one kind on their way to the pilot."""

    waiting: list[tuple[int, int, str]] = msgspec.field(default_factory=list)
    """(severity, number, text) of each, in order of arrival."""
    told: OrderedDict[str, float] = msgspec.field(default_factory=OrderedDict)
    """Time at which each text was last queued, s."""
    turn: int = 0
    """Turn number of the last text of this kind that was sent."""

    def take(self, severity: int, number: int, text: str, now: float) -> None:
        """Queue a text unless it was sent lately, or the full queue holds none less severe."""
        if now - self.told.get(text, -math.inf) < QUIET_S or not self._makes_room(severity):
            return
        self.told[text] = now
        self.told.move_to_end(text)
        if len(self.told) > MOST_REMEMBERED:
            self.told.popitem(last=False)
        self.waiting.append((severity, number, text))

    def _makes_room(self, severity: int) -> bool:
        """Drop the newest of the least severe texts of a full queue; return whether there is room."""
        if len(self.waiting) < MOST_WAITING:
            return True
        last = max(self.waiting)
        if last[0] <= severity:
            return False
        self.waiting.remove(last)
        # The dropped text may be queued again.
        self.told.pop(last[2], None)
        return True


class Alerts:
    """Texts and events of one companion."""

    def __init__(self) -> None:
        self._said: deque[Alert] = deque()
        self._counts: Counter[str] = Counter()
        self._quiet_until: OrderedDict[str, float] = OrderedDict()
        self._rooms: dict[str, Room] = {}
        self._holding: set[str] = set()
        self._change: str | None = None
        self._sent_s = self._changed_s = -math.inf
        self._number = 0

    def say(
        self,
        key: str,
        severity: int,
        text: str,
        *,
        about: EventKind = "text",
        quiet_s: float = 0.0,
        told: bool = True,
    ) -> None:
        """Say something to operator and pilot.

        Args:
            key: kind, or `kind: subject`.
            severity: severity of MAVLink, lower is worse.
            text: one sentence that says what to do.
            about: kind of event in a record.
            quiet_s: time for which this key is then ignored, s.
            told: whether the pilot gets it; ground stations get the autopilot's own texts anyway.
        """
        alert = Alert(
            key=key, severity=severity, text=text, about=about, quiet_s=quiet_s, told=told
        )
        self._counts[alert.kind] += 1
        if self._counts[alert.kind] <= MOST_SAID:
            self._said.append(alert)

    def turns(self, what: str, *, holds: bool) -> bool:
        """Note whether a condition holds; return whether that has changed, and so is worth a text."""
        changed = holds is not (what in self._holding)
        if changed:
            self._holding.symmetric_difference_update((what,))
        return changed

    def show_mode(self, text: str) -> None:
        """Send a change of mode to the pilot, in place of one that still waits."""
        self._change = text

    def forget(self, kind: str) -> None:
        """Allow every key of a kind again, as in another flight."""
        for key in [one for one in self._quiet_until if one.partition(":")[0] == kind]:
            del self._quiet_until[key]

    def only_while(self, holds: Callable[[], bool]) -> "Alerts":
        """Return alerts for a part of the companion that is heard only while a condition holds."""
        return _PartAlerts(self, holds)

    def heard(self, now: float) -> list[Event]:
        """Return events since the last call, for log and record; their texts go on to the pilot."""
        if not self._said:
            return []
        said, self._said = self._said, deque()
        self._counts.clear()
        return [self._taken(one, now) for one in said if not self._is_quiet(one, now)]

    def due(self, now: float) -> tuple[int, str] | None:
        """Return (severity, text) that the pilot gets now, or None.

        A change of mode precedes all, waits for no other text and delays none: it says who steers.
        """
        if self._change is not None:
            if now - self._changed_s < PAUSE_S:
                return None
            text, self._change, self._changed_s = self._change, None, now
            return NOTICE, text
        rooms = [one for one in self._rooms.values() if one.waiting]
        if not rooms or now - self._sent_s < PAUSE_S:
            return None
        self._sent_s = now
        room = min(rooms, key=lambda one: (min(one.waiting)[0], one.turn, min(one.waiting)[1]))
        first = min(room.waiting)
        room.waiting.remove(first)
        self._number += 1
        room.turn = self._number
        return first[0], first[2]

    def _is_quiet(self, alert: Alert, now: float) -> bool:
        """Check whether a key was used lately; otherwise note its use."""
        if alert.quiet_s <= 0.0:
            return False
        if now < self._quiet_until.get(alert.key, -math.inf):
            return True
        self._quiet_until[alert.key] = now + alert.quiet_s
        self._quiet_until.move_to_end(alert.key)
        if len(self._quiet_until) > MOST_KEYS:
            self._quiet_until.popitem(last=False)
        return False

    def _taken(self, alert: Alert, now: float) -> Event:
        """Queue an alert's text for the pilot and return its event for the log."""
        self._number += 1
        if alert.told:
            room = self._rooms.setdefault(alert.kind, Room())
            room.take(alert.severity, self._number, alert.text, now)
        return Event(
            time_s=now, text=alert.text, warning=alert.severity <= WARNING, kind=alert.about
        )


class _PartAlerts(Alerts):
    """Alerts of a part of the companion."""

    def __init__(self, whole: Alerts, holds: Callable[[], bool]) -> None:
        super().__init__()
        self._whole = whole
        self._holds = holds

    def say(
        self,
        key: str,
        severity: int,
        text: str,
        *,
        about: EventKind = "text",
        quiet_s: float = 0.0,
        told: bool = True,
    ) -> None:
        if self._holds():
            self._whole.say(key, severity, text, about=about, quiet_s=quiet_s, told=told)

    def forget(self, kind: str) -> None:
        self._whole.forget(kind)


LASTS_S = 2.0
"""Time after which a lasting reason for not steering is told, s: it changes on the way into steering."""


class Announcer:
    """Sender of one companion's texts to the ground station."""

    def __init__(self, name: str, alerts: Alerts) -> None:
        self._name = name
        self._alerts = alerts
        self._number = 0
        self._mode = Mode.WAITING
        self._control = self._announced = Control.UNKNOWN
        self._control_since = -math.inf

    def watch(self, mode: Mode, control: Control, sentence: Callable[[], str], now: float) -> None:
        """Announce a change of mode at once, and another reason for not steering once it lasts."""
        if control is not self._control:
            self._control, self._control_since = control, now
        changed, self._mode = mode is not self._mode, mode
        idle = mode is Mode.WAITING and control in {Control.GUIDED, Control.UNKNOWN}
        lasts = now - self._control_since >= LASTS_S
        if changed or (idle and lasts and control is not self._announced):
            self._announced = control
            self._alerts.show_mode(sentence())

    def due(self, now: float) -> list[MAVLink_message]:
        """Return messages for the text that may be sent now."""
        alert = self._alerts.due(now)
        if alert is None:
            return []
        severity, text = alert
        self._number = self._number % 65_535 + 1
        return status_texts(f"vfguide {self._name}: {text}", severity, self._number)


def mode_sentence(
    mode: Mode, control: Control, flight_mode: str, guided: str, returns_s: float | None
) -> str:
    """Return text on what has happened, and what to do.

    The silence of positions before a hand-back is `returns_s`, s; None where the vehicle was not steered.
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
    """Return text on who flies while the pilot has control."""
    if control is Control.PILOT and flight_mode == guided:
        return (
            f"the autopilot denies being in {guided}, which its heartbeats show: not steering;"
            " watch it, or take over"
        )
    return f"{flight_mode}: the pilot flies; select {guided} to be steered"


def waiting_sentence(
    control: Control, flight_mode: str, guided: str, returns_s: float | None
) -> str:
    """Return text on why nothing is steered."""
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
