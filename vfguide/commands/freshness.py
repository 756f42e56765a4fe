"""Which presences are of now: a broker keeps the last word of a companion that is gone; links get lost."""

from collections.abc import Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from vfguide.link.opening import Link
from vfguide.link.presence import Presence

SILENT_S = 5.0
"""A companion that has not said for so long how it is counts as gone."""


@dataclass(slots=True)
class HeardPresence:
    """What was heard of one vehicle."""

    said_s: float
    """The time of its newest presence, s on its own clock."""
    heard_s: float
    """When that was heard, s."""
    again: bool = False
    """Whether it is not the first one: then its companion lives, or did so a moment ago."""


class Freshness:
    """Who has said how it is twice, and not long ago."""

    def __init__(self, silent_s: float = SILENT_S) -> None:
        """Begin with nobody heard; who says nothing for so long (s) is offline."""
        self._silent_s = silent_s
        self._heard: dict[str, HeardPresence] = {}
        self._before: dict[str, float] = {}

    def note(self, found: Mapping[str, Presence], now: float) -> None:
        """Take what each vehicle said last."""
        for name, presence in found.items():
            if presence.time_s == self._before.get(name):
                continue
            heard = self._heard.get(name)
            if heard is None:
                self._heard[name] = HeardPresence(presence.time_s, now)
            elif presence.time_s != heard.said_s:
                self._heard[name] = HeardPresence(presence.time_s, now, again=True)

    def lose(self, found: Mapping[str, Presence]) -> None:
        """Note that the link was lost: what a broker says next may be kept, and newer than what was heard."""
        self._before = {name: presence.time_s for name, presence in found.items()}
        self._heard.clear()

    def missing(self, found: Mapping[str, Presence]) -> list[str]:
        """Vehicles that say they are online, and were not heard twice."""
        return [
            name
            for name, presence in found.items()
            if presence.status == "online" and not (name in self._heard and self._heard[name].again)
        ]

    def judge(self, found: Mapping[str, Presence], now: float) -> dict[str, Presence]:
        """The presences, those that may be old as offline.

        Args:
            found: what each vehicle said last.
            now: s.
        """
        self.note(found, now)
        return {name: self._judged(name, presence, now) for name, presence in found.items()}

    def _judged(self, name: str, presence: Presence, now: float) -> Presence:
        heard = self._heard.get(name)
        if presence.status == "offline":
            return presence
        if heard is None:
            text = "not heard since the link was lost: it may be gone"
        elif not heard.again:
            text = f"nothing new of its companion in {now - heard.heard_s:.0f} s: it may be gone"
        elif now - heard.heard_s > self._silent_s:
            text = f"its companion has been silent for {now - heard.heard_s:.0f} s"
        else:
            return presence
        return replace(presence, status="offline", obstacle=text)


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What is known of a formation at a moment."""

    found: Mapping[str, Presence]
    """What each vehicle said last, those that may be gone as offline."""
    complaint: str = ""
    """Which of the own links do not stand, and why; empty while all do."""
    deaf: bool = False
    """Whether none stands: then nothing is known of the vehicles."""


class Lookout:
    """Looks at what comes in by a link."""

    def __init__(
        self, link: Link, current: Mapping[str, Presence], *, silent_s: float = SILENT_S
    ) -> None:
        """Begin with nobody heard.

        Args:
            link: by which presences come in.
            current: what each vehicle said last.
            silent_s: who says nothing for so long (s) is offline.
        """
        self._link = link
        self._current = current
        self._freshness = Freshness(silent_s)
        self._losses = link.losses

    def look(self, now: float) -> None:
        """Take what has come in until now (s); often, or what was kept is taken for what was said."""
        if self._link.losses != self._losses:
            self._losses = self._link.losses
            self._freshness.lose(self._current)
        self._freshness.note(self._current, now)

    @property
    def waits(self) -> bool:
        """Whether a vehicle was heard, and not again since."""
        return bool(self._freshness.missing(self._current))

    def seen(self, now: float) -> Seen:
        """What is known now (s)."""
        self.look(now)
        return Seen(
            found=self._freshness.judge(self._current, now),
            complaint=self._link.complaint(),
            deaf=not self._link.connected,
        )
