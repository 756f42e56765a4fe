"""Setpoints that change nothing are not sent again, except now and then in case one was lost."""

from collections.abc import Sequence
from itertools import compress
from math import isfinite

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.adapter import AutopilotAdapter

DIGITS = 2
"""Decimals that count: 0.01 m/s of speed, which is all that ArduPlane keeps, 0.01 degrees of course."""

Kind = tuple[int, int]
Content = tuple[object, ...]


class SetpointStream:
    """Remembers what an autopilot was last told."""

    def __init__(self, adapter: AutopilotAdapter) -> None:
        """Make a stream that has sent nothing yet.

        Args:
            adapter: says how long a setpoint may go unrepeated, and whether its parts belong together.
        """
        self._adapter = adapter
        self._content: dict[Kind, Content] = {}
        self._sent: dict[Kind, float] = {}

    def reset(self) -> None:
        """Forget what was sent: the autopilot has left the mode in which it was told."""
        self._content.clear()
        self._sent.clear()

    def due(self, messages: Sequence[MAVLink_message], now: float) -> list[MAVLink_message]:
        """Those of a setpoint's messages that have to be sent now (s)."""
        kinds = [kind_of(message) for message in messages]
        contents = [content_of(message) for message in messages]
        due = [self._is_due(*one, now) for one in zip(kinds, contents, strict=True)]
        if any(due) and self._adapter.parts_belong_together:
            due = [True] * len(due)
        for kind, content in compress(zip(kinds, contents, strict=True), due):
            self._content[kind], self._sent[kind] = content, now
        return list(compress(messages, due))

    def _is_due(self, kind: Kind, content: Content, now: float) -> bool:
        if self._content.get(kind) != content:
            return True
        # A clock that was set back makes the last sending lie ahead.
        return not 0.0 <= now - self._sent[kind] < self._adapter.keep_alive_s


def kind_of(message: MAVLink_message) -> Kind:
    """What a message replaces: the one before of the same number and, for commands, the same command."""
    return message.get_msgId(), getattr(message, "command", 0)


def content_of(message: MAVLink_message) -> Content:
    """The fields of a message, as finely as they matter."""
    values = map(vars(message).__getitem__, message.fieldnames)
    return tuple(
        round(value, DIGITS) if type(value) is float and isfinite(value) else value
        for value in values
    )
