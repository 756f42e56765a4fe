"""STATUSTEXT: long texts come in parts of 50 bytes, which are one text again here."""

import msgspec
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.reports import TextReport

PART_BYTES = 50
"""Of a text that goes on; a shorter part is the last."""

MOST_PARTS = 20
"""Of one text: autopilots send a few."""

PATIENCE = 2
"""Heartbeats of the sender without another part of a text, after which the rest of it is lost."""

GAP = "[...]"
"""In the place of parts that are lost."""


class TextParts(msgspec.Struct):
    """A text of which some parts have come."""

    number: int
    """By which its parts are known."""
    severity: int
    """MAV_SEVERITY."""
    parts: dict[int, bytes] = msgspec.field(default_factory=dict)
    """By their place."""
    count: int | None = None
    """How many there are; None until the last has come."""
    beats: int = 0
    """Heartbeats since the newest."""

    def report(self) -> TextReport:
        """The text as far as it has come."""
        last = max(self.parts)
        runs = [self.parts.get(0, b"")]
        for place in range(1, last + 1):
            if place in self.parts and place - 1 in self.parts:
                runs[-1] += self.parts[place]
            elif place in self.parts:
                runs.append(self.parts[place])
        if self.count is None:
            runs.append(b"")
        return TextReport(severity=self.severity, text=GAP.join(map(printable, runs)))


class TextJoiner:
    """Joins the texts of one sender, one at a time."""

    def __init__(self) -> None:
        self._open: TextParts | None = None

    def take(self, message: MAVLink_message) -> list[TextReport]:
        """Take a STATUSTEXT; the texts that are whole with it, or that end here."""
        raw = bytes(message._text_raw).split(b"\0", 1)[0]  # noqa: SLF001 - its `text` has lost bytes
        if not message.id:
            return [*self._give_up(), TextReport(severity=message.severity, text=printable(raw))]
        given_up: list[TextReport] = []
        if self._open is None or self._open.number != message.id:
            given_up = self._give_up()
            self._open = TextParts(number=message.id, severity=message.severity)
        one = self._open
        if message.chunk_seq >= MOST_PARTS:
            return given_up
        one.parts[message.chunk_seq], one.beats = raw, 0
        if len(raw) < PART_BYTES:
            one.count = message.chunk_seq + 1
        if one.count is not None and len(one.parts) >= one.count:
            return [*given_up, *self._give_up()]
        return given_up

    def beat(self) -> list[TextReport]:
        """Note a heartbeat of the sender: a text whose rest is lost ends here."""
        if self._open is None:
            return []
        self._open.beats += 1
        return self._give_up() if self._open.beats >= PATIENCE else []

    def _give_up(self) -> list[TextReport]:
        one, self._open = self._open, None
        return [] if one is None or not one.parts else [one.report()]


def printable(raw: bytes) -> str:
    r"""Text of bytes, for a terminal and a log.

    Bytes that are no text, and characters that command a terminal, are shown by their numbers: `\xb0`.
    """
    text = raw.decode("utf-8", "backslashreplace")
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in text
    )
