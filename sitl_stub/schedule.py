"""When each message is due: exact multiples of its interval, so that nothing drifts."""

from collections.abc import Iterable


class Schedule:
    """Periodic messages by id, in whole microseconds of simulation time.

    Messages due at the same instant come in the order in which the ids were given, not in the
    order in which they were asked for. With a tick longer than a microsecond they leave at the first
    tick at which they are due, as a scheduler's tasks do: 50 ms on ticks of 20 ms come 40 and 60 ms apart.
    """

    def __init__(self, order: Iterable[int], *, sent_until_us: int = -1, tick_us: int = 1) -> None:
        self._rank = {message_id: rank for rank, message_id in enumerate(order)}
        self._intervals_us: dict[int, int] = {}
        self._due_us: dict[int, int] = {}
        self._sent_until_us = sent_until_us
        self._tick_us = tick_us
        self.next_due_us: int | None = None
        """The next instant at which anything is due; None while nothing is scheduled."""

    def every(self, message_id: int, interval_us: int) -> None:
        """Send a message at each multiple of the interval from now on."""
        self._intervals_us[message_id] = interval_us
        self._due_us[message_id] = (self._sent_until_us // interval_us + 1) * interval_us
        self._due_us = dict(sorted(self._due_us.items(), key=lambda item: self._rank[item[0]]))
        self._look_ahead()

    def stop(self, message_id: int) -> None:
        """Send a message no more."""
        self._due_us.pop(message_id, None)
        self._look_ahead()

    def interval_us(self, message_id: int) -> int | None:
        """How often a message is sent; None if it is not."""
        return self._intervals_us[message_id] if message_id in self._due_us else None

    def pop_due(self, instant_us: int) -> list[int]:
        """The ids due up to and including an instant, each then moved on to after it."""
        self._sent_until_us = instant_us
        if self.next_due_us is None or instant_us < self.next_due_us:
            return []
        tick_us = instant_us // self._tick_us * self._tick_us
        due = [message_id for message_id, due_us in self._due_us.items() if due_us <= tick_us]
        for message_id in due:
            interval_us = self._intervals_us[message_id]
            self._due_us[message_id] = (instant_us // interval_us + 1) * interval_us
        self._look_ahead()
        return due

    def _look_ahead(self) -> None:
        first_us = min(self._due_us.values(), default=None)
        if first_us is not None:
            first_us = -(-first_us // self._tick_us) * self._tick_us
        self.next_due_us = first_us
