"""What the operator and the pilot of a vehicle hear: the worst first, and no kind hidden by another.

    alerts.say(key, severity, text)

A key is a kind, or `kind: what of it`, and is quiet for as long as it asks for. Each kind has its own room
and memory. Kinds of the same severity take turns: a burst of one delays another by one text and hides none.
A change of mode goes before all.

`heard` collects what was said, at the end of each call of the companion, for log and record. `due` gives it
to the pilot, text by text. An `Announcer` sends the ground station texts, modes in words, and values to plot.
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
"""Until a pilot gets the same text again."""

PAUSE_S = 2.0
"""From one text to the next: ground stations show them for some seconds, and a radio has little room."""

MOST_WAITING = 16
"""Texts of a kind that wait for their turn: when so many wait, the least severe is left to the log."""

MOST_REMEMBERED = 64
"""Texts of a kind that are known to have been sent, and keys that are quiet."""

MOST_SAID = 64
"""Of a kind between two collections, some tenths of a second: of a flood the first ones are logged."""


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """Something an operator should know."""

    time_s: float
    """When."""
    text: str
    """What, in one line."""
    warning: bool = False
    """Whether it is something to worry about."""
    kind: EventKind = "text"
    """What it is about."""


class Alert(msgspec.Struct, frozen=True, kw_only=True):
    """Something that was said."""

    key: str
    """Its kind, or `kind: what of it`."""
    severity: int
    """Of MAVLink: the lower the worse."""
    text: str
    """One sentence."""
    about: EventKind
    """Its place in a record."""
    quiet_s: float
    """Until the key may be used again, s."""
    told: bool
    """Whether the pilot gets it."""

    @property
    def kind(self) -> str:
        """What it shares a room with."""
        return self.key.partition(":")[0]


class Room(msgspec.Struct):
    """Texts of one kind on their way to the pilot."""

    waiting: list[tuple[int, int, str]] = msgspec.field(default_factory=list)
    """(severity, number, text) of each, as they came."""
    told: OrderedDict[str, float] = msgspec.field(default_factory=OrderedDict)
    """When each text was taken last, s."""
    turn: int = 0
    """Number of the last text that was sent of this kind."""

    def take(self, severity: int, number: int, text: str, now: float) -> None:
        """Let a text wait, unless it was sent a short while ago or all that wait are as severe."""
        if now - self.told.get(text, -math.inf) < QUIET_S or not self._makes_room(severity):
            return
        self.told[text] = now
        self.told.move_to_end(text)
        if len(self.told) > MOST_REMEMBERED:
            self.told.popitem(last=False)
        self.waiting.append((severity, number, text))

    def _makes_room(self, severity: int) -> bool:
        """Whether another text can wait, after the newest of the least severe ones has made way for it."""
        if len(self.waiting) < MOST_WAITING:
            return True
        last = max(self.waiting)
        if last[0] <= severity:
            return False
        self.waiting.remove(last)
        # It may come again.
        self.told.pop(last[2], None)
        return True


class Alerts:
    """What one companion has to say."""

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
        """Tell operator and pilot something.

        Args:
            key: its kind, or `kind: what of it`.
            severity: of MAVLink, the lower the worse.
            text: one sentence that says what to do.
            about: its place in a record.
            quiet_s: for so long nothing more is said by this key, s.
            told: whether the pilot gets it: what the autopilot says reaches ground stations anyway.
        """
        alert = Alert(
            key=key, severity=severity, text=text, about=about, quiet_s=quiet_s, told=told
        )
        self._counts[alert.kind] += 1
        if self._counts[alert.kind] <= MOST_SAID:
            self._said.append(alert)

    def turns(self, what: str, *, holds: bool) -> bool:
        """Note whether something holds; whether that has changed, so that it is worth a text."""
        changed = holds is not (what in self._holding)
        if changed:
            self._holding.symmetric_difference_update((what,))
        return changed

    def show_mode(self, text: str) -> None:
        """Send a change of mode to the pilot; one that still waits is out of date."""
        self._change = text

    def forget(self, kind: str) -> None:
        """Let every key of a kind be used again, as in another flight."""
        for key in [one for one in self._quiet_until if one.partition(":")[0] == kind]:
            del self._quiet_until[key]

    def only_while(self, holds: Callable[[], bool]) -> "Alerts":
        """For a part of the companion that is heard only while something holds."""
        return _PartAlerts(self, holds)

    def heard(self, now: float) -> list[Event]:
        """What was said since the last call, for log and record, as it came; texts go on to the pilot."""
        if not self._said:
            return []
        said, self._said = self._said, deque()
        self._counts.clear()
        return [self._taken(one, now) for one in said if not self._is_quiet(one, now)]

    def due(self, now: float) -> tuple[int, str] | None:
        """(severity, text) of what the pilot gets now, or None.

        A change of mode goes before all, waits for no other text and keeps none waiting: it says who steers.
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
        """Whether a key was used a short while ago; it counts as used now where it was not."""
        if alert.quiet_s <= 0.0:
            return False
        if now < self._quiet_until.get(alert.key, -math.inf):
            return True
        self._quiet_until[alert.key] = now + alert.quiet_s
        self._quiet_until.move_to_end(alert.key)
        return False

    def _taken(self, alert: Alert, now: float) -> Event:
        """An event for the log, whose text waits for the pilot from now on."""
        self._number += 1
        if alert.told:
            room = self._rooms.setdefault(alert.kind, Room())
            room.take(alert.severity, self._number, alert.text, now)
        return Event(
            time_s=now, text=alert.text, warning=alert.severity <= WARNING, kind=alert.about
        )


class _PartAlerts(Alerts):
    """Alerts of a part."""

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
"""Why nothing is steered is told once it has lasted for so long: it changes on the way into steering."""


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
