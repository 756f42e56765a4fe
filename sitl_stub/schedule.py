"""When each message is due: exact multiples of its interval, so that nothing drifts."""

from collections.abc import Iterable


class Schedule:
    """Periodic messages by id, in whole microseconds of simulation time.

    Messages due at the same instant come in the order in which the ids were given, not in the
    order in which they were asked for.
    """

    def __init__(self, order: Iterable[int], *, sent_until_us: int = -1) -> None:
        self._rank = {message_id: rank for rank, message_id in enumerate(order)}
        self._intervals_us: dict[int, int] = {}
        self._due_us: dict[int, int] = {}
        self._sent_until_us = sent_until_us
        self.next_due_us: int | None = None
        """The next instant at which anything is due; None while nothing is scheduled."""

    def every(self, message_id: int, interval_us: int) -> None:
        """Send a message at each multiple of the interval from now on."""
        self._intervals_us[message_id] = interval_us
        self._due_us[message_id] = (self._sent_until_us // interval_us + 1) * interval_us
        self._due_us = dict(sorted(self._due_us.items(), key=lambda item: self._rank[item[0]]))
        self.next_due_us = min(self._due_us.values())

    def stop(self, message_id: int) -> None:
        """Send a message no more."""
        self._due_us.pop(message_id, None)
        self.next_due_us = min(self._due_us.values(), default=None)

    def pop_due(self, instant_us: int) -> list[int]:
        """The ids due up to and including an instant, each then moved on to after it."""
        self._sent_until_us = instant_us
        if self.next_due_us is None or instant_us < self.next_due_us:
            return []
        due = [message_id for message_id, due_us in self._due_us.items() if due_us <= instant_us]
        for message_id in due:
            interval_us = self._intervals_us[message_id]
            self._due_us[message_id] = (instant_us // interval_us + 1) * interval_us
        self.next_due_us = min(self._due_us.values())
        return due
